"""Generators by their names, and one's own by `module:Class`."""

from __future__ import annotations

from collections.abc import Callable

from prior_reinforce.generators import FAMILY
from prior_reinforce.generators.base import Generator
from prior_reinforce.generators.diffusion import DiffusionGenerator
from prior_reinforce.generators.diffusion_config import DiffusionConfig
from prior_reinforce.generators.dmp import (
    DynamicMovementPrimitives,
    DynamicMovementPrimitivesConfig,
)
from prior_reinforce.generators.regression import UNetRegression
from prior_reinforce.generators.regression_config import UNetRegressionConfig
from prior_reinforce.registry import make_own


def make_generator(name: str) -> Generator:
    """Make a generator by its name, or one's own by `module:Class`.

    `diffusion`, `regression` and `dmp` know when a motion starts as a number of its own;
    `diffusion-whole`, `regression-whole` and `dmp-whole` learn whole plans, rests and all, as we
    read the paper (docs/baselines.md).

    Raises:
        ConfigurationError: There is no such generator.
    """
    # Networks on one core each, so that the last digits do not depend on how many there are.
    known: dict[str, Callable[[], Generator]] = {
        **{kind.name: kind for kind in FAMILY},
        "diffusion": lambda: DiffusionGenerator(threads=1),
        "diffusion-whole": lambda: DiffusionGenerator(
            DiffusionConfig(start_times=False), threads=1
        ),
        "dmp-whole": lambda: DynamicMovementPrimitives(
            DynamicMovementPrimitivesConfig(segmented=False)
        ),
        "regression": lambda: UNetRegression(threads=1),
        "regression-whole": lambda: UNetRegression(
            UNetRegressionConfig(start_times=False), threads=1
        ),
    }
    if name in known:
        return known[name]()
    return make_own(name, Generator, list(known))


def name_of(generator: Generator) -> str:
    """What to call a generator's kind in a record: its name if it is ours, else `module:Class`."""
    kind = type(generator)
    return kind.name if kind in FAMILY else f"{kind.__module__}:{kind.__qualname__}"

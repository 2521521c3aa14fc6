"""Members of the four families by their names, and one's own by `module:Class`."""

from __future__ import annotations

import importlib
from typing import Any, Literal

from prior_reinforce.adapters import (
    Adapter,
    FrozenAdapter,
    GaussianProcessAdapter,
    GaussianProcessConfig,
    ProportionalAdapter,
)
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import FAMILY as GENERATORS
from prior_reinforce.generators import (
    DiffusionGenerator,
    DynamicMovementPrimitives,
    DynamicMovementPrimitivesConfig,
    Generator,
)
from prior_reinforce.perception import Amplified, Exact, Eye, Perception


def make_generator(name: str) -> Generator:
    """Make a generator by its name, or one's own by `module:Class`.

    `dmp` fits its primitives to the motion alone; `dmp-whole` to the whole plan, rests and all, as
    we read the paper (docs/baselines.md).

    Raises:
        ConfigurationError: There is no such generator.
    """
    known = {kind.name: kind for kind in GENERATORS}
    if name == "dmp-whole":
        return DynamicMovementPrimitives(DynamicMovementPrimitivesConfig(segmented=False))
    if name == DiffusionGenerator.name:
        # One core each, so that the last digits do not depend on how many there are.
        return DiffusionGenerator(threads=1)
    if name in known:
        return known[name]()
    return _imported(name, Generator, [*known, "dmp-whole"])


def make_adapter(name: str) -> Adapter:
    """Make an adapter by its name, or one's own by `module:Class`.

    `gp` is the paper's with m = 2; `gp-all` keeps every trial (m = infinity).

    Raises:
        ConfigurationError: There is no such adapter.
    """
    if name == "gp":
        return GaussianProcessAdapter()
    if name == "gp-all":
        return GaussianProcessAdapter(GaussianProcessConfig(memory_size=None))
    if name == "proportional":
        return ProportionalAdapter()
    if name == "frozen":
        return FrozenAdapter()
    return _imported(name, Adapter, ["gp", "gp-all", "proportional", "frozen"])


def make_perception(name: str) -> Perception:
    """Make a perception by its name, or one's own by `module:Class`.

    Raises:
        ConfigurationError: There is no such perception.
    """
    known = {"exact": Exact, "eye": Eye, "amplified": Amplified}
    if name in known:
        return known[name]()
    return _imported(name, Perception, list(known))


def family_of(name: str) -> Literal["generator", "adapter"]:
    """Which family one's own `module:Class` joins in a comparison.

    Raises:
        ConfigurationError: It cannot be made, or is neither a generator nor an adapter.
    """
    module, _, attribute = name.partition(":")
    if not attribute:
        raise ConfigurationError(f"expected one's own method as module:Class, got {name!r}")
    made = _made(name, module, attribute)
    if isinstance(made, Generator):
        return "generator"
    if isinstance(made, Adapter):
        return "adapter"
    raise ConfigurationError(
        f"{name} is neither a Generator nor an Adapter; only these are compared side by side"
    )


def _imported(name: str, family: Any, known: list[str]) -> Any:
    module, _, attribute = name.partition(":")
    if not attribute:
        raise ConfigurationError(
            f"no {family.__name__.lower()} {name!r}; known are {', '.join(known)}, or give your "
            "own as module:Class"
        )
    made = _made(name, module, attribute)
    if not isinstance(made, family):
        raise ConfigurationError(f"{name} is no {family.__name__}; derive it from that class")
    return made


def _made(name: str, module: str, attribute: str) -> Any:
    try:
        return getattr(importlib.import_module(module), attribute)()
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise ConfigurationError(
            f"cannot make {name}: {error}; it must be importable from here (PYTHONPATH) and need "
            "no arguments"
        ) from error

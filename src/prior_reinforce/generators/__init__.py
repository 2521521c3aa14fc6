"""pi: conditional motion generators. All share the interface of `base`, and any can be `Timed`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from prior_reinforce.errors import FileFormatError
from prior_reinforce.generators.base import FitProgress as FitProgress
from prior_reinforce.generators.base import Generator as Generator
from prior_reinforce.generators.config import UNetSize as UNetSize
from prior_reinforce.generators.diffusion import PAPER
from prior_reinforce.generators.diffusion import DiffusionConfig as DiffusionConfig
from prior_reinforce.generators.diffusion import DiffusionGenerator as DiffusionGenerator
from prior_reinforce.generators.dmp import DynamicMovementPrimitives as DynamicMovementPrimitives
from prior_reinforce.generators.interpolation import NearestNeighbours as NearestNeighbours
from prior_reinforce.generators.interpolation import SmoothInterpolation as SmoothInterpolation
from prior_reinforce.generators.regression import UNetRegression as UNetRegression
from prior_reinforce.generators.regression import UNetRegressionConfig as UNetRegressionConfig
from prior_reinforce.generators.saving import read_model
from prior_reinforce.generators.timed import Timed as Timed
from prior_reinforce.generators.timed import Timing
from prior_reinforce.registry import Member, Registry, parse_choice

_HERE = "prior_reinforce.generators"


class GeneratorRegistry(Registry[Generator]):
    """All generators; each can be chosen with `timing`, which wraps it in `Timed`."""

    def __init__(self, members: Mapping[str, Member], timing: Mapping[str, Timing]) -> None:
        """Name the members, and the `timing` of those that are timed by default."""
        super().__init__("generator", f"{_HERE}.base:Generator", members)
        self._timing = timing

    @property
    def help(self) -> str:
        """The choices in one sentence, for help texts."""
        return (
            f"{super().help}; each also with timing=start (learn when a motion starts apart from "
            "the motion), timing=align (align the demonstrations first) or timing=none; default: "
            f"start for {' and '.join(self._timing)}, none for the others"
        )

    def make(self, choice: str, **context: Any) -> Generator:
        """Make a generator; see `Registry.make`.

        Args:
            choice: `name` or `module:Class`, with settings if need be: `nearest,timing=align`.
            context: `device` and `threads`, for those that take them.
        """
        name, settings = parse_choice(choice)
        timing = settings.pop("timing", self._timing.get(name, "none"))
        plain = ",".join([name, *(f"{key}={value}" for key, value in settings.items())])
        generator = super().make(plain, **context)
        return generator if timing == "none" else Timed(generator, cast(Timing, timing))

    def name_of(self, made: Generator) -> str:
        """Return the name of a generator's class, timed or not; `module:Class` for one's own."""
        return super().name_of(made.generator if isinstance(made, Timed) else made)


GENERATORS = GeneratorRegistry(
    {
        "diffusion": Member(
            f"{_HERE}.diffusion:DiffusionGenerator", "the paper's method, sized for a laptop"
        ),
        "diffusion-paper": Member(
            f"{_HERE}.diffusion:DiffusionGenerator", "with the paper's settings", PAPER
        ),
        "regression": Member(f"{_HERE}.regression:UNetRegression", "the same network, supervised"),
        "dmp": Member(f"{_HERE}.dmp:DynamicMovementPrimitives", "dynamic movement primitives"),
        "nearest": Member(
            f"{_HERE}.interpolation:NearestNeighbours", "nearest demonstrations, mixed"
        ),
        "interpolation": Member(
            f"{_HERE}.interpolation:SmoothInterpolation", "all demonstrations, mixed by a spline"
        ),
    },
    timing={"diffusion": "start", "regression": "start"},
)
make_generator = GENERATORS.make


def load_generator(
    folder: str | os.PathLike[str], *, own: str | None = None, device: str = "cpu"
) -> Generator:
    """Read a saved generator of any kind.

    Args:
        folder: Of the model.
        own: `module:Class` of the generator, where it is not one of ours, timed or not. It is never
            taken from the folder: a model is data, and names no code to run.
        device: Where torch computes, `cpu` or `cuda`; only networks run on the latter.

    Raises:
        FileFormatError: Files are missing, damaged, or of a generator that is not known here.
        ConfigurationError: The device is not there, or the generator does not run on it.
    """
    saved = read_model(Path(folder))
    if saved.generator == Timed.name:
        inner = class_named(Timed.wrapped(saved), own)
        return Timed.unpack(saved, kind=inner).to(device)
    return class_named(saved.generator, own).unpack(saved).to(device)


def class_named(name: str, own: str | None = None) -> type[Generator]:
    """Return the class of a saved generator.

    Args:
        name: What the model says it is, `Generator.name`.
        own: `module:Class` that it must be; one of ours if None.

    Raises:
        FileFormatError: It is not that one, or none of ours.
    """
    if own is None and name not in GENERATORS.members:
        raise FileFormatError(
            f"the model is of a generator {name!r}; known here are "
            f"{', '.join(GENERATORS.members)}, others have to be named as module:Class"
        )
    kind = GENERATORS.kind(own or name)
    if kind.name != name:
        raise FileFormatError(f"the model is of a {name} generator, not of {own or name}")
    return kind

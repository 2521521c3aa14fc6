"""pi: conditional motion generators. All share the interface of `base`, and any can be `Timed`."""

from __future__ import annotations

import inspect
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators.auto import Auto as Auto
from prior_reinforce.generators.base import FitProgress as FitProgress
from prior_reinforce.generators.base import Generator as Generator
from prior_reinforce.generators.config import UNetSize as UNetSize
from prior_reinforce.generators.corrected import Corrected as Corrected
from prior_reinforce.generators.diffusion import PAPER
from prior_reinforce.generators.diffusion import DiffusionConfig as DiffusionConfig
from prior_reinforce.generators.diffusion import DiffusionGenerator as DiffusionGenerator
from prior_reinforce.generators.dmp import DynamicMovementPrimitives as DynamicMovementPrimitives
from prior_reinforce.generators.interpolation import NearestNeighbours as NearestNeighbours
from prior_reinforce.generators.interpolation import SmoothInterpolation as SmoothInterpolation
from prior_reinforce.generators.regression import UNetRegression as UNetRegression
from prior_reinforce.generators.regression import UNetRegressionConfig as UNetRegressionConfig
from prior_reinforce.generators.saving import SavedModel, read_model
from prior_reinforce.generators.timed import Timed as Timed
from prior_reinforce.generators.timed import Timing
from prior_reinforce.generators.wrapping import Wrapper
from prior_reinforce.registry import Member, Registry, parse_choice

_HERE = "prior_reinforce.generators"


class GeneratorRegistry(Registry[Generator]):
    """All generators; each can be chosen with `timing` and `exact`, which wrap it."""

    def __init__(
        self, members: Mapping[str, Member], timing: Mapping[str, Timing], exact: Sequence[str]
    ) -> None:
        """Name the members, the `timing` of those that have one by default, and which are exact."""
        super().__init__("generator", f"{_HERE}.base:Generator", members)
        self._timing, self._exact = timing, exact

    @property
    def help(self) -> str:
        """The choices in one sentence, for help texts."""
        return (
            f"{super().help}; each but auto also with timing=start, tempo or warp (learn when and "
            "how fast a motion runs apart from its shape), timing=auto (what the demonstrations "
            "ask for), timing=align (align the demonstrations first) or timing=none, and with "
            "exact=yes (demonstrations come back as recorded) or exact=no; default: timing=auto "
            f"for {' and '.join(self._timing)}, exact=yes for {' and '.join(self._exact)}"
        )

    def make(self, choice: str, **context: Any) -> Generator:
        """Make a generator; see `Registry.make`.

        Args:
            choice: `name` or `module:Class`, with settings if need be: `nearest,timing=align`.
            context: `device`, `threads` and `states`, for those that take them.

        Raises:
            ConfigurationError: Also where `exact` is neither yes nor no, or another device is asked
                for than the generator computes on.
        """
        name, settings = parse_choice(choice)
        device = context.get("device", "cpu")
        if device != "cpu" and "device" not in inspect.signature(self.kind(name)).parameters:
            raise ConfigurationError(f"{name} computes on the CPU, not on device {device!r}")
        if name == Auto.name and settings.keys() & {"timing", "exact"}:
            raise ConfigurationError(
                "auto chooses its timing itself, and is exact; name the generator that is to have "
                "another, for instance interpolation,timing=align"
            )
        timing = settings.pop("timing", self._timing.get(name, "none"))
        exact = settings.pop("exact", "yes" if name in self._exact else "no")
        if exact not in ("yes", "no"):
            raise ConfigurationError(f"exact must be yes or no, got {exact!r}")
        plain = ",".join([name, *(f"{key}={value}" for key, value in settings.items())])
        generator = super().make(plain, **context)
        if exact == "yes":
            generator = Corrected(generator)
        return generator if timing == "none" else Timed(generator, cast(Timing, timing))

    def name_of(self, made: Generator) -> str:
        """Return the name of a generator's class, wrapped or not; `module:Class` for one's own."""
        while isinstance(made, Wrapper) and not isinstance(made, Auto):
            made = made.generator
        return super().name_of(made)


GENERATORS = GeneratorRegistry(
    {
        "auto": Member(
            f"{_HERE}.auto:Auto", "what the demonstrations ask for: closed form, or diffusion"
        ),
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
    timing={"diffusion": "auto", "regression": "auto", "interpolation": "auto"},
    exact=("diffusion", "regression", "dmp"),
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
    return _rebuilt(read_model(Path(folder)), own).to(device)


_WRAPPERS: dict[str, type[Wrapper]] = {kind.name: kind for kind in (Auto, Timed, Corrected)}


def _rebuilt(saved: SavedModel, own: str | None) -> Generator:
    """The generator that was saved, with all that is wrapped around it."""
    wrapper = _WRAPPERS.get(saved.generator)
    if wrapper is None:
        return class_named(saved.generator, own).unpack(saved)
    return wrapper.unpack(saved, generator=_rebuilt(wrapper.wrapped(saved), own))


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

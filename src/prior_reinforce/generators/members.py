"""All generators by name: choosing one, and loading a saved one.

Classes are named, not imported: `Registry` resolves a name when it is used. So a generator can be
loaded by its base class, and a list of names imports neither scipy nor torch.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators.config import PAPER, WAYS
from prior_reinforce.generators.saving import SavedLayer, read_model
from prior_reinforce.registry import Member, Registry, parse_choice

if TYPE_CHECKING:
    from prior_reinforce.generators.base import Generator
    from prior_reinforce.generators.timed import Timing

_HERE = "prior_reinforce.generators"
_BASE = f"{_HERE}.base:Generator"
_TIMED_BY_DEFAULT = ("diffusion", "diffusion-ways", "regression", "interpolation")


class GeneratorRegistry(Registry["Generator"]):
    """All generators; each can be chosen with `timing` and `correction`, which wrap it."""

    @property
    def help(self) -> str:
        """The choices in one sentence, for help texts."""
        return (
            f"{super().help}; each but auto also with timing=start or tempo (learn when and "
            "how fast a motion runs apart from its shape), timing=auto (what the demonstrations "
            "ask for), timing=align (align the demonstrations first) or timing=none, and with "
            "correction=spline (what it misses at the demonstrations is interpolated in closed "
            f"form and added); default: timing=auto for {' and '.join(_TIMED_BY_DEFAULT)}"
        )

    def make(self, choice: str, **context: Any) -> Generator:
        """Make a generator; see `Registry.make`.

        Args:
            choice: `name` or `module:Class`, with settings if need be: `nearest,timing=align`.
            context: `device`, `threads` and `states`, for those that take them.

        Raises:
            ConfigurationError: Also where there is no such `correction`, or another device is asked
                for than the generator computes on.
        """
        from prior_reinforce.generators.corrected import Corrected
        from prior_reinforce.generators.timed import Timed

        name, settings = parse_choice(choice)
        device = context.get("device", "cpu")
        if device != "cpu" and "device" not in inspect.signature(self.resolve(name)).parameters:
            raise ConfigurationError(f"{name} computes on the CPU, not on device {device!r}")
        if name == "auto" and settings.keys() & {"timing", "correction"}:
            raise ConfigurationError(
                "auto chooses its timing itself, and corrects nothing; name the generator that is "
                "to have another, for instance interpolation,timing=align"
            )
        timing = settings.pop("timing", "auto" if name in _TIMED_BY_DEFAULT else "none")
        correction = settings.pop("correction", "none")
        if correction not in ("spline", "none"):
            raise ConfigurationError(f"correction must be spline or none, got {correction!r}")
        plain = ",".join([name, *(f"{key}={value}" for key, value in settings.items())])
        generator = super().make(plain, **context)
        if correction == "spline":
            generator = Corrected(generator)
        return generator if timing == "none" else Timed(generator, cast("Timing", timing))

    def name_of(self, made: Generator) -> str:
        """Return the name of a generator's class, wrapped or not; `module:Class` for one's own."""
        while getattr(made, "name", None) in WRAPPERS.members:
            made = cast(Any, made).generator
        return super().name_of(made)


GENERATORS = GeneratorRegistry(
    "generator",
    _BASE,
    {
        "auto": Member(
            f"{_HERE}.auto:Auto", "what the demonstrations ask for: closed form, or a network"
        ),
        "diffusion": Member(
            f"{_HERE}.diffusion:DiffusionGenerator",
            "a network alone, which denoises mixtures of demonstrations",
        ),
        "diffusion-ways": Member(
            f"{_HERE}.diffusion:DiffusionGenerator",
            "the same for demonstrations of several ways",
            WAYS,
        ),
        "diffusion-paper": Member(
            f"{_HERE}.diffusion:DiffusionGenerator",
            "a network alone, our reading of the paper's, on whole plans",
            PAPER,
        ),
        "regression": Member(
            f"{_HERE}.regression:UNetRegression", "a network like the paper's, supervised"
        ),
        "dmp": Member(f"{_HERE}.dmp:DynamicMovementPrimitives", "dynamic movement primitives"),
        "nearest": Member(
            f"{_HERE}.interpolation:NearestNeighbours", "nearest demonstrations, mixed"
        ),
        "interpolation": Member(
            f"{_HERE}.interpolation:SmoothInterpolation", "all demonstrations, mixed by a spline"
        ),
    },
)
WRAPPERS: Registry[Generator] = Registry(
    "wrapper",
    _BASE,
    {
        "timed": Member(f"{_HERE}.timed:Timed", "timing apart from shape"),
        "corrected": Member(f"{_HERE}.corrected:Corrected", "a spline corrects it"),
    },
)
"""Generators around another one, by the names that saved models know them by."""
make_generator = GENERATORS.make


def load_generator(
    folder: str | os.PathLike[str], *, own: str | None = None, device: str = "cpu"
) -> Generator:
    """Read a saved generator of any kind.

    Args:
        folder: What it was saved to.
        own: `module:Class` of the generator, where it is not one of ours, timed or not. It is never
            taken from the folder: a model is data, and names no code to run.
        device: Where torch computes, `cpu` or `cuda`; only networks run on the latter.

    Raises:
        FileFormatError: Files are missing, damaged, or of a generator that is not known here.
        ConfigurationError: The device is not there, or the generator does not run on it.
    """
    return unpack(read_model(Path(folder)), own).to(device)


def unpack(layers: Sequence[SavedLayer], own: str | None = None) -> Generator:
    """Rebuild a saved generator, from the innermost layer outwards; see `load_generator`."""
    generator: Generator | None = None
    for layer in reversed(layers):
        generator = _class_of(layer.name, own).unpack_layer(layer, generator)
    assert generator is not None
    return generator


def _class_of(name: str, own: str | None) -> type[Generator]:
    """The class of a saved layer: a wrapper, `own` where that is given, or one of ours."""
    if name in WRAPPERS.members:
        return WRAPPERS.resolve(name)
    if own is None and name not in GENERATORS.members:
        raise FileFormatError(
            f"the model is of a generator {name!r}; known here are "
            f"{', '.join(GENERATORS.members)}, others have to be named as module:Class"
        )
    kind = GENERATORS.resolve(own or name)
    if kind.name != name:
        raise FileFormatError(f"the model is of a {name} generator, not of {own or name}")
    return kind

"""Registry of all generators by name: make one, or load a saved one.

Classes are named, not imported: `Registry` resolves a name when it is used. So a generator can be
loaded by its base class, and a list of names imports neither scipy nor torch.
"""

from __future__ import annotations

import inspect
import os
import pkgutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators.network.config import PAPER
from prior_reinforce.generators.saving import SavedLayer, read_model
from prior_reinforce.registry import Member, Registry

if TYPE_CHECKING:
    from prior_reinforce.generators.base import Generator
    from prior_reinforce.generators.timing.timed import Timing

_HERE = "prior_reinforce.generators"
TIMED = {"timing": "auto"}
_SYMMETRIC = {"symmetry": "use"}
"""Default settings of members: timing is learned separately from shape; plans are made canonical by
the demonstrations' symmetry before learning, and moved by it afterwards."""


class GeneratorRegistry(Registry["Generator"]):
    """All generators; each can be wrapped, with settings `timing` and `symmetry`."""

    @property
    def help(self) -> str:
        """The choices in one sentence, for help texts."""
        return (
            f"{super().help}; each but auto also with timing=start or tempo (learn when and "
            "how fast a motion runs apart from its shape), timing=auto (what the demonstrations "
            "ask for), timing=align (align the demonstrations first) or timing=none; default: "
            f"timing=auto for {self._with('timing')}; each with symmetry=use (learn what the "
            "demonstrations' symmetry leaves) or symmetry=none; default: use for "
            f"{self._with('symmetry')}"
        )

    def _with(self, setting: str) -> str:
        """Return the names of the members with a setting by default."""
        named = (name for name, member in self.members.items() if setting in member.settings)
        return " and ".join(named)

    def _make(
        self, name: str, settings: Mapping[str, Any], context: Mapping[str, Any], choice: str
    ) -> Generator:
        """Make a generator, wrapped according to its settings `timing` and `symmetry`.

        The context is `device`, `threads` and `states`, for those that take them.
        ConfigurationError also if there is no such `symmetry`, or the generator does not compute on
        the device.
        """
        from prior_reinforce.generators.equivariant import Equivariant
        from prior_reinforce.generators.timing.timed import Timed

        device = context.get("device", "cpu")
        if device != "cpu" and "device" not in inspect.signature(self._class(name)).parameters:
            raise ConfigurationError(f"{name} computes on the CPU, not on device {device!r}")
        own = dict(settings)
        timing, symmetry = own.pop("timing", "none"), own.pop("symmetry", "none")
        if name == "auto" and "timing" in settings:
            raise ConfigurationError(
                "auto chooses its timing itself; name the generator that is to have another, for "
                "instance interpolation,timing=align"
            )
        if symmetry not in ("use", "none"):
            raise ConfigurationError(f"symmetry must be use or none, got {symmetry!r}")
        generator = super()._make(name, own, context, choice)
        if timing != "none":
            generator = Timed(generator, cast("Timing", timing))
        if symmetry == "none":
            return generator
        return Equivariant(generator, finds=name == "auto")

    def name_of(self, made: Generator) -> str | None:
        """Return the registered name of a generator, wrapped or not; None if it has none."""
        while made.name in _WRAPPERS:
            made = cast(Any, made).generator
        return super().name_of(made)


GENERATORS = GeneratorRegistry(
    "generator",
    f"{_HERE}.base:Generator",
    {
        "auto": Member(
            f"{_HERE}.auto:Auto",
            "what the demonstrations ask for: closed form, or a network",
            _SYMMETRIC,
        ),
        "diffusion": Member(
            f"{_HERE}.network.diffusion:DiffusionGenerator",
            "a network alone, which denoises mixtures of demonstrations",
            TIMED | _SYMMETRIC,
        ),
        "diffusion-paper": Member(
            f"{_HERE}.network.diffusion:DiffusionGenerator",
            "a network alone, our reading of the paper's, on whole plans",
            PAPER,
        ),
        "interpolation": Member(
            f"{_HERE}.interpolation:SmoothInterpolation",
            "all demonstrations, mixed by a spline",
            TIMED,
        ),
    },
)
_WRAPPERS = {
    "equivariant": f"{_HERE}.equivariant:Equivariant",
    "timed": f"{_HERE}.timing.timed:Timed",
}
"""Wrapper classes by their names in saved models."""
make_generator = GENERATORS.make


def load_generator(folder: str | os.PathLike[str], *, device: str = "cpu") -> Generator:
    """Read a saved generator: one of ours, or one whose class is registered in this process.

    A model is data, and names no code to run.

    Args:
        folder: What it was saved to.
        device: Where torch computes, `cpu` or `cuda`; only networks run on the latter.

    Raises:
        FileFormatError: Files are missing, damaged, or of a generator that is not known here.
        ConfigurationError: The device is not there, or the generator does not run on it.
    """
    return unpack(read_model(Path(folder))).to(device)


def unpack(layers: Sequence[SavedLayer]) -> Generator:
    """Rebuild a saved generator, from the innermost layer outwards; see `load_generator`."""
    generator: Generator | None = None
    for layer in reversed(layers):
        generator = _class_of(layer.name).unpack_layer(layer, generator)
    assert generator is not None
    return generator


def _class_of(name: str) -> type[Generator]:
    """Return the class of a saved layer."""
    if name in _WRAPPERS:
        return cast("type[Generator]", pkgutil.resolve_name(_WRAPPERS[name]))
    try:
        kind = GENERATORS.resolve(name)
    except ConfigurationError as error:
        raise FileFormatError(f"the model cannot be loaded: {error}") from error
    if kind.name != name:
        raise FileFormatError(f"the model is of a {name} generator, not of {kind.name}")
    return kind

"""What generators that wrap another have in common: they are saved and moved with it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators.base import Generator
from prior_reinforce.generators.saving import SavedModel, Tensors


class Wrapper(Generator):
    """A generator around another one, which it fits with itself."""

    generator: Generator
    """The one within."""

    def __init__(self, generator: Generator) -> None:
        """Wrap a generator.

        Raises:
            ConfigurationError: It is wrapped in the same way already.
        """
        inner: Generator | None = generator
        while isinstance(inner, Wrapper):
            if isinstance(inner, type(self)):
                raise ConfigurationError(f"this generator is {self.name} already; wrap it once")
            inner = inner.generator
        self.generator = generator

    def check_savable(self) -> None:
        """Do nothing if the wrapped generator can be saved; see `Generator.check_savable`."""
        self.generator.check_savable()

    def to(self, device: str) -> Self:
        """Compute on another device from now on; see `Generator.to`."""
        self.generator.to(device)
        return self

    def pack(self) -> SavedModel:
        """Return all that both learned; see `Generator.pack`."""
        own, inner = super().pack(), self.generator.pack()
        return SavedModel(
            own.generator,
            {**own.settings, "generator": inner.generator, "settings": dict(inner.settings)},
            {**inner.tensors, **{self._key(name): value for name, value in own.tensors.items()}},
        )

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote, with the generator within; see `Generator.load`.

        Raises:
            FileFormatError: Files are missing, truncated, or of another generator.
        """
        from prior_reinforce.generators import load_generator

        loaded = load_generator(folder)
        if not isinstance(loaded, cls):
            raise FileFormatError(f"the model in {folder} is of a {loaded.name} generator")
        return loaded

    @classmethod
    def wrapped(cls, saved: SavedModel) -> SavedModel:
        """Return the generator within a saved one.

        Raises:
            FileFormatError: There is none.
        """
        try:
            return SavedModel(
                str(saved.settings["generator"]),
                saved.settings["settings"],
                {n: value for n, value in saved.tensors.items() if not n.startswith(cls._key(""))},
            )
        except (KeyError, TypeError) as error:
            raise FileFormatError(f"the model names no generator within it ({error!r})") from error

    @classmethod
    def from_state(
        cls, settings: Mapping[str, Any], tensors: Tensors, generator: Generator | None = None
    ) -> Self:
        """Rebuild it around a generator; see `Generator.from_state`.

        Args:
            settings: From `state`.
            tensors: From `state`, and those of the generator.
            generator: The one within, rebuilt already.
        """
        if generator is None:
            raise ValueError(f"a {cls.name} generator is rebuilt around another")
        own = {
            name.removeprefix(cls._key("")): value
            for name, value in tensors.items()
            if name.startswith(cls._key(""))
        }
        return cls._around(generator, settings, own)

    @classmethod
    def _around(cls, generator: Generator, settings: Mapping[str, Any], tensors: Tensors) -> Self:
        """Rebuild it from its own settings and tensors."""
        raise NotImplementedError

    @classmethod
    def _key(cls, name: str) -> str:
        return f"{cls.name}.{name}"

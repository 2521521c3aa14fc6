"""What generators that wrap another have in common: they are fitted, saved and moved with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.base import Generator, OnProgress
from prior_reinforce.generators.saving import SavedLayer, Tensors
from prior_reinforce.plans.motions import Demonstrations


class Wrapper(Generator):
    """A generator around another one, which it fits with itself."""

    generator: Generator
    """The one that is wrapped."""

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

    def fit(
        self, demonstrations: Demonstrations, *, seed: int, progress: OnProgress | None = None
    ) -> Self:
        """Learn with the wrapped generator, whose remarks follow one's own; see `Generator.fit`."""
        super().fit(demonstrations, seed=seed, progress=progress)
        self.remarks += self.generator.remarks
        return self

    def check_savable(self) -> None:
        """Do nothing if the wrapped generator can be saved; see `Generator.check_savable`."""
        self.generator.check_savable()

    def to(self, device: str) -> Self:
        """Compute on another device from now on; see `Generator.to`."""
        self.generator.to(device)
        return self

    def pack(self) -> list[SavedLayer]:
        """Return what both learned; see `Generator.pack`."""
        return super().pack() + self.generator.pack()

    @classmethod
    def from_state(
        cls, settings: Mapping[str, Any], tensors: Tensors, generator: Generator | None = None
    ) -> Self:
        """Rebuild it around a generator that was rebuilt already; see `Generator.from_state`."""
        if generator is None:
            raise ValueError(f"a {cls.name} generator is rebuilt around another")
        wrapper = cls(generator)
        wrapper.restore(settings, tensors)
        return wrapper

    def restore(self, settings: Mapping[str, Any], tensors: Tensors) -> None:
        """Take up what `state` gave.

        Raises:
            KeyError, TypeError, ValueError: Something is missing, or does not fit.
        """
        raise NotImplementedError

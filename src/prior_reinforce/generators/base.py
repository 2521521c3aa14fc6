"""The interface of pi: conditions in, whole action plans out (paper, Stage 1).

A generator implements learning (`_fit`), generation (`_generate`), and what is saved (`state`,
`from_state`). Checking of conditions, saving and loading are here, as is the base class of
generators around another one (`Wrapper`).
"""

from __future__ import annotations

import logging
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import Self

from prior_reinforce.arrays import Plans, Points, as_conditions, check_spread
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    NotFittedError,
)
from prior_reinforce.generators.members import unpack
from prior_reinforce.generators.saving import SavedLayer, Tensors, read_model, write_model
from prior_reinforce.plans.motions import Demonstrations

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class FitProgress:
    """Progress of a fit, for a progress line."""

    step: int
    """Steps done."""
    n_steps: int
    """Steps in all."""
    loss: float
    """Running mean of the training loss [-]."""
    seconds_left: float
    """Estimated, in [s]."""


OnProgress = Callable[[FitProgress], None]


class Generator(ABC):
    """A conditional motion generator: maps a desired outcome to a plan that may reach it.

    After `fit` it is a function: the same conditions always give the same plans
    (reproduction/docs/decisions.md says why diffusion samples with noise drawn once).
    """

    name: ClassVar[str]
    """Name on the command line, in results and in a saved model's `config.json`."""
    remarks: tuple[str, ...] = ()
    """What `fit` could not do, in sentences; kept with the model."""
    _outcome_dim: int | None = None
    """k of the demonstrations; None before `fit`."""

    def fit(
        self, demonstrations: Demonstrations, *, seed: int, progress: OnProgress | None = None
    ) -> Self:
        """Learn outcome -> plan from all demonstrations (none is held out).

        Args:
            demonstrations: N plans with their perceived outcomes.
            seed: Of everything random in the fit.
            progress: Called now and then while fitting.

        Returns:
            This generator, fitted; `remarks` says what could not be done.

        Raises:
            InvalidDemonstrationsError: See `check_demonstrations`.
        """
        self.check_demonstrations(demonstrations)
        self.remarks = ()
        self._fit(demonstrations, seed, progress or (lambda _: None))
        self._outcome_dim = demonstrations.outcome_dim
        remarks: tuple[str, ...] = self.remarks
        for remark in remarks:
            _LOG.info("%s: %s", self.name, remark)
        return self

    def __repr__(self) -> str:
        """Class, and whether it is fitted."""
        return f"{type(self).__name__}({'not fitted' if self._outcome_dim is None else 'fitted'})"

    def generate(self, conditions: ArrayLike) -> Plans:
        """Generate one plan for each condition.

        Args:
            conditions: c, shape (n, k), in the units of the outcomes. Any n, also 0.

        Returns:
            Plans, float64, in the demonstrations' units. If a symmetry makes some longer than
            others, shorter ones rest at their last frame; a single plan is not padded.

        Raises:
            NotFittedError: Before `fit`.
            InvalidGoalError: Wrong shape, or not finite.
        """
        return self._generate(as_conditions(conditions, self._fitted_to()))

    def with_symmetry_used(self, demonstrations: Demonstrations) -> Demonstrations:
        """Return its demonstrations with the symmetry by which it moves plans, stated or found.

        An adapter starts with these, so that it knows how plans are made.
        """
        return demonstrations

    def check_demonstrations(self, demonstrations: Demonstrations) -> None:
        """Do nothing if it can learn from these.

        Raises:
            InvalidDemonstrationsError: They are too few, or their outcomes lie in a subspace.
        """
        if demonstrations.n == 1:
            raise InvalidDemonstrationsError(
                f"generator {self.name} learns from at least two demonstrations, got one; "
                "demonstrate more, or say how this one may be moved (docs/symmetry.md), and learn "
                "with auto"
            )
        check_spread(demonstrations.outcomes_seen)

    def check_savable(self) -> None:
        """Do nothing if this generator can be saved once it is fitted.

        Raises:
            ConfigurationError: Its class has no `state`, or no `from_state`.
        """
        classes = type(self).__mro__[: type(self).__mro__.index(Generator)]
        if not {"state", "from_state"} <= {name for each in classes for name in vars(each)}:
            raise ConfigurationError(
                f"a {type(self).__name__} cannot be saved; give the class state() and from_state()"
            )

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors` into a folder, made if need be.

        Raises:
            NotFittedError: Before `fit`.
            ConfigurationError: See `check_savable`.
        """
        self.check_savable()
        write_model(Path(folder), self.pack())

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; loading runs no code from the files.

        Raises:
            FileFormatError: Files are missing, truncated, or of another generator.
        """
        outer, *inner = read_model(Path(folder))
        if outer.name != cls.name:
            raise FileFormatError(
                f"{folder} holds a {outer.name} generator, not {cls.name}; load it with "
                "load_generator"
            )
        return cls.unpack_layer(outer, unpack(inner) if inner else None)

    def to(self, device: str) -> Self:
        """Compute on another device from now on.

        Args:
            device: `cpu`, or `cuda` where the generator runs there.

        Raises:
            ConfigurationError: The device is not there, or the generator does not run on it.
        """
        if device != "cpu":
            raise ConfigurationError(
                f"a {self.name} generator runs on the CPU only, got device {device!r}"
            )
        return self

    def pack(self) -> list[SavedLayer]:
        """Return everything learned, as data; a wrapper first, then the generator it wraps.

        Raises:
            NotFittedError: Before `fit`.
        """
        outcome_dim, (settings, tensors) = self._fitted_to(), self.state()
        return [SavedLayer(self.name, outcome_dim, self.remarks, settings, dict(tensors))]

    @classmethod
    def unpack_layer(cls, layer: SavedLayer, inner: Generator | None = None) -> Self:
        """Rebuild a fitted generator from its layer of what `pack` gave.

        Args:
            layer: What it learned.
            inner: What it wraps, if it is a wrapper.

        Raises:
            FileFormatError: Something is missing, or does not fit; a class of one's own raises its
                own error, which may be a bug in its `from_state`.
        """
        wrapped = () if inner is None else (inner,)
        try:
            generator = cls.from_state(layer.settings, layer.tensors, *wrapped)
        except Exception as error:  # wrong settings and arrays may raise anything
            if not cls.__module__.startswith("prior_reinforce."):
                raise
            raise FileFormatError(
                f"this is no complete {cls.name} generator ({error!r}); learn it again"
            ) from error
        generator.remarks, generator._outcome_dim = layer.remarks, layer.outcome_dim
        return generator

    @abstractmethod
    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        """Learn; called by `fit`."""

    @abstractmethod
    def _generate(self, conditions: Points) -> Plans:
        """Generate one plan for each checked condition; called by `generate` once fitted."""

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """Return what was learned: settings of JSON types, and arrays by name.

        Only a generator with `state` and `from_state` can be saved.
        """
        raise NotImplementedError

    @classmethod
    def from_state(cls, settings: Mapping[str, Any], tensors: Tensors) -> Self:
        """Rebuild it from its `state`; checksums have verified the file."""
        raise NotImplementedError

    def _fitted_to(self) -> int:
        """Return k of the demonstrations; NotFittedError before `fit`."""
        if self._outcome_dim is None:
            raise NotFittedError(
                f"this {type(self).__name__} has learned nothing yet; call fit first"
            )
        return self._outcome_dim


class Wrapper(Generator):
    """A generator around another one, which is fitted, saved and moved with it."""

    generator: Generator
    """The one that is wrapped."""

    def __init__(self, generator: Generator) -> None:
        """Wrap a generator; ConfigurationError if it is wrapped in the same way already."""
        inner: Generator | None = generator
        while isinstance(inner, Wrapper):
            if isinstance(inner, type(self)):
                raise ConfigurationError(f"this generator is {self.name} already; wrap it once")
            inner = inner.generator
        self.generator = generator

    def __repr__(self) -> str:
        """Class, and the wrapped generator: for `auto`, the chosen one."""
        return f"{type(self).__name__}({self.generator!r})"

    def fit(
        self, demonstrations: Demonstrations, *, seed: int, progress: OnProgress | None = None
    ) -> Self:
        """Learn with the wrapped generator, whose remarks follow one's own; see `Generator.fit`."""
        super().fit(demonstrations, seed=seed, progress=progress)
        self.remarks += self.generator.remarks
        return self

    def with_symmetry_used(self, demonstrations: Demonstrations) -> Demonstrations:
        """Return them with the symmetry that the wrapped one uses."""
        return self.generator.with_symmetry_used(demonstrations)

    def check_savable(self) -> None:
        """Do nothing if the wrapped generator can be saved; see `Generator.check_savable`."""
        self.generator.check_savable()

    def to(self, device: str) -> Self:
        """Compute on another device from now on; see `Generator.to`."""
        self.generator.to(device)
        return self

    def pack(self) -> list[SavedLayer]:
        """Return the layers of both; see `Generator.pack`."""
        return super().pack() + self.generator.pack()

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """Nothing of its own, unless a member says otherwise; see `Generator.state`."""
        return {}, {}

    @classmethod
    def from_state(
        cls, settings: Mapping[str, Any], tensors: Tensors, generator: Generator | None = None
    ) -> Self:
        """Rebuild it around an already rebuilt generator; see `Generator.from_state`."""
        if generator is None:
            raise FileFormatError(
                f"a {cls.name} generator is rebuilt around another; learn it again"
            )
        return cls(generator)


def report_single_step(progress: OnProgress, loss: float) -> None:
    """Report a fit that is a single step."""
    progress(FitProgress(step=1, n_steps=1, loss=loss, seconds_left=0.0))


@dataclass(frozen=True, eq=False)
class ConditionScale:
    """Maps the demonstrated range of each outcome component to [-1, 1], whatever its unit."""

    range: Points
    """Least and greatest outcome seen, two rows, the second above the first in every component."""

    @classmethod
    def fit(cls, outcomes: Points) -> Self:
        """Take the range of outcomes, which in `Demonstrations` is never zero."""
        return cls(np.stack([outcomes.min(axis=0), outcomes.max(axis=0)]))

    def scale(self, conditions: Points) -> Points:
        """Scale conditions from their own units."""
        low, high = self.range
        scaled: np.ndarray = 2 * (conditions - low) / (high - low) - 1
        return scaled

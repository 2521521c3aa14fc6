"""What the numbers of an outcome mean, and how near to a goal counts as reached.

Notation (docs/notation.md):
    k        `outcome_dim`  components of an outcome
    epsilon  `tolerance`    of each component, in its unit
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import Self

from prior_reinforce.arrays import Point, as_error
from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError
from prior_reinforce.units import UNITS, looks_like, spelt

_LEAST_SD = 1 / 3
"""Least sd of a number of unknown origin, in tolerances (ours): half a centimetre of 1.5 cm. Who
gives numbers for words means to; with twice as much, P(hit) is said too low and adapters lag
(reproduction/docs/decisions-adapter.md)."""
_FAR = 10.0
"""Tolerances from which an error is looked at twice (ours): 15 cm, where 1.5 cm are allowed. It is
taken for an outcome, or an outcome for an error, where that would be four times nearer."""
_TYPED = 3
"""Digits behind the point that people type at most (ours). Longer numbers were computed, in the
unit that is asked for: they may be twice as large as the goal's and those of what was shown."""


@dataclass(frozen=True)
class OutcomeFormat:
    """What the k numbers of an outcome, condition, goal or error mean.

    Raises:
        ConfigurationError: Repeated names, another number of units than of names, or a tolerance
            that is not one positive number for each component.
    """

    names: tuple[str, ...] = ()
    """Name of each component, for instance `x`."""
    units: tuple[str, ...] = ()
    """Unit of each: `m`, `s`, `rad`, or any other word."""
    tolerance: tuple[float, ...] = ()
    """epsilon of each: an error of one tolerance's length still counts as reached. Empty where
    nothing is to be reached, as of demonstrations."""

    def __post_init__(self) -> None:
        for name in ("names", "units", "tolerance"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if len(set(self.names)) < len(self.names):
            raise ConfigurationError(f"outcome names must differ from each other, got {self.names}")
        if len(self.units) != len(self.names):
            raise ConfigurationError(
                f"{len(self.names)} outcome names {self.names} need as many units, got "
                f"{len(self.units)}: {self.units}"
            )
        if self.tolerance:
            object.__setattr__(self, "tolerance", self._checked(self.tolerance))

    @classmethod
    def metres(cls, outcome_dim: int) -> Self:
        """The format of k lengths: `x`, `y`, `z`, or numbers from 0 where there are more."""
        names = "xyz"[:outcome_dim] if outcome_dim <= 3 else map(str, range(outcome_dim))
        return cls(tuple(names), ("m",) * outcome_dim)

    @property
    def outcome_dim(self) -> int:
        """k, the number of components."""
        return len(self.names)

    @property
    def half_axes(self) -> Point:
        """The tolerance as an array, shape (k,)."""
        return np.array(self.tolerance)

    @property
    def least_sd(self) -> Point:
        """Least sd of an error of unknown origin, shape (k,), in `units`; 0 with no tolerance."""
        return _LEAST_SD * self.half_axes if self.tolerance else np.zeros(self.outcome_dim)

    def within(self, tolerance: ArrayLike) -> Self:
        """Return the format with a tolerance.

        Args:
            tolerance: One number where all components have one unit, else one for each: 2 cm are
                neither more nor less than 20 ms until somebody says so.

        Raises:
            ConfigurationError: Not positive, another number of numbers, one number for several
                units, or one that looks like another unit's: 1.5 m.
        """
        return replace(self, tolerance=self._checked(tolerance))

    def as_listed(self) -> Self:
        """Return the format with each unit by its name in `units`: `deg` where it is spelt `°`.

        To read words only: stored fingerprints have the task's own spelling.
        """
        return replace(self, units=tuple(spelt(unit) or unit for unit in self.units))

    def slip(self, numbers: Iterable[float], *, error: bool) -> str:
        """Say which number looks like another unit's; empty if all are plausible.

        Args:
            numbers: Of each component, in `units`, where nobody stated the unit.
            error: Whether they are an error or a tolerance, not a place.
        """
        for number, name, unit in zip(numbers, self.names, self.units, strict=True):
            if looks := looks_like(unit, number, error=error):
                return (
                    f"{name} of {number:g} {unit} looks like {UNITS[looks].plural}; give "
                    f"{UNITS[unit].plural}"
                )
        return ""

    def _checked(self, tolerance: ArrayLike) -> tuple[float, ...]:
        try:
            array = np.asarray(tolerance)
        except ValueError:
            array = np.empty(0)
        is_number = array.dtype.kind in "iuf" and array.shape in ((), (self.outcome_dim,))
        if not (is_number and np.all((array > 0) & np.isfinite(array))):
            raise ConfigurationError(
                f"tolerance must be a positive number, or one for each of {self}, got {tolerance!r}"
            )
        if array.ndim == 0 and len(set(self.units)) > 1:
            raise ConfigurationError(
                f"tolerance is one number, {tolerance!r}, for outcomes of several units; give one "
                f"for each of {self}"
            )
        numbers = np.broadcast_to(array, self.outcome_dim).astype(float).tolist()
        if slip := self.slip(numbers, error=True):
            raise ConfigurationError(f"tolerance: {slip}")
        return tuple(numbers)

    def __str__(self) -> str:
        """Names with their units: `x [m], t [s]`."""
        return ", ".join(
            f"{name} [{unit}]" for name, unit in zip(self.names, self.units, strict=True)
        )


def in_tolerances(error: ArrayLike, tolerance: ArrayLike) -> float:
    """Return how far an error is from the goal, in tolerances: a hit is at most 1.

    The length of the error, each component divided by its tolerance (ours: the one way in which
    metres and seconds add up, and the paper's distance where all tolerances are one number). Both
    are of shape (k,), or the tolerance is one number for all.
    """
    return float(np.linalg.norm(np.asarray(error) / np.asarray(tolerance)))


def as_bare_error(
    told: ArrayLike,
    goal: Point,
    form: OutcomeFormat,
    *,
    landed: bool = False,
    expected: ArrayLike = 0.0,
    shown: ArrayLike = 0.0,
) -> Point:
    """Return outcome minus goal in the outcome's units, which nobody stated, as a fresh array.

    `told` is the error; or, if `landed`, the outcome was asked for. An error as large as
    `expected`, (k,), is not doubted, nor a computed one twice as large as the goal or the outcomes
    that were `shown`, (N, k). InvalidFeedbackError for a wrong shape, what is not finite,
    another unit by its size, or an outcome in place of an error, or the other way round.
    """
    array = as_error(told, form.outcome_dim)
    error, other = (array - goal, array) if landed else (array, array - goal)
    far, otherwise = (in_tolerances(e, form.tolerance or 1.0) for e in (error, other))
    doubted = ~(np.abs(error) <= expected)  # of what nobody expects, nan, all is
    if form.tolerance and far >= max(_FAR, 4 * otherwise) and doubted.any():
        kinds = ("an error (outcome minus goal)", "where the object ended")
        asked, mistaken = kinds[::-1] if landed else kinds
        said = ", ".join(f"{number:g}" for number in array)
        raise InvalidFeedbackError(
            f"{said} looks like {mistaken}; give {asked}, or the unit if it is that "
            "(in Python a pr.Reading, as pr.Reading.measured)"
        )
    if not np.array_equal(array, array.round(_TYPED)):
        of_unit = np.equal.outer(form.units, form.units)
        largest = np.maximum(np.abs(goal), np.abs(np.atleast_2d(shown)).max(axis=0))
        doubted &= ~(np.abs(error) <= 2.0 * np.max(of_unit * largest, axis=1))
    if slip := form.slip(np.where(doubted, error, 0.0), error=True):
        what = "where it ended" if landed else "outcome minus goal"
        raise InvalidFeedbackError(
            f"an error in {slip} ({what}), or words with their unit "
            "(in Python a pr.Reading, as pr.Reading.measured)"
        )
    return error

"""Reading of one trial: the perceived error, and its uncertainty.

    e = r - g, the true error  lies in [low, high] +- sd, in each component
    e tilde  `error_seen`      one number for each component (the paper's)

"5 cm long" by eye means anything from 3.5 to 7.5 cm; 5 cm by tape measure means 5.0 +- 0.2 cm;
"long" alone has no upper end. Adapters use either `error_seen` or the intervals. Whether a trial
hit is recorded separately, if it was seen directly.

Source: paper, Section IV and V-A, "Perception Process", for e tilde and the words by eye. Intervals
are ours, because words are intervals: treated as exact numbers, repeated words would count as
independent evidence, and an adapter would stop moving.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import msgspec
import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from typing_extensions import Self

from prior_reinforce.arrays import Point, as_error
from prior_reinforce.errors import InvalidFeedbackError

EYE_NEAR = np.array([0.0, 0.02, 0.05, 0.10])
"""Distances an observer distinguishes near the goal, in [m] (paper: 0 cm, 2 cm, 5 cm, multiples of
10 cm)."""
EYE_BETWEEN = (0.01, 0.035, 0.075)
"""Midpoints of these; literals, since the float (5 cm + 10 cm) / 2 is not 7.5 cm."""
EYE_STEP = 0.10
"""Farther distances are multiples of this, in [m]."""
LEAST_SD = 0.01
"""Least sd of a length of unknown origin, in [m] (ours): half of an observer's finest step."""
_SHARE_SD = 0.2
"""Relative sd of a number of unknown origin (ours): people misjudge lengths by 15 to 25 %, and the
paper's amplified noise is 20 %."""
OPEN_ERROR = 0.05
"""Length used if only the direction is known, in [m] (ours): an observer's middle word."""
_SAME = 1e-9
"""Tolerance of comparisons, in [m]."""
_MEASURED = 0.5
"""A number with an sd below this share of the tolerance is more informative than a hit (ours)."""
NOISE_SDS = 2.0
"""Standard deviations within which a reading leaves a hit possible (ours): only then a miss says
more than its reading, as with coarse words or noisy numbers."""


class ReadingRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A `Reading` as plain data; an open end of an interval is None."""

    error_seen: list[float]
    low: list[float | None]
    high: list[float | None]
    sd: list[float]
    hit: bool | None = None
    said: str = ""
    lost: bool = False


@dataclass(frozen=True, eq=False)
class Reading:
    """One trial's perceived error, outcome minus goal, in the outcomes' units.

    Raises:
        InvalidFeedbackError: Shapes that differ, an interval from high to low, a negative sd, or a
            number that is not finite where it must be.
    """

    error_seen: Point
    """e tilde, one finite number for each component; 0 if unknown."""
    low: Point
    """Lower end of the true error, up to sd; -inf if open."""
    high: Point
    """Upper end; inf if open, equal to `low` for a number."""
    sd: Point
    """Standard deviation of the interval's ends; 0 if they are sharp."""
    hit: bool | None = None
    """Whether the goal was reached; None if that was not seen directly."""
    said: str = ""
    """The words, if given in words, with the units that were understood."""
    lost: bool = False
    """Whether the object was lost from sight, or never left: a miss."""
    missed_by_at_least: Point | None = None
    """After a miss, half-axes of an ellipsoid that the true error lies outside of; None if unknown.
    Set by `within`."""

    @property
    def spread(self) -> Point:
        """Standard deviation of the error given this reading; inf where an end is open."""
        width = self.high - self.low
        return np.asarray(np.sqrt(width**2 / 12.0 + self.sd**2))

    @property
    def expected(self) -> Point:
        """Mean of the error given this reading: its middle; `error_seen` if an end is open."""
        is_open = np.isinf(self.low) | np.isinf(self.high)
        low, high = (np.where(is_open, self.error_seen, end) for end in (self.low, self.high))
        return np.asarray(0.5 * (low + high))

    def __post_init__(self) -> None:
        k = np.size(self.error_seen)
        object.__setattr__(self, "error_seen", as_error(self.error_seen, k))
        for name in ("low", "high", "sd"):
            try:
                array = np.array(getattr(self, name), dtype=np.float64)
            except (TypeError, ValueError):
                array = np.empty(0)
            if array.shape != (k,) or np.isnan(array).any():
                raise InvalidFeedbackError(
                    f"{name} must be {k} numbers, one for each component of the error, got "
                    f"{getattr(self, name)!r:.80}"
                )
            object.__setattr__(self, name, array)
        if ((self.low > self.high) | (self.low == np.inf) | (self.high == -np.inf)).any():
            raise InvalidFeedbackError(
                f"the error cannot lie in [{self.low.tolist()}, {self.high.tolist()}]; give the "
                "lower end first"
            )
        if not ((self.sd >= 0) & np.isfinite(self.sd)).all():
            raise InvalidFeedbackError(f"sd must be 0 or more, got {self.sd.tolist()}")
        if not (self.hit is None or isinstance(self.hit, (bool, np.bool_))):
            raise InvalidFeedbackError(f"hit must be True, False or None, got {self.hit!r}")
        if self.lost and (self.hit is not False or self.has_number):
            raise InvalidFeedbackError("a lost object missed, nobody knows where; say one of them")
        for array in (self.error_seen, self.low, self.high, self.sd):
            array.setflags(write=False)

    @classmethod
    def measured(cls, error: ArrayLike, sd: ArrayLike = 0.0, hit: bool | None = None) -> Self:
        """Make a reading of a measured number, with the standard deviation of the measurement.

        Args:
            error: Outcome minus goal, shape (k,), in the outcomes' units.
            sd: In the same units, shape (k,), or one for all.
            hit: See `Reading`.
        """
        number = np.array(error, dtype=np.float64)
        return cls(number, number, number, np.broadcast_to(sd, number.shape), hit)

    @classmethod
    def estimated(
        cls, error: ArrayLike, least_sd: ArrayLike = LEAST_SD, hit: bool | None = None
    ) -> Self:
        """Make one of a number of unknown origin: sd^2 = (a fifth of it)^2 + least_sd^2 (ours).

        Args:
            error: Outcome minus goal, shape (k,), in the outcomes' units.
            least_sd: In the same units; the default is for lengths.
            hit: See `Reading`.
        """
        number = np.asarray(error, dtype=np.float64)
        return cls.measured(number, np.hypot(_SHARE_SD * number, least_sd), hit)

    @classmethod
    def by_eye(cls, words: ArrayLike, hit: bool | None = None) -> Self:
        """Make one of an observer's words: intervals with sharp ends (see `perception.eye`).

        0 cm is anything within 1 cm, 2 cm from 1 to 3.5, 5 cm from 3.5 to 7.5, 10 cm from 7.5 to
        15, 20 cm from 15 to 25, ... If 2 cm is the only component that is not zero, it may be a
        miss of 1 cm shared among all. A component that is none of these words is `estimated`.

        Args:
            words: Outcome minus goal, shape (k,), in [m].
            hit: See `Reading`.
        """
        said = as_error(words, np.size(words))
        size = np.abs(said)
        tens = np.maximum(EYE_STEP * np.round(size / EYE_STEP), EYE_STEP)
        word = np.argmin(np.abs(size[:, None] - EYE_NEAR), axis=1)
        near = np.abs(size - EYE_NEAR[word]) < _SAME
        low = np.where(near, np.array([-EYE_BETWEEN[0], *EYE_BETWEEN])[word], tens - EYE_STEP / 2)
        high = np.where(near, np.array([*EYE_BETWEEN, EYE_STEP * 1.5])[word], tens + EYE_STEP / 2)
        if np.count_nonzero(size > _SAME) == 1 and abs(size.max() - EYE_NEAR[1]) < _SAME:
            low[np.argmax(size)] = EYE_BETWEEN[0] / math.sqrt(size.size)
        left = said < 0
        low, high = np.where(left, -high, low), np.where(left, -low, high)
        estimated = cls.estimated(said)
        by_word = near | (np.abs(size - tens) < _SAME)
        return cls(
            said,
            np.where(by_word, low, said),
            np.where(by_word, high, said),
            np.where(by_word, 0.0, estimated.sd),
            hit,
        )

    @classmethod
    def only(cls, hit: bool, outcome_dim: int, *, lost: bool = False) -> Self:
        """Make one that says only hit, miss or lost; `error_seen` is 0."""
        everywhere, zero = np.full(outcome_dim, np.inf), np.zeros(outcome_dim)
        return cls(zero, -everywhere, everywhere, zero, hit, lost=lost)

    @property
    def has_place(self) -> bool:
        """Whether some bound of the error is known."""
        return bool(np.any(np.isfinite(self.low) | np.isfinite(self.high)))

    @property
    def is_open(self) -> bool:
        """Whether some component has an open end: its size is unknown."""
        return not bool(np.isfinite([*self.low, *self.high]).all())

    @property
    def has_number(self) -> bool:
        """Whether `error_seen` is informative: some bound is known, or that it hit."""
        return bool(self.hit or self.has_place)

    def with_hit(self, hit: bool | None) -> Self:
        """Return the reading with `hit` set; None changes nothing."""
        return self if hit is None else replace(self, hit=hit)

    def within(self, radius: Point) -> Self:
        """Condition the intervals on hit or miss.

        An error that is larger than its noise explains is a miss, told or not. After a hit every
        component lies within the radius, even if that contradicts the intervals. After a miss, each
        component is at least as large as the others' bounds require: "2 cm long" that missed by
        more than 1.5 cm, and at most 1 cm to the side, was at least 1.1 cm long. Components stay
        independent: intervals describe a box, and `missed_by_at_least` keeps the ellipsoid.

        Args:
            radius: Tolerance of each component, shape (k,), in the outcomes' units.
        """
        if self.hit is None and not self._is_sure_miss(radius):
            return self
        if self.hit:
            measured = (self.low == self.high) & (self.sd < _MEASURED * radius)
            low, high = np.clip(self.low, -radius, radius), np.clip(self.high, -radius, radius)
            contradicts = ~measured & ((high - low < 0.1 * radius) | (self.low == self.high))
            low, high = np.where(contradicts, -radius, low), np.where(contradicts, radius, high)
            return replace(self, low=low, high=high, sd=np.where(contradicts, 0.0, self.sd))
        farthest = np.square(np.maximum(np.abs(self.low), np.abs(self.high)) / radius)
        others = np.array([np.delete(farthest, j).sum() for j in range(radius.size)])
        least = radius * np.sqrt(np.maximum(1.0 - others, 0.0))
        low = np.where(self.low > 0, np.maximum(self.low, least), self.low)
        high = np.where(self.high < 0, np.minimum(self.high, -least), self.high)
        sound = low < high
        return replace(
            self,
            low=np.where(sound, low, self.low),
            high=np.where(sound, high, self.high),
            missed_by_at_least=np.asarray(radius),
        )

    def _is_sure_miss(self, radius: Point) -> bool:
        """Whether the intervals, widened by noise, lie outside of the tolerance."""
        beyond = np.maximum(np.maximum(self.low, -self.high) - NOISE_SDS * self.sd, 0.0)
        return float(np.linalg.norm(beyond / radius)) > 1.0

    def record(self) -> ReadingRecord:
        """Return plain data for a log."""
        hit = None if self.hit is None else bool(self.hit)
        low, high = _ends(self.low), _ends(self.high)
        return ReadingRecord(
            self.error_seen.tolist(), low, high, self.sd.tolist(), hit, self.said, self.lost
        )

    @classmethod
    def from_record(cls, record: ReadingRecord) -> Self:
        """Restore a reading from `record`."""
        low = np.array([-math.inf if end is None else end for end in record.low])
        high = np.array([math.inf if end is None else end for end in record.high])
        seen, sd = np.array(record.error_seen), np.array(record.sd)
        return cls(seen, low, high, sd, record.hit, record.said, record.lost)


def _ends(ends: Float[np.ndarray, " k"]) -> list[float | None]:
    return [end if math.isfinite(end) else None for end in ends.tolist()]

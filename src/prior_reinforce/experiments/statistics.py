"""Intervals and paired differences: what "better" means here.

Goals and trainings are both drawn at random, so both are resampled: a bootstrap draws trainings,
and goals, the same for all of them as all are tried on the same. A bootstrap over half a dozen of
trainings is too narrow, so its interval is widened to what Student's distribution asks for so few.
Methods of one comparison share goals, prior sets and seeds: their difference is taken pair by pair.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

_RESAMPLES = 2000
_CONFIDENCE = 0.95
_ANYWHERE = (-np.inf, np.inf)
SHARE = (0.0, 1.0)
"""What a share can be."""


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """Value and interval, two decimals."""
        return format(self, "")

    def __format__(self, spec: str) -> str:
        """Value and interval, each number in the format given; two decimals without one."""
        spec = spec or ".2f"
        return f"{self.value:{spec}} [{self.low:{spec}}, {self.high:{spec}}]"


def bootstrap_mean(
    values: np.ndarray, *, within: tuple[float, float] = _ANYWHERE, seed: int = 0
) -> Interval:
    """Mean over groups and members, resampling both.

    Args:
        values: Shape (groups, members): a row a training (prior set and seed), a column a goal.
        within: What such a mean can be at all, `SHARE` for instance; the interval ends there. What
            was seen is no such bound: one goal that differs would decide on which side zero lies.
        seed: Of the resampling.
    """
    values = np.asarray(values, dtype=float)
    rng = np.random.default_rng(seed)
    groups, members = values.shape
    rows = rng.integers(groups, size=(_RESAMPLES, groups, 1))
    columns = rng.integers(members, size=(_RESAMPLES, 1, members))
    means = values[rows, columns].mean(axis=(1, 2))
    value = values.mean()
    tail = (1 - _CONFIDENCE) / 2
    ends = value + _widening(groups) * (np.quantile(means, [tail, 1 - tail]) - value)
    low, high = np.clip(ends, *within)
    return Interval(float(value), float(low), float(high))


def _widening(groups: int) -> float:
    """How much too narrow a bootstrap over so few groups is: its variance, and its tails."""
    if groups < 2:
        return 1.0
    tail = (1 + _CONFIDENCE) / 2
    student = stats.t.ppf(tail, groups - 1) / stats.norm.ppf(tail)
    return float(student * np.sqrt(groups / (groups - 1)))


def bootstrap_difference(
    a: np.ndarray, b: np.ndarray, *, within: tuple[float, float] = _ANYWHERE, seed: int = 0
) -> Interval:
    """Mean of a - b, paired by group and member; shapes (groups, members) as above.

    `within` is what either mean can be.
    """
    low, high = within
    difference = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    return bootstrap_mean(difference, within=(low - high, high - low), seed=seed)


def trials_counted(solved_at: np.ndarray, rounds: int) -> np.ndarray:
    """Trials that each goal took, one more than there were rounds where it was not reached.

    Args:
        solved_at: Number of the trial that reached each goal; 0 where none did.
        rounds: Trials a goal at most.
    """
    return np.where(solved_at > 0, solved_at, rounds + 1).astype(float)


def reached_by(solved_at: np.ndarray, round_number: int) -> np.ndarray:
    """1 where a goal was reached within that many trials, else 0; same shape.

    Args:
        solved_at: Number of the trial that reached each goal; 0 where none did.
        round_number: From 1.
    """
    return ((solved_at > 0) & (solved_at <= round_number)).astype(float)

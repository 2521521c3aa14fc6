"""Intervals and paired differences: what "better" means here.

Goals and training seeds are both drawn at random, so both are resampled: a bootstrap draws seeds,
and within each drawn seed draws goals. Methods of one comparison share goals, prior sets and seeds,
so their difference is taken pair by pair within the same draw.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_RESAMPLES = 2000
_CONFIDENCE = 0.95


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


def bootstrap_mean(values: np.ndarray, *, seed: int = 0) -> Interval:
    """Mean over groups and members, resampling both.

    Args:
        values: Shape (groups, members): a row a training (prior set and seed), a column a goal.
        seed: Of the resampling.
    """
    values = np.asarray(values, dtype=float)
    rng = np.random.default_rng(seed)
    groups, members = values.shape
    rows = rng.integers(groups, size=(_RESAMPLES, groups, 1))
    columns = rng.integers(members, size=(_RESAMPLES, groups, members))
    means = values[rows, columns].mean(axis=(1, 2))
    tail = 100 * (1 - _CONFIDENCE) / 2
    low, high = np.percentile(means, [tail, 100 - tail])
    return Interval(float(values.mean()), float(low), float(high))


def bootstrap_difference(a: np.ndarray, b: np.ndarray, *, seed: int = 0) -> Interval:
    """Mean of a - b, paired by group and member; shapes (groups, members) as above."""
    return bootstrap_mean(np.asarray(a, dtype=float) - np.asarray(b, dtype=float), seed=seed)


def reached_by(solved_at: np.ndarray, round_number: int) -> np.ndarray:
    """1 where a goal was reached within that many trials, else 0; same shape.

    Args:
        solved_at: Number of the trial that reached each goal; 0 where none did.
        round_number: From 1.
    """
    return ((solved_at > 0) & (solved_at <= round_number)).astype(float)

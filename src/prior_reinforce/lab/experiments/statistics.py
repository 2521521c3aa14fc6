"""Intervals and paired differences: what "better" means here.

Goals and trainings are both drawn at random, so both are resampled: a bootstrap draws trainings,
and goals, the same for all of them as all are tried on the same. A bootstrap over half a dozen
trainings is too narrow, so its interval is widened to what Student's distribution asks for so few.
Methods of one comparison share goals, prior sets and seeds: their difference is taken pair by pair.

Everywhere `solved_at` is the number of the trial that reached each goal, 0 where none did; its rows
are trainings (prior set and seed), its columns goals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Shaped

_RESAMPLES = 4000
_CONFIDENCE = 0.95
_ANYWHERE = (-np.inf, np.inf)
SHARE = (0.0, 1.0)
"""What a share can be."""

LEAST_TRAININGS = 3
"""Ours: an interval over fewer trainings knows nothing of how trainings differ, and decides no
claim."""
Values = Shaped[np.ndarray, "_ _"]
"""One number for each training, a row, and goal, a column."""


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
        """Value and interval, each number in the format given; two decimals without one.

        Nothing where there is no value (NaN).
        """
        spec = spec or ".2f"
        if np.isnan(self.value):
            return ""
        return f"{self.value:{spec}} [{self.low:{spec}}, {self.high:{spec}}]"


def bootstrap_mean(
    values: Values, *, within: tuple[float, float] = _ANYWHERE, seed: int = 0
) -> Interval:
    """Mean over trainings and goals, resampling both.

    Args:
        values: What is averaged.
        within: What such a mean can be at all, `SHARE` for instance; the interval ends there. What
            was seen is no such bound: one goal that differs would decide on which side zero lies.
        seed: Of the resampling.
    """
    return mean_of_groups([values], within=within, seed=seed)


def bootstrap_difference(
    a: Values, b: Values, *, within: tuple[float, float] = _ANYWHERE
) -> Interval:
    """Mean of a - b, paired by training and goal; `within` is what either mean can be."""
    low, high = within
    difference = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    return bootstrap_mean(difference, within=(low - high, high - low))


def mean_of_groups(
    groups: Sequence[Values],
    weights: Sequence[float] | None = None,
    *,
    within: tuple[float, float] = _ANYWHERE,
    seed: int = 0,
) -> Interval:
    """Mean over groups of trainings that share nothing: tasks with demonstrations of their own.

    Args:
        groups: Each with its own trainings and goals, which are drawn anew; groups are not.
        weights: Of the groups in the mean; alike without.
        within: As for `bootstrap_mean`.
        seed: Of the resampling.
    """
    value, means = _resampled(groups, weights, seed)
    tail = (1 - _CONFIDENCE) / 2
    low, high = np.clip(np.quantile(means, [tail, 1 - tail]), *within)
    return Interval(value, float(low), float(high))


def p_above(
    groups: Sequence[Values], bound: float, weights: Sequence[float] | None = None
) -> float:
    """One-sided p-value of "the mean is above the bound", by the same widened bootstrap.

    Below .025 where the lower end of the 95 % interval is above the bound.
    """
    _, means = _resampled(groups, weights, 0)
    return float((1 + np.sum(means <= bound)) / (1 + len(means)))


def _resampled(
    groups: Sequence[Values], weights: Sequence[float] | None, seed: int
) -> tuple[float, Float[np.ndarray, " resamples"]]:
    """The mean and resampled ones: deviations widened as a variance of so few, with its tails."""
    from scipy import stats

    rng, value = np.random.default_rng(seed), 0.0
    deviation = np.zeros(_RESAMPLES)
    shares = np.ones(len(groups)) if weights is None else np.asarray(weights, dtype=float)
    for values, share in zip(groups, shares / shares.sum(), strict=True):
        values = np.asarray(values, dtype=float)
        m, n = values.shape
        counts = rng.multinomial(m, np.full(m, 1 / m), size=_RESAMPLES) / m
        drawn = np.take_along_axis(counts @ values, rng.integers(n, size=(_RESAMPLES, n)), axis=1)
        deviation += share * np.sqrt(m / max(m - 1, 1)) * (drawn.mean(axis=1) - values.mean())
        value += float(share * values.mean())
    freedom = sum(len(values) - 1 for values in groups)
    if freedom > 0:
        tail = (1 + _CONFIDENCE) / 2
        deviation *= stats.t.ppf(tail, freedom) / stats.norm.ppf(tail)
    return value, value + deviation


def trials_counted(solved_at: Shaped[np.ndarray, "*any"], rounds: int) -> Float[np.ndarray, "*any"]:
    """Trials that each goal took, one more than there were rounds where it was not reached."""
    return np.where(solved_at > 0, solved_at, rounds + 1).astype(float)


def reached_by(
    solved_at: Shaped[np.ndarray, "*any"], round_number: int
) -> Float[np.ndarray, "*any"]:
    """1 where a goal was reached within that many trials, else 0."""
    return ((solved_at > 0) & (solved_at <= round_number)).astype(float)

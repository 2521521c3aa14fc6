"""Intervals and paired differences: what "better" means here.

Sets of demonstrations and goals are both drawn at random, so both are resampled: a bootstrap draws
sets, and goals, the same for all of them as all are tried on the same. Seeds of one set are no more
sets: they are averaged before. A bootstrap over few sets is too narrow, so its interval is widened
to what Student's distribution asks for so few; over fewer than three there is none. Methods of one
comparison share goals, prior sets and seeds: their difference is taken pair by pair.

Everywhere `solved_at` is the number of the trial that reached each goal, 0 where none did.
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

_LEAST_FREEDOM = 2
"""Degrees of freedom below which there is no interval (ours): three sets of one task, or two each
of two tasks; fewer know nothing of how sets differ."""
Values = Shaped[np.ndarray, "_ _"]
"""One number for each set of demonstrations, a row, and goal, a column."""


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval; NaN where there is none."""

    value: float
    low: float
    high: float

    @property
    def known(self) -> bool:
        """Whether there is an interval: enough sets were learned from."""
        return not np.isnan(self.low)

    def __str__(self) -> str:
        """Value and interval, two decimals."""
        return format(self, "")

    def __format__(self, spec: str) -> str:
        """Value and interval, each number in the format given; two decimals without one.

        Nothing where there is no value, and the value alone where there is no interval.
        """
        spec = spec or ".2f"
        if np.isnan(self.value):
            return ""
        if not self.known:
            return f"{self.value:{spec}}"
        return f"{self.value:{spec}} [{self.low:{spec}}, {self.high:{spec}}]"


def bootstrap_mean(
    values: Values, *, within: tuple[float, float] = _ANYWHERE, seed: int = 0
) -> Interval:
    """Mean over sets and goals, resampling both.

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
    """Mean of a - b, paired by set and goal; `within` is what either mean can be."""
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
    """Mean over groups of sets that share nothing: tasks with demonstrations of their own.

    Args:
        groups: Each with its own sets and goals, which are drawn anew; groups are not.
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

    Below .025 where the lower end of the 95 % interval is above the bound; NaN where there is none.
    """
    _, means = _resampled(groups, weights, 0)
    if np.isnan(means).any():
        return float("nan")
    return float((1 + np.sum(means <= bound)) / (1 + len(means)))


def _resampled(
    groups: Sequence[Values], weights: Sequence[float] | None, seed: int
) -> tuple[float, Float[np.ndarray, " resamples"]]:
    """The mean and resampled ones: deviations widened as a variance of so few, with its tails."""
    from scipy import stats

    shares = np.ones(len(groups)) if weights is None else np.asarray(weights, dtype=float)
    shared = [
        (np.asarray(values, dtype=float), share)
        for values, share in zip(groups, shares / shares.sum(), strict=True)
    ]
    value = sum(float(share * values.mean()) for values, share in shared)
    freedom = sum(len(values) - 1 for values, _ in shared)
    if freedom < _LEAST_FREEDOM:
        return value, np.full(_RESAMPLES, np.nan)
    rng, deviation = np.random.default_rng(seed), np.zeros(_RESAMPLES)
    for values, share in shared:
        m, n = values.shape
        counts = rng.multinomial(m, np.full(m, 1 / m), size=_RESAMPLES) / m
        drawn = np.take_along_axis(counts @ values, rng.integers(n, size=(_RESAMPLES, n)), axis=1)
        deviation += share * np.sqrt(m / max(m - 1, 1)) * (drawn.mean(axis=1) - values.mean())
    tail = (1 + _CONFIDENCE) / 2
    return value, value + deviation * stats.t.ppf(tail, freedom) / stats.norm.ppf(tail)


def trials_counted(solved_at: Shaped[np.ndarray, "*any"], rounds: int) -> Float[np.ndarray, "*any"]:
    """Trials that each goal took, one more than there were rounds where it was not reached."""
    return np.where(solved_at > 0, solved_at, rounds + 1).astype(float)


def reached_by(
    solved_at: Shaped[np.ndarray, "*any"], round_number: int
) -> Float[np.ndarray, "*any"]:
    """1 where a goal was reached within that many trials, else 0."""
    return ((solved_at > 0) & (solved_at <= round_number)).astype(float)

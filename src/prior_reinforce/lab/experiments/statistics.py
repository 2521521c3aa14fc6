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

_RESAMPLES = 2000
_CONFIDENCE = 0.95
_ANYWHERE = (-np.inf, np.inf)
SHARE = (0.0, 1.0)
"""What a share can be."""

Values = Shaped[np.ndarray, "trainings goals"]
"""One number for each training and goal."""
ValuesByTask = Sequence[Shaped[np.ndarray, "_ _"]]
"""Such numbers of each task; tasks may have different numbers of trainings."""


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


Curve = Sequence[Interval]
"""An interval for each round, from round 1."""


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
    values = np.asarray(values, dtype=float)
    rng = np.random.default_rng(seed)
    trainings, goals = values.shape
    rows = rng.integers(trainings, size=(_RESAMPLES, trainings, 1))
    columns = rng.integers(goals, size=(_RESAMPLES, 1, goals))
    means = values[rows, columns].mean(axis=(1, 2))
    value = values.mean()
    tail = (1 - _CONFIDENCE) / 2
    ends = value + _widening(trainings) * (np.quantile(means, [tail, 1 - tail]) - value)
    low, high = np.clip(ends, *within)
    return Interval(float(value), float(low), float(high))


def _widening(trainings: int) -> float:
    """How much too narrow a bootstrap over so few trainings is: its variance, and its tails."""
    from scipy import stats

    if trainings < 2:
        return 1.0
    tail = (1 + _CONFIDENCE) / 2
    student = stats.t.ppf(tail, trainings - 1) / stats.norm.ppf(tail)
    return float(student * np.sqrt(trainings / (trainings - 1)))


def bootstrap_difference(
    a: Values, b: Values, *, within: tuple[float, float] = _ANYWHERE
) -> Interval:
    """Mean of a - b, paired by training and goal; `within` is what either mean can be."""
    low, high = within
    difference = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    return bootstrap_mean(difference, within=(low - high, high - low))


def trials_counted(solved_at: Shaped[np.ndarray, "*any"], rounds: int) -> Float[np.ndarray, "*any"]:
    """Trials that each goal took, one more than there were rounds where it was not reached."""
    return np.where(solved_at > 0, solved_at, rounds + 1).astype(float)


def reached_by(
    solved_at: Shaped[np.ndarray, "*any"], round_number: int
) -> Float[np.ndarray, "*any"]:
    """1 where a goal was reached within that many trials, else 0."""
    return ((solved_at > 0) & (solved_at <= round_number)).astype(float)


def success_curve(solved_at: Values, rounds: int) -> Curve:
    """Share of goals reached within 1, 2, ... rounds, with its interval."""
    return [bootstrap_mean(reached_by(solved_at, r), within=SHARE) for r in range(1, rounds + 1)]


def difference_curve(solved_at: Values, other: Values, rounds: int) -> Curve:
    """Share reached minus the other's, paired by training and goal, with its interval."""
    return [
        bootstrap_difference(reached_by(solved_at, r), reached_by(other, r), within=SHARE)
        for r in range(1, rounds + 1)
    ]


def mean_success_difference(solved_at: Values, other: Values, rounds: int) -> Interval:
    """Area between two curves: the difference of the share reached, mean of all rounds."""
    a, b = (
        np.mean([reached_by(at, r) for r in range(1, rounds + 1)], axis=0)
        for at in (solved_at, other)
    )
    return bootstrap_difference(a, b, within=SHARE)


def mean_of_tasks(
    rows: ValuesByTask, *, within: tuple[float, float] = _ANYWHERE, seed: int = 0
) -> Interval:
    """Mean of tasks that weigh alike: trainings and goals are drawn anew in each, tasks are not.

    Returns:
        As `bootstrap_mean`, each task's deviations widened as a variance of so few trainings, all
        together to Student's tails.
    """
    from scipy import stats

    rng, deviation = np.random.default_rng(seed), np.zeros(_RESAMPLES)
    for row in rows:
        m, n = row.shape
        drawn = row[
            rng.integers(m, size=(_RESAMPLES, m, 1)), rng.integers(n, size=(_RESAMPLES, 1, n))
        ].mean(axis=(1, 2))
        deviation += np.sqrt(m / max(m - 1, 1)) * (drawn - row.mean()) / len(rows)
    tail = (1 + _CONFIDENCE) / 2
    freedom = max(sum(len(row) - 1 for row in rows), 1)
    widened = stats.t.ppf(tail, freedom) / stats.norm.ppf(tail) * deviation
    value = float(np.mean([row.mean() for row in rows]))
    low, high = np.clip(value + np.quantile(widened, [1 - tail, tail]), *within)
    return Interval(value, float(low), float(high))


def difference_of_tasks(a: ValuesByTask, b: ValuesByTask) -> Interval:
    """Mean of a - b over tasks, paired; of the trainings of a, the first that b has as well."""
    pairs = zip(a, b, strict=True)
    return mean_of_tasks([of_a[: len(of_b)] - of_b for of_a, of_b in pairs])

"""Success fraction by round, and how two methods differ: shared by the comparisons of methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from prior_reinforce.experiments.evaluation import Training, Trials
from prior_reinforce.experiments.recipes.base import Run, Scale
from prior_reinforce.experiments.recipes.claims import Verdict, above, all_of
from prior_reinforce.experiments.statistics import (
    SHARE,
    Interval,
    bootstrap_difference,
    bootstrap_mean,
    reached_by,
)

TASK = "basketball-v1"
"""The task of all comparisons of methods, as in the paper."""

Curve = list[dict[str, float]]
"""An interval for each round, from round 1."""

_ROUNDS_SHOWN = (1, 2, 4, 8, 10)


def trainings_of(
    scale: Scale, generator: str, *, aligned: bool = False, perception: str | None = None
) -> list[Training]:
    """One training for each prior set and seed; `perception` sees the demonstrations."""
    return [
        Training(TASK, name, generator, seed, aligned=aligned, perception=perception)
        for name in scale.sets
        for seed in scale.seeds
    ]


def solved_at(run: Run, units: Sequence[Trials]) -> np.ndarray:
    """Trial that reached each goal, 0 where none did, shape (units, goals)."""
    return np.array([result["solved_at"] for result in run.results(units)])


def success_curve(solved: np.ndarray, rounds: int) -> Curve:
    """Share of goals reached within 1, 2, ... rounds, with its interval."""
    return [
        asdict(bootstrap_mean(reached_by(solved, r), within=SHARE)) for r in range(1, rounds + 1)
    ]


def difference_curve(solved: np.ndarray, other: np.ndarray, rounds: int) -> Curve:
    """Share reached minus the other's, paired by training and goal, with its interval."""
    return [
        asdict(bootstrap_difference(reached_by(solved, r), reached_by(other, r), within=SHARE))
        for r in range(1, rounds + 1)
    ]


def interval_of(values: Mapping[str, Any]) -> Interval:
    """An interval as it was before it became JSON."""
    return Interval(**values)


def mean_success_difference(solved: np.ndarray, other: np.ndarray, rounds: int) -> Interval:
    """Area between two curves: the difference of the share reached, mean of all rounds."""
    a, b = (
        np.mean([reached_by(at, r) for r in range(1, rounds + 1)], axis=0) for at in (solved, other)
    )
    return bootstrap_difference(a, b, within=SHARE)


def rounds_shown(rounds: int) -> list[int]:
    """Rounds that a table shows."""
    return [r for r in _ROUNDS_SHOWN if r <= rounds]


def verdict_by_round(
    curve: Curve, other: Curve, difference: Curve, first: int, trainings: int
) -> Verdict:
    """Judge the claim that one method is above another at every round.

    Rounds at which both reach every goal leave nothing to be above in, and are left out.

    Args:
        curve: Share reached by the method that is claimed to be better.
        other: By the other one.
        difference: The first minus the second, paired.
        first: Round from which on the claim is made.
        trainings: How many trainings the intervals resampled.
    """
    return all_of(
        [
            above(interval_of(difference[i]), 0.0, trainings)
            for i in range(first - 1, len(difference))
            if not curve[i]["value"] == other[i]["value"] == 1.0
        ]
    )

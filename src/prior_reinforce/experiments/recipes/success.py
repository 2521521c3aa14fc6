"""Success fraction by round, and how two methods differ: shared by the comparisons of methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from prior_reinforce.experiments.evaluation import Training, Trials
from prior_reinforce.experiments.recipes.base import Run, Scale
from prior_reinforce.experiments.statistics import (
    Interval,
    bootstrap_difference,
    bootstrap_mean,
    reached_by,
)

TASK = "basketball-v1"
"""The task of all comparisons of methods, as in the paper."""

Curve = list[dict[str, float]]
"""An interval for each round, from round 1."""


def trainings_of(scale: Scale, generator: str, *, aligned: bool = False) -> list[Training]:
    """One training for each prior set and seed."""
    return [
        Training(TASK, name, generator, seed, aligned=aligned)
        for name in scale.sets
        for seed in scale.seeds
    ]


def solved_at(run: Run, units: Sequence[Trials]) -> np.ndarray:
    """Trial that reached each goal, 0 where none did, shape (units, goals)."""
    return np.array([result["solved_at"] for result in run.results(units)])


def success_curve(solved: np.ndarray, rounds: int) -> Curve:
    """Share of goals reached within 1, 2, ... rounds, with its interval."""
    return [asdict(bootstrap_mean(reached_by(solved, r))) for r in range(1, rounds + 1)]


def difference_curve(solved: np.ndarray, other: np.ndarray, rounds: int) -> Curve:
    """Share reached minus the other's, paired by training and goal, with its interval."""
    return [
        asdict(bootstrap_difference(reached_by(solved, r), reached_by(other, r)))
        for r in range(1, rounds + 1)
    ]


def interval_of(values: Mapping[str, Any]) -> Interval:
    """An interval as it was before it became JSON."""
    return Interval(**values)

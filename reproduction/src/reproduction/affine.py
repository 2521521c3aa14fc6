"""The rival that remembers with the same prior knowledge as ours, and no model of noise.

In a file of its own: `rivals.py` names results on disk by its bytes.
"""

from __future__ import annotations

import math

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.arrays import Point
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.outcome_weights import smooth_weights


class RidgeAdapter(Adapter):
    """c = g + w(g)' V, V the ridge solution of c - r = w(r)' V over all trials it was told.

    w are the weights by which closed form mixes demonstrations, those that our Bayesian adapter has
    in its prior: every affine map is in their span. A reading is a number to it. It remembers
    earlier goals where these are carried over. The penalty has no unit, as weights have none; its
    default is that of `examples/own_adapter.py`, not tuned.
    """

    def __init__(self, penalty: float = 0.1) -> None:
        """Choose how strongly displacements are drawn to 0."""
        if not (math.isfinite(penalty) and penalty > 0):
            raise ConfigurationError(f"penalty must be a positive number, got {penalty}")
        self.penalty = penalty

    def _start(self, demonstrations: Demonstrations) -> None:
        self._weights = smooth_weights(
            demonstrations.outcomes_seen, noise=demonstrations.outcome_noise
        )
        self._trials: list[tuple[Point, Point]] = []

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        self._trials.append((condition, outcome_seen))

    def _propose(self, goal_seen: Point) -> Point:
        if not self._trials:
            return goal_seen
        conditions, outcomes = (np.array(of) for of in zip(*self._trials, strict=True))
        of_trials = self._weights(outcomes)
        kernel = of_trials @ of_trials.T + self.penalty * np.eye(len(of_trials))
        dual = np.linalg.solve(kernel, conditions - outcomes)
        return np.asarray(goal_seen + (self._weights(goal_seen[None]) @ of_trials.T @ dual)[0])

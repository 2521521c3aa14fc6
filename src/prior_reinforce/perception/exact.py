"""Perception without error: what a simulator, or a very good measurement, reports."""

from __future__ import annotations

import numpy as np

from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.perception.base import Perception
from prior_reinforce.readings import Reading


class Exact(Perception):
    """The true error, outcome minus goal."""

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """Return r - g; draws nothing from `rng`."""
        return Reading.measured(rollout.outcome - goal)

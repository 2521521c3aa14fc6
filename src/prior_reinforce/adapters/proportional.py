"""The paper's proportional compensator: no model, a fixed share of the last error corrected."""

from __future__ import annotations

import math

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.arrays import Point
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations


class ProportionalAdapter(Adapter):
    """Next condition = last condition - gain x last observed error (paper, Section V-B).

    The first condition is the goal. For another goal than the last trial's, the error is that
    trial's outcome minus the new goal: a trial then goes `gain` of the way, so that it is better to
    start again for a new goal.
    """

    def __init__(self, gain: float = 0.8) -> None:
        """Choose the share of the error to correct; the paper's is 0.8.

        Raises:
            ConfigurationError: The gain is not a positive number.
        """
        if not (math.isfinite(gain) and gain > 0):
            raise ConfigurationError(f"gain must be a positive number, got {gain}; try 0.8")
        self.gain = gain

    def _start(self, demonstrations: Demonstrations) -> None:
        self._last: tuple[Point, Point] | None = None

    def _propose(self, goal_seen: Point) -> Point:
        if self._last is None:
            return goal_seen
        condition, outcome_seen = self._last
        return condition - self.gain * (outcome_seen - goal_seen)

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        self._last = condition, outcome_seen

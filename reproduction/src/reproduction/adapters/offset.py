"""The mean of what outcomes were off by, taken off every condition (a rival, not in the paper)."""

from __future__ import annotations

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.arrays import Point
from prior_reinforce.plans.motions import Demonstrations


class MeanOffsetAdapter(Adapter):
    """c = g - mean(r_i - c_i) over all trials: what one shift of everything would ask for.

    For one goal: with the trials of others it can no longer follow what differs from place to
    place (5.8 trials a goal in afternoons where the others need about two).
    """

    def _start(self, demonstrations: Demonstrations) -> None:
        self._off: list[Point] = []

    def _propose(self, goal_seen: Point) -> Point:
        return goal_seen - np.mean(self._off, axis=0) if self._off else goal_seen

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        self._off.append(outcome_seen - condition)

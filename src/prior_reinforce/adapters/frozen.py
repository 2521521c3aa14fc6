"""No adapter (paper, Section V-B: "w/o Adapter"): the goal itself, trial after trial."""

from __future__ import annotations

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.arrays import Point
from prior_reinforce.plans.motions import Demonstrations


class FrozenAdapter(Adapter):
    """The condition is always the goal."""

    def _start(self, demonstrations: Demonstrations) -> None:
        pass

    def _propose(self, goal_seen: Point) -> Point:
        return goal_seen

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        pass

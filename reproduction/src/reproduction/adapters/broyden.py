"""Broyden's method: a secant in every direction that was tried (a rival, not in the paper)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from prior_reinforce.adapters.normalisation import Normalisation
from prior_reinforce.adapters.proportional import ProportionalAdapter
from prior_reinforce.arrays import Point
from prior_reinforce.plans.motions import Demonstrations

_SINGULAR = (0.5, 2.0)
"""What the slope may be in any direction (ours): readings by eye make secants of any size, and a
plan's outcome follows its condition nearly one to one."""
_LEAST_STEP = 1e-6
"""Steps below it, in spreads, say nothing of a slope."""


class BroydenAdapter(ProportionalAdapter):
    """c' = c - gain J^-1 (r - g), J the slope of outcomes, learned from one trial to the next.

    J begins as the identity; every step c' - c with its r' - r corrects J along that step alone
    (Broyden 1965, A class of methods for solving nonlinear simultaneous equations, the good
    method), its singular values kept within a factor of two of 1. Until then it is proportional.
    """

    def _start(self, demonstrations: Demonstrations) -> None:
        super()._start(demonstrations)
        self._normalisation = Normalisation.of(demonstrations)
        self._slope = np.eye(demonstrations.outcome_dim)

    def _propose(self, goal_seen: Point) -> Point:
        if self._last is None:
            return goal_seen
        condition, outcome = self._last
        error = outcome - self._normalisation.apply(goal_seen)
        step = np.linalg.solve(self._slope, error)
        return self._normalisation.undo(condition - self.gain * step)

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        now = self._normalisation.apply(condition), self._normalisation.apply(outcome_seen)
        if self._last is not None:
            step, moved = now[0] - self._last[0], now[1] - self._last[1]
            square = float(step @ step)
            if square > _LEAST_STEP**2:
                slope = self._slope + np.outer(moved - self._slope @ step, step) / square
                self._slope = bounded(slope)
        self._last = now


def bounded(slope: Float[np.ndarray, "k k"]) -> Float[np.ndarray, "k k"]:
    """The same slope of outcomes, no direction's beyond a factor of two of 1."""
    left, singular, right = np.linalg.svd(slope)
    return np.asarray(left @ np.diag(np.clip(singular, *_SINGULAR)) @ right)

"""The paper's proportional compensator: no model, a fixed share of the last error corrected."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.adapters.vectors import as_goal_seen, as_trial, not_started
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations


class ProportionalAdapter(Adapter):
    """Next condition = last condition - gain x last observed error (paper, Section V-B).

    The first condition is the goal. Asked about another goal than the last trial's, the error is
    that trial's outcome minus the new goal: one trial then makes `gain` of the way, so that a
    session for a new goal is better started afresh.
    """

    name: ClassVar[str] = "proportional"

    def __init__(self, gain: float = 0.8) -> None:
        """Choose the share of the error to correct.

        Args:
            gain: Dimensionless; the paper's is 0.8.

        Raises:
            ConfigurationError: The gain is not a positive number.
        """
        if not (math.isfinite(gain) and gain > 0):
            raise ConfigurationError(f"gain must be a positive number, got {gain}; try 0.8")
        self.gain = gain
        self._outcome_dim: int | None = None
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def start(self, demonstrations: Demonstrations) -> None:
        """Forget all trials; of the demonstrations only k matters."""
        self._outcome_dim = demonstrations.outcome_dim
        self._last = None

    def propose(self, goal_seen: np.ndarray) -> np.ndarray:
        """Return the goal, or the last condition corrected, shape (k,)."""
        if self._outcome_dim is None:
            raise not_started(self)
        goal = as_goal_seen(goal_seen, self._outcome_dim)
        if self._last is None:
            return goal
        condition, outcome_seen = self._last
        return condition - self.gain * (outcome_seen - goal)

    def observe(self, condition: np.ndarray, outcome_seen: np.ndarray) -> None:
        """Remember this trial in place of the one before it."""
        if self._outcome_dim is None:
            raise not_started(self)
        self._last = as_trial(condition, outcome_seen, self._outcome_dim)

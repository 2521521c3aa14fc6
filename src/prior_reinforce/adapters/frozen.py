"""No adapter (paper, Section V-B: "w/o Adapter"): the goal itself, trial after trial."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.adapters.vectors import as_goal_seen, as_trial, not_started
from prior_reinforce.plans.motions import Demonstrations


class FrozenAdapter(Adapter):
    """The condition is the goal, whatever was seen."""

    name: ClassVar[str] = "frozen"

    def __init__(self) -> None:
        """Know nothing yet."""
        self._outcome_dim: int | None = None

    def start(self, demonstrations: Demonstrations) -> None:
        """Note how many components an outcome has."""
        self._outcome_dim = demonstrations.outcome_dim

    def propose(self, goal_seen: np.ndarray) -> np.ndarray:
        """Return the goal, shape (k,), a fresh array."""
        if self._outcome_dim is None:
            raise not_started(self)
        return as_goal_seen(goal_seen, self._outcome_dim)

    def observe(self, condition: np.ndarray, outcome_seen: np.ndarray) -> None:
        """Check the trial as every adapter does, and ignore it."""
        if self._outcome_dim is None:
            raise not_started(self)
        as_trial(condition, outcome_seen, self._outcome_dim)

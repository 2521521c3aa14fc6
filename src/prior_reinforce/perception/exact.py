"""Seeing without error: what a simulator, or a very good measurement, reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from prior_reinforce.perception.base import Perception
from prior_reinforce.rollouts import Rollout


@dataclass(frozen=True)
class Exact(Perception):
    """The true error, outcome minus goal."""

    name: ClassVar[str] = "exact"

    def perceive(self, rollout: Rollout, goal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return r - g, shape (k,), in [m]; draws nothing from `rng`."""
        return rollout.outcome - goal

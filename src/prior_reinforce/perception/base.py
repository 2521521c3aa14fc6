"""The interface of P: what came of a trial in, the error that is seen out (paper, Section IV)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from prior_reinforce.rollouts import Rollout


class Perception(ABC):
    """A way of seeing by how much a trial missed: e_seen = P(r - g)."""

    name: ClassVar[str]
    """Name on the command line and in results."""

    @abstractmethod
    def perceive(self, rollout: Rollout, goal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the perceived error of one trial.

        Args:
            rollout: What came of the trial; its true outcome, or the picture of its key frame.
            goal: True goal g, shape (k,), in [m].
            rng: Source of perception noise.

        Returns:
            Error seen, outcome minus goal, shape (k,), in [m].

        Raises:
            PerceptionFailedError: Nothing could be made out; ask an operator.
        """

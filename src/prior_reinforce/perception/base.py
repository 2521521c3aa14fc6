"""The interface of P: what came of a trial in, what is seen of it out (paper, Section IV)."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from typing_extensions import Self

from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.readings import Reading


class Perception(ABC):
    """Perceives by how much a trial missed: e_seen = P(r - g), and how far that can be trusted."""

    @abstractmethod
    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """Return what is perceived of one trial's error.

        Args:
            rollout: What came of the trial; its true outcome, or the picture of its key frame.
            goal: True goal g, in [m].
            rng: Source of perception noise.

        Returns:
            The reading of outcome minus goal, in [m].

        Raises:
            PerceptionFailedError: Nothing could be recognised; ask an operator.
        """

    def close(self) -> None:  # noqa: B027  # most hold nothing
        """Free what it holds: connections, graphics memory."""

    def __enter__(self) -> Self:
        """Use it for the length of a block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

"""The interface of M: a perceived goal in, the condition to try out (paper, Stage 2)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from prior_reinforce.plans.motions import Demonstrations


class Adapter(ABC):
    """A condition adapter, correcting what the generator is asked for from trial to trial.

    It only ever receives perceived outcomes. It has no notion of a trial's number: to forget an
    amended or voided trial, the session starts it afresh and observes again (at most a dozen).
    """

    name: ClassVar[str]
    """Name on the command line and in results."""

    @abstractmethod
    def start(self, demonstrations: Demonstrations) -> None:
        """Begin anew with D_M = {(c_i, r_i) | c_i = r_i} (Algorithm 1), forgetting all trials."""

    @abstractmethod
    def propose(self, goal_seen: np.ndarray) -> np.ndarray:
        """Return the condition to try next for a goal: c = M(g).

        Args:
            goal_seen: Perceived goal, shape (k,), in the outcomes' units.

        Returns:
            Condition, shape (k,), a fresh array. Proposing changes nothing.

        Raises:
            NotFittedError: Before `start`.
        """

    @abstractmethod
    def observe(self, condition: np.ndarray, outcome_seen: np.ndarray) -> None:
        """Take in one trial: this condition gave that perceived outcome.

        Args:
            condition: c, shape (k,). Copied.
            outcome_seen: r = g + e as perceived, shape (k,). Copied.
        """

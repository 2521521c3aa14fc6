"""The interface of M: a perceived goal in, the condition to try out (paper, Stage 2)."""

from __future__ import annotations

from abc import ABC, abstractmethod

from numpy.typing import ArrayLike

from prior_reinforce.arrays import Point, as_vector
from prior_reinforce.errors import InvalidFeedbackError, InvalidGoalError, NotFittedError
from prior_reinforce.plans.motions import Demonstrations


class Adapter(ABC):
    """A condition adapter, correcting what the generator is asked for from trial to trial.

    It only ever receives perceived outcomes. It has no notion of a trial's number: to forget an
    amended or voided trial, the session starts it afresh and observes again (at most a dozen).

    The checks stand here; a member implements `_start`, `_propose` and `_observe`, which receive
    fresh, finite vectors of the right length, and only after `start`.
    """

    _outcome_dim: int | None = None

    def start(self, demonstrations: Demonstrations) -> None:
        """Begin anew with D_M = {(c_i, r_i) | c_i = r_i} (Algorithm 1), forgetting all trials."""
        self._start(demonstrations)
        self._outcome_dim = demonstrations.outcome_dim

    def propose(self, goal_seen: ArrayLike) -> Point:
        """Return the condition to try next for a goal: c = M(g).

        Args:
            goal_seen: Perceived goal, in the outcomes' units.

        Returns:
            Condition, in the same units, a fresh array. Proposing changes nothing.

        Raises:
            NotFittedError: Before `start`.
            InvalidGoalError: Wrong shape, or not finite.
        """
        return self._propose(self._checked(goal_seen, "goal", InvalidGoalError))

    def observe(self, condition: ArrayLike, outcome_seen: ArrayLike) -> None:
        """Take in one trial: this condition gave that perceived outcome.

        Args:
            condition: c. Copied.
            outcome_seen: r = g + e as perceived. Copied.

        Raises:
            NotFittedError: Before `start`.
            InvalidFeedbackError: Wrong shape, or not finite.
        """
        self._observe(
            self._checked(condition, "condition", InvalidFeedbackError),
            self._checked(outcome_seen, "perceived outcome", InvalidFeedbackError),
        )

    @abstractmethod
    def _start(self, demonstrations: Demonstrations) -> None:
        """See `start`."""

    @abstractmethod
    def _propose(self, goal_seen: Point) -> Point:
        """See `propose`; the goal may be returned itself."""

    @abstractmethod
    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        """See `observe`; both may be kept."""

    def _checked(
        self,
        values: ArrayLike,
        name: str,
        problem: type[InvalidGoalError] | type[InvalidFeedbackError],
    ) -> Point:
        if self._outcome_dim is None:
            raise NotFittedError(
                f"{type(self).__name__} knows no demonstrations yet; call start(demonstrations) "
                "first"
            )
        return as_vector(
            values,
            self._outcome_dim,
            problem,
            name=name,
            size=f"the demonstrations' outcomes have {self._outcome_dim} components",
            remedy="void a trial nobody saw",
        )

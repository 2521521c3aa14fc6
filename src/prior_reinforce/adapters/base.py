"""The interface of M: a perceived goal in, the condition to try out (paper, Stage 2)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Point, as_vector
from prior_reinforce.errors import InvalidFeedbackError, InvalidGoalError, NotFittedError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading


@dataclass(frozen=True, eq=False)
class Expectation:
    """What is expected of a trial before it is executed."""

    p_hit: float
    """Probability that it reaches the goal."""
    trials: float
    """Trials until the goal is reached, this one included."""
    error: Point | None = None
    """Expected error, outcome minus goal, shape (k,), in the outcomes' units; None if unknown."""
    sd: Point | None = None
    """Its standard deviation, likewise."""


class Adapter(ABC):
    """A condition adapter, correcting what the generator is asked for from trial to trial.

    It only ever receives perceived outcomes. It has no notion of a trial's number: to forget an
    amended or voided trial, the session starts it afresh and observes again (at most a dozen).

    The checks stand here; a member implements `_start`, `_propose` and `_observe`, or
    `_observe_reading`, which receive fresh, finite vectors of the right length, and only after
    `start`.
    """

    carries_over: ClassVar[bool] = False
    """Whether trials of earlier goals serve it, so that a session gives it those unless told
    otherwise."""
    n_starts: int = 0
    """How often it was started: two sessions that share it tell by this that it is the other's."""
    _outcome_dim: int | None = None

    def start(self, demonstrations: Demonstrations) -> None:
        """Begin anew with D_M = {(c_i, r_i) | c_i = r_i} (Algorithm 1), forgetting all trials."""
        self.n_starts += 1
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

    def observe(self, condition: ArrayLike, goal: ArrayLike, reading: Reading | ArrayLike) -> None:
        """Take in one trial: what was perceived of outcome minus goal for this condition.

        Args:
            condition: c. Copied.
            goal: g, which the reading is about. Copied.
            reading: What was perceived; an array is a number of unknown origin.

        Raises:
            NotFittedError: Before `start`.
            InvalidFeedbackError: Wrong shape, or not finite.
        """
        checked = self._checked(condition, "condition", InvalidFeedbackError)
        about = self._checked(goal, "goal", InvalidFeedbackError)
        seen = reading.error_seen if isinstance(reading, Reading) else reading
        error = self._checked(seen, "perceived error", InvalidFeedbackError)
        if not isinstance(reading, Reading):
            reading = Reading.estimated(error)
        self._observe_reading(checked, about, reading)

    def expect(
        self, condition: ArrayLike, goal: ArrayLike, tolerance: ArrayLike
    ) -> Expectation | None:
        """Return what is expected of a trial; None from adapters that expect nothing.

        Args:
            condition: c, mostly what was proposed.
            goal: g.
            tolerance: epsilon of each component, or one for all, in the outcomes' units.

        Raises:
            NotFittedError: Before `start`.
            InvalidGoalError: Wrong shape, or not finite.
        """
        return self._expect(
            self._checked(condition, "condition", InvalidGoalError),
            self._checked(goal, "goal", InvalidGoalError),
            np.broadcast_to(np.asarray(tolerance, np.float64), self._outcome_dim or 0),
        )

    def change_hardware(self) -> None:  # noqa: B027  # most know no difference
        """Take note that the hardware changes between the trials before and those to come.

        Nothing, for most: they tell no difference between what was learned and what has changed.
        """

    @abstractmethod
    def _start(self, demonstrations: Demonstrations) -> None:
        """See `start`."""

    @abstractmethod
    def _propose(self, goal_seen: Point) -> Point:
        """See `propose`; the goal may be returned itself."""

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        """Take in one trial as a number: the perceived outcome r = g + e; both may be kept."""
        raise NotImplementedError(
            f"{type(self).__name__} takes in no trials: write _observe, or _observe_reading"
        )

    def _observe_reading(self, condition: Point, goal: Point, reading: Reading) -> None:
        """See `observe`; for adapters that know what to do with more than a number.

        Others get the number, and are not called for a trial without one (a bare "a miss").
        """
        if reading.has_number:
            self._observe(condition, goal + reading.error_seen)

    def _expect(self, condition: Point, goal: Point, tolerance: Point) -> Expectation | None:
        """See `expect`."""
        return None

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

"""Algorithm 1 of the paper as an ask/tell state machine: the one place where pi and M meet.

A trial is asked for, executed by anything at all (an arm, a simulator, a person), and told. Between
`ask` and `tell` a session can wait for an afternoon. Everything it knows follows from its list of
trials, so a journal that keeps that list can bring it back (`trials=`).

Notation (docs/notation.md):
    g tilde  `goal`        (k,)    [m], table frame
    c        `condition`   (k,)    [m], table frame
    e tilde  `error_seen`  (k,)    [m], outcome minus goal, as perceived
    A        `plan`        (H, D)  unit of the plan format
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.arrays import as_error
from prior_reinforce.errors import ConfigurationError, TrialStateError
from prior_reinforce.generators.base import Generator
from prior_reinforce.plans.motions import Demonstrations


class TrialState(Enum):
    """Where a trial stands."""

    PENDING = "pending"
    """Asked for; its error has not been told yet."""
    TOLD = "told"
    """Executed, its error seen and told."""
    VOIDED = "voided"
    """Not data: the ball slipped, the arm stopped, nothing was seen."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One Stage-2 trial. Never changed; the session replaces it by another as it proceeds."""

    number: int
    """From 1, in the order in which trials were asked for."""
    condition: np.ndarray
    """c = M(g), shape (k,), [m]; read-only."""
    plan: np.ndarray
    """A = pi(c), shape (H, D); read-only."""
    state: TrialState = TrialState.PENDING
    error_seen: np.ndarray | None = None
    """e tilde, shape (k,), [m]; None unless told."""
    hit: bool = False
    """Whether the goal was reached: as reported, or judged from `error_seen`."""
    note: str = ""
    """Why it was voided."""


class Session:
    """Reaching one goal, trial by trial (paper, Algorithm 1, Stage 2)."""

    def __init__(
        self,
        generator: Generator,
        adapter: Adapter,
        demonstrations: Demonstrations,
        goal: ArrayLike,
        tolerance: float,
        *,
        trials: Sequence[Trial] = (),
        earlier: Sequence[tuple[np.ndarray, np.ndarray]] = (),
    ) -> None:
        """Begin, or go on with, the trials for one goal.

        Args:
            generator: pi, fitted to `demonstrations`.
            adapter: M; started here, and owned by this session from now on.
            demonstrations: D_prior with its perceived outcomes.
            goal: g tilde, shape (k,), in the outcomes' units.
            tolerance: epsilon, largest perceived error that counts as reached, in the same units.
            trials: Trials so far, numbered 1, 2, ...; at most the last one pending.
            earlier: Pairs (condition, outcome_seen) of trials for earlier goals, oldest first, for
                the adapter to take in before this goal's own.

        Raises:
            InvalidGoalError: The goal has a wrong shape, or is not finite.
            ConfigurationError: The tolerance is not a positive number.
            TrialStateError: `trials` are not numbered in order, or a pending one is not the last.
        """
        number = isinstance(tolerance, Real) and not isinstance(tolerance, bool)
        if not (number and math.isfinite(tolerance) and tolerance > 0):
            raise ConfigurationError(
                f"tolerance must be a positive number in the outcomes' units, got {tolerance!r}"
            )
        self.demonstrations = demonstrations
        self.goal: np.ndarray = _frozen(demonstrations.check_goal(goal))
        self.tolerance = float(tolerance)
        self._generator = generator
        self._adapter = adapter
        self._earlier = [(np.array(c, float), np.array(r, float)) for c, r in earlier]
        self._trials = list(trials)
        for i, trial in enumerate(self._trials):
            last = i == len(self._trials) - 1
            if trial.number != i + 1 or (trial.state is TrialState.PENDING and not last):
                raise TrialStateError(
                    f"trial {trial.number} ({trial.state.value}) cannot stand at place {i + 1} of "
                    f"{len(self._trials)}; trials are numbered 1, 2, ... and only the last may be "
                    "pending"
                )
        self._restart_adapter()

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All trials so far, in order."""
        return tuple(self._trials)

    @property
    def pending(self) -> Trial | None:
        """The trial that waits to be told, if any."""
        if self._trials and self._trials[-1].state is TrialState.PENDING:
            return self._trials[-1]
        return None

    @property
    def solved(self) -> bool:
        """Whether a told trial reached the goal."""
        return any(trial.hit for trial in self._trials)

    @property
    def n_trials(self) -> int:
        """Stage-2 trials told so far; voided ones are not counted."""
        return sum(trial.state is TrialState.TOLD for trial in self._trials)

    @property
    def total_trials(self) -> int:
        """N of the paper: Stage-1 rollouts plus Stage-2 trials."""
        return self.demonstrations.n + self.n_trials

    def ask(self) -> Trial:
        """Return the trial to execute next: the pending one, or a new one.

        Asking again changes nothing until that trial is told or voided. Asking goes on after the
        goal is reached, for whoever wants to repeat or to measure.
        """
        return ask_all([self])[0]

    def tell(self, number: int, error_seen: ArrayLike, *, hit: bool | None = None) -> Trial:
        """Report what was seen of the pending trial.

        Args:
            number: The pending trial's number.
            error_seen: e tilde, outcome minus goal as perceived, shape (k,), in the outcomes'
                units.
            hit: Whether the goal was reached, where that is seen directly (the ball is in the
                hoop); None judges it by the perceived error, as Algorithm 1 does.

        Returns:
            The trial as it stands now.

        Raises:
            TrialStateError: There is no such trial, or it is not pending.
            InvalidFeedbackError: Wrong shape, or not finite.
        """
        trial = self._trial(number)
        if trial.state is not TrialState.PENDING:
            raise TrialStateError(
                f"trial {number} is already {trial.state.value}; amend it to correct what was seen"
            )
        told = self._told(trial, error_seen, hit)
        self._trials[number - 1] = told
        self._observe(told)
        return told

    def void(self, number: int, reason: str) -> Trial:
        """Declare that a trial is not data; the adapter forgets it.

        Raises:
            TrialStateError: There is no such trial, or it is voided already.
        """
        trial = self._trial(number)
        if trial.state is TrialState.VOIDED:
            raise TrialStateError(f"trial {number} is already voided ({trial.note})")
        was_told = trial.state is TrialState.TOLD
        voided = replace(trial, state=TrialState.VOIDED, error_seen=None, hit=False, note=reason)
        self._trials[number - 1] = voided
        if was_told:
            self._restart_adapter()
        return voided

    def amend(self, number: int, error_seen: ArrayLike, *, hit: bool | None = None) -> Trial:
        """Correct what was told of a trial. A pending trial keeps the plan it has.

        Raises:
            TrialStateError: There is no such trial, or it has not been told.
            InvalidFeedbackError: Wrong shape, or not finite.
        """
        trial = self._trial(number)
        if trial.state is not TrialState.TOLD:
            raise TrialStateError(
                f"trial {number} is {trial.state.value}; only a told trial can be amended"
            )
        amended = self._told(trial, error_seen, hit)
        self._trials[number - 1] = amended
        self._restart_adapter()
        return amended

    def _trial(self, number: int) -> Trial:
        if not isinstance(number, Integral) or isinstance(number, bool):
            raise TrialStateError(
                f"a trial's number is a whole number, got {number!r}; give .number"
            )
        if not 1 <= number <= len(self._trials):
            raise TrialStateError(
                f"there is no trial {number}; "
                + (f"trials are 1 to {len(self._trials)}" if self._trials else "ask for one first")
            )
        return self._trials[number - 1]

    def _told(self, trial: Trial, error_seen: ArrayLike, hit: bool | None) -> Trial:
        error = as_error(error_seen, self.demonstrations.outcome_dim)
        reached = bool(np.linalg.norm(error) <= self.tolerance) if hit is None else hit
        return replace(trial, state=TrialState.TOLD, error_seen=_frozen(error), hit=reached)

    def _observe(self, trial: Trial) -> None:
        assert trial.error_seen is not None
        self._adapter.observe(trial.condition, self.goal + trial.error_seen)

    def _restart_adapter(self) -> None:
        self._adapter.start(self.demonstrations)
        for condition, outcome_seen in self._earlier:
            self._adapter.observe(condition, outcome_seen)
        for trial in self._trials:
            if trial.state is TrialState.TOLD:
                self._observe(trial)

    def _propose(self) -> np.ndarray:
        return self._adapter.propose(self.goal)

    def _open(self, condition: np.ndarray, plan: np.ndarray) -> None:
        number = len(self._trials) + 1
        self._trials.append(Trial(number, _frozen(condition), _frozen(plan)))


def ask_all(sessions: Sequence[Session]) -> list[Trial]:
    """Ask many sessions at once: one call of the generator for all that have nothing pending.

    Args:
        sessions: Sessions that share one fitted generator.

    Returns:
        The pending trial of each, in order.

    Raises:
        ConfigurationError: The sessions have different generators.
    """
    new = [session for session in sessions if session.pending is None]
    if new:
        generator = new[0]._generator
        if any(session._generator is not generator for session in new):
            raise ConfigurationError("sessions asked together must share one generator object")
        conditions = np.stack([session._propose() for session in new])
        for session, condition, plan in zip(
            new, conditions, generator.generate(conditions), strict=True
        ):
            session._open(condition, plan)
    return [session._trials[-1] for session in sessions]


def _frozen(values: np.ndarray) -> np.ndarray:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array

"""Algorithm 1 of the paper as a state machine of trials: the one place where pi and M meet.

A trial is asked for, executed by anything (an arm, a simulator, a person), and told. Between `ask`
and `tell` a session can wait for an afternoon. The rules of a trial are here; the events are in a
log, a list in memory or the journal of a workspace, from which a session is restored.

Notation (docs/notation.md):
    g tilde  `goal`        (k,)    [m], table frame
    c        `condition`   (k,)    [m], table frame
    e tilde  `reading`     (k,)    [m], outcome minus goal, as perceived
    A        `plan`        (H, D)  unit of the plan format
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from threading import RLock
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import ConfigurationError, RobotLimitError, TrialStateError
from prior_reinforce.generators.base import Generator
from prior_reinforce.parsing import as_place, as_reading
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading
from prior_reinforce.session.events import Amended, GoalSet, Told, Voided
from prior_reinforce.session.parts import Parts, check_parts, generate_plans, latest_goal
from prior_reinforce.session.trials import Goal, Log, SessionState, Stage, Trial, Verdict


class Session:
    """Reaching goals, one after another, trial by trial (paper, Algorithm 1, Stage 2).

    Threads may share a session: one call at a time changes it, and the others wait.
    """

    def __init__(
        self,
        generator: Generator | Callable[[], Generator],
        adapter: Adapter | Callable[[], Adapter],
        demonstrations: Demonstrations | Callable[[], Demonstrations],
        goal: ArrayLike | None = None,
        tolerance: ArrayLike | None = None,
        *,
        carry_over: bool | None = None,
        log: Log | None = None,
        gate: Callable[[Frames, Point], Verdict | None] | None = None,
        check_open: Callable[[Trial, Literal["ask", "tell"]], None] | None = None,
    ) -> None:
        """Begin, or continue where a log ends.

        The first three may be functions that load them, called when first needed, and again when
        the log names another model (`SessionState.in_use`): telling, voiding and amending need
        neither generator nor adapter. Trials of other models teach nothing, since their conditions
        mean other motions.

        Args:
            generator: pi, fitted to `demonstrations`.
            adapter: M; owned by this session from now on.
            demonstrations: D_prior with its perceived outcomes.
            goal: g tilde, shape (k,), in the outcomes' units; the log's latest goal if not given.
            tolerance: epsilon, largest perceived error that counts as reached, in the same units:
                one number, or one for each component, which mixed units need. A hit is an error
                whose length, each component divided by its tolerance, is at most 1.
            carry_over: Let the adapter learn from the trials of earlier goals too; by default it
                does where they serve it (`Adapter.carries_over`).
            log: Earlier events, and where to write new ones; in memory if not given.
            gate: Checks a plan, given its condition, against a robot's limits whenever the plan is
                returned, such as `check_plan`; by default nothing is checked.
            check_open: Raises TrialStateError if the open trial may not be returned again, or not
                be told; by default it always may.

        Raises:
            InvalidGoalError: The goal has a wrong shape, or is not finite.
            ConfigurationError: The tolerance is not positive, or does not say what counts in each
                unit; or a class or a name is given instead of an object.
            TrialStateError: A goal is given, and a trial for the one before waits to be told.
        """
        check_parts(generator, adapter, demonstrations)
        self.log = Log() if log is None else log
        self._given: Any = (generator, adapter, demonstrations)
        self._gate, self._check_open = gate, check_open
        self._current = Parts(self._given, ())
        self._carry_over = carry_over
        self._tolerance = tolerance
        self._lock = RLock()
        if goal is not None:
            self.set_goal(goal)

    @property
    def generator(self) -> Generator:
        """The generator pi; loaded now, if a function was given."""
        return self._parts(self.state).generator

    @property
    def adapter(self) -> Adapter:
        """The adapter M; loaded now, if a function was given."""
        return self._parts(self.state).adapter

    @property
    def demonstrations(self) -> Demonstrations:
        """The demonstrations D_prior; loaded now, if a function was given."""
        return self._parts(self.state).demonstrations

    @property
    def state(self) -> SessionState:
        """The state that all events of the log add up to."""
        return self.log.state()

    @property
    def goals(self) -> tuple[Goal, ...]:
        """All goals so far, in order."""
        return tuple(self.state.goals)

    @property
    def goal(self) -> Point:
        """The goal g tilde that is worked on: the latest."""
        return latest_goal(self.state).goal

    @property
    def tolerance(self) -> Point:
        """The tolerance epsilon of each component, of the goal that is worked on."""
        return latest_goal(self.state).tolerance

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All trials for the goal that is worked on, in order; `state.trials` has all."""
        return self.state.current

    @property
    def open_trial(self) -> Trial | None:
        """The trial that waits to be told, if any."""
        return self.state.open_trial

    @property
    def solved(self) -> bool:
        """Whether a told trial reached the goal that is worked on."""
        return self.state.solved

    @property
    def n_trials(self) -> int:
        """Trials told so far for the goal that is worked on; voided ones are not counted."""
        return sum(trial.stage is Stage.TOLD for trial in self.trials)

    def trial(self, number: int) -> Trial:
        """Return a trial of any goal as it stands.

        Raises:
            TrialStateError: There is no such trial.
        """
        return self.state.trial(number)

    def set_goal(
        self,
        goal: ArrayLike | str,
        tolerance: ArrayLike | None = None,
        *,
        carry_over: bool | None = None,
        adapter: str = "",
        new_hardware: str | None = None,
    ) -> Goal:
        """Set the goal that the next trials are for.

        Args:
            goal: g tilde, shape (k,), in the outcomes' units; or said, with its units: `92cm 10cm`.
            tolerance: epsilon; the session's own if not given.
            carry_over: As in the constructor; the session's own if not given.
            adapter: Name of the adapter that `adapter` loads for this goal, for a log that is gone
                on with later; `carry_over` goes with it.
            new_hardware: What was changed on the hardware, a note; None where nothing was. An
                adapter that knows the difference (`Adapter.change_hardware`) then believes less of
                what it knew, and the next reading more.

        Raises:
            InvalidGoalError: Wrong shape, not finite, or of another unit by its size.
            ConfigurationError: As in the constructor; or an adapter without `carry_over`.
            TrialStateError: A trial for the goal before waits to be told.
        """
        state = self.state
        state.refuse_open_trial("setting a goal")  # before anything is said of the goal
        demonstrations = self._parts(state).demonstrations
        form, shown = demonstrations.outcome_format, demonstrations.outcomes_seen
        checked = demonstrations.check_goal(as_place(goal, form, shown))
        given = self._tolerance if tolerance is None else tolerance
        if given is None:
            raise ConfigurationError(
                f"give tolerance=, the largest error that is a hit: one number, or one for {form}"
            )
        form = form.within(given)
        carried = self._carry_over if carry_over is None else carry_over
        if carried is None:
            if adapter:
                raise ConfigurationError(f"say carry_over for the adapter {adapter}: True or False")
            carried = self._parts(state).adapter.carries_over
        event = GoalSet(
            goal=checked.tolist(),
            format=form,
            carry_over=carried,
            adapter=adapter,
            new_hardware=new_hardware,
        )
        with self._exclusive() as state:
            state.refuse_open_trial("setting a goal")
            self.log.append(event)
        return state.goals[-1]

    def ask(self) -> Trial:
        """Return the trial to execute next: the open one, or a new one.

        Asking again changes nothing until that trial is told or voided. Asking goes on after the
        goal is reached, for whoever wants to repeat or to measure. A plan that the gate refuses now
        is not returned, whatever the gate said before.

        Returns:
            The trial, with its plan and the gate's verdict on it.

        Raises:
            OutOfReachError: No plan reaches the goal, and the nearest one missed.
            RobotLimitError: The plan breaks a limit of the robot.
            TrialStateError: The open trial may not be given out again (`check_open`).
            WorkspaceError: No goal is set, or the log cannot be written.
        """
        return ask_all([self], may_repeat=False)[0]

    def tell(
        self, number: int, seen: Reading | ArrayLike | None = None, *, hit: bool | None = None
    ) -> Trial:
        """Report what was seen of the open trial.

        Args:
            number: The open trial's number.
            seen: What perception returned; or words, `5 cm long, 2 cm left`, `20 ms late` (see
                `from_words`); or outcome minus goal as a number of unknown origin, shape (k,), in
                the outcomes' units (see `Reading.estimated`). None: nothing but `hit` is known.
            hit: Whether the goal was reached, where that is seen directly (the ball is in the
                hoop). None leaves it to `seen`; where that does not know, it is judged by the
                perceived error, as Algorithm 1 does.

        Returns:
            The trial as it stands now.

        Raises:
            TrialStateError: There is no such trial, or it is not open; or it was not executed,
                where that is known.
            InvalidFeedbackError: Wrong shape, not finite, numbers of another unit by their size, or
                an outcome in place of an error.
        """
        with self._exclusive() as state:
            trial = state.trial(number)
            if not trial.open:
                remedy = "amend it to correct it" if trial.amendable else "ask for another"
                raise TrialStateError(f"trial {number} is already {trial.stage.value}; {remedy}")
            self._check(trial, "tell")
            self._append_reading(Told, trial, state.goal_of(trial), seen, hit)
        return state.trial(number)

    def amend(
        self, number: int, seen: Reading | ArrayLike | None = None, *, hit: bool | None = None
    ) -> Trial:
        """Correct what was told of a trial, of any goal; one that was voided since counts again.

        An open trial keeps the plan it has, and says so (`Trial.outdated`).

        Arguments, and errors of what was seen, as in `tell`.

        Raises:
            TrialStateError: There is no such trial, or it has not been told.
        """
        with self._exclusive() as state:
            trial = state.trial(number)
            if not trial.amendable:
                raise TrialStateError(
                    f"trial {number} is {trial.stage.value}, only a told trial can be amended; "
                    + ("tell it" if trial.open else "ask for another")
                )
            self._append_reading(Amended, trial, state.goal_of(trial), seen, hit)
        return state.trial(number)

    def void(self, number: int, reason: str = "") -> Trial:
        """Declare that a trial, open or told, is not data; the adapter forgets it.

        Args:
            number: The trial's.
            reason: Why, for the log and the report.

        Raises:
            TrialStateError: There is no such trial, or it is voided already.
        """
        with self._exclusive() as state:
            trial = state.trial(number)
            if trial.stage is Stage.VOIDED:
                raise TrialStateError(f"trial {number} is already voided; ask for another")
            # What a terminal could not decode cannot be printed again.
            text = str(reason).encode(errors="replace").decode()
            self.log.append(Voided(trial=trial.number, reason=text))
        return state.trial(number)

    def __repr__(self) -> str:
        state = self.state
        if state.goal is None:
            return "Session(no goal)"
        reached = "reached" if state.solved else "not reached"
        waits = f"; trial {state.open_trial.number} waits" if state.open_trial else ""
        goal = np.round(state.goal.goal, 4).tolist()
        told = f"{self.n_trials} trial{'s' * (self.n_trials != 1)} told"
        return f"Session(goal {goal} {reached}, {told}{waits})"

    def __getstate__(self) -> dict[str, Any]:
        """Return all but the lock: a copy of a session in memory has its own log."""
        return {name: value for name, value in self.__dict__.items() if name != "_lock"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore with a new lock."""
        self.__dict__.update(state, _lock=RLock())

    @contextmanager
    def _exclusive(self) -> Iterator[SessionState]:
        """Hold the log, and return its state."""
        with self._lock, self.log.exclusive():
            yield self.log.state()

    def _parts(self, state: SessionState) -> Parts:
        """Return the parts that the log names; parts of other names are dropped."""
        with self._lock:
            names = (*state.in_use, "" if state.goal is None else state.goal.adapter)
            if names != self._current.names:
                self._current = Parts(self._given, names)
            return self._current

    def _append_reading(
        self,
        event: type[Told],
        trial: Trial,
        goal: Goal,
        seen: Reading | ArrayLike | None,
        hit: bool | None,
    ) -> None:
        number = not isinstance(seen, Reading | str | None)  # others need no demonstrations
        shown = self.demonstrations.outcomes_seen if number else 0.0
        reading = as_reading(seen, hit, goal.goal, goal.format, trial.expected.large_error, shown)
        # An error with an open end is judged a miss.
        near = goal.is_hit(reading.error_seen) and np.isfinite(reading.spread).all()
        reached = near if reading.hit is None else reading.hit
        self.log.append(event(trial=trial.number, reading=reading.record(), hit=bool(reached)))

    def informed_adapter(self) -> Adapter:
        """Return the adapter after every reading that counts for the latest goal.

        For queries only; changes made to it are not rolled back.

        Raises:
            WorkspaceError: No goal is set.
        """
        with self._exclusive() as state:
            return self._parts(state).trusted(state, self.log).adapter

    def _check(self, trial: Trial, verb: Literal["ask", "tell"]) -> None:
        """Raise TrialStateError if an open trial may not be returned again, or not be told."""
        if self._check_open is not None:
            self._check_open(trial, verb)

    def _open_trial(
        self, state: SessionState, parts: Parts, condition: Point, plan: Frames, may_repeat: bool
    ) -> Verdict | None:
        """Append a new trial to the log, if its plan may be executed; return the gate's verdict."""
        again = may_repeat and self._gate is None
        event, plan, verdict = parts.next_trial(
            state, condition, plan, self._verdict, may_repeat=again
        )
        self.log.keep_adapter(parts.adapter)
        self.log.append_asked(event, plan, parts.demonstrations.format)
        return verdict

    def _with_plan(
        self, state: SessionState, number: int, fresh: Mapping[Session, Verdict | None]
    ) -> Trial:
        """Return a trial with its plan and the gate's verdict, unless the gate refuses it now.

        `fresh` holds the verdicts on trials that this call has opened.
        """
        trial = state.trial(number)
        if not trial.open:
            raise TrialStateError(f"trial {number} was {trial.stage.value} meanwhile; ask again")
        plan = self.log.plan(trial)
        refusal = f"trial {number} may not be executed now, void it and ask again"
        verdict = fresh[self] if self in fresh else self._verdict(plan, trial.condition, refusal)
        if len(trial.plan) and verdict is None:
            return trial
        return replace(trial, plan=plan, verdict=verdict)

    def _verdict(self, plan: Frames, condition: Point, refusal: str) -> Verdict | None:
        """Return the gate's verdict; if it refuses, raise an error that begins with `refusal`."""
        try:
            verdict = None if self._gate is None else self._gate(plan, condition)
            if verdict is not None:
                verdict.require()
        except RobotLimitError as error:
            raise RobotLimitError(f"{refusal}: {error.problem}", remedy=error.remedy) from error
        return verdict


def ask_all(sessions: Sequence[Session], *, may_repeat: bool = True) -> list[Trial]:
    """Ask many sessions at once: one call of each generator for all that have no open trial.

    Args:
        sessions: Different sessions; those that share a generator share its call.
        may_repeat: Without a gate, repeat plans that do not reach a goal; `ask` raises instead.

    Returns:
        The open trial of each, in order.

    Raises:
        ConfigurationError: A session is given twice.
    """
    if len({id(session) for session in sessions}) < len(sessions):
        raise ConfigurationError("sessions asked together must be different ones")
    for session in sessions:
        state = session.state
        if state.open_trial is None:  # load before holding the log, so that others need not wait
            session._parts(state).load()
            latest_goal(state)  # raises if there is none
    with ExitStack() as logs:
        asked, new = list[tuple[SessionState, int]](), dict[Session, SessionState]()
        for session in sessions:
            state = logs.enter_context(session._exclusive())
            if state.open_trial is None:
                new[session] = state
            else:
                session._check(state.open_trial, "ask")
            asked.append((state, len(state.trials) + (session in new)))
        verdicts: dict[Session, Verdict | None] = {}
        if new:
            parts = [s._parts(state).trusted(state, s.log) for s, state in new.items()]
            goals = [latest_goal(state).goal for state in new.values()]
            conditions = [each.adapter.propose(g) for each, g in zip(parts, goals, strict=True)]
            plans = generate_plans([each.generator for each in parts], conditions)
            opened = zip(new.items(), parts, conditions, plans, strict=True)
            for (session, state), each, condition, plan in opened:
                verdicts[session] = session._open_trial(state, each, condition, plan, may_repeat)
    return [
        session._with_plan(state, number, verdicts)
        for session, (state, number) in zip(sessions, asked, strict=True)
    ]

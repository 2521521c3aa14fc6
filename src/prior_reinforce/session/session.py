"""Algorithm 1 of the paper as the one state machine of trials: the one place where pi and M meet.

A trial is asked for, executed by anything at all (an arm, a simulator, a person), and told. Between
`ask` and `tell` a session can wait for an afternoon. Every rule of a trial stands here; what
happened stands in a log, a list in memory or a workspace's journal, from which a session is brought
back.

Notation (docs/notation.md):
    g tilde  `goal`        (k,)    [m], table frame
    c        `condition`   (k,)    [m], table frame
    e tilde  `reading`     (k,)    [m], outcome minus goal, as perceived
    A        `plan`        (H, D)  unit of the plan format
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from numbers import Integral, Real
from threading import RLock
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.arrays import Frames, Point, as_error
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidFeedbackError,
    InvalidPlanError,
    RobotLimitError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.plans.normalisation import Normalisation
from prior_reinforce.readings import Reading
from prior_reinforce.session.trials import Goal, History, Log, MemoryLog, Stage, Trial
from prior_reinforce.wording import from_words, in_words

if TYPE_CHECKING:
    from prior_reinforce.adapters.base import Adapter
    from prior_reinforce.generators.base import Generator
    from prior_reinforce.plans.motions import Demonstrations


class Verdict(Protocol):
    """What a gate says of a plan; see `robots.report.LimitReport`."""

    def require(self) -> None:
        """Raise RobotLimitError unless the plan may be executed."""

    def as_json(self) -> Mapping[str, Any]:
        """The same as plain data, for the log."""


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
        tolerance: float | None = None,
        *,
        carry_over: bool | None = None,
        log: Log | None = None,
        gate: Callable[[Frames], Verdict | None] | None = None,
        in_use: Callable[[], tuple[str, ...]] = lambda: ("",),
    ) -> None:
        """Begin, or go on where a log ends.

        The first three may be functions that load them, called when first needed: telling, voiding
        and amending need neither generator nor adapter.

        Args:
            generator: pi, fitted to `demonstrations`.
            adapter: M; owned by this session from now on.
            demonstrations: D_prior with its perceived outcomes.
            goal: g tilde, shape (k,), in the outcomes' units; the log's latest goal if not given.
            tolerance: epsilon, largest perceived error that counts as reached, in the same units;
                where they are mixed, in the first one (see `Normalisation.metric`).
            carry_over: Let the adapter learn from the trials of earlier goals too; by default it
                does where they serve it (`Adapter.carries_over`).
            log: What happened so far, and where to write what happens; in memory if not given.
            gate: Holds a plan against a robot's limits whenever it is to leave; none by default.
            in_use: Returns the name of the model in use, and whatever else the functions above
                load: when it changes, they are called again. Trials of other models teach nothing,
                since their conditions mean other motions.

        Raises:
            InvalidGoalError: The goal has a wrong shape, or is not finite.
            ConfigurationError: The tolerance is not a positive number.
            TrialStateError: A goal is given, and a trial for the one before waits to be told.
        """
        self.log: Log = MemoryLog() if log is None else log
        self._given: Any = (generator, adapter, demonstrations)
        self._gate = gate
        self._in_use = in_use
        self._loaded_for: tuple[str, ...] = ()
        self._carry_over = carry_over
        self._tolerance = tolerance
        self._history = History()
        self._observed: list[Trial] | None = None
        self._lock = RLock()
        self._mark = object()
        self._on_hardware_of = 0
        """The latest goal whose change of hardware the adapter knows of."""
        self._refresh()
        if goal is not None:
            self.set_goal(goal)

    @cached_property
    def generator(self) -> Generator:
        """The generator pi; loaded now, if a function was given."""
        return _loaded(self._given[0])

    @cached_property
    def adapter(self) -> Adapter:
        """The adapter M; loaded now, if a function was given."""
        return _loaded(self._given[1])

    @cached_property
    def demonstrations(self) -> Demonstrations:
        """The demonstrations D_prior; loaded now, if a function was given."""
        return _loaded(self._given[2])

    @property
    def goals(self) -> tuple[Goal, ...]:
        """All goals so far, in order."""
        return tuple(self._history.goals)

    @property
    def goal(self) -> Point:
        """The goal g tilde that is worked on: the latest."""
        return self._current_goal().goal

    @property
    def tolerance(self) -> float:
        """The tolerance epsilon of the goal that is worked on."""
        return self._current_goal().tolerance

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All trials for the goal that is worked on, in order."""
        return self.trials_of(len(self._history.goals))

    def trials_of(self, goal_number: int) -> tuple[Trial, ...]:
        """All trials for one goal, in order."""
        return self._history.trials_of(goal_number)

    def readings_for(self, goal: Goal, model: str) -> list[Trial]:
        """Told trials that count for a goal and that a model planned, oldest first."""
        return self._history.readings_for(goal, model)

    @property
    def open_trial(self) -> Trial | None:
        """The trial that waits to be told, if any."""
        return self._history.open_trial

    @property
    def solved(self) -> bool:
        """Whether a told trial reached the goal that is worked on."""
        return any(trial.hit for trial in self.trials)

    @property
    def n_trials(self) -> int:
        """Trials told so far for the goal that is worked on; voided ones are not counted."""
        return sum(trial.stage is Stage.TOLD for trial in self.trials)

    @property
    def n_trials_asked(self) -> int:
        """Trials asked for so far, for all goals: the number of the latest."""
        return len(self._history.trials)

    def trial(self, number: int) -> Trial:
        """Return a trial of any goal as it stands.

        Raises:
            TrialStateError: There is no such trial.
        """
        if not isinstance(number, Integral) or isinstance(number, bool):
            raise TrialStateError(
                f"a trial's number is a whole number, got {number!r}; give .number"
            )
        trials = self._history.trials
        if not 1 <= number <= len(trials):
            known = f"give a number from 1 to {len(trials)}" if trials else "ask for one first"
            raise TrialStateError(f"there is no trial {number}; {known}")
        return trials[number - 1]

    def set_goal(
        self,
        goal: ArrayLike,
        tolerance: float | None = None,
        *,
        carry_over: bool | None = None,
        adapter: str = "",
        new_hardware: str | None = None,
    ) -> Goal:
        """Set the goal that the next trials are for.

        Args:
            goal: g tilde, shape (k,), in the outcomes' units.
            tolerance: epsilon; the session's own if not given.
            carry_over: As in the constructor; the session's own if not given.
            adapter: Name of the adapter, for a log that is gone on with later.
            new_hardware: What was changed on the hardware, a note; None where nothing was. What
                had changed since the demonstrations is then unknown anew to adapters that know the
                difference (`Adapter.change_hardware`), and the rest stays known.

        Raises:
            InvalidGoalError: Wrong shape, or not finite.
            ConfigurationError: The tolerance is not a positive number.
            TrialStateError: A trial for the goal before waits to be told.
        """
        self._refresh()
        self.refuse_open_trial("setting a goal")  # before anything is said of the goal
        checked = self.demonstrations.check_goal(goal)
        tolerance = _as_tolerance(self._tolerance if tolerance is None else tolerance)
        carried = self._carry_over if carry_over is None else carry_over
        if carried is None:
            kind = ADAPTERS.kind(adapter) if adapter else type(self.adapter)
            carried = kind.carries_over
        with self._exclusive():
            self.refuse_open_trial("setting a goal")
            data = {
                "goal": checked.tolist(),
                "tolerance": tolerance,
                "metric": Normalisation.of(self.demonstrations).metric.tolist(),
                "memory": "workspace" if carried else "goal",
                "adapter": adapter,
            }
            if new_hardware is not None:
                data["new_hardware"] = new_hardware
            self.log.append("goal_set", data)
        self._refresh()
        return self._history.goals[-1]

    def ask(self, *, arm_did_not_move: bool = False) -> Trial:
        """Return the trial to execute next: the open one, or a new one.

        Asking again changes nothing until that trial is told or voided. Asking goes on after the
        goal is reached, for whoever wants to repeat or to measure. A plan that the gate refuses now
        is not returned, whatever the gate said before.

        Args:
            arm_did_not_move: What a person saw of a trial that was executing when the program died:
                nothing moved, it may be executed after all.

        Raises:
            RobotLimitError: The plan breaks a limit of the robot.
            TrialStateError: The open trial is executing, or was when the program died and nobody
                said yet whether the arm moved.
            WorkspaceError: No goal is set, or the log cannot be written.
        """
        return ask_all([self], arm_did_not_move=arm_did_not_move)[0]

    def tell(
        self, number: int, seen: Reading | ArrayLike | None = None, *, hit: bool | None = None
    ) -> Trial:
        """Report what was seen of the open trial.

        Args:
            number: The open trial's number.
            seen: What perception returned; or words, `5 cm long, 2 cm left`, where outcomes are
                lengths (see `from_words`); or outcome minus goal as a number of unknown origin,
                shape (k,), in the outcomes' units (see `Reading.estimated`). None where nothing
                but `hit` is known.
            hit: Whether the goal was reached, where that is seen directly (the ball is in the
                hoop). None leaves it to `seen`; where that does not know, it is judged by the
                perceived error, as Algorithm 1 does.

        Returns:
            The trial as it stands now.

        Raises:
            TrialStateError: There is no such trial, or it is not open.
            InvalidFeedbackError: Wrong shape, or not finite.
        """
        with self._exclusive():
            trial = self.trial(number)
            if not trial.open:
                raise TrialStateError(
                    f"trial {number} is already {trial.stage.value}; "
                    + ("amend it to correct it" if trial.stage is Stage.TOLD else "ask for another")
                )
            self._append_reading("told", trial, seen, hit)
        return self._now(number)

    def amend(
        self, number: int, seen: Reading | ArrayLike | None = None, *, hit: bool | None = None
    ) -> Trial:
        """Correct what was told of a trial, of any goal.

        An open trial keeps the plan it has, and says so (`Trial.outdated`).

        Arguments as in `tell`.

        Raises:
            TrialStateError: There is no such trial, or it has not been told.
            InvalidFeedbackError: Wrong shape, or not finite.
        """
        with self._exclusive():
            trial = self.trial(number)
            if trial.stage is not Stage.TOLD:
                raise TrialStateError(
                    f"trial {number} is {trial.stage.value}, only a told trial can be amended; "
                    + ("tell it" if trial.open else "ask for another")
                )
            self._append_reading("amended", trial, seen, hit)
        return self._now(number)

    def void(self, number: int, reason: str) -> Trial:
        """Declare that a trial, open or told, is not data; the adapter forgets it.

        Raises:
            TrialStateError: There is no such trial, or it is voided already.
        """
        with self._exclusive():
            trial = self.trial(number)
            if trial.stage is Stage.VOIDED:
                raise TrialStateError(f"trial {number} is already voided; ask for another")
            # What a terminal could not decode cannot be printed again.
            text = reason.encode(errors="replace").decode()
            self.log.append("voided", {"trial": trial.number, "reason": text})
        return self._now(number)

    def begin_execution(self, number: int, command: str, folder: str = "") -> Trial:
        """Note that a trial's plan is given to a command now: a plan is executed once.

        Args:
            number: The trial.
            command: Its text.
            folder: Name of the folder for what it writes, if any.

        Raises:
            TrialStateError: There is no such trial, or it was executed already.
        """
        with self._exclusive():
            trial = self.trial(number)
            if trial.stage is not Stage.ASKED:
                raise TrialStateError(
                    f"trial {number} is {trial.stage.value} already; a plan runs once: tell it or "
                    "void it, then ask for the next"
                )
            data = {"trial": trial.number, "command": command, "folder": folder}
            self.log.append("executing", data)
        return self._now(number)

    def end_execution(self, number: int, result: Mapping[str, Any] | None) -> Trial:
        """Note how the command ended.

        Args:
            number: The trial.
            result: What came of it; None if it was never started. Where nothing moved, as then or
                where its `outcome` is `not_moved`, the trial may be executed after all.
        """
        with self._exclusive():
            trial = self.trial(number)
            if trial.stage is Stage.EXECUTING:  # it may have been told meanwhile
                moved = result is not None and result.get("outcome") != "not_moved"
                kind = "executed" if moved else "not_executed"
                self.log.append(kind, {"trial": trial.number, **(result or {})})
        return self._now(number)

    def refuse_open_trial(self, doing: str) -> None:
        """Do nothing unless a trial waits to be told.

        Raises:
            TrialStateError: One does.
        """
        trial = self.open_trial
        if trial is not None:
            raise TrialStateError(
                f"trial {trial.number} waits to be told; tell or void it before {doing}"
            )

    def _current_goal(self) -> Goal:
        goal = self._history.goal
        if goal is None:
            raise WorkspaceError(
                "no goal is set; set one (Session.set_goal, or: prior-reinforce goal)"
            )
        return goal

    def _refresh(self) -> None:
        """Know all that the log says, and forget what was loaded if other things are in use."""
        with self._lock:
            self._history.update(self.log.events())
            goal = self._history.goal
            now = (*self._in_use(), "" if goal is None else goal.adapter)
            if now != self._loaded_for:
                self._loaded_for, self._observed = now, None
                for name in ("generator", "adapter", "demonstrations"):
                    self.__dict__.pop(name, None)

    def _now(self, number: int) -> Trial:
        self._refresh()
        return self._history.trials[number - 1]

    def _exclusive(self) -> ExitStack:
        """Hold the log, and know all that it says."""
        with ExitStack() as stack:
            stack.enter_context(self._lock)
            stack.enter_context(self.log.exclusive())
            self._refresh()
            return stack.pop_all()

    def _append_reading(
        self, kind: str, trial: Trial, seen: Reading | ArrayLike | None, hit: bool | None
    ) -> None:
        goal = self._history.goals[trial.goal_number - 1]
        if not (hit is None or isinstance(hit, (bool, np.bool_))):
            raise InvalidFeedbackError(f"hit must be True, False or None, got {hit!r}")
        reading = self._as_reading(seen, goal, hit).with_hit(hit)
        reached = reading.hit
        if reached is None:
            reached = goal.distance(reading.error_seen) <= goal.tolerance
        data = {
            "trial": trial.number,
            "error_seen": reading.error_seen.tolist(),
            "reading": reading.as_json(),
            "hit": bool(reached),
        }
        self.log.append(kind, data)

    def _as_reading(
        self, seen: Reading | ArrayLike | None, goal: Goal, hit: bool | None
    ) -> Reading:
        k = goal.goal.size
        if seen is None:
            if hit is None:
                raise InvalidFeedbackError("say what was seen, or whether it hit")
            return Reading.only(bool(hit), k)
        if isinstance(seen, str):
            units = self.demonstrations.outcome_units
            if not in_words(units):
                raise InvalidFeedbackError(
                    f"words are for lengths, these outcomes are in {', '.join(units)}; give {k} "
                    "numbers"
                )
            return from_words(seen, k)
        if not isinstance(seen, Reading):
            return goal.estimated(as_error(seen, k))
        as_error(seen.error_seen, k)
        return seen

    def _settle(self, trial: Trial, arm_did_not_move: bool) -> None:
        """Note that a trial that was executing may be executed after all; within `_exclusive`."""
        if self.log.is_executing():
            raise TrialStateError(f"trial {trial.number} is executing now; wait for it")
        if not arm_did_not_move:
            raise TrialStateError(
                f"trial {trial.number} was executing when the program stopped; did the arm move? "
                f"If it did, tell or void trial {trial.number}; if it did not, ask again with "
                "--arm-did-not-move"
            )
        self.log.append("not_executed", {"trial": trial.number})

    def informed_adapter(self) -> Adapter:
        """The adapter, after it has seen every reading that counts for the goal of now.

        For asking it what it knows; what else is done to it is undone by nothing.

        Raises:
            WorkspaceError: No goal is set.
        """
        with self._exclusive():
            self._inform()
        return self.adapter

    def _propose(self) -> Point:
        """M(g), after the adapter has seen every reading that counts."""
        self._inform()
        return self.adapter.propose(self.goal)

    def _inform(self) -> None:
        """Let the adapter see every reading that counts."""
        readings = self._history.readings_for(self._current_goal(), self._loaded_for[0])
        seen, self._observed = self._observed, None  # until it has seen them all
        # Another session's readings are in it, where two share it by mistake.
        if vars(self.adapter).get("_used_by") is not self._mark:
            vars(self.adapter)["_used_by"], seen = self._mark, None
        if seen is None or seen != readings[: len(seen)]:  # one was voided or amended: start again
            self.adapter.start(self.demonstrations)
            seen, self._on_hardware_of = [], 0
        for trial in readings[len(seen) :]:
            goal = self._history.goals[trial.goal_number - 1]
            assert trial.reading is not None
            self._change_hardware_until(goal.number)
            reading = trial.reading.within(goal.radius)
            self.adapter.observe(trial.condition, goal.goal, reading)
        self._observed = readings
        self._change_hardware_until(self._current_goal().number)

    def _change_hardware_until(self, goal_number: int) -> None:
        """Tell the adapter of every change of hardware up to a goal, once."""
        for goal in self._history.goals[self._on_hardware_of : goal_number]:
            if goal.new_hardware is not None:
                self.adapter.change_hardware()
        self._on_hardware_of = max(self._on_hardware_of, goal_number)

    def _open(self, condition: Point, plan: Frames) -> None:
        """Write a new trial down, if its plan may be executed."""
        goal = self._current_goal()
        verdict = self._check(plan, self._say_no_plan(goal.goal, condition))
        number = len(self._history.trials) + 1
        expected = self.adapter.expect(condition, goal.goal, goal.tolerance)
        data = {
            "trial": number,
            "goal": goal.number,
            "condition": condition.tolist(),
            "model": self._loaded_for[0],
            "gate": None if verdict is None else verdict.as_json(),
            "p_hit": None if expected is None else expected.p_hit,
            "expected_trials": None if expected is None else expected.trials,
            **self.log.keep_plan(number, plan),
        }
        self.log.append("asked", data)

    def _say_no_plan(self, goal: Point, condition: Point) -> str:
        """For which goal there is no plan, and why that is, where it is simply too far."""
        place, at = ((np.round(point, 4) + 0.0).tolist() for point in (goal, condition))
        said = f"no plan for the goal {place}"
        if at != place:
            said += f", asked of the generator as {at}"
        if np.any(self.demonstrations.far_outside(goal)):
            said += ", which lies far outside the demonstrations (choose one nearer to them)"
        return said

    def _with_plan(self, number: int, *, is_new: bool) -> Trial:
        """A trial with its plan, unless the gate refuses it now."""
        trial = self._now(number)
        if not trial.open:
            raise TrialStateError(f"trial {number} was {trial.stage.value} meanwhile; ask again")
        plan = self.log.plan(trial) if trial.plan is None else trial.plan
        if not is_new:
            self._check(plan, f"trial {number} may not be executed now, void it and ask again")
        return trial if trial.plan is not None else replace(trial, plan=plan)

    def _check(self, plan: Frames, refusal: str) -> Verdict | None:
        """What the gate says of a plan; an error that begins with `refusal` if it refuses."""
        verdict = None if self._gate is None else self._gate(plan)
        try:
            if verdict is not None:
                verdict.require()
        except RobotLimitError as error:
            raise RobotLimitError(f"{refusal}: {error}") from error
        return verdict


def ask_all(sessions: Sequence[Session], *, arm_did_not_move: bool = False) -> list[Trial]:
    """Ask many sessions at once: one call of the generator for all that have no open trial.

    Args:
        sessions: Different sessions that share one fitted generator.
        arm_did_not_move: See `Session.ask`.

    Returns:
        The open trial of each, in order.

    Raises:
        ConfigurationError: The sessions have different generators, or one stands there twice.
    """
    if len({id(session) for session in sessions}) < len(sessions):
        raise ConfigurationError("sessions asked together must be different ones")
    for session in sessions:
        session._refresh()
        if session.open_trial is None:  # load before the log is held: others need not wait for it
            session.generator, session.goal, session.adapter  # noqa: B018
    with ExitStack() as logs:
        numbers = []
        for session in sessions:
            logs.enter_context(session._exclusive())
            trial = session.open_trial
            if trial is not None and trial.stage is Stage.EXECUTING:
                session._settle(trial, arm_did_not_move)
            numbers.append(session.n_trials_asked + 1 if trial is None else trial.number)
        new = [session for session in sessions if session.open_trial is None]
        if new:
            generator = new[0].generator
            if any(session.generator is not generator for session in new):
                raise ConfigurationError("sessions asked together must share one generator object")
            conditions = np.stack([session._propose() for session in new])
            plans = generator.generate(conditions)
            if not np.all(np.isfinite(plans)):
                raise InvalidPlanError(
                    "the generator gives plans that hold no numbers (nan or inf); learn again"
                )
            for session, condition, plan in zip(new, conditions, plans, strict=True):
                session._open(condition, plan)
    return [
        session._with_plan(number, is_new=session in new)
        for session, number in zip(sessions, numbers, strict=True)
    ]


def _loaded(given: Any) -> Any:
    """What was given, or what the function that was given loads; a network is callable too."""
    return given() if isinstance(given, (FunctionType, MethodType)) else given


def _as_tolerance(tolerance: Any) -> float:
    number = isinstance(tolerance, Real) and not isinstance(tolerance, bool)
    if not (number and math.isfinite(tolerance) and tolerance > 0):
        raise ConfigurationError(
            f"tolerance must be a positive number in the outcomes' units, got {tolerance!r}"
        )
    return float(tolerance)

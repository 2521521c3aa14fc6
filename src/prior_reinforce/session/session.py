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

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import cached_property
from threading import RLock
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidPlanError,
    RobotLimitError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.plans.motions import Plan
from prior_reinforce.readings import Reading, as_tolerance
from prior_reinforce.session.events import Amended, Asked, GoalSet, Told, Voided
from prior_reinforce.session.trials import AskedTrial, Goal, Log, Stage, State, Trial, Verdict
from prior_reinforce.wording import as_reading

if TYPE_CHECKING:
    from prior_reinforce.adapters.base import Adapter
    from prior_reinforce.generators.base import Generator
    from prior_reinforce.plans.motions import Demonstrations


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
        gate: Callable[[Frames], Verdict | None] | None = None,
    ) -> None:
        """Begin, or go on where a log ends.

        The first three may be functions that load them, called when first needed, and again when
        the log names another model in use (`State.in_use`): telling, voiding and amending need
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
            log: What happened so far, and where to write what happens; in memory if not given.
            gate: Holds a plan against a robot's limits whenever it is to leave, such as
                `check_plan`; by default nothing is checked.

        Raises:
            InvalidGoalError: The goal has a wrong shape, or is not finite.
            ConfigurationError: The tolerance is not positive, or does not say what counts in each
                unit; or a class is given instead of an object.
            TrialStateError: A goal is given, and a trial for the one before waits to be told.
        """
        for given in (generator, adapter, demonstrations):
            if isinstance(given, type):
                raise ConfigurationError(
                    f"{given.__name__} is a class; give an object, for instance {given.__name__}()"
                )
        self.log = Log() if log is None else log
        self._given: Any = (generator, adapter, demonstrations)
        self._gate = gate
        self._loaded_for: tuple[str, ...] = ()
        self._carry_over = carry_over
        self._tolerance = tolerance
        self._lock = RLock()
        self._observed: list[Trial] | None = None
        """Readings that the adapter has observed since its start `_start`."""
        self._start = 0
        self._on_hardware_of = 0
        """The latest goal whose change of hardware the adapter knows of."""
        self.state  # noqa: B018  (whether the log can be read)
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
    def state(self) -> State:
        """What happened so far, whoever wrote it down."""
        with self._lock:
            state = self.log.state()
            now = (*state.in_use, "" if state.goal is None else state.goal.adapter)
            if now != self._loaded_for:  # forget what was loaded: other things are in use
                self._loaded_for, self._observed = now, None
                for name in ("generator", "adapter", "demonstrations"):
                    self.__dict__.pop(name, None)
            return state

    @property
    def goals(self) -> tuple[Goal, ...]:
        """All goals so far, in order."""
        return tuple(self.state.goals)

    @property
    def goal(self) -> Point:
        """The goal g tilde that is worked on: the latest."""
        return self._latest_goal().goal

    @property
    def tolerance(self) -> Point:
        """The tolerance epsilon of each component, of the goal that is worked on."""
        return self._latest_goal().tolerance

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
        goal: ArrayLike,
        tolerance: ArrayLike | None = None,
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
            new_hardware: What was changed on the hardware, a note; None where nothing was. An
                adapter that knows the difference (`Adapter.change_hardware`) then believes less of
                what it knew, and the next reading more.

        Raises:
            InvalidGoalError: Wrong shape, or not finite.
            ConfigurationError: As in the constructor.
            TrialStateError: A trial for the goal before waits to be told.
        """
        self.state.refuse_open_trial("setting a goal")  # before anything is said of the goal
        checked = self.demonstrations.check_goal(goal)
        names, units = self.demonstrations.outcome_names, self.demonstrations.outcome_units
        given = self._tolerance if tolerance is None else tolerance
        tolerances = as_tolerance(() if given is None else given, names, units)
        carried = self._carry_over if carry_over is None else carry_over
        if carried is None:
            kind = ADAPTERS.resolve(adapter) if adapter else type(self.adapter)
            carried = kind.carries_over
        event = GoalSet(
            goal=checked.tolist(),
            tolerance=tolerances.tolist(),
            names=list(names),
            units=list(units),
            carry_over=carried,
            adapter=adapter,
            new_hardware=new_hardware,
        )
        with self._exclusive() as state:
            state.refuse_open_trial("setting a goal")
            self.log.append(event)
        return self.state.goals[-1]

    def ask(self, *, arm_did_not_move: bool = False) -> AskedTrial:
        """Return the trial to execute next: the open one, or a new one.

        Asking again changes nothing until that trial is told or voided. Asking goes on after the
        goal is reached, for whoever wants to repeat or to measure. A plan that the gate refuses now
        is not returned, whatever the gate said before.

        Args:
            arm_did_not_move: What a person saw of a trial whose command failed, or that was
                executing when the program died: nothing moved, it may be executed after all.

        Returns:
            The trial, with its plan and the gate's verdict on it.

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
            seen: What perception returned; or words, `5 cm long, 2 cm left`, `20 ms late` (see
                `from_words`); or outcome minus goal as a number of unknown origin,
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
        with self._exclusive() as state:
            trial = state.trial(number)
            if not trial.open:
                raise TrialStateError(
                    f"trial {number} is already {trial.stage.value}; "
                    + ("amend it to correct it" if trial.stage is Stage.TOLD else "ask for another")
                )
            self._append_reading(Told, trial, seen, hit)
        return self.trial(number)

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
        with self._exclusive() as state:
            trial = state.trial(number)
            if trial.stage is not Stage.TOLD:
                raise TrialStateError(
                    f"trial {number} is {trial.stage.value}, only a told trial can be amended; "
                    + ("tell it" if trial.open else "ask for another")
                )
            self._append_reading(Amended, trial, seen, hit)
        return self.trial(number)

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
        return self.trial(number)

    def __repr__(self) -> str:
        state = self.state
        if state.goal is None:
            return "Session(no goal)"
        said = "reached" if state.solved else "not reached"
        waits = f"; trial {state.open_trial.number} waits" if state.open_trial else ""
        goal = np.round(state.goal.goal, 4).tolist()
        told = f"{self.n_trials} trial{'s' * (self.n_trials != 1)} told"
        return f"Session(goal {goal} {said}, {told}{waits})"

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the lock: a session in memory is copied with its log."""
        return {name: value for name, value in self.__dict__.items() if name != "_lock"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """As it was, with a lock of its own."""
        self.__dict__.update(state, _lock=RLock())

    def _latest_goal(self) -> Goal:
        goal = self.state.goal
        if goal is None:
            raise WorkspaceError(
                "no goal is set; set one (Session.set_goal, or: prior-reinforce goal)"
            )
        return goal

    @contextmanager
    def _exclusive(self) -> Iterator[State]:
        """Hold the log, and know all that it says."""
        with self._lock, self.log.exclusive():
            yield self.state

    def _append_reading(
        self,
        event: type[Told],
        trial: Trial,
        seen: Reading | ArrayLike | None,
        hit: bool | None,
    ) -> None:
        goal = self.state.goal_of(trial)
        reading = as_reading(seen, hit, goal.names, goal.units, goal.least_sd)
        reached = goal.is_hit(reading.error_seen) if reading.hit is None else reading.hit
        self.log.append(event(trial=trial.number, reading=reading.record(), hit=bool(reached)))

    def informed_adapter(self) -> Adapter:
        """The adapter, after it has seen every reading that counts for the goal of now.

        For queries only; changes made to it are not rolled back.

        Raises:
            WorkspaceError: No goal is set.
        """
        with self._exclusive():
            return self._informed()

    def _informed(self) -> Adapter:
        goal, adapter = self._latest_goal(), self.adapter
        readings = self.state.readings_for(goal, self._loaded_for[0])
        seen, self._observed = self._observed, None  # until it has seen them all
        # Start again if one was voided or amended, or if another session has used the adapter.
        again = adapter.n_starts != self._start
        if again or seen is None or seen != readings[: len(seen)]:
            adapter.start(self.demonstrations)
            seen, self._start, self._on_hardware_of = [], adapter.n_starts, 0
        for trial in readings[len(seen) :]:
            about = self.state.goal_of(trial)
            assert trial.reading is not None
            self._change_hardware_until(about.number)
            adapter.observe(trial.condition, about.goal, trial.reading.within(about.tolerance))
        self._observed = readings
        self._change_hardware_until(goal.number)
        return adapter

    def _change_hardware_until(self, goal_number: int) -> None:
        """Tell the adapter of every change of hardware up to a goal, once."""
        for goal in self.state.goals[self._on_hardware_of : goal_number]:
            if goal.new_hardware is not None:
                self.adapter.change_hardware()
        self._on_hardware_of = max(self._on_hardware_of, goal_number)

    def _open(self, condition: Point, plan: Frames) -> Verdict | None:
        """Write a new trial down, if its plan may be executed."""
        goal = self._latest_goal()
        verdict = self._check(plan, self._say_no_plan(goal.goal, condition))
        number = len(self.state.trials) + 1
        expected = self.adapter.expect(condition, goal.goal, goal.tolerance)
        event = Asked(
            trial=number,
            goal=goal.number,
            condition=condition.tolist(),
            model=self._loaded_for[0],
            gate=None if verdict is None else verdict.as_json(),
            p_hit=None if expected is None else expected.p_hit,
            expected_trials=None if expected is None else expected.trials,
            expected_error=None if expected is None else _as_list(expected.error),
            expected_sd=None if expected is None else _as_list(expected.sd),
            plan=self.log.keep_plan(number, Plan(plan, self.demonstrations.format)),
        )
        self.log.append(event)
        return verdict

    def _say_no_plan(self, goal: Point, condition: Point) -> str:
        """For which goal there is no plan, and why that is, where it is simply too far."""
        place, at = ((np.round(point, 4) + 0.0).tolist() for point in (goal, condition))
        said = f"no plan for the goal {place}"
        if at != place:
            said += f", asked of the generator as {at}"
        if np.any(self.demonstrations.far_outside(goal)):
            said += ", which lies far outside the demonstrations (choose one nearer to them)"
        return said

    def _with_plan(self, number: int, verdict: Verdict | None) -> AskedTrial:
        """A trial with its plan and the gate's verdict, unless the gate refuses it now.

        `verdict` is that on a trial that was opened just now.
        """
        trial = self.trial(number)
        if not trial.open:
            raise TrialStateError(f"trial {number} was {trial.stage.value} meanwhile; ask again")
        plan = self.log.plan(trial)
        refusal = f"trial {number} may not be executed now, void it and ask again"
        verdict = verdict or self._check(plan, refusal)
        if isinstance(trial, AskedTrial) and verdict is None:
            return trial
        return AskedTrial(**{**vars(trial), "plan": plan, "verdict": verdict})

    def _check(self, plan: Frames, refusal: str) -> Verdict | None:
        """What the gate says of a plan; an error that begins with `refusal` if it refuses."""
        verdict = None if self._gate is None else self._gate(plan)
        try:
            if verdict is not None:
                verdict.require()
        except RobotLimitError as error:
            raise RobotLimitError(f"{refusal}: {error}") from error
        return verdict


def ask_all(sessions: Sequence[Session], *, arm_did_not_move: bool = False) -> list[AskedTrial]:
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
        if session.open_trial is None:  # load before the log is held: others need not wait for it
            session.generator, session.goal, session.adapter  # noqa: B018
    with ExitStack() as logs:
        numbers, new = [], []
        for session in sessions:
            state = logs.enter_context(session._exclusive())
            trial = state.open_trial
            if trial is None:
                new.append(session)
            elif trial.stage is Stage.EXECUTING or (
                trial.stage is Stage.EXECUTED and arm_did_not_move
            ):
                session.log.settle(trial, arm_did_not_move=arm_did_not_move)
            numbers.append(len(state.trials) + 1 if trial is None else trial.number)
        verdicts: dict[Session, Verdict | None] = {}
        if new:
            generator = new[0].generator
            if any(session.generator is not generator for session in new):
                raise ConfigurationError("sessions asked together must share one generator object")
            conditions = np.stack([each._informed().propose(each.goal) for each in new])
            plans = generator.generate(conditions)
            if not np.all(np.isfinite(plans)):
                raise InvalidPlanError(
                    "the generator gives plans that hold no numbers (nan or inf); learn again"
                )
            for session, condition, plan in zip(new, conditions, plans, strict=True):
                verdicts[session] = session._open(condition, plan)
    return [
        session._with_plan(number, verdicts.get(session))
        for session, number in zip(sessions, numbers, strict=True)
    ]


def _as_list(numbers: Point | None) -> list[float] | None:
    return None if numbers is None else numbers.tolist()


def _loaded(given: Any) -> Any:
    """What was given, or what the function that was given loads; a network is callable too."""
    return given() if isinstance(given, (FunctionType, MethodType)) else given

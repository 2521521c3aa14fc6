"""What a session knows: its goals and trials, as the fold of a log of events.

What stands is `State`, so a session can be brought back from its log alone. `Log` keeps the events
in a list; a workspace's keeps a journal on disk.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from enum import Enum
from numbers import Integral
from typing import Any, Protocol

import numpy as np
from msgspec import structs

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import (
    InvalidFeedbackError,
    PriorReinforceError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.plans.motions import Plan
from prior_reinforce.readings import Reading, in_tolerances
from prior_reinforce.session.events import (
    Amended,
    Asked,
    Entry,
    Event,
    GoalSet,
    KeptPlan,
    Told,
    Voided,
)


class Verdict(Protocol):
    """What a gate says of a plan; see `bench.robots.report.LimitReport`."""

    def require(self) -> None:
        """Raise RobotLimitError unless the plan may be executed."""

    def text(self) -> str:
        """The same for a person."""

    def as_json(self) -> dict[str, Any]:
        """The same as plain data, for the log."""


class Stage(Enum):
    """Where a trial stands."""

    ASKED = "asked"
    """Its plan was generated; as far as is known nothing moved yet."""
    EXECUTING = "executing"
    """A command was given the plan. If the program died then, only a person knows what moved."""
    EXECUTED = "executed"
    """The command ended; the error has not been told."""
    TOLD = "told"
    """What was seen of it was told."""
    VOIDED = "voided"
    """Not data: the ball slipped, the arm stopped, nothing was seen."""


_LEAST_SD = 1 / 3
"""Least sd of a number of unknown origin, in tolerances (ours): half a centimetre of 1.5 cm. Who
gives numbers for words means to; with twice as much, P(hit) is said too low and adapters lag
(docs/decisions-adapter.md)."""

_NEWS = 4.0
"""A reading is a surprise from so many standard deviations on (ours): of 398 trials in which
nothing happened, on our own tasks and four others', three were, and one in thirty lay beyond 3."""


@dataclass(frozen=True, eq=False)
class Goal:
    """One goal of a session."""

    number: int
    """From 1."""
    goal: Point
    """g, in the outcomes' units."""
    tolerance: Point
    """epsilon of each component, in its unit: an error of one tolerance's length still counts as
    reached (see `in_tolerances`)."""
    carry_over: bool = False
    """Whether the adapter also learns from the trials of earlier goals."""
    adapter: str = ""
    """The adapter's name; empty where the session was given one by hand."""
    new_hardware: str | None = None
    """What was changed on the hardware before its first trial; None where nothing was."""
    names: tuple[str, ...] = ()
    """Names of the components."""
    units: tuple[str, ...] = ()
    """Their units."""

    def is_hit(self, error: Point) -> bool:
        """Whether an error, outcome minus goal, counts as reached."""
        return in_tolerances(error, self.tolerance) <= 1.0

    @property
    def least_sd(self) -> Point:
        """Least standard deviation of an error of unknown origin, in each component's unit."""
        return _LEAST_SD * self.tolerance


@dataclass(frozen=True, eq=False)
class Trial:
    """One Stage-2 trial. Never changed; the session replaces it by another as it proceeds."""

    number: int
    """From 1, over all goals of the session, in the order in which trials were asked for."""
    goal_number: int
    """The goal that it was asked for."""
    condition: Point
    """c = M(g); read-only."""
    plan: Frames | None = None
    """A = pi(c); read-only. None for a trial read back from a journal, until it is asked for."""
    stage: Stage = Stage.ASKED
    reading: Reading | None = None
    """What was said of it; None unless told."""
    hit: bool = False
    """Whether the goal was reached: as seen, or judged from `error_seen`."""
    note: str = ""
    """Why it was voided."""
    outdated: bool = False
    """Whether a reading that it was planned from was amended or voided while it waited."""
    p_hit: float | None = None
    """Probability that it hits, as its adapter saw it; None from one that expects nothing."""
    expected_trials: float | None = None
    """Trials until the goal is reached, this one included, likewise."""
    expected_error: Point | None = None
    """Error that was expected of it, outcome minus goal, likewise."""
    expected_sd: Point | None = None
    """Its standard deviation, likewise."""
    model: str = ""
    """Which model planned it: the name of its folder in a workspace, else empty."""
    kept: KeptPlan | None = None
    """The plan's file; None where the log keeps plans in memory."""
    gate: dict[str, Any] | None = None
    """The gate's verdict when the trial was asked for, as plain data."""
    verdict: Verdict | None = None
    """The gate's verdict of now, on a trial that `Session.ask` returned; None without a gate."""

    def __repr__(self) -> str:
        said = [f"{self.number} for goal {self.goal_number}", self.stage.value]
        said.append(f"condition {np.round(self.condition, 4).tolist()}")
        if self.error_seen is not None:
            hit = "hit" if self.hit else "miss"
            said.append(f"error {np.round(self.error_seen, 4).tolist()}, {hit}")
        if self.plan is not None:
            said.append(f"plan {' x '.join(map(str, self.plan.shape))}")
        return f"Trial({', '.join(said)})"

    @property
    def error_seen(self) -> Point | None:
        """The error e tilde, outcome minus goal as perceived; None unless told."""
        return None if self.reading is None else self.reading.error_seen

    @property
    def surprise(self) -> str:
        """What is odd about what was told of it, and what to do about that; empty where nothing."""
        if self.reading is None or self.expected_error is None or self.expected_sd is None:
            return ""
        low, high = self.reading.low - self.expected_error, self.expected_error - self.reading.high
        off = np.maximum(np.maximum(low, high), 0.0) / np.hypot(self.expected_sd, self.reading.sd)
        sds, n = float(np.linalg.norm(off)), self.number
        if sds < _NEWS:
            return ""
        return (
            f"{sds:.0f} sd from what was expected of it; mistyped: amend {n}; "
            "changed: goal --new-hardware"
        )

    @property
    def open(self) -> bool:
        """Whether the trial still waits to be told or voided."""
        return self.stage in {Stage.ASKED, Stage.EXECUTING, Stage.EXECUTED}


class AskedTrial(Trial):
    """A trial with its plan, as `Session.ask` returns it."""

    plan: Frames
    """A = pi(c); read-only."""


class State:
    """What the events of a log add up to."""

    def __init__(self) -> None:
        self.goals: list[Goal] = []
        self.trials: list[Trial] = []
        self.plans: dict[int, Frames] = {}
        """Plans that are kept in memory, by the trial's number."""

    @property
    def in_use(self) -> tuple[str, ...]:
        """Name of the model in use, and of whatever else a session loads."""
        return ("",)

    @property
    def goal(self) -> Goal | None:
        """The goal that is worked on: the latest."""
        return self.goals[-1] if self.goals else None

    @property
    def open_trial(self) -> Trial | None:
        """The trial that waits to be told, if any."""
        return next((trial for trial in self.trials if trial.open), None)

    @property
    def solved(self) -> bool:
        """Whether a told trial reached the goal that is worked on."""
        return any(trial.hit for trial in self.current)

    @property
    def current(self) -> tuple[Trial, ...]:
        """Trials for the goal that is worked on, in order."""
        return self.trials_of(len(self.goals))

    def trial(self, number: int) -> Trial:
        """Return a trial of any goal as it stands.

        Raises:
            TrialStateError: There is no such trial.
        """
        if not isinstance(number, Integral) or isinstance(number, bool):
            raise TrialStateError(
                f"a trial's number is a whole number, got {number!r}; give .number"
            )
        n = len(self.trials)
        if not 1 <= number <= n:
            known = f"give a number from 1 to {n}" if n else "ask for one first"
            raise TrialStateError(f"there is no trial {number}; {known}")
        return self.trials[number - 1]

    def goal_of(self, trial: Trial) -> Goal:
        """The goal that a trial was asked for."""
        return self.goals[trial.goal_number - 1]

    def trials_of(self, goal_number: int) -> tuple[Trial, ...]:
        """Trials of one goal, in order."""
        return tuple(trial for trial in self.trials if trial.goal_number == goal_number)

    def readings_for(self, goal: Goal, model: str) -> list[Trial]:
        """Told trials that an adapter learns from for a goal, oldest first.

        Those of the goal, and of earlier ones where they are carried over, as far as this model
        planned them.
        """
        return [
            trial
            for trial in self.trials
            if trial.stage is Stage.TOLD
            and trial.model == model
            and (goal.carry_over or trial.goal_number == goal.number)
            and trial.goal_number <= goal.number
        ]

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

    def add(self, entry: Entry) -> None:
        """Take in the next event.

        Raises:
            WorkspaceError: It cannot follow the others.
        """
        try:
            self._apply(entry.event)
        except (IndexError, ValueError, PriorReinforceError) as error:
            raise WorkspaceError(
                f"event {entry.id} ({entry.kind}) does not fit the ones before it: {error}; "
                "restore the journal from a copy"
            ) from error

    def _apply(self, event: Event) -> None:
        match event:
            case GoalSet():
                each = (event.goal, event.tolerance, event.names, event.units)
                if len({len(of) for of in each}) > 1:
                    raise ValueError("goal, tolerance, names and units have different lengths")
                place, tolerance = _read_only(event.goal), _read_only(event.tolerance)
                if not np.all(tolerance > 0):
                    raise ValueError("a tolerance is not positive")
                rest = (event.carry_over, event.adapter, event.new_hardware)
                outcome = (tuple(event.names), tuple(event.units))
                self.goals.append(Goal(len(self.goals) + 1, place, tolerance, *rest, *outcome))
            case Asked():
                if event.trial != len(self.trials) + 1 or self.open_trial is not None:
                    raise ValueError(f"trial {event.trial} after {len(self.trials)}")
                if not 1 <= event.goal <= len(self.goals):
                    raise ValueError(f"there is no goal {event.goal}")
                if len(event.condition) != self.goals[event.goal - 1].goal.size:
                    raise ValueError("the condition has another length than the goal")
                known = structs.asdict(event)
                for name in ("condition", "expected_error", "expected_sd"):
                    known[name] = None if known[name] is None else _read_only(known[name])
                number, goal, kept = (known.pop(name) for name in ("trial", "goal", "plan"))
                plan = self.plans.get(number)
                kind = Trial if plan is None else AskedTrial
                self.trials.append(kind(number, goal, plan=plan, kept=kept, **known))
            case Amended():
                self._correct(self._told(event))
            case Told():
                self.trials[event.trial - 1] = self._told(event)
            case Voided():
                void = replace(self.trial(event.trial), stage=Stage.VOIDED, note=event.reason)
                self._correct(replace(void, reading=None, hit=False))
            case _:
                raise ValueError("no event of a session")

    def _told(self, event: Told) -> Trial:
        trial = self.trial(event.trial)
        reading = Reading.from_record(event.reading)
        if reading.error_seen.size != self.goal_of(trial).goal.size:
            raise InvalidFeedbackError("the reading has another number of components than the goal")
        return replace(trial, stage=Stage.TOLD, reading=reading, hit=event.hit)

    def _correct(self, corrected: Trial) -> None:
        """Replace a trial, and mark the open one if it was planned from what is corrected now."""
        before, waiting = self.trial(corrected.number), self.open_trial
        if (
            waiting is not None
            and not before.open
            and _meaning(before) != _meaning(corrected)
            and before in self.readings_for(self.goal_of(waiting), waiting.model)
        ):
            self.trials[waiting.number - 1] = replace(waiting, outdated=True)
        self.trials[corrected.number - 1] = corrected


class Log:
    """Events of a session, and what they add up to; here, as long as the program lasts."""

    def __init__(self) -> None:
        self._entries: list[Entry] = []
        self._state = State()
        self._n_added = 0

    def entries(self) -> Sequence[Entry]:
        """All events so far, in order, whoever wrote them."""
        return self._entries

    def state(self) -> State:
        """What happened so far, whoever wrote it.

        Raises:
            WorkspaceError: The events do not fit together, or cannot be read.
        """
        for entry in self.entries()[self._n_added :]:
            self._state.add(entry)
            self._n_added += 1
        return self._state

    def exclusive(self) -> AbstractContextManager[object]:
        """Hold the log for reading and then appending; what is appended is kept when it ends."""
        return nullcontext()  # nobody else can append

    def append(self, event: Event) -> None:
        """Add an event; called within `exclusive`."""
        entry = Entry(len(self._entries) + 1, event)
        self._state.add(entry)  # which refuses what does not fit
        self._entries.append(entry)
        self._n_added += 1

    def keep_plan(self, number: int, plan: Plan) -> KeptPlan | None:
        """Keep a trial's plan, and return its file if it has one."""
        self._state.plans[number] = plan.actions
        return None

    def plan(self, trial: Trial) -> Frames:
        """Return a plan that was kept."""
        return self._state.plans[trial.number]

    def settle(self, trial: Trial, *, arm_did_not_move: bool) -> None:
        """Note that a trial may be executed after all; called within `exclusive`.

        Raises:
            TrialStateError: It is executing now, was executed to its end, or nobody has said
                whether the arm moved.
        """
        raise NotImplementedError("only a workspace executes trials")


def _meaning(trial: Trial) -> object:
    """What was seen of a trial, in whatever words; None unless told."""
    reading = trial.reading
    return None if reading is None else (replace(reading, said="").record(), trial.hit)


def _read_only(values: Any) -> np.ndarray:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array

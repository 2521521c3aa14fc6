"""Goals and trials of a session: the fold of a log of events.

`SessionState` follows from the events alone, so a session can be restored from its log. `Log` keeps
the events in a list; the log of a workspace keeps a journal on disk.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from enum import Enum
from numbers import Integral
from typing import Any, Protocol

import numpy as np

from prior_reinforce.adapters import base
from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import (
    InvalidFeedbackError,
    PriorReinforceError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.formats import OutcomeFormat, in_tolerances
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading
from prior_reinforce.session.events import Amended, Asked, Entry, Event, GoalSet, Told, Voided


class Verdict(Protocol):
    """Verdict of a gate on a plan; see `arm.robots.report.LimitReport`."""

    def require(self) -> None:
        """Raise RobotLimitError unless the plan may be executed."""

    def text(self) -> str:
        """Return the verdict as text for a person."""

    def as_json(self) -> dict[str, Any]:
        """Return the verdict as plain data for the log."""


class Stage(Enum):
    """Stage of a trial."""

    ASKED = "asked"
    """Its plan was generated; its outcome is not told yet."""
    TOLD = "told"
    """Its reading was told."""
    VOIDED = "voided"
    """Not data: the ball slipped, the arm stopped, nothing was seen."""


_SURPRISE = 4.0
"""Least surprising error of a prediction, in standard deviations (ours): of 398 trials in which
nothing happened, on our own tasks and four others', three were, and one in thirty lay beyond 3."""


@dataclass(frozen=True, eq=False)
class Goal:
    """One goal of a session."""

    number: int
    """From 1."""
    goal: Point
    """g, in the outcomes' units."""
    format: OutcomeFormat
    """Names, units and tolerance of its components."""
    carry_over: bool = False
    """Whether the adapter also learns from the trials of earlier goals."""
    adapter: str = ""
    """The adapter's name; empty if the session was given an object."""
    new_hardware: str | None = None
    """Note on the hardware change before its first trial; None if there was none."""

    def is_hit(self, error: Point) -> bool:
        """Return whether an error, outcome minus goal, is a hit."""
        return in_tolerances(error, self.tolerance) <= 1.0

    @property
    def tolerance(self) -> Point:
        """Epsilon of each component, in the component's unit."""
        return self.format.half_axes


@dataclass(frozen=True, eq=False)
class Trial:
    """One Stage-2 trial. Immutable; the session replaces it by another as it proceeds."""

    number: int
    """From 1, over all goals of the session, in the order in which trials were asked for."""
    goal_number: int
    """Number of its goal."""
    condition: Point
    """c = M(g); read-only."""
    plan: Frames = field(default_factory=lambda: np.empty((0, 0)))
    """A = pi(c), shape (H, D), read-only; no rows in a trial that was read back from a log."""
    stage: Stage = Stage.ASKED
    reading: Reading | None = None
    """What was perceived; None unless told."""
    hit: bool = False
    """Whether the goal was reached: seen directly, or judged by the perceived error."""
    note: str = ""
    """Why it was voided."""
    told_before: bool = False
    """Whether it was told before it was voided: a person may have meant another trial."""
    outdated: bool = False
    """Whether a reading used for its plan was amended or voided while it was open."""
    expected: base.Expectation = field(default_factory=base.Expectation)
    """Prediction by its adapter; `beyond` also if the gate passes no plan so far."""
    model: str = ""
    """Model that generated its plan: the name of its folder in a workspace, else empty."""
    gate: dict[str, Any] | None = None
    """The gate's verdict when the trial was asked for, as plain data."""
    verdict: Verdict | None = None
    """The gate's verdict when `Session.ask` returned the trial; None without a gate."""
    asked_at: str = ""
    """When it was asked for, ISO 8601, UTC; empty if the log is in memory."""
    told_at: str = ""
    """When its reading was told or amended last, likewise; empty unless told."""

    def __repr__(self) -> str:
        parts = [f"{self.number} for goal {self.goal_number}", self.stage.value]
        parts.append(f"condition {np.round(self.condition, 4).tolist()}")
        if self.error_seen is not None:
            parts.append(f"error {np.round(self.error_seen, 4).tolist()}")
        if self.reading is not None:
            parts.append("hit" if self.hit else "miss")
        if len(self.plan):
            parts.append(f"plan {' x '.join(map(str, self.plan.shape))}")
        return f"Trial({', '.join(parts)})"

    @property
    def error_seen(self) -> Point | None:
        """The perceived error e tilde, outcome minus goal; None if the outcome is unknown."""
        reading = self.reading
        return reading.error_seen if reading is not None and reading.has_place else None

    @property
    def surprise(self) -> str:
        """How far its reading is from the prediction, and what to do; empty without surprise."""
        reading, error, sd = self.reading, self.expected.error, self.expected.sd
        if reading is None or error is None or sd is None:
            return ""
        low, high = reading.low - error, error - reading.high
        off = np.maximum(np.maximum(low, high), 0.0) / np.hypot(sd, reading.sd)
        sds, n = float(np.linalg.norm(off)), self.number
        if sds < _SURPRISE:
            return ""
        return (
            f"{sds:.0f} standard deviations from the prediction (a typo? amend {n}; other "
            "hardware? goal --new-hardware)"
        )

    @property
    def open(self) -> bool:
        """Whether the trial is neither told nor voided."""
        return self.stage is Stage.ASKED

    @property
    def amendable(self) -> bool:
        """Whether it was told, even if voided since: its reading can be corrected."""
        return self.stage is Stage.TOLD or self.told_before


def told_trials(trials: Iterable[Trial]) -> tuple[Trial, ...]:
    """Return the trials that count: neither voided nor open (paper, Evaluation Protocol)."""
    return tuple(trial for trial in trials if trial.stage is Stage.TOLD)


def trials_to_hit(trials: Iterable[Trial]) -> int | None:
    """Return the number of counted trials up to and including the first hit; None without a hit."""
    return next((n for n, trial in enumerate(told_trials(trials), start=1) if trial.hit), None)


class SessionState:
    """State of a session: the fold of its events, one at a time.

    Trials of one goal are consecutive, and only the last trial can be open. So the cost of an event
    or a query does not grow with the number of trials.
    """

    def __init__(self) -> None:
        self.goals: list[Goal] = []
        self.trials: list[Trial] = []
        self._n_before: list[int] = []
        """Number of trials before each goal."""

    @property
    def in_use(self) -> tuple[str, ...]:
        """Names of the model in use, and of whatever else a session loads."""
        return ("",)

    @property
    def goal(self) -> Goal | None:
        """The latest goal."""
        return self.goals[-1] if self.goals else None

    @property
    def open_trial(self) -> Trial | None:
        """The open trial, if any; it is the last one."""
        return self.trials[-1] if self.trials and self.trials[-1].open else None

    @property
    def solved(self) -> bool:
        """Whether a told trial reached the latest goal."""
        return any(trial.hit for trial in self.current)

    @property
    def current(self) -> tuple[Trial, ...]:
        """Trials for the latest goal, in order."""
        return self.trials_of(len(self.goals)) if self.goals else ()

    def trial(self, number: int) -> Trial:
        """Return a trial of any goal; TrialStateError if there is no such trial."""
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
        """Return the goal of a trial."""
        return self.goals[trial.goal_number - 1]

    def trials_of(self, goal_number: int) -> tuple[Trial, ...]:
        """Return the trials of one goal, in order."""
        latest = goal_number == len(self.goals)
        end = len(self.trials) if latest else self._n_before[goal_number]
        return tuple(self.trials[self._n_before[goal_number - 1] : end])

    def readings_for(self, goal: Goal, model: str) -> list[Trial]:
        """Return the told trials that an adapter learns from for a goal, oldest first.

        These are the trials of this model for the goal, and for earlier goals if carried over.
        """
        return [trial for trial in self.trials if _teaches(trial, goal, model)]

    def refuse_open_trial(self, doing: str) -> None:
        """Raise TrialStateError if a trial is open."""
        trial = self.open_trial
        if trial is not None:
            raise TrialStateError(
                f"trial {trial.number} waits to be told; tell or void it before {doing}"
            )

    def add(self, entry: Entry) -> None:
        """Fold in the next event; WorkspaceError if it cannot follow the others."""
        try:
            self._apply(entry.event, entry.time)
        except (IndexError, ValueError, PriorReinforceError) as error:
            raise WorkspaceError(
                f"event {entry.id} ({entry.kind}) does not fit the ones before it: {error}; "
                "restore the journal from a copy"
            ) from error

    def _apply(self, event: Event, time: str) -> None:
        match event:
            case GoalSet():
                place = _read_only(event.goal)
                if not place.size == event.format.outcome_dim == len(event.format.tolerance):
                    raise ValueError("goal, tolerance, names and units have different lengths")
                if self.goals and place.size != self.goals[0].goal.size:
                    raise ValueError("it has another number of components than the goals before")
                rest = (event.carry_over, event.adapter, event.new_hardware)
                self.goals.append(Goal(len(self.goals) + 1, place, event.format, *rest))
                self._n_before.append(len(self.trials))
            case Asked():
                if event.trial != len(self.trials) + 1 or self.open_trial is not None:
                    raise ValueError(f"trial {event.trial} after {len(self.trials)}")
                if event.goal != len(self.goals) or not self.goals:
                    raise ValueError(f"goal {event.goal} is not the latest of {len(self.goals)}")
                if len(event.condition) != self.goals[event.goal - 1].goal.size:
                    raise ValueError("the condition has another length than the goal")
                self.trials.append(
                    Trial(
                        event.trial,
                        event.goal,
                        _read_only(event.condition),
                        expected=event.expected,
                        model=event.model,
                        gate=event.gate,
                        asked_at=time,
                    )
                )
            case Amended():
                if not self.trial(event.trial).amendable:
                    raise ValueError(f"trial {event.trial} has not been told")
                self._correct(self._with_reading(event, time))
            case Told():
                if not self.trial(event.trial).open:
                    raise ValueError(f"trial {event.trial} is not open")
                self.trials[event.trial - 1] = self._with_reading(event, time)
            case Voided():
                trial = self.trial(event.trial)
                void = replace(trial, stage=Stage.VOIDED, told_before=trial.amendable)
                self._correct(replace(void, note=event.reason, reading=None, hit=False, told_at=""))
            case _:
                raise ValueError("no event of a session")

    def _with_reading(self, event: Told, time: str) -> Trial:
        trial = self.trial(event.trial)
        reading = Reading.from_record(event.reading)
        if reading.error_seen.size != self.goal_of(trial).goal.size:
            raise InvalidFeedbackError("the reading has another number of components than the goal")
        told = replace(trial, stage=Stage.TOLD, told_before=False, note="", told_at=time)
        return replace(told, reading=reading, hit=event.hit)

    def _correct(self, corrected: Trial) -> None:
        """Replace a trial; mark the open one as outdated if its plan used the corrected reading."""
        before, waiting = self.trial(corrected.number), self.open_trial
        if (
            waiting is not None
            and not before.open
            and _content(before) != _content(corrected)
            and any(
                _teaches(trial, self.goal_of(waiting), waiting.model)
                for trial in (before, corrected)
            )
        ):
            self.trials[waiting.number - 1] = replace(waiting, outdated=True)
        self.trials[corrected.number - 1] = corrected


class Log:
    """Events of a session and the state they add up to, kept in memory."""

    def __init__(self) -> None:
        self._entries: list[Entry] = []
        self._state = SessionState()

    def entries(self) -> Sequence[Entry]:
        """Return all events so far, in order, whoever wrote them."""
        return self._entries

    def state(self) -> SessionState:
        """Return the state after all events, whoever wrote them.

        WorkspaceError if the events do not fit together, or cannot be read.
        """
        return self._state

    def exclusive(self) -> AbstractContextManager[object]:
        """Hold the log for reading and appending; events are saved when the context ends."""
        return nullcontext()  # nobody else can append

    def append(self, event: Event) -> None:
        """Append an event; called within `exclusive`."""
        self._add(Entry(len(self._entries) + 1, event))

    def _add(self, entry: Entry) -> None:
        """Fold the next event into the state; an invalid event changes nothing."""
        self._state.add(entry)
        self._entries.append(entry)

    def append_asked(self, event: Asked, plan: Frames, form: PlanFormat) -> None:
        """Append a new trial with its plan; called within `exclusive`.

        In memory a plan may have numbers that no arm can execute: a simulation then loses its
        object.
        """
        self.append(event)
        self._state.trials[-1] = replace(self._state.trials[-1], plan=_read_only(plan))

    def keep_adapter(self, adapter: base.Adapter) -> None:
        """Save the state of an adapter for later programs; called within `exclusive`."""

    def kept_adapter(self) -> base.State | None:
        """Return the state that was saved last."""
        return None

    def plan(self, trial: Trial) -> Frames:
        """Return the saved plan of a trial."""
        return trial.plan


def _teaches(trial: Trial, goal: Goal, model: str) -> bool:
    """Whether an adapter learns from a trial; see `SessionState.readings_for`."""
    of_goal = trial.goal_number == goal.number
    earlier = goal.carry_over and trial.goal_number < goal.number
    return trial.stage is Stage.TOLD and trial.model == model and (of_goal or earlier)


def _content(trial: Trial) -> object:
    """Reading and hit of a trial, regardless of the words; None unless told."""
    reading = trial.reading
    return None if reading is None else (replace(reading, said="").record(), trial.hit)


def _read_only(values: Any) -> np.ndarray:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array

"""What a session knows: its goals, its trials, and the log of events that they follow from.

A log is a list of events that only grows. What stands is a fold over it (`History`), so a session
can be brought back from its log alone. `MemoryLog` is a list; a workspace keeps a journal on disk.

| event | data |
|---|---|
| `goal_set` | goal, tolerance, metric, memory (`workspace` carries over), adapter, new_hardware |
| `asked` | trial, goal (its number), condition, model, gate, p_hit, expected_trials, and its plan |
| `executing`, `executed`, `not_executed` | trial, and what executed it |
| `told`, `amended` | trial, error_seen, reading (what was said, `Reading.as_json`), hit |
| `voided` | trial, reason |
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Protocol

import numpy as np

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import InvalidFeedbackError, WorkspaceError
from prior_reinforce.readings import Reading


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


_LEAST_SD = 2 / 3
"""Least sd of a number of unknown origin, in tolerances (ours): 1 cm of 1.5 cm, as for lengths in
`readings`."""


@dataclass(frozen=True, eq=False)
class Goal:
    """One goal of a session."""

    number: int
    """From 1."""
    goal: Point
    """g, in the outcomes' units."""
    tolerance: float
    """epsilon, the largest perceived error that counts as reached, in the first component's
    unit."""
    metric: Point
    """What one unit of each component counts in a distance; 1 everywhere where all units agree."""
    carry_over: bool = False
    """Whether the adapter also learns from the trials of earlier goals."""
    adapter: str = ""
    """The adapter's name; empty where the session was given one by hand."""
    new_hardware: str | None = None
    """What was changed on the hardware before its first trial; None where nothing was."""

    def distance(self, error: Point) -> float:
        """How far an error, outcome minus goal, is from the goal, in the first component's unit."""
        return float(np.linalg.norm(self.metric * error))

    @property
    def radius(self) -> Point:
        """The tolerance along each component alone, in its own unit."""
        return np.asarray(self.tolerance / self.metric)

    def estimated(self, error: Point) -> Reading:
        """Return what a number of unknown origin says, whatever its unit."""
        return Reading.estimated(error, _LEAST_SD * self.radius)


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
    model: str = ""
    """Which model planned it: the name of its folder in a workspace, else empty."""
    kept: Mapping[str, Any] = field(default_factory=dict)
    """What its log keeps of the plan, for instance a file and its hash."""
    execution: Mapping[str, Any] = field(default_factory=dict)
    """What is known of its execution: how the command ended, what the driver said; empty where a
    person executed it."""

    @property
    def error_seen(self) -> Point | None:
        """The error e tilde, outcome minus goal as perceived; None unless told."""
        return None if self.reading is None else self.reading.error_seen

    @property
    def open(self) -> bool:
        """Whether the trial still waits to be told or voided."""
        return self.stage in {Stage.ASKED, Stage.EXECUTING, Stage.EXECUTED}


@dataclass(frozen=True)
class Event:
    """Something that happened, and will always have happened."""

    id: int
    """Order of events, from 1."""
    kind: str
    """One of this module's table, or a workspace's own."""
    data: Mapping[str, Any]
    """What it says; JSON types in a journal."""
    time: str = ""
    """When it was written, ISO 8601, UTC; empty in memory."""


class Log(Protocol):
    """Where the events of a session are kept."""

    def events(self) -> Sequence[Event]:
        """All events so far, in order."""

    def exclusive(self) -> AbstractContextManager[object]:
        """Hold the log for reading and then appending; what is appended is kept when it ends."""

    def append(self, kind: str, data: Mapping[str, Any]) -> None:
        """Add an event; called within `exclusive`."""

    def keep_plan(self, number: int, plan: Frames) -> Mapping[str, Any]:
        """Keep a trial's plan, and return what its event says of it."""

    def plan(self, trial: Trial) -> Frames:
        """Return a plan that was kept."""

    def is_executing(self) -> bool:
        """Whether something executes a plan right now."""


class MemoryLog:
    """A log that lasts as long as the program."""

    def __init__(self) -> None:
        """Start empty."""
        self._events: list[Event] = []

    def events(self) -> Sequence[Event]:
        """See `Log.events`."""
        return self._events

    def exclusive(self) -> AbstractContextManager[object]:
        """Nobody else can append."""
        return nullcontext()

    def append(self, kind: str, data: Mapping[str, Any]) -> None:
        """See `Log.append`."""
        self._events.append(Event(len(self._events) + 1, kind, data))

    def keep_plan(self, number: int, plan: Frames) -> Mapping[str, Any]:
        """The plan stays in its event."""
        return {"plan": plan}

    def plan(self, trial: Trial) -> Frames:
        """See `Log.plan`."""
        return np.asarray(trial.plan)

    def is_executing(self) -> bool:
        """Nothing that this log knows of."""
        return False


class History:
    """What the events of a log add up to."""

    def __init__(self) -> None:
        """Nothing has happened."""
        self.goals: list[Goal] = []
        self.trials: list[Trial] = []
        self._n_events = 0

    @property
    def goal(self) -> Goal | None:
        """The goal that is worked on: the latest."""
        return self.goals[-1] if self.goals else None

    @property
    def open_trial(self) -> Trial | None:
        """The trial that waits to be told, if any."""
        return next((trial for trial in self.trials if trial.open), None)

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

    def update(self, events: Sequence[Event]) -> None:
        """Take in the events of the log that came since the last time.

        Raises:
            WorkspaceError: An event cannot follow the others.
        """
        for event in events[self._n_events :]:
            try:
                self._apply(event.kind, event.data)
            except (KeyError, IndexError, TypeError, ValueError, InvalidFeedbackError) as error:
                raise WorkspaceError(
                    f"event {event.id} ({event.kind}) does not fit the ones before it: {error!r}; "
                    "restore the journal from a copy"
                ) from error
            self._n_events += 1

    def _apply(self, kind: str, data: Mapping[str, Any]) -> None:
        if kind == "goal_set":
            self.goals.append(
                Goal(
                    len(self.goals) + 1,
                    _read_only(data["goal"]),
                    data["tolerance"],
                    _read_only(data.get("metric", [1.0] * len(data["goal"]))),
                    data["memory"] == "workspace",
                    data.get("adapter", "gp"),  # the first journals knew no other
                    data.get("new_hardware"),
                )
            )
        elif kind == "asked":
            number = data["trial"]
            if number != len(self.trials) + 1 or self.open_trial is not None:
                raise ValueError(f"trial {number} after {len(self.trials)}")
            plan = data.get("plan")
            self.trials.append(
                Trial(
                    number,
                    data["goal"],
                    _read_only(data["condition"]),
                    None if plan is None else _read_only(plan),
                    p_hit=data.get("p_hit"),
                    expected_trials=data.get("expected_trials"),
                    model=data.get("model", ""),
                    kept=data,
                )
            )
        elif kind in _CHANGES:
            changes: dict[str, Any] = {"stage": _CHANGES[kind]}
            if kind in {"told", "amended"}:
                changes |= {"reading": self._reading(data), "hit": data["hit"]}
            if kind in {"executing", "executed", "not_executed"}:
                changes["execution"] = data
            if kind == "voided":
                changes |= {"reading": None, "hit": False, "note": data["reason"]}
            index = range(1, len(self.trials) + 1).index(data["trial"])
            before, after = self.trials[index], replace(self.trials[index], **changes)
            if kind in {"amended", "voided"} and _meaning(before) != _meaning(after):
                self._outdate(before)
            self.trials[index] = after

    def _outdate(self, corrected: Trial) -> None:
        """Mark the open trial if it was planned from a reading that is corrected now."""
        trial = self.open_trial
        if trial is None or corrected.open:
            return
        used = self.readings_for(self.goals[trial.goal_number - 1], trial.model)
        if corrected.number in {reading.number for reading in used}:
            self.trials[trial.number - 1] = replace(trial, outdated=True)

    def _reading(self, data: Mapping[str, Any]) -> Reading:
        """What was told; the first journals kept a number a component, and nothing of its origin.

        Nor whether a hit was seen or judged: what differs from the judgement was seen.
        """
        if "reading" in data:
            return Reading.from_json(data["error_seen"], data["reading"])
        goal = self.goals[self.trials[data["trial"] - 1].goal_number - 1]
        reading = goal.estimated(_read_only(data["error_seen"]))
        judged = goal.distance(reading.error_seen) <= goal.tolerance
        return reading.with_hit(data["hit"] if data["hit"] != judged else None)


_CHANGES = {
    "executing": Stage.EXECUTING,
    "executed": Stage.EXECUTED,
    "not_executed": Stage.ASKED,
    "told": Stage.TOLD,
    "amended": Stage.TOLD,
    "voided": Stage.VOIDED,
}
KINDS = frozenset({"goal_set", "asked", *_CHANGES})
"""Events that a session writes."""


def _meaning(trial: Trial) -> object:
    """What was seen of a trial, in whatever words; None unless told."""
    reading = trial.reading
    if reading is None:
        return None
    return reading.error_seen.tolist(), trial.hit, {**reading.as_json(), "said": ""}


def _read_only(values: Any) -> np.ndarray:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array

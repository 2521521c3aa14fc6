"""What the page shows: a workspace as plain data. Nothing is kept here; the journal says it all."""

from __future__ import annotations

from typing import Literal

import numpy as np
from msgspec import Struct, convert, structs

from prior_reinforce.arrays import Frames
from prior_reinforce.bench.robots.executors.lock import last_stop
from prior_reinforce.bench.robots.kinematics import link_places
from prior_reinforce.bench.robots.limits import match_joints
from prior_reinforce.bench.robots.report import LimitLine, LimitReport
from prior_reinforce.bench.workspace.log import Executed, Executing, Moved, Moving, NotExecuted
from prior_reinforce.bench.workspace.manifest import Manifest
from prior_reinforce.bench.workspace.records import (
    GoalRecord,
    TrialRecord,
    goal_record,
    trial_records,
)
from prior_reinforce.bench.workspace.status import execution_warning, say_trial
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.session.events import Event
from prior_reinforce.session.trials import Stage, Trial
from prior_reinforce.wording import PLACE_WORDS, axes_of, error_words, say_reading

Step = Literal[
    "import", "learn", "goal", "ask", "execute", "executing", "settle", "tell", "reached"
]
Mover = Literal["", "command", "arm"]
_SHOWN = {"m": ("cm", 100.0), "s": ("ms", 1000.0), "rad": ("deg", 180 / np.pi)}
"""The unit that a person says, and how many of it are one of the outcome's."""
_SAMPLES = 120
"""Of a motion that is played: more cannot be told apart on a screen."""
_OUTPUT = 20_000
"""Bytes of an execution's output that are shown, from its end."""


class Component(Struct):
    """One number of an outcome."""

    name: str
    unit: str
    """All numbers on this interface are in it."""
    shown: str
    """Unit in which a person reads and types it."""
    factor: float
    """How many of those are one `unit`."""
    axis: int
    """0, 1, 2 where it is a length along x, y, z, which a map shows; 3 where it is none."""
    words: tuple[str, ...]
    """Of an error: where it is positive, where it is negative; empty where there are none."""
    places: tuple[str, ...]
    """The same of a place."""
    tolerance: float


class TrialView(TrialRecord, frozen=True, kw_only=True):
    """A trial as it stands."""

    line: str
    """What became of it."""
    outcome: list[float] | None
    """Where the object ended, as far as that was told."""
    warning: str
    """Why a reading of it might mislead."""
    sha256: str
    """Of its plan."""


class State(Struct):
    """Everything that the page shows, but for the motion of a plan."""

    id: int
    """Of the latest event; a verb that was meant for an earlier one is refused."""
    stopped: str
    """When Stop was pressed last; what was asked for before then begins no motion."""
    name: str
    components: list[Component]
    step: Step
    """What comes next."""
    model: str
    remarks: list[str]
    """What the model could not do, as `learn` says."""
    demonstrations: list[list[float]]
    """Where each one's object ended."""
    goals: list[GoalRecord]
    trials: list[TrialView]
    open: int | None
    """The trial that waits to be told."""
    output: str
    """The end of what its execution wrote."""
    moved_by: Mover = ""
    """What executes a plan for this program; empty where it is to be downloaded. An arm also says
    where it stands, goes to the plan's start, and rehearses."""
    learning: tuple[float, float] | None = None
    """Share that is done of a training that runs, and how many seconds are left."""
    report: str = ""
    """Path of the report; empty before the first trial."""


def state_of(workspace: Workspace) -> State:
    """Return what the page shows now.

    Raises:
        WorkspaceError, ConfigurationError: See `Workspace.state`.
        FileFormatError: The demonstrations are damaged.
    """
    entries, state = workspace.events, workspace.state
    shown = np.empty((0, 0))
    if state.demonstrations is not None:
        shown = workspace.demonstrations.outcomes_seen
    training, waiting = state.training, state.open_trial
    pairs = zip(state.trials, trial_records(workspace), strict=True)
    return State(
        id=entries[-1].id if entries else 0,
        stopped=str(last_stop(workspace.folder)),
        name=workspace.manifest.name,
        components=components_of(workspace.manifest),
        step=step_of(workspace),
        model="" if training is None else training.generator,
        remarks=[] if training is None else [*training.remarks],
        demonstrations=shown.tolist(),
        goals=[goal_record(workspace, goal) for goal in state.goals],
        trials=[_trial(workspace, trial, record) for trial, record in pairs],
        open=None if waiting is None else waiting.number,
        output="" if waiting is None else output_of(workspace, waiting),
    )


def components_of(manifest: Manifest) -> list[Component]:
    """Return what an outcome's numbers are."""
    names, units = manifest.outcome_names, manifest.outcome_units
    axes = [a if u == "m" else 3 for a, u in zip(axes_of(names, units), units, strict=True)]
    found = zip(names, units, axes, error_words(names, units), manifest.tolerance, strict=True)
    return [
        Component(name, u, *_SHOWN.get(u, (u, 1.0)), a, words or (), (*PLACE_WORDS, ())[a], epsilon)
        for name, u, a, words, epsilon in found
    ]


def step_of(workspace: Workspace) -> Step:
    """Return what comes next."""
    state = workspace.state
    if state.demonstrations is None:
        return "import"
    if state.stale:
        return "learn"
    if not state.goals:
        return "goal"
    trial = state.open_trial
    if trial is None:
        return "reached" if state.solved else "ask"
    if trial.stage is Stage.ASKED:
        moving = isinstance(_latest(workspace, trial), Moving)
        return "executing" if moving and workspace.log.is_executing() else "execute"
    if trial.stage is Stage.EXECUTING:
        return "executing" if workspace.log.is_executing() else "settle"
    ended = state.executions.get(trial.number)
    return "settle" if isinstance(ended, Executed) and ended.outcome == "aborted" else "tell"


def output_of(workspace: Workspace, trial: Trial) -> str:
    """Return the end of what a trial's execution wrote so far; empty where nothing."""
    event = _latest(workspace, trial)
    if isinstance(event, (Executing, Moving)) and event.folder:
        path = workspace.store.execution_folder(event.folder) / "output.txt"
        try:
            with path.open("rb") as file:
                file.seek(max(0, path.stat().st_size - _OUTPUT))
                return file.read().decode(errors="replace")
        except OSError:
            return ""
    return event.output_tail if isinstance(event, (Executed, Moved)) else ""


def _latest(workspace: Workspace, trial: Trial) -> Event | None:
    """What the arm was last moved for, on behalf of a trial."""
    kinds = (Executing, Executed, Moving, Moved)
    events = (entry.event for entry in reversed(workspace.events))
    moves = (event for event in events if isinstance(event, kinds))
    return next((event for event in moves if event.trial == trial.number), None)


def _trial(workspace: Workspace, trial: Trial, record: TrialRecord) -> TrialView:
    manifest, reading, outcome = workspace.manifest, trial.reading, None
    if reading is None:
        line = say_trial(workspace, trial)
    else:
        line = say_reading(reading, manifest.outcome_names, manifest.outcome_units)
        if reading.has_number:
            outcome = (workspace.state.goal_of(trial).goal + reading.error_seen).tolist()
    return TrialView(
        **structs.asdict(record),
        line=line,
        outcome=outcome,
        warning=_warning(workspace, trial) if reading is None else "",
        sha256="" if trial.kept is None else trial.kept.sha256,
    )


def _warning(workspace: Workspace, trial: Trial) -> str:
    ended = _latest(workspace, trial)
    if isinstance(ended, Moving) and not workspace.log.is_executing():
        return "nobody wrote down what moved"
    if isinstance(ended, Moved | NotExecuted) and ended.outcome == "not_moved":
        return f"nothing moved: {ended.reason}" if ended.reason else "nothing moved"
    if isinstance(ended, Moved):
        return "" if ended.outcome == "done" else f"the arm only began to move: {ended.reason}"
    return execution_warning(workspace, trial)


class Column(Struct):
    """A column of a plan, and what it may do."""

    name: str
    unit: str
    limits: tuple[float, float] | None
    """Least and greatest position that the robot allows; None where that is not known."""
    values: list[float]
    """At the times of the motion that is played."""


class MotionView(Struct):
    """A plan to be played."""

    trial: int
    sha256: str
    times: list[float]
    """[s]."""
    columns: list[Column]
    links: list[list[list[float]]]
    """Base, joints and flange at these times, [m]; empty where the kinematics are not known."""
    verdict: str
    checks: list[LimitLine]
    """What the gate said when it was asked for."""


def motion_of(workspace: Workspace, number: int) -> MotionView:
    """Return a trial's plan with the gate's report of when it was asked for.

    Raises:
        TrialStateError: There is no such trial.
        FileFormatError: Its plan is lost or damaged.
    """
    bounds: dict[int, tuple[float, float]]
    trial = workspace.state.trial(number)
    plan, robot = workspace.plan(trial), workspace.manifest.robot
    chosen = np.unique(np.linspace(0, plan.horizon - 1, _SAMPLES).round().astype(int))
    frames, bounds, links = plan.actions[chosen], {}, []
    if robot is not None:
        joints = match_joints(plan.format, robot)
        bounds = {c: (float(robot.lower[j]), float(robot.upper[j])) for j, c in joints.items()}
        if robot.chain is not None and len(joints) == len(robot.joint_names):
            ordered: Frames = frames[:, [joints[j] for j in range(len(joints))]]
            links = link_places(robot.chain, ordered).round(4).tolist()
    gate = None if trial.gate is None else convert(trial.gate, LimitReport)
    verdict = "no robot in the manifest, no limits checked"
    if gate is not None:
        verdict = gate.text().partition("\n")[0].removeprefix("plan ")
    return MotionView(
        trial=number,
        sha256="" if trial.kept is None else trial.kept.sha256,
        times=(chosen * plan.format.dt).tolist(),
        columns=[
            Column(name, unit, bounds.get(i), frames[:, i].round(5).tolist())
            for i, (name, unit) in enumerate(zip(plan.format.names, plan.format.units, strict=True))
        ],
        links=links,
        verdict=verdict,
        checks=[] if gate is None else [*gate.lines],
    )

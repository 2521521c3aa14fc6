"""What the page shows: a workspace as plain data. Nothing is kept here; the journal says it all."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from msgspec import Struct

from prior_reinforce.arrays import Frames
from prior_reinforce.bench.robots.kinematics import link_places
from prior_reinforce.bench.robots.limits import match_joints
from prior_reinforce.bench.workspace.log import (
    Executed,
    Executing,
    Moved,
    Moving,
    NotExecuted,
    WorkspaceState,
)
from prior_reinforce.bench.workspace.status import execution_warning, say_trial
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.session.events import Event
from prior_reinforce.session.trials import Goal, Stage, Trial
from prior_reinforce.wording import in_words, say_place, say_reading

Step = Literal[
    "import", "learn", "goal", "ask", "execute", "executing", "settle", "tell", "reached"
]
_SAMPLES = 120
"""Of a motion that is played: more cannot be told apart on a screen."""
_OUTPUT = 20_000
"""Bytes of an execution's output that are shown, from its end."""


class Demonstration(Struct):
    """Where a demonstration's object ended."""

    outcome: list[float]


class TrialView(Struct):
    """A trial as it stands."""

    number: int
    goal: int
    condition: list[float]
    stage: Literal["asked", "executing", "executed", "told", "voided"]
    said: str
    """What became of it, in a line."""
    outcome: list[float] | None
    """Where the object ended, as far as that was told."""
    hit: bool
    p_hit: float | None
    expected_trials: float | None
    surprising: int | None
    """The trial whose reading surprised when this one was planned."""
    surprise: str
    outdated: bool
    warning: str
    """Why a reading of it might mislead."""
    plan: str
    """SHA-256 of its plan."""
    time: str
    """When it was asked for, ISO 8601, UTC."""


class GoalView(Struct):
    """A goal, and how many told trials it took."""

    number: int
    goal: list[float]
    said: str
    tolerance: list[float]
    """Of each component."""
    told: int
    reached: bool
    new_hardware: str | None


class State(Struct):
    """Everything that the page shows of a workspace, but for the motion of a plan."""

    id: int
    """Of the latest event; a verb that was meant for an earlier one is refused."""
    name: str
    outcome_names: list[str]
    outcome_units: list[str]
    in_words: bool
    """Whether outcomes are lengths ahead and to the left, which a map shows."""
    step: Step
    """What comes next."""
    model: str
    remarks: list[str]
    """What the model could not do, as `learn` says."""
    demonstrations: list[Demonstration]
    goals: list[GoalView]
    trials: list[TrialView]
    open: int | None
    """The trial that waits to be told."""
    output: str
    """The end of what its execution wrote."""


def state_of(workspace: Workspace) -> State:
    """Return what the page shows now.

    Raises:
        WorkspaceError, ConfigurationError: See `Workspace.state`.
        FileFormatError: The demonstrations are damaged.
    """
    entries, state, manifest = workspace.events, workspace.state, workspace.manifest
    shown = np.empty((0, 0))
    if state.demonstrations is not None:
        shown = workspace.demonstrations.outcomes_seen
    asked = {getattr(e.event, "trial", 0): e.time for e in entries if e.kind == "asked"}
    training, waiting = state.training, state.open_trial
    return State(
        id=entries[-1].id if entries else 0,
        name=manifest.name,
        outcome_names=[*manifest.outcome_names],
        outcome_units=[*manifest.outcome_units],
        in_words=in_words(manifest.outcome_units),
        step=step_of(workspace),
        model="" if training is None else training.generator,
        remarks=[] if training is None else [*training.remarks],
        demonstrations=[Demonstration(outcome) for outcome in shown.tolist()],
        goals=[_goal(workspace, state, goal) for goal in state.goals],
        trials=[_trial(workspace, state, trial, asked[trial.number]) for trial in state.trials],
        open=None if waiting is None else waiting.number,
        output="" if waiting is None else output_of(workspace, waiting),
    )


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


def _goal(workspace: Workspace, state: WorkspaceState, goal: Goal) -> GoalView:
    told = [t for t in state.trials_of(goal.number) if t.stage is Stage.TOLD]
    manifest = workspace.manifest
    return GoalView(
        number=goal.number,
        goal=goal.goal.tolist(),
        said=say_place(goal.goal, manifest.outcome_names, manifest.outcome_units),
        tolerance=goal.tolerance.tolist(),
        told=len(told),
        reached=any(trial.hit for trial in told),
        new_hardware=goal.new_hardware,
    )


def _trial(workspace: Workspace, state: WorkspaceState, trial: Trial, asked: str) -> TrialView:
    manifest, outcome = workspace.manifest, None
    if trial.reading is not None and trial.reading.has_number:
        outcome = (state.goal_of(trial).goal + trial.reading.error_seen).tolist()
    earlier = reversed(state.trials[: trial.number - 1])
    before = next((t for t in earlier if t.stage is Stage.TOLD), None)
    surprise = "" if before is None else before.surprise.partition("; mistyped")[0]
    told = trial.reading is not None
    return TrialView(
        number=trial.number,
        goal=trial.goal_number,
        condition=trial.condition.tolist(),
        stage=trial.stage.value,
        said=say_reading(trial.reading, manifest.outcome_names, manifest.outcome_units)
        if trial.reading is not None
        else say_trial(workspace, trial),
        outcome=outcome,
        hit=trial.hit,
        p_hit=trial.p_hit,
        expected_trials=trial.expected_trials,
        surprising=before.number if before is not None and surprise else None,
        surprise=surprise,
        outdated=trial.outdated,
        warning="" if told else _warning(workspace, trial),
        plan="" if trial.kept is None else trial.kept.sha256,
        time=asked,
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
    low: float | None
    """Least position that the robot's limits allow; None where none is known."""
    high: float | None
    values: list[float]
    """At the times of the motion that is played."""


class Check(Struct):
    """A line of the gate's report."""

    check: str
    status: Literal["pass", "warn", "refuse", "unchecked"]
    text: str


class MotionView(Struct):
    """A plan to be played."""

    trial: int
    plan: str
    """SHA-256 of its file."""
    file: str
    times: list[float]
    """[s]."""
    columns: list[Column]
    links: list[list[list[float]]]
    """Base, joints and flange at these times, [m]; empty where the kinematics are not known."""
    robot: str
    verdict: str
    checks: list[Check]


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
    frames, bounds, links = plan.actions[chosen], {}, None
    if robot is not None:
        joints = match_joints(plan.format, robot)
        bounds = {c: (float(robot.lower[j]), float(robot.upper[j])) for j, c in joints.items()}
        if robot.chain is not None and len(joints) == len(robot.joint_names):
            ordered: Frames = frames[:, [joints[j] for j in range(len(joints))]]
            links = link_places(robot.chain, ordered).round(4)
    gate: dict[str, Any] = trial.gate or {}
    lines = [Check(x["check"], x["status"], x["text"]) for x in gate.get("lines", ())]
    return MotionView(
        trial=number,
        plan="" if trial.kept is None else trial.kept.sha256,
        file=workspace.plan_path(trial).name,
        times=(chosen * plan.format.dt).tolist(),
        columns=[
            Column(
                name=name,
                unit=plan.format.units[i],
                low=bounds[i][0] if i in bounds else None,
                high=bounds[i][1] if i in bounds else None,
                values=frames[:, i].round(5).tolist(),
            )
            for i, name in enumerate(plan.format.names)
        ],
        links=[] if links is None else links.tolist(),
        robot="" if robot is None else robot.robot,
        verdict=_verdict(gate),
        checks=lines,
    )


def _verdict(gate: dict[str, Any]) -> str:
    if not gate:
        return "no robot in the manifest, no limits checked"
    said = "passes with warnings" if gate["warned"] else "passes"
    missing = ", ".join(gate["unchecked"])
    return f"{said} the limits of {gate['robot']}" + (f"; not looked at: {missing}" * bool(missing))

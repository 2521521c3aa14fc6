"""What the page shows: a workspace as plain data. Nothing is kept here; the journal says it all."""

from __future__ import annotations

from typing import Literal

import numpy as np
from msgspec import Struct, convert, structs

from prior_reinforce.arm.executing.lock import last_stop
from prior_reinforce.arm.robots.limits import match_joints
from prior_reinforce.arm.robots.report import LimitLine, LimitReport
from prior_reinforce.arm.workspace.events import Moved, Moving
from prior_reinforce.arm.workspace.manifest import Manifest
from prior_reinforce.arm.workspace.state import WorkspaceState
from prior_reinforce.arm.workspace.view import StatusView, status_view
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.arrays import Frames
from prior_reinforce.plans.kinematics import link_places
from prior_reinforce.units import spoken
from prior_reinforce.wording import PLACE_WORDS, axes_of, error_words

Mover = Literal["", "command", "arm"]
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


class ConsoleState(StatusView, frozen=True, kw_only=True):
    """Everything that the page shows, but for the motion of a plan."""

    id: int
    """Of the latest event; a verb that was meant for an earlier one is refused."""
    stopped: str
    """When Stop was pressed last; what was asked for before then begins no motion."""
    components: list[Component]
    shown: list[list[float]]
    """Where each demonstration's object ended."""
    far: str
    """How far the goal lies outside what was demonstrated; empty where it is near enough."""
    output: str
    """The end of what the motion of the trial that waits wrote."""
    moved_by: Mover = ""
    """What executes a plan for this program; empty where it is to be downloaded. An arm also says
    where it stands, goes to the plan's start, and rehearses."""
    learning: tuple[float, float] | None = None
    """Share that is done of a training that runs, and how many seconds are left."""
    report: str = ""
    """Path of the report; empty before the first trial."""


def state_of(workspace: Workspace) -> ConsoleState:
    """Return what the page shows now.

    FileFormatError if the demonstrations are damaged; else as `Workspace.state`.
    """
    now, entries, shown, far = workspace.standing, workspace.events, np.empty((0, 0)), ""
    if now.state.demonstrations is not None:
        shown = workspace.demonstrations.outcomes_seen
        if now.state.goal is not None:
            far = workspace.demonstrations.say_far_outside(now.state.goal.goal)
    return ConsoleState(
        **structs.asdict(status_view(now)),
        id=entries[-1].id if entries else 0,
        stopped=str(last_stop(workspace.folder)),
        components=components_of(workspace.manifest),
        shown=shown.tolist(),
        far=far,
        output=output_of(workspace, now.state),
    )


def components_of(manifest: Manifest) -> list[Component]:
    """Return what an outcome's numbers are."""
    form = manifest.outcome_format
    axes = [a if u == "m" else 3 for a, u in zip(axes_of(form), form.units, strict=True)]
    found = zip(form.names, form.units, axes, error_words(form), form.tolerance, strict=True)
    return [
        Component(name, u, *spoken(u), a, words or (), (*PLACE_WORDS, ())[a], epsilon)
        for name, u, a, words, epsilon in found
    ]


def output_of(workspace: Workspace, state: WorkspaceState) -> str:
    """Return the end of what the motion of the trial that waits wrote; empty where nothing."""
    event = None if state.open_trial is None else state.moves.get(state.open_trial.number)
    if isinstance(event, Moving) and event.folder:
        path = workspace.store.execution_folder(event.folder) / "output.txt"
        try:
            with path.open("rb") as file:
                file.seek(max(0, path.stat().st_size - _OUTPUT))
                return file.read().decode(errors="replace")
        except OSError:
            return ""
    return event.output_tail if isinstance(event, Moved) else ""


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

    TrialStateError if there is no such trial, FileFormatError if its plan is lost or damaged.
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
            ordered: Frames = frames[:, [*joints.values()]]
            links = link_places(robot.chain, ordered).round(4).tolist()
    gate = None if trial.gate is None else convert(trial.gate, LimitReport)
    verdict = "no robot in the manifest, no limits checked"
    if gate is not None:
        verdict = gate.text().partition("\n")[0].removeprefix("plan ")
    return MotionView(
        trial=number,
        sha256=workspace.plan_file(trial).sha256,
        times=(chosen * plan.format.dt).tolist(),
        columns=[
            Column(name, unit, bounds.get(i), frames[:, i].round(5).tolist())
            for i, (name, unit) in enumerate(zip(plan.format.names, plan.format.units, strict=True))
        ],
        links=links,
        verdict=verdict,
        checks=[] if gate is None else [*gate.lines],
    )

"""Commands on a workspace as a whole: make one, set a goal, see where it stands, report."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import tyro

from prior_reinforce.adapters import ADAPTERS, DEFAULT_ADAPTER
from prior_reinforce.arrays import Point
from prior_reinforce.bench.robots import RobotLimits, robot_limits
from prior_reinforce.bench.robots.presets import GRIPPERS, PRESETS
from prior_reinforce.bench.robots.urdf import read_urdf
from prior_reinforce.bench.workspace.manifest import filled_in
from prior_reinforce.bench.workspace.status import describe, next_step
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidFeedbackError,
    InvalidGoalError,
)
from prior_reinforce.wording import read_place, say_place, say_tolerance

Folder = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="WORKSPACE")]


def print_next(workspace: Workspace) -> None:
    """Say which command comes next."""
    print(f"next: {next_step(workspace)}")


@dataclass(frozen=True)
class OnWorkspace:
    """A command on a workspace."""

    folder: Folder
    """Workspace."""

    def run(self) -> int | None:
        """Open the workspace and do it there; the exit status, None for 0."""
        with Workspace(self.folder) as workspace:
            return self.run_on(workspace)

    def run_on(self, workspace: Workspace) -> int | None:
        """What the command does."""
        raise NotImplementedError


@dataclass(frozen=True)
class New:
    """Make a workspace: a folder with a commented manifest."""

    folder: Folder
    """Folder to make."""
    name: str | None = None
    """Name of the task; the folder's name if not given."""
    action_names: tuple[str, ...] | None = None
    """Names of the action dimensions; the robot's joints if not given."""
    action_units: tuple[str, ...] = ("rad",)
    """Unit of each action dimension; a single one holds for all."""
    gripper: str | None = None
    """Unit of a gripper's opening, one more dimension: percent, m, steps, ..., or none; an SO-101
    has one in percent if not given."""
    dt: float = 0.0125
    """Time between two frames of a plan, in seconds."""
    outcome_names: tuple[str, ...] = ("x", "y")
    """Names of the outcome's components."""
    outcome_units: tuple[str, ...] = ("m",)
    """Unit of each component; a single one holds for all."""
    tolerance: tuple[float, ...] = (0.015,)
    """Largest distance from the goal that counts as reached, in the outcome's units: one number,
    or one for each component, which mixed units need."""
    robot: Annotated[
        str,
        tyro.conf.arg(
            help=f"Whose limits hold: {', '.join(PRESETS)}, the path of a .urdf, or none."
        ),
    ] = "panda"
    tip: str | None = None
    """Link of the URDF that is the flange; tool0, flange or the last that turns if not given."""

    def run(self) -> None:
        """Write the folder."""
        robot = self._robot()
        names = self.action_names
        if names is None:
            names = tuple(f"joint{i}" for i in range(1, 8)) if robot is None else robot.joint_names
        units = _spread(self.action_units, len(names))
        gripper, unit = GRIPPERS.get(self.robot.lower(), ("gripper", "none"))
        unit = self.gripper or (unit if self.action_names is None else "none")
        if unit != "none":
            names, units = (*names, gripper), (*units, unit)
        is_given = robot is not None and self.robot.lower() not in (*PRESETS, "fer")
        manifest = filled_in(
            name=self.name or self.folder.resolve().name,
            names=names,
            units=units,
            dt=self.dt,
            outcome_names=self.outcome_names,
            outcome_units=_spread(self.outcome_units, len(self.outcome_names)),
            tolerance=self.tolerance[0] if len(self.tolerance) == 1 else self.tolerance,
            robot=robot if robot is not None and is_given else self.robot,
        )
        with Workspace.create(self.folder, manifest) as workspace:
            print(f"workspace made in {self.folder}; look through {self.folder / 'workspace.toml'}")
            if robot is not None:
                print(_say_robot(robot))
            print_next(workspace)

    def _robot(self) -> RobotLimits | None:
        """The arm that was named, None for none."""
        is_file = self.robot.lower().endswith((".urdf", ".xml", ".xacro"))
        if self.tip is not None and not is_file:
            raise ConfigurationError(
                f"--tip is a link of a URDF, and --robot is {self.robot}; drop it"
            )
        if self.robot == "none":
            return None
        return read_urdf(Path(self.robot), self.tip) if is_file else robot_limits(self.robot)


def _say_robot(robot: RobotLimits) -> str:
    said = f"robot {robot.robot}: {', '.join(robot.joint_names)}; limits from {robot.source}"
    unknown = [key for key in ("acceleration", "jerk") if getattr(robot, key) is None]
    if not unknown:
        return said
    return (
        f"{said}; no limits of {' and '.join(unknown)} are known: plans are compared with the "
        "demonstrations in these"
    )


def read_goal(workspace: Workspace, words: Sequence[str]) -> Point:
    """Read a goal as a person says it, in the outcome's units.

    Raises:
        InvalidGoalError: It is none.
    """
    manifest = workspace.manifest
    try:
        return read_place(" ".join(words), manifest.outcome_names, manifest.outcome_units)
    except InvalidFeedbackError as error:
        raise InvalidGoalError(f"goal: {error}") from error


def print_goal(workspace: Workspace) -> None:
    """Say which goal the next trials are for."""
    goal, names = workspace.state.goals[-1], workspace.manifest.outcome_names
    place = say_place(goal.goal, names, goal.units)
    print(f"goal {goal.number}: {place}; within {say_tolerance(goal.tolerance, names, goal.units)}")


@dataclass(frozen=True)
class Goal(OnWorkspace):
    """Set the goal that the next trials are for."""

    goal: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Its place: 0.92 0.10 (metres ahead, metres left, or the outcome's units), 92cm 10cm, or
    "92cm ahead, 10cm left"."""
    memory: Literal["goal", "workspace"] | None = None
    """Which trials the adapter learns from: this goal's, or earlier goals' as well; by default
    earlier ones too where they serve the adapter, as they do bayes."""
    adapter: Annotated[
        str, tyro.conf.arg(help=f"How the condition is corrected: {ADAPTERS.help}.")
    ] = DEFAULT_ADAPTER
    new_hardware: str | None = None
    """What was changed on the hardware since the last trial, a note: another ball, a new gripper.
    What was known is then believed less, and the next reading more."""

    def run_on(self, workspace: Workspace) -> None:
        """Set it."""
        workspace.set_goal(
            read_goal(workspace, self.goal),
            carry_over=None if self.memory is None else self.memory == "workspace",
            adapter=self.adapter,
            new_hardware=self.new_hardware,
        )
        print_goal(workspace)
        print_next(workspace)


@dataclass(frozen=True)
class Status(OnWorkspace):
    """Say where a workspace stands and what to do next."""

    def run_on(self, workspace: Workspace) -> None:
        """Print ten lines."""
        print(describe(workspace))


@dataclass(frozen=True)
class Log(OnWorkspace):
    """Print the journal, one JSON object a line."""

    def run_on(self, workspace: Workspace) -> None:
        """Print it."""
        for entry in workspace.events:
            event = msgspec.to_builtins(entry.event)
            print(json.dumps({"id": entry.id, "time": entry.time, **event}))


@dataclass(frozen=True)
class Report(OnWorkspace):
    """Write a page with every goal, its trials, and the plans that were executed."""

    out: Path | None = None
    """Folder for the page and its pictures; `report` in the workspace if not given."""

    def run_on(self, workspace: Workspace) -> None:
        """Write it."""
        from rich.console import Console

        from prior_reinforce.bench.workspace.report import report_workspace
        from prior_reinforce.commands.live import drawing_progress

        with drawing_progress(Console()) as progress:
            page = report_workspace(workspace, self.out or self.folder / "report", progress)
        print(f"report: {page}")


def _spread(values: tuple[str, ...], n: int) -> tuple[str, ...]:
    return values * n if len(values) == 1 else values

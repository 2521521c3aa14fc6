"""Commands on a workspace as a whole: make one, set a goal, see where it stands, report."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import tyro

from prior_reinforce.adapters import ADAPTERS, DEFAULT_ADAPTER
from prior_reinforce.arrays import Point
from prior_reinforce.bench.robots import RobotLimits
from prior_reinforce.bench.robots.presets import PRESETS
from prior_reinforce.bench.workspace.manifest import NewWorkspace
from prior_reinforce.bench.workspace.records import status_record, trial_records, trials_table
from prior_reinforce.bench.workspace.status import describe, say_trial
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands.base import Json, OnWorkspace, Words, print_json, print_next
from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError, InvalidGoalError
from prior_reinforce.files import check_path
from prior_reinforce.wording import read_place, say_place, say_tolerance

AdapterChoice = Annotated[
    str, tyro.conf.arg(help=f"How the condition is corrected: {ADAPTERS.help}.")
]


@dataclass(frozen=True, kw_only=True)
class New(NewWorkspace):
    """Make a workspace: a folder with a commented manifest.

    For example:
        prior-reinforce new hoop --robot ur5e
        prior-reinforce new hoop --robot my_arm.urdf --gripper percent
        prior-reinforce new hoop --robot none
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="WORKSPACE")]
    """Folder to make."""
    robot: Annotated[
        str,
        tyro.conf.arg(
            help=f"Whose limits hold: {', '.join(PRESETS)}, the path of a .urdf, or none."
        ),
    ] = "panda"
    tolerance: tuple[float, ...] = (0.015,)

    def run(self) -> None:
        """Write the folder."""
        text = self.manifest(self.folder.resolve().name)
        with Workspace.create(self.folder, text) as workspace:
            print(f"workspace made in {self.folder}; look through {self.folder / 'workspace.toml'}")
            if workspace.manifest.robot is not None:
                print(_say_robot(workspace.manifest.robot))
            print_next(workspace)


def _say_robot(robot: RobotLimits) -> str:
    said = f"robot {robot.robot}: {', '.join(robot.joint_names)}; limits from {robot.source}"
    unknown = [key for key in ("acceleration", "jerk") if getattr(robot, key) is None]
    if not unknown:
        return said
    return (
        f"{said}; no limits of {' and '.join(unknown)} are known: plans are compared with the "
        "demonstrations in these"
    )


def read_goal(workspace: Workspace, words: tuple[str, ...]) -> Point:
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
    """Set the goal that the next trials are for.

    For example:
        prior-reinforce goal hoop 0.92 0.10
        prior-reinforce goal hoop "92cm ahead, 10cm left" --new-hardware "another ball"
    """

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] PLACE")] = ()
    """The workspace (the current folder's if not given) and the goal: 0.92 0.10 (metres ahead,
    metres left, or the outcome's units), 92cm 10cm, or "92cm ahead, 10cm left"."""
    memory: Literal["goal", "workspace"] | None = None
    """Which trials the adapter learns from: this goal's, or earlier goals' as well; by default
    earlier ones too where they serve the adapter, as they do bayes."""
    adapter: AdapterChoice = DEFAULT_ADAPTER
    new_hardware: str | None = None
    """What was changed on the hardware since the last trial, a note: another ball, a new gripper.
    What was known is then believed less, and the next reading more."""

    takes_words = True

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        workspace.set_goal(
            read_goal(workspace, words),
            carry_over=None if self.memory is None else self.memory == "workspace",
            adapter=self.adapter,
            new_hardware=self.new_hardware,
        )
        print_goal(workspace)
        print_next(workspace)


@dataclass(frozen=True)
class Status(OnWorkspace):
    """Say where a workspace stands and what to do next.

    For example:
        prior-reinforce status hoop
        prior-reinforce status hoop --json
    """

    json: Json = False

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        if self.json:
            print_json(status_record(workspace))
        else:
            print(describe(workspace))


@dataclass(frozen=True)
class Trials(OnWorkspace):
    """Print every trial: what was asked for, what was seen.

    For example:
        prior-reinforce trials hoop
        prior-reinforce trials hoop --csv > trials.csv
    """

    csv: bool = False
    """As a table with a column for each number."""
    json: Json = False

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        if self.csv and self.json:
            raise ConfigurationError("--csv or --json: drop one of the two")
        if self.json:
            print_json(trial_records(workspace))
        elif self.csv:
            print(trials_table(workspace), end="")
        else:
            names, units = workspace.manifest.outcome_names, workspace.manifest.outcome_units
            for trial in workspace.state.trials:
                aim = say_place(trial.condition, names, units)
                said = f"aimed at {aim}: {say_trial(workspace, trial)}"
                print(f"goal {trial.goal_number}  trial {trial.number:<4}{said}")


@dataclass(frozen=True)
class Log(OnWorkspace):
    """Print the journal, one JSON object a line.

    For example:
        prior-reinforce log hoop | grep told
    """

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        for entry in workspace.events:
            event = msgspec.to_builtins(entry.event)
            print(json.dumps({"id": entry.id, "time": entry.time, **event}))


@dataclass(frozen=True)
class Report(OnWorkspace):
    """Write a page with every goal, its trials, and the plans that were executed.

    For example:
        prior-reinforce report hoop --out shown-on-monday
    """

    out: Path | None = None
    """Folder for the page and its pictures; `report` in the workspace if not given."""

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        from rich.console import Console

        from prior_reinforce.commands.live import drawing_progress

        with drawing_progress(Console()) as progress:
            page = workspace.report(self.out, progress=progress)
        print(f"report: {page}")


@dataclass(frozen=True)
class Pack(OnWorkspace):
    """Write a workspace into one file, to be opened on another machine.

    For example:
        prior-reinforce pack hoop hoop.zip
    """

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] FILE")] = ()
    """The workspace (the current folder's if not given), and the file to write."""

    takes_words = True

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        if len(words) != 1:
            raise ConfigurationError("say which file to write: one name, such as hoop.zip")
        file = check_path(Path(words[0]))
        print(f"packed: {file}  sha256 {workspace.pack(file)}")
        said = sum(bool(getattr(e, "output_tail", "")) for e in workspace.state.executions.values())
        if said:
            print(f"it holds the last output of {said} commands, as `log` shows: read it first")


@dataclass(frozen=True)
class Unpack:
    """Make a workspace of what `pack` wrote; nothing in it is run.

    For example:
        prior-reinforce unpack hoop.zip hoop
    """

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """What `pack` wrote."""
    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="WORKSPACE")]
    """Folder to make."""

    def run(self) -> None:
        """Make it."""
        from prior_reinforce.bench.workspace.packing import unpack

        print(f"unpacked: {self.folder}  sha256 {unpack(self.file, self.folder)}")
        with Workspace(self.folder) as workspace:
            waiting = workspace.state.open_trial
            if waiting is not None:
                print(
                    f"trial {waiting.number} waits: was it executed where this was packed? then "
                    "tell or void it here"
                )
            print(describe(workspace))

"""Commands on a workspace: one's own arm, one's own demonstrations, an afternoon of trials."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from prior_reinforce.commands.live import place
from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError, TrialStateError
from prior_reinforce.feedback import from_words, to_words
from prior_reinforce.workspace.history import TrialRecord, TrialStage
from prior_reinforce.workspace.importing import (
    Preprocessing,
    RecordingFormat,
    import_demonstrations,
)
from prior_reinforce.workspace.manifest import TEMPLATE
from prior_reinforce.workspace.plan_files import write_plan
from prior_reinforce.workspace.status import describe
from prior_reinforce.workspace.workspace import Workspace

Folder = Annotated[Path, tyro.conf.Positional]
Number = Annotated[int, tyro.conf.Positional]


@contextmanager
def opened(folder: Path) -> Iterator[Workspace]:
    """Open a workspace for one command."""
    workspace = Workspace(folder)
    try:
        yield workspace
    finally:
        workspace.close()


@dataclass(frozen=True)
class New:
    """Make a workspace: a folder with a commented manifest."""

    folder: Folder
    """Folder to make."""
    name: str | None = None
    """Name of the task; the folder's name if not given."""
    action_names: tuple[str, ...] = tuple(f"joint{i}" for i in range(1, 8))
    """Names of the action dimensions."""
    action_units: tuple[str, ...] = ("rad",)
    """Unit of each action dimension; a single one holds for all."""
    dt: float = 0.0125
    """Time between two frames of a plan, in seconds."""
    outcome_names: tuple[str, ...] = ("x", "y")
    """Names of the outcome's components."""
    outcome_units: tuple[str, ...] = ("m",)
    """Unit of each component; a single one holds for all."""
    tolerance: float = 0.015
    """Largest distance from the goal that counts as reached."""
    robot: Literal["panda", "fr3", "none"] = "panda"
    """Whose limits hold."""

    def run(self) -> None:
        """Write the folder."""

        def texts(values: tuple[str, ...]) -> str:
            return (
                "["
                + ", ".join('"' + v.replace("\\", "").replace('"', "") + '"' for v in values)
                + "]"
            )

        def spread(values: tuple[str, ...], n: int) -> tuple[str, ...]:
            return values * n if len(values) == 1 else values

        manifest = TEMPLATE.format(
            name=(self.name or self.folder.name).replace("\\", "").replace('"', ""),
            names=texts(self.action_names),
            units=texts(spread(self.action_units, len(self.action_names))),
            dt=self.dt,
            outcome_names=texts(self.outcome_names),
            outcome_units=texts(spread(self.outcome_units, len(self.outcome_names))),
            tolerance=self.tolerance,
            robot=self.robot,
        )
        Workspace.create(self.folder, manifest).close()
        print(f"workspace made in {self.folder}; its manifest is {self.folder / 'workspace.toml'}")
        print(f"next: prior-reinforce import {self.folder} RECORDINGS")


@dataclass(frozen=True)
class Import:
    """Bring recorded demonstrations into a workspace, and look at them."""

    folder: Folder
    """Workspace."""
    source: Annotated[Path, tyro.conf.Positional]
    """Recording: NPZ, CSV, LeRobot, robomimic or DROID HDF5, ROS 1, ROS 2 or MCAP."""
    format: RecordingFormat | None = None
    """What it is; detected if not given."""
    outcomes: Path | None = None
    """CSV `episode,x,y` with where each object landed; `outcomes.csv` beside the source if not
    given."""
    key: str | None = None
    """Where the motion is within the source (HDF5 data set, topic, column)."""
    rate: float | None = None
    """Frames a second, where the source does not say."""
    joints: tuple[str, ...] | None = None
    """Columns to keep, in order; the manifest's action names if not given."""
    horizon: int | None = None
    """Frames of every plan; the longest recording's if not given."""
    trim: bool = True
    """Drop the still ends of each recording."""

    def run(self) -> None:
        """Read, preview, take in."""
        with opened(self.folder) as workspace:
            manifest = workspace.manifest
            result = import_demonstrations(
                self.source,
                format=self.format,
                key=self.key,
                rate=self.rate,
                outcomes=self.outcomes,
                outcome_names=manifest.outcome_names,
                outcome_units=manifest.outcome_units,
                joints=self.joints or manifest.format.names,
                names=manifest.format.names,
                units=manifest.format.units,
                preprocessing=Preprocessing(
                    dt=manifest.format.dt, horizon=self.horizon, trim=self.trim
                ),
            )
            workspace.import_demonstrations(result.demonstrations, str(self.source))
            picture = self.folder / "demonstrations.png"
            result.preview.draw(picture)
        print(result.preview.text)
        print(f"picture: {picture}")
        print(f"next: prior-reinforce learn {self.folder}")


@dataclass(frozen=True)
class Goal:
    """Set the goal that the next trials are for."""

    folder: Folder
    """Workspace."""
    goal: Annotated[tuple[float, ...], tyro.conf.Positional]
    """Its place in the outcome's units, for instance 0.92 0.10."""
    memory: Literal["goal", "workspace"] = "goal"
    """Which trials the adapter learns from: this goal's, or earlier goals' as well."""

    def run(self) -> None:
        """Set it."""
        with opened(self.folder) as workspace:
            record = workspace.set_goal(self.goal, memory=self.memory)
        print(f"goal {record.number} at {place(record.goal)}")
        print(f"next: prior-reinforce ask {self.folder}")


@dataclass(frozen=True)
class Ask:
    """Get the plan of the next trial; asking again gives the same one until it is told."""

    folder: Folder
    """Workspace."""
    out: Path | None = None
    """Write the plan to this file as well: .npz (t, q, dq, ddq), .csv or .json."""
    rate: float | None = None
    """Samples a second of --out; the plan's own frames if not given."""
    run_command: Annotated[str | None, tyro.conf.arg(name="run")] = None
    """Execute the plan with this command, once; {plan} stands for the plan's file."""
    time_limit: float = 120.0
    """Seconds that the command may take."""
    arm_did_not_move: bool = False
    """After a crash while executing: a person saw that nothing moved."""

    def run(self) -> int:
        """Hand the plan out."""
        with opened(self.folder) as workspace:
            trial = workspace.ask(arm_did_not_move=self.arm_did_not_move)
            plan = workspace.plan(trial)
            report = workspace.gate(plan)
            print(f"trial {trial.number}: condition {place(trial.condition)}")
            if report is not None:
                print(report.text())
            print(f"plan: {workspace.plan_path(trial)}")
            if self.out is not None:
                written = write_plan(plan, self.out, rate=self.rate)
                print(f"written: {written.path}")
            if self.run_command is None:
                print(
                    f"next: execute it, then: prior-reinforce tell {self.folder} {trial.number} "
                    '--error "5cm long, 2cm left"   (or --hit)'
                )
                return 0
            hand_over = workspace.execute(
                trial.number, self.run_command, time_limit=self.time_limit
            )
        if hand_over.output_tail:
            print(hand_over.output_tail.rstrip())
        if hand_over.succeeded:
            print(f"next: prior-reinforce tell {self.folder} {trial.number} --error ... or --hit")
            return 0
        why = (
            "was stopped at its time limit"
            if hand_over.timed_out
            else (f"ended with status {hand_over.exit_status}")
        )
        print(
            f"prior-reinforce: the command {why}; if the arm moved, tell trial {trial.number}; if "
            f"not, void it: prior-reinforce void {self.folder} {trial.number} --reason ...",
            file=sys.stderr,
        )
        return 1


@dataclass(frozen=True)
class _Feedback:
    folder: Folder
    """Workspace."""
    number: Number
    """Number of the trial."""
    error: tuple[str, ...] | None = None
    """What was seen, outcome minus goal: words (`"5cm long, 2cm left"`) or metres (0.05 -0.02)."""
    outcome: tuple[float, ...] | None = None
    """Or where the object ended, in the table frame, in the outcome's units."""
    hit: bool = False
    """Or that the goal was reached."""

    def read(self, workspace: Workspace) -> tuple[np.ndarray, bool | None]:
        """The error seen, and whether it was a hit if that was said."""
        given = [self.error is not None, self.outcome is not None]
        if sum(given) > 1 or not (any(given) or self.hit):
            raise ConfigurationError(
                "say what was seen with one of --error, --outcome, --hit (--hit may go with either)"
            )
        history = workspace.history
        if not 1 <= self.number <= len(history.trials):
            raise TrialStateError(f"there is no trial {self.number}; see prior-reinforce status")
        k = len(workspace.manifest.outcome_names)
        goal = history.goals[history.trials[self.number - 1].goal_number - 1].goal
        hit = True if self.hit else None
        if self.outcome is not None:
            if len(self.outcome) != k:
                raise InvalidFeedbackError(f"--outcome needs {k} numbers, got {self.outcome}")
            return np.array(self.outcome) - goal, hit
        if self.error is None:
            return np.zeros(k), hit
        try:
            return np.array([float(word) for word in self.error]), hit
        except ValueError:
            return from_words(" ".join(self.error), k), hit


@dataclass(frozen=True)
class Tell(_Feedback):
    """Report what was seen of a trial."""

    def run(self) -> None:
        """Write it down."""
        with opened(self.folder) as workspace:
            error, hit = self.read(workspace)
            _confirm(self.folder, workspace.tell(self.number, error, hit=hit))


@dataclass(frozen=True)
class Amend(_Feedback):
    """Correct what was told of a trial."""

    def run(self) -> None:
        """Write it down."""
        with opened(self.folder) as workspace:
            error, hit = self.read(workspace)
            _confirm(self.folder, workspace.amend(self.number, error, hit=hit))


@dataclass(frozen=True)
class Void:
    """Declare that a trial is not data: the ball slipped, the arm stopped."""

    folder: Folder
    """Workspace."""
    number: Number
    """Number of the trial."""
    reason: str = ""
    """Why."""

    def run(self) -> None:
        """Write it down."""
        with opened(self.folder) as workspace:
            workspace.void(self.number, self.reason)
        print(f"trial {self.number} is not data")
        print(f"next: prior-reinforce ask {self.folder}")


@dataclass(frozen=True)
class Status:
    """Say where a workspace stands and what to do next."""

    folder: Folder
    """Workspace."""

    def run(self) -> None:
        """Print ten lines."""
        with opened(self.folder) as workspace:
            print(describe(workspace))


@dataclass(frozen=True)
class Log:
    """Print the journal, one JSON object a line."""

    folder: Folder
    """Workspace."""

    def run(self) -> None:
        """Print it."""
        with opened(self.folder) as workspace:
            for event in workspace.events:
                print(event.as_json())


@dataclass(frozen=True)
class Export:
    """Write a trial's plan in another form: NPZ, CSV, or JSON in ROS 2's JointTrajectory order."""

    folder: Folder
    """Workspace."""
    number: Number
    """Number of the trial."""
    out: Annotated[Path, tyro.conf.Positional]
    """File: .npz, .csv or .json."""
    rate: float | None = None
    """Samples a second; the plan's own frames if not given."""

    def run(self) -> None:
        """Write it."""
        with opened(self.folder) as workspace:
            history = workspace.history
            if not 1 <= self.number <= len(history.trials):
                raise TrialStateError(
                    f"there is no trial {self.number}; see prior-reinforce status"
                )
            plan = workspace.plan(history.trials[self.number - 1])
            written = write_plan(plan, self.out, rate=self.rate)
        print(f"written: {written.path}  sha256 {written.sha256}")


def _confirm(folder: Path, trial: TrialRecord) -> None:
    assert trial.stage is TrialStage.TOLD
    assert trial.error_seen is not None
    if trial.hit:
        print(f"trial {trial.number}: reached")
        print(f"next: another goal, or prior-reinforce report {folder}")
    else:
        print(f"trial {trial.number}: {to_words(trial.error_seen)}")
        print(f"next: prior-reinforce ask {folder}")

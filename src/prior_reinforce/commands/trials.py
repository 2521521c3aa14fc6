"""Commands on the trials of a workspace: ask, tell, amend, void, export."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from prior_reinforce.commands.reading import Number, Reading
from prior_reinforce.commands.workspace import Folder, opened, print_next
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators.by_name import make_generator
from prior_reinforce.plans.files import check_plan_path, write_plan
from prior_reinforce.robots.executors.command import check_command
from prior_reinforce.robots.executors.lock import is_executing
from prior_reinforce.workspace.execution import execute
from prior_reinforce.workspace.history import TrialRecord, TrialStage
from prior_reinforce.workspace.status import say_trial
from prior_reinforce.workspace.trials import amend, ask, tell, void
from prior_reinforce.workspace.wording import say_place
from prior_reinforce.workspace.workspace import Workspace


@dataclass(frozen=True)
class Ask:
    """Get the plan of the next trial; asking again gives the same one until it is told."""

    folder: Folder
    """Workspace."""
    out: Path | None = None
    """Write the plan to this file as well: .npz (t, q, dq, ddq), .csv or .json. {trial} in its
    name stands for the trial's number; a folder takes trial-{trial}.npz."""
    rate: float | None = None
    """Samples a second of --out; the plan's own frames if not given."""
    run_command: Annotated[str | None, tyro.conf.arg(name="run")] = None
    """Execute the plan with this command, once, for instance "mycontroller {plan}"; {plan} stands
    for the plan's file."""
    time_limit: float = 120.0
    """Seconds that the command may take."""
    arm_did_not_move: bool = False
    """After a crash while executing: a person saw that nothing moved."""
    generator: str | None = None
    """The generator that the model was learned by, where it is one's own: module:Class."""

    def run(self) -> int:
        """Hand the plan out."""
        own = None if self.generator is None else make_generator(self.generator)
        if self.run_command is not None:
            check_command(self.run_command, time_limit=self.time_limit)
        if self.rate is not None and self.out is None:
            raise ConfigurationError(
                "--rate is of the file that --out writes; --run is given the plan's own frames"
            )
        with opened(self.folder) as workspace:
            self._check_out(workspace)
            did_not_move = self.arm_did_not_move
            if not did_not_move and _should_ask_whether_it_moved(workspace):
                moved = _ask_whether_it_moved(workspace)
                if moved:
                    print_next(workspace)
                    return 1
                did_not_move = True
            trial = ask(workspace, arm_did_not_move=did_not_move, own=own)
            plan = workspace.plan(trial)
            print(
                f"trial {trial.number}: aimed at {say_place(workspace.manifest, trial.condition)}"
            )
            if _reached_before(workspace, trial):
                print("the goal is reached already: this trial repeats it")
            report = workspace.gate(plan)
            print(
                "no robot in the manifest, no limits checked" if report is None else report.text()
            )
            print(f"plan: {workspace.plan_path(trial)}")
            out = self._out_of(trial.number)
            if out is not None:
                print(f"written: {write_plan(plan, out, rate=self.rate).path}")
            if self.run_command is not None:
                return self._execute(workspace, trial, self.run_command)
            if trial.stage is TrialStage.EXECUTED:
                print("it was executed already")
            else:
                print("execute it, then say where the object went:")
            print_next(workspace)
            return 0

    def _out_of(self, number: int) -> Path | None:
        """Where --out puts the plan of a trial."""
        if self.out is None:
            return None
        out = self.out / "trial-{trial}.npz" if self.out.is_dir() else self.out
        return Path(str(out).replace("{trial}", str(number)))

    def _check_out(self, workspace: Workspace) -> None:
        """Say what --out cannot do before a trial is made."""
        history = workspace.history
        new = history.open_trial is None
        number = len(history.trials) + 1 if new else history.trials[-1].number
        out = self._out_of(number)
        if out is None:
            return
        check_plan_path(out, rate=self.rate)
        # The open trial's plan may be there from the last time it was asked for.
        if new and out.exists():
            raise FileFormatError(
                f"{out} is there already, and plans are never overwritten; choose another name, "
                'for instance with the trial\'s number: --out "plan-{trial}.npz"'
            )

    def _execute(self, workspace: Workspace, trial: TrialRecord, command: str) -> int:
        hand_over = execute(workspace, trial.number, command, time_limit=self.time_limit)
        if hand_over.output_tail:
            print(hand_over.output_tail.rstrip())
        if hand_over.succeeded:
            print_next(workspace)
            return 0
        ended = f"ended with status {hand_over.exit_status}"
        why = "was stopped at its time limit" if hand_over.timed_out else ended
        print(
            f"prior-reinforce: the command {why}; if the object flew, tell trial {trial.number}; "
            f"if not, void it: prior-reinforce void {self.folder} {trial.number} --reason WHY",
            file=sys.stderr,
        )
        return 1


@dataclass(frozen=True)
class Tell(Reading):
    """Report what was seen of a trial."""

    def run(self) -> None:
        """Write it down."""
        with opened(self.folder) as workspace:
            error, hit = self.read(workspace)
            trial = tell(workspace, self.number, error, hit=hit)
            print(f"trial {trial.number}: {say_trial(workspace, trial)}")
            print_next(workspace)


@dataclass(frozen=True)
class Amend(Reading):
    """Correct what was told of a trial."""

    def run(self) -> None:
        """Write it down."""
        with opened(self.folder) as workspace:
            error, hit = self.read(workspace)
            trial = amend(workspace, self.number, error, hit=hit)
            print(f"trial {trial.number}, corrected: {say_trial(workspace, trial)}")
            print_next(workspace)


@dataclass(frozen=True)
class Void:
    """Declare that a trial is not data: the ball slipped, the arm stopped."""

    folder: Folder
    """Workspace."""
    number: Number
    """Number of the trial."""
    reason: str = ""
    """Why, for the log and the report."""

    def run(self) -> None:
        """Write it down."""
        with opened(self.folder) as workspace:
            trial = void(workspace, self.number, self.reason)
            print(
                f"trial {trial.number}: {say_trial(workspace, trial)}; nothing is learned from it"
            )
            print_next(workspace)


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
            plan = workspace.plan(workspace.record(self.number))
            written = write_plan(plan, self.out, rate=self.rate)
        print(f"written: {written.path}  sha256 {written.sha256}")


def _reached_before(workspace: Workspace, trial: TrialRecord) -> bool:
    return any(other.hit for other in workspace.history.trials_of(trial.goal_number))


def _should_ask_whether_it_moved(workspace: Workspace) -> bool:
    trial = workspace.history.open_trial
    cut_off = trial is not None and trial.stage is TrialStage.EXECUTING
    return cut_off and sys.stdin.isatty() and not is_executing(workspace.folder)


def _ask_whether_it_moved(workspace: Workspace) -> bool:
    trial = workspace.history.open_trial
    assert trial is not None
    print(f"trial {trial.number} was executing when the program stopped")
    while True:
        answer = _answer("did the arm move? (yes/no) ").lower()
        if answer in {"y", "yes", "n", "no"}:
            return answer.startswith("y")


def _answer(question: str) -> str:
    try:
        return input(question).strip()
    except EOFError as error:
        raise ConfigurationError(
            "no answer; ask again, with --arm-did-not-move if it did not"
        ) from error

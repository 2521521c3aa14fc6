"""Commands on the trials of a workspace: ask, tell, amend, void, export."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from prior_reinforce.commands.reading import Number, Reading
from prior_reinforce.commands.workspace import Folder, print_next
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.plans.files import check_plan_path, write_plan
from prior_reinforce.plans.motions import Plan
from prior_reinforce.session import Session
from prior_reinforce.trials import Stage, Trial
from prior_reinforce.wording import say_place
from prior_reinforce.workspace.status import say_trial
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
    """The generator that the model was learned by, where it is your own: module:Class."""
    adapter: str | None = None
    """The adapter that the goal was set with, where it is your own: module:Class."""

    def run(self) -> int:
        """Show the plan, write it, execute it."""
        from prior_reinforce.robots.executors.command import check_command

        if self.run_command is not None:
            check_command(self.run_command, time_limit=self.time_limit)
        if self.rate is not None and self.out is None:
            raise ConfigurationError(
                "--rate is of the file that --out writes; --run is given the plan's own frames"
            )
        with Workspace(self.folder) as workspace:
            session = workspace.session(self.generator, self.adapter)
            self._check_out(session)
            did_not_move = self.arm_did_not_move
            if not did_not_move and _was_cut_off(workspace, session) and sys.stdin.isatty():
                if _ask_whether_it_moved(session):
                    print_next(workspace)
                    return 1
                did_not_move = True
            reached_before = session.solved
            trial = session.ask(arm_did_not_move=did_not_move)
            self._show(workspace, trial, reached_before)
            if self.run_command is not None:
                return self._execute(workspace, trial.number, self.run_command)
            if trial.stage is Stage.EXECUTED:
                print("it was executed already")
            else:
                print("execute it, then say where the object went:")
            print_next(workspace)
            return 0

    def _show(self, workspace: Workspace, trial: Trial, reached_before: bool) -> None:
        """Print where the trial aims and what the gate says, and write --out."""
        manifest = workspace.manifest
        place = say_place(trial.condition, manifest.outcome_names, manifest.outcome_units)
        print(f"trial {trial.number}: aimed at {place}")
        if reached_before:
            print("the goal is reached already: this trial repeats it")
        assert trial.plan is not None
        report = workspace.gate(trial.plan)
        print("no robot in the manifest, no limits checked" if report is None else report.text())
        print(f"plan: {workspace.plan_path(trial)}")
        out = self._out_of(trial.number)
        if out is not None:
            plan = Plan(trial.plan, manifest.format)
            print(f"written: {write_plan(plan, out, rate=self.rate).path}")

    def _out_of(self, number: int) -> Path | None:
        """Where --out puts the plan of a trial."""
        if self.out is None:
            return None
        out = self.out / "trial-{trial}.npz" if self.out.is_dir() else self.out
        return Path(str(out).replace("{trial}", str(number)))

    def _check_out(self, session: Session) -> None:
        """Say what --out cannot do before a trial is made."""
        trial = session.open_trial
        number = session.n_trials_asked + 1 if trial is None else trial.number
        out = self._out_of(number)
        if out is None:
            return
        check_plan_path(out, rate=self.rate)
        # The open trial's plan may be there from the last time it was asked for.
        if trial is None and out.exists():
            hint = ', for instance with the trial\'s number: --out "plan-{trial}.npz"'
            raise FileFormatError(
                f"{out} is there already, and plans are never overwritten; choose another name"
                + ("" if "{trial}" in str(self.out) else hint)
            )

    def _execute(self, workspace: Workspace, number: int, command: str) -> int:
        result = workspace.execute(number, command, time_limit=self.time_limit)
        if result.output_tail:
            print(result.output_tail.rstrip())
        if result.succeeded:
            print_next(workspace)
            return 0
        ended = f"ended with status {result.exit_status}"
        why = "was stopped at its time limit" if result.timed_out else ended
        print(
            f"prior-reinforce: the command {why}; if the object flew, tell trial {number}; "
            f"if not, void it: prior-reinforce void {self.folder} {number} --reason WHY",
            file=sys.stderr,
        )
        return 1


@dataclass(frozen=True)
class Tell(Reading):
    """Report what was seen of a trial."""

    def run(self) -> None:
        """Write it down."""
        with Workspace(self.folder) as workspace:
            session = workspace.session()
            error, hit = self.read(workspace, session)
            trial = session.tell(self.number, error, hit=hit)
            print(f"trial {trial.number}: {say_trial(workspace, trial)}")
            print_next(workspace)


@dataclass(frozen=True)
class Amend(Reading):
    """Correct what was told of a trial."""

    def run(self) -> None:
        """Write it down."""
        with Workspace(self.folder) as workspace:
            session = workspace.session()
            error, hit = self.read(workspace, session)
            trial = session.amend(self.number, error, hit=hit)
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
        with Workspace(self.folder) as workspace:
            trial = workspace.session().void(self.number, self.reason)
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
        """Write it, if it may still be executed."""
        with Workspace(self.folder) as workspace:
            plan = workspace.plan(workspace.session().trial(self.number))
            verdict = workspace.gate(plan.actions)
            if verdict is not None:
                verdict.require()
            written = write_plan(plan, self.out, rate=self.rate)
        print(f"written: {written.path}  sha256 {written.sha256}")


def _was_cut_off(workspace: Workspace, session: Session) -> bool:
    trial = session.open_trial
    executing = trial is not None and trial.stage is Stage.EXECUTING
    return executing and not workspace.log.is_executing()


def _ask_whether_it_moved(session: Session) -> bool:
    assert session.open_trial is not None
    print(f"trial {session.open_trial.number} was executing when the program stopped")
    while True:
        try:
            answer = input("did the arm move? (yes/no) ").strip().lower()
        except EOFError as error:
            raise ConfigurationError(
                "no answer; ask again, with --arm-did-not-move if it did not"
            ) from error
        if answer in {"y", "yes", "n", "no"}:
            return answer.startswith("y")

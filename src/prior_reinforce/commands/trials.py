"""Commands on the trials of a workspace: ask, tell, amend, void, export."""

from __future__ import annotations

import io
import sys
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from msgspec import to_builtins

from prior_reinforce.bench.robots.executors.base import ArmSettings, Motion
from prior_reinforce.bench.robots.executors.lock import last_stop
from prior_reinforce.bench.robots.plan_files import check_plan_path, write_plan
from prior_reinforce.bench.workspace.records import AskRecord, trial_records
from prior_reinforce.bench.workspace.status import (
    OUTDATED,
    ask_to_move,
    execution_warning,
    next_step,
    say_expectation,
    say_look,
    say_trial,
)
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands import complain, warn
from prior_reinforce.commands.base import (
    Json,
    OnWorkspace,
    Words,
    answer_to,
    print_checked,
    print_json,
    print_next,
    says_yes,
    trial_and_rest,
)
from prior_reinforce.commands.reading import Seen, rows_to_tell
from prior_reinforce.commands.workspace import print_goal, read_goal
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.files import check_path
from prior_reinforce.plans.motions import Plan
from prior_reinforce.registry import own_class
from prior_reinforce.session.trials import Stage, State, Trial
from prior_reinforce.wording import bare_units, say_place

if TYPE_CHECKING:
    from prior_reinforce.bench.robots.executors.drive import Look


@dataclass(frozen=True)
class Ask(OnWorkspace):
    """Get the plan of the next trial; asking again gives the same one until it is told.

    For example:
        prior-reinforce ask hoop --out "plan-{trial}.npz"
        prior-reinforce ask hoop --run "mycontroller {plan} {result}"
        prior-reinforce ask hoop --execute --approach
    """

    goal: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="PLACE")] = None
    """Set this goal first, as `goal` does, unless it is the present one: 0.92 0.10, 92cm 10cm."""
    out: Path | None = None
    """Write the plan to this file as well: .npz (t, q, dq, ddq), .csv or .json. {trial} in its
    name stands for the trial's number; a folder takes trial-{trial}.npz."""
    rate: float | None = None
    """Samples a second of --out; the plan's own frames if not given."""
    run_command: Annotated[str | None, tyro.conf.arg(name="run")] = None
    """Execute the plan with this command, once, for instance "mycontroller {plan} {result}"; {plan}
    stands for the plan's file, {result} for a folder where it may say how it went."""
    execute: bool = False
    """Execute the plan on the arm that [arm] of the manifest names, once."""
    approach: bool = False
    """With --execute: move slowly to the plan's first frame before, if the arm stands elsewhere."""
    rehearse: float | None = None
    """With --execute: play the plan at this fraction of its speed, such as 0.2. It is no trial."""
    executor: str | None = None
    """The executor that [arm] names, where it is your own: module:Class."""
    yes: bool = False
    """Move without asking whether the arm may move now."""
    check: bool = False
    """Check everything that --run or --execute needs, and move nothing."""
    where: str | None = None
    """Ask this command first where the arm stands, and compare: its last line is JSON such as
    {"joint1": 0.1}, with every joint, in the plan's units. It must move nothing."""
    time_limit: float = 120.0
    """Seconds that the command may take; with --execute, beyond the plan's own duration."""
    arm_did_not_move: bool = False
    """After a crash while executing, or a command that failed: a person saw that nothing moved."""
    generator: str | None = None
    """The generator that the model was learned by, where it is your own: module:Class."""
    adapter: str | None = None
    """The adapter that the goal was set with, where it is your own: module:Class."""
    json: Json = False

    def run(self) -> int | None:
        """Check the flags before anything is opened."""
        self._check_flags()
        return super().run()

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> int:
        stop_seen = last_stop(workspace.folder)
        with redirect_stdout(io.StringIO()) if self.json else nullcontext():
            status = self._ask(workspace, stop_seen)
        if self.json:
            print_json(self._record(workspace))
        return status

    def _record(self, workspace: Workspace) -> AskRecord:
        """The trial as it stands now."""
        record, form = trial_records(workspace)[-1], workspace.manifest.format
        plan = workspace.plan(workspace.state.trials[-1])
        verdict = workspace.gate(plan.actions)
        ended = workspace.state.executions.get(record.number)
        out = self._out_of(record.number)
        return AskRecord(
            trial=record,
            first_pose=dict(zip(form.names, plan.actions[0].tolist(), strict=True)),
            gate=verdict.as_json() if verdict is not None else None,
            written=None if out is None else str(out),
            execution=to_builtins(ended) if ended is not None else None,
            next=next_step(workspace),
        )

    def _ask(self, workspace: Workspace, stop_seen: int) -> int:
        self._check_out(workspace.state)
        if self.goal is not None:
            place, goals = read_goal(workspace, self.goal), workspace.state.goals
            if not goals or goals[-1].goal.tolist() != [*place]:
                workspace.set_goal(place)
            print_goal(workspace)
        session = workspace.session(self.generator, self.adapter)
        recovered = workspace.recover()
        if recovered is not None:
            print(f"trial {recovered.number}: {say_trial(workspace, recovered)}")
        did_not_move = self.arm_did_not_move
        if not did_not_move and sys.stdin.isatty() and (cut := _cut_off(workspace)) is not None:
            print(f"trial {cut.number}: {say_trial(workspace, cut)}")
            if _ask_whether_it_moved():
                print_next(workspace)
                return 1
            did_not_move = True
        reached_before = session.solved
        trial = session.ask(arm_did_not_move=did_not_move)
        self._show(workspace, trial, reached_before)
        if trial.stage is Stage.EXECUTED:
            if self.run_command or self.execute:
                workspace.to_execute(trial.number)  # which refuses
            print("it was executed already")
        elif self.execute:
            return self._on_arm(workspace, trial, stop_seen)
        else:
            command = None if self.check else self.run_command
            if command is not None and not self._may_move(workspace, trial):
                return 1
            # Last: the arm may be moved by hand while a person is asked.
            if self.where is not None and not _is_there(workspace, trial, self.where):
                return 1
            if command is not None:
                return self._execute(workspace, trial.number, command, stop_seen)
            wait = "execute it, then say where the object went:"
            print("checked; nothing moved" if self.check else wait)
        print_next(workspace)
        return 0

    def _on_arm(self, workspace: Workspace, trial: Trial, stop_seen: int) -> int:
        """Look at the arm, ask a person, and let its executor move it."""
        arm = arm_of(workspace, self.executor)
        if arm is None:
            raise ConfigurationError(
                f"{workspace.folder} names no arm; add [arm] with its executor to the manifest, "
                "or give a command with --run"
            )
        speed = 1.0 if self.rehearse is None else self.rehearse
        look = workspace.look_at_arm(trial.number, arm, speed=speed)
        print(say_look(look))
        refused = look.refused
        if not look.there and not refused:
            elsewhere = f"{look.said}; move it there, or ask again with --approach"
            refused = look.approach_refused if self.approach else elsewhere
        if refused:
            complain(f"{refused}; nothing moved")
            return 1
        if self.check:
            print("checked; nothing moved")
            return 0
        motions: list[Motion] = [] if look.there else ["approach"]
        motions.append("trial" if self.rehearse is None else "rehearsal")
        for motion in motions:
            share = speed if motion == "rehearsal" else 1.0
            if not self._may_move(workspace, trial, look, motion, share):
                return 1
            status = self._execute(workspace, trial.number, arm, stop_seen, motion, share)
            if status != 0:
                break
        return status

    def _may_move(
        self,
        workspace: Workspace,
        trial: Trial,
        look: Look | None = None,
        motion: Motion = "trial",
        speed: float = 1.0,
    ) -> bool:
        """Whether a person says that the arm may move now."""
        where = self.where is not None
        if self.yes or says_yes(ask_to_move(workspace, trial, look, motion, speed, where=where)):
            return True
        print("nothing moved; ask again when it may")
        return False

    def _check_flags(self) -> None:
        """Say what cannot be before anything is changed."""
        from prior_reinforce.bench.robots.executors.arguments import check_command

        if self.run_command is not None:
            check_command(self.run_command, time_limit=self.time_limit)
        moves = self.run_command is not None or self.execute
        if moves and not (self.yes or self.check or sys.stdin.isatty()):
            raise ConfigurationError(
                "a person says that the arm may move: run it in a terminal, or add --yes"
            )
        if self.execute and (self.run_command is not None or self.where is not None):
            raise ConfigurationError("--execute asks the arm itself; drop --run and --where")
        if not self.execute and (self.approach or self.rehearse is not None or self.executor):
            raise ConfigurationError("--approach, --rehearse and --executor go with --execute")
        if self.rehearse is not None and not 0 < self.rehearse < 1:
            raise ConfigurationError(
                f"--rehearse must be a fraction of the speed, such as 0.2, got {self.rehearse:g}"
            )
        if self.rate is not None and self.out is None:
            raise ConfigurationError(
                "--rate is of the file that --out writes; --run is given the plan's own frames"
            )

    def _show(self, workspace: Workspace, trial: Trial, reached_before: bool) -> None:
        """Print where the trial aims and what the gate says, and write --out."""
        manifest = workspace.manifest
        place = say_place(trial.condition, manifest.outcome_names, manifest.outcome_units)
        print(f"trial {trial.number}: aimed at {place}")
        for line in say_expectation(workspace.state, trial):
            print(line)
        _print_outdated(workspace)
        if reached_before:
            print("the goal is reached already: this trial repeats it")
        assert trial.plan is not None
        unchecked = "no robot in the manifest, no limits checked"
        print_checked(unchecked if trial.verdict is None else trial.verdict.text())
        print(f"plan: {workspace.plan_path(trial)}")
        form = manifest.format
        first = zip(form.names, trial.plan[0].round(4) + 0.0, form.units, strict=True)
        begins = ", ".join(f"{name} {q:.4g} {unit}" for name, q, unit in first)
        print(f"it begins at {begins}: move the arm there slowly first")
        out = self._out_of(trial.number)
        if out is not None:
            plan = Plan(trial.plan, form)
            print(f"written: {write_plan(plan, out, rate=self.rate).path}")

    def _out_of(self, number: int) -> Path | None:
        """Where --out puts the plan of a trial."""
        if self.out is None:
            return None
        out = self.out / "trial-{trial}.npz" if self.out.is_dir() else self.out
        return Path(str(out).replace("{trial}", str(number)))

    def _check_out(self, state: State) -> None:
        """Say what --out cannot do before a trial is made."""
        trial = state.open_trial
        number = len(state.trials) + 1 if trial is None else trial.number
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

    def _execute(
        self,
        workspace: Workspace,
        number: int,
        command: str | ArmSettings,
        stop_seen: int,
        motion: Motion = "trial",
        speed: float = 1.0,
    ) -> int:
        result = workspace.execute(
            number,
            command,
            time_limit=self.time_limit,
            motion=motion,
            speed=speed,
            show=lambda text: print(text, end="", flush=True),
            stop_seen=stop_seen,
        )
        if result.output_tail and not result.output_tail.endswith("\n"):
            print()
        for unit, most in result.tracking_max.items():
            print(f"measured: at most {most:.3g} {unit} off the plan")
        why = f": {result.reason}" if result.reason else ""
        if result.outcome == "not_moved":
            said = f"the arm did not move{why}; trial {number} may be executed again"
        elif result.outcome == "unknown":
            said = f"trial {number}{why}; nobody knows what moved: look, then ask again"
        elif motion != "trial":
            if result.succeeded:
                return 0
            said = f"the {motion} was aborted{why}; trial {number} was not executed"
        else:
            trial = workspace.state.trial(number)
            said = f"trial {number}: {say_trial(workspace, trial)}"
            if result.outcome == "aborted":
                said += f"; if the object flew all the same, tell trial {number}"
            elif not execution_warning(workspace, trial):
                print_next(workspace)
                return 0
        complain(said)
        aborted = result.outcome == "aborted" and motion == "trial"
        if aborted and sys.stdin.isatty() and says_yes(f"void trial {number}?"):
            workspace.session().void(number, result.reason)
            print(f"trial {number} is void; nothing is learned from it")
        if result.outcome != "unknown":
            print_next(workspace)
        return 0 if result.succeeded else 1


@dataclass(frozen=True)
class Tell(Seen):
    """Report what was seen of a trial.

    For example:
        prior-reinforce tell hoop 3 "5cm long, 2cm left"
        prior-reinforce tell "5cm long"
        prior-reinforce tell hoop --from tracker.csv
    """

    table: Annotated[Path | None, tyro.conf.arg(name="from")] = None
    """Or a table with a row a trial, such as a tracker writes: trial, x, y (where the object ended,
    units as in x_cm) or said (words), and hit. Rows that were told already are passed over."""

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        if self.table is not None:
            self._tell_table(workspace, self.table, words)
        else:
            number, (seen, hit) = self.read(workspace, words)
            _warn_of_its_execution(workspace, number)
            trial = workspace.session().tell(number, seen, hit=hit)
            print(f"trial {trial.number}: {_say_told(workspace, trial)}")
        print_next(workspace)

    def _tell_table(self, workspace: Workspace, path: Path, words: tuple[str, ...]) -> None:
        if words or (self.error, self.outcome, self.hit, self.miss) != (None, None, False, False):
            raise ConfigurationError("--from tells what its table says; drop what else was given")
        rows, session = rows_to_tell(path, workspace), workspace.session()
        for number, (seen, hit) in rows:
            _warn_of_its_execution(workspace, number)
            trial = session.tell(number, seen, hit=hit)
            print(f"trial {trial.number}: {say_trial(workspace, trial)}")
        if not rows:
            print(f"{path} says nothing that was not told already")


@dataclass(frozen=True)
class Amend(Seen):
    """Correct what was told of a trial, of any goal.

    For example:
        prior-reinforce amend hoop 3 "5cm short"
    """

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        number, (seen, hit) = self.read(workspace, words)
        trial = workspace.session().amend(number, seen, hit=hit)
        print(f"trial {trial.number}, corrected: {_say_told(workspace, trial)}")
        _print_outdated(workspace)
        print_next(workspace)


@dataclass(frozen=True)
class Void(OnWorkspace):
    """Declare that a trial is not data: the ball slipped, the arm stopped.

    For example:
        prior-reinforce void hoop 3 --reason "ball slipped"
    """

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] [TRIAL]")] = ()
    """The workspace (the current folder's if not given), and the trial's number (the one that waits
    if not given)."""
    reason: str = ""
    """Why, for the log and the report."""

    takes_words = True

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        number, rest = trial_and_rest(workspace, words)
        if rest:
            raise ConfigurationError(f"unexpected {rest[0]!r}; say why with --reason")
        trial = workspace.session().void(number, self.reason)
        print(f"trial {trial.number}: {say_trial(workspace, trial)}; nothing is learned from it")
        _print_outdated(workspace)
        print_next(workspace)


@dataclass(frozen=True)
class Export(OnWorkspace):
    """Write a trial's plan in another form: NPZ, CSV, or JSON in ROS 2's JointTrajectory order.

    For example:
        prior-reinforce export hoop 3 plan.json
        prior-reinforce export hoop 3 plan.csv --rate 500
    """

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] [TRIAL] FILE")] = ()
    """The workspace (the current folder's if not given), the trial's number (the one that waits if
    not given), and the file: .npz, .csv or .json."""
    rate: float | None = None
    """Samples a second; the plan's own frames if not given."""

    takes_words = True

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        number, rest = trial_and_rest(workspace, words)
        if len(rest) != 1:
            raise ConfigurationError("say the file to write after the trial: .npz, .csv or .json")
        written = workspace.export(number, check_path(Path(rest[0])), rate=self.rate)
        print(f"written: {written.path}  sha256 {written.sha256}")


def _cut_off(workspace: Workspace) -> Trial | None:
    """The trial that was executing when the program stopped, if any."""
    trial = workspace.state.open_trial
    if trial is None or trial.stage is not Stage.EXECUTING or workspace.log.is_executing():
        return None
    return trial


def _is_there(workspace: Workspace, trial: Trial, where: str) -> bool:
    """Whether the arm stands where the plan begins, as far as a command says."""
    from prior_reinforce.bench.robots.executors.pose import compare_pose, read_pose

    assert trial.plan is not None
    form = workspace.manifest.format
    try:
        said, there = compare_pose(
            read_pose(where, form), trial.plan[0], form, workspace.manifest.gate
        )
    except ConfigurationError as error:
        complain(f"{error}; nothing moved")
        return False
    if there:
        print(said)
    else:
        complain(f"{said}; move it there, then ask again")
    return there


def _say_told(workspace: Workspace, trial: Trial) -> str:
    """What was told as it was understood, and that numbers had no unit, if so."""
    said = say_trial(workspace, trial)
    typed = trial.reading.said if trial.reading is not None else ""
    no_unit = bool(typed) and typed not in said
    bare = bare_units(workspace.manifest.outcome_units)
    return f"{said}; numbers without a unit are {bare}" if no_unit else said


def _warn_of_its_execution(workspace: Workspace, number: int) -> None:
    """Say before a reading is taken what could make it mislead."""
    trial = workspace.state.trial(number)
    warning = execution_warning(workspace, trial) if trial.open else ""
    if warning:
        warn(
            f"trial {number} was executed, {warning}; if that spoiled it, void it: a told "
            "trial can be voided too"
        )


def _print_outdated(workspace: Workspace) -> None:
    """Say so where the trial that waits was planned before a correction."""
    trial = workspace.state.open_trial
    if trial is not None and trial.stage is Stage.ASKED and trial.outdated:
        print(f"trial {trial.number} was {OUTDATED}")


def arm_of(workspace: Workspace, own: str | None) -> ArmSettings | None:
    """The arm that the manifest names; None where it names none.

    Args:
        workspace: Whose arm.
        own: Its executor, where it is the user's own: nothing in the folder may start code.

    Raises:
        ConfigurationError: `own` is not the class that the manifest names, or is missing.
    """
    arm = workspace.manifest.driven_by
    named = None if arm is None else own_class(arm.executor)
    if own != named:
        executor = "no executor of one's own" if arm is None else arm.executor
        raise ConfigurationError(
            f"[arm] names {executor}, and a manifest starts no code of its own; "
            f"{'drop --executor' if own else f'add --executor {executor}'}"
        )
    return arm


def _ask_whether_it_moved() -> bool:
    while True:
        try:
            answer = answer_to("did the arm move? (yes/no) ").strip().lower()
        except EOFError as error:
            raise ConfigurationError(
                "no answer; ask again, with --arm-did-not-move if it did not"
            ) from error
        if answer in {"y", "yes", "n", "no"}:
            return answer.startswith("y")

"""Commands on the plans of trials: ask, which may execute one, and export."""

from __future__ import annotations

import io
import sys
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from msgspec import to_builtins

from prior_reinforce.arm.executing.base import ArmSettings, Motion
from prior_reinforce.arm.executing.lock import last_stop
from prior_reinforce.arm.executing.result import MotionResult
from prior_reinforce.arm.robots.plan_files import check_plan_path
from prior_reinforce.arm.workspace.execute import (
    FULL_SPEED,
    ask_to_move,
    execute,
    is_fast,
    look_at_arm,
    note_not_moved,
    recover,
    say_look,
    to_execute,
)
from prior_reinforce.arm.workspace.state import Standing
from prior_reinforce.arm.workspace.text import (
    execution_warning,
    next_step,
    say_expectation,
    say_left_out,
    say_outdated,
    say_trial,
)
from prior_reinforce.arm.workspace.view import AskView, trial_view
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands import complain
from prior_reinforce.commands.base import (
    Json,
    OnWorkspace,
    Words,
    print_checked,
    print_json,
    print_next,
    trial_and_rest,
)
from prior_reinforce.commands.questions import agrees, answer_after
from prior_reinforce.commands.workspace import print_goal
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.files import check_path
from prior_reinforce.parsing import as_place
from prior_reinforce.session.trials import SessionState, Trial
from prior_reinforce.terminal import RED, coloured
from prior_reinforce.wording import in_words, say_place, to_words, too_far

if TYPE_CHECKING:
    from prior_reinforce.arm.executing.drive import Look


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
    yes: bool = False
    """Move without asking whether the arm may move now."""
    check: bool = False
    """Check everything that --run or --execute needs, and move nothing."""
    time_limit: float = 120.0
    """Seconds that the command may take; with --execute, beyond the plan's own duration."""
    arm_did_not_move: bool = False
    """After a crash while executing, or a command that failed: a person saw that nothing moved."""
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
            print_json(self._view(workspace))
        return status

    def _view(self, workspace: Workspace) -> AskView:
        """The trial as it stands now."""
        now, form = workspace.standing, workspace.manifest.format
        trial = now.state.trials[-1]
        plan, out = workspace.plan(trial), self._out_of(trial.number)
        verdict, ended = (
            workspace.gate(plan.actions, trial.condition),
            now.state.executions.get(trial.number),
        )
        return AskView(
            trial=trial_view(now, trial),
            first_pose=dict(zip(form.names, plan.actions[0].tolist(), strict=True)),
            gate=verdict.as_json() if verdict is not None else None,
            written=None if out is None else str(out),
            execution=to_builtins(ended) if ended is not None else None,
            next=next_step(now),
        )

    def _ask(self, workspace: Workspace, stop_seen: int) -> int:
        now = workspace.standing
        self._check_out(now.state)
        if self.goal is not None:
            place, goals = " ".join(self.goal), now.state.goals
            known, shown = workspace.manifest.outcome_format, workspace.demonstrations.outcomes_seen
            if not goals or goals[-1].goal.tolist() != [*as_place(place, known, shown)]:
                workspace.set_goal(place)
            print_goal(workspace, place)
        session = workspace.session()
        recovered = recover(workspace)
        if recovered is not None:
            print(f"trial {recovered.number}: {say_trial(workspace.standing, recovered)}")
        did_not_move, cut = self.arm_did_not_move, now.executing
        if cut is not None and not did_not_move and sys.stdin.isatty() and not now.moving:
            print(f"trial {cut.number}: {say_trial(now, cut)}")
            if _ask_whether_it_moved():
                print_next(workspace)
                return 1
            did_not_move = True
        if did_not_move:
            note_not_moved(workspace)
        reached_before = now.state.solved
        trial = session.ask()
        self._show(workspace, now, trial, reached_before)
        if now.state.stage(trial) == "executed":
            if self.run_command or self.execute:
                to_execute(workspace, trial.number)  # which refuses
            print("it was executed already")
        elif self.execute:
            return self._on_arm(workspace, trial, stop_seen)
        elif self.run_command is not None and not self.check:
            return self._move(workspace, trial, self.run_command, stop_seen)
        else:
            wait = "execute it, then say where the object went:"
            print("checked; nothing moved" if self.check else wait)
            goal = now.state.goal_of(trial).goal
            if side := too_far(goal, workspace.manifest.outcome_format):
                print(f"(words are of somebody behind the robot: here, too far is {side})")
        print_next(workspace)
        return 0

    def _on_arm(self, workspace: Workspace, trial: Trial, stop_seen: int) -> int:
        """Look at the arm, ask a person, and let its executor move it."""
        arm = workspace.manifest.driven_by
        if arm is None:
            raise ConfigurationError(
                f"{workspace.folder} names no arm; add [arm] with its executor to the manifest, "
                "or give a command with --run"
            )
        speed = 1.0 if self.rehearse is None else self.rehearse
        look = look_at_arm(workspace, trial.number, arm, speed=speed)
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
            status = self._move(workspace, trial, arm, stop_seen, look, motion, share)
            if status != 0:
                break
        return status

    def _move(
        self,
        workspace: Workspace,
        trial: Trial,
        by: str | ArmSettings,
        stop_seen: int,
        look: Look | None = None,
        motion: Motion = "trial",
        speed: float = 1.0,
    ) -> int:
        """Make a motion, if a person says that the arm may move now."""
        question = ask_to_move(workspace, trial, look, motion, speed)
        stop = "Ctrl-C stops the command" if look is None else "Ctrl-C stops the arm"
        question = f"{question} {stop}; keep the arm's own stop button in your hand."
        word = "rehearse" if motion == "rehearsal" else "throw"
        answer = f"{word} {trial.number}" if is_fast(motion, speed) else "yes"
        shown = question.replace(FULL_SPEED, coloured(FULL_SPEED, RED, sys.stdin))
        if not (self.yes or agrees(shown, answer)):
            print("nothing moved; run ask again when the area is clear")
            return 1
        result = execute(
            workspace,
            trial.number,
            by,
            time_limit=self.time_limit,
            motion=motion,
            speed=speed,
            show=lambda text: print(text, end="", flush=True),
            stop_seen=stop_seen,
            stood=None if look is None else look.pose,
        )
        return _say_ended(workspace, trial.number, motion, result)

    def _check_flags(self) -> None:
        """Say what cannot be before anything is changed."""
        from prior_reinforce.arm.executing.arguments import check_command

        if self.run_command is not None:
            check_command(self.run_command, time_limit=self.time_limit)
        moves = self.run_command is not None or self.execute
        if moves and not (self.yes or self.check or sys.stdin.isatty()):
            raise ConfigurationError(
                "a person at a terminal says that the arm may move, no pipe: run it in a terminal, "
                "or add --yes"
            )
        if self.execute and self.run_command is not None:
            raise ConfigurationError("--execute moves the arm itself; drop --run")
        if not self.execute and (self.approach or self.rehearse is not None):
            raise ConfigurationError("--approach and --rehearse go with --execute")
        if self.rehearse is not None and not 0 < self.rehearse < 1:
            raise ConfigurationError(
                f"--rehearse must be a fraction of the speed, such as 0.2, got {self.rehearse:g}"
            )
        if self.rate is not None and self.out is None:
            raise ConfigurationError(
                "--rate is of the file that --out writes; --run is given the plan's own frames"
            )

    def _show(
        self, workspace: Workspace, now: Standing, trial: Trial, reached_before: bool
    ) -> None:
        """Print where the trial aims and what the gate says, and write --out."""
        manifest, state = workspace.manifest, now.state
        outcome, goal = manifest.outcome_format, state.goal_of(trial).goal
        aims = f"trial {trial.number}: aims at {say_place(trial.condition, outcome)}"
        beside = to_words(trial.condition - goal, outcome) if in_words(outcome) else ""
        if beside and beside != to_words(0.0 * goal, outcome):
            aims += f" ({beside} of the goal, so that it lands there)"
        print(aims)
        expected = say_expectation(now, trial)
        for line in (*expected, *say_left_out(state), *say_outdated(state)):
            print(line)
        if reached_before:
            print("the goal is reached already: this trial repeats it")
        unchecked = "no robot in the manifest, no limits checked"
        print_checked(unchecked if trial.verdict is None else trial.verdict.text())
        print(f"plan: {workspace.plan_file(trial).path}")
        form = manifest.format
        first = zip(form.names, trial.plan[0].round(4) + 0.0, form.units, strict=True)
        begins = [f"{name} {q:.4g} {unit}" for name, q, unit in first]
        if moved := form.increments:
            begins = [of for i, of in enumerate(begins) if i not in moved]
            begins.append(f"the pose where demonstrations of {form.names[moved[0]]} began")
        print(
            f"it begins at {', '.join(begins)}"
            + ("" if self.execute else ": move the arm there slowly first")
        )
        out = self._out_of(trial.number)
        if out is not None:
            print(f"written: {workspace.export(trial.number, out, rate=self.rate).path}")

    def _out_of(self, number: int) -> Path | None:
        """Where --out puts the plan of a trial."""
        if self.out is None:
            return None
        out = self.out / "trial-{trial}.npz" if self.out.is_dir() else self.out
        return Path(str(out).replace("{trial}", str(number)))

    def _check_out(self, state: SessionState) -> None:
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


def _say_ended(workspace: Workspace, number: int, motion: Motion, result: MotionResult) -> int:
    """Say what became of a motion for a trial, and what comes next; the exit status."""
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
            if motion == "rehearsal":
                print_next(workspace)
            return 0
        said = f"the {motion} was aborted{why}; trial {number} was not executed"
    else:
        now = workspace.standing
        trial = now.state.trial(number)
        said = f"trial {number}: {say_trial(now, trial)}"
        if result.outcome == "aborted":
            said += f"; if the object flew all the same, tell trial {number}"
        elif not execution_warning(now, trial):
            print_next(workspace)
            return 0
    complain(said)
    aborted = result.outcome == "aborted" and motion == "trial"
    if aborted and sys.stdin.isatty() and agrees(f"void trial {number}?"):
        workspace.session().void(number, result.reason)
        print(f"trial {number} is void; nothing is learned from it")
    if result.outcome != "unknown":
        print_next(workspace)
    return 0 if result.succeeded else 1


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


def _ask_whether_it_moved() -> bool:
    while True:
        try:
            answer = answer_after("did the arm move?", 'type "yes" or "no": ')
        except EOFError as error:
            raise ConfigurationError(
                "no answer; ask again, with --arm-did-not-move if it did not"
            ) from error
        if answer in ("yes", "no"):
            return answer == "yes"

"""Executing a plan by a command: whatever drives the arm, in processes of its own.

Bindings of robot libraries exclude each other in one process, and the session must outlive a
driver that crashes or hangs; so the plan's file is given to a command. A supervisor
(`supervisor.py`) runs it and lives until everything that the command started has ended, whatever
becomes of this program.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from prior_reinforce.arm.executing.arguments import check_command, split_command
from prior_reinforce.arm.executing.lock import ExecutingLock, executing_lock
from prior_reinforce.arm.executing.result import (
    NOT_MOVED_STATUS,
    DriverResult,
    MotionResult,
    Outcome,
    by_unit,
    read_driver_result,
)
from prior_reinforce.arm.executing.supervision import (
    ENDED_FILE,
    OUTPUT_FILE,
    Ended,
    Interruptions,
    read_ended,
    supervise,
)
from prior_reinforce.arm.robots.plan_files import PlanFile
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.files import write_once
from prior_reinforce.terminal import plain


def run_command(
    command: str,
    plan: PlanFile,
    *,
    time_limit: float,
    arm: str = "",
    show: Callable[[str], None] | None = None,
) -> MotionResult:
    """Run `mycontroller {plan}` in processes of its own, and wait for all that it starts.

    No limit is checked here (`check_plan` does). One motion is made at a time. At the time limit,
    and when this program is interrupted or stopped (Ctrl-C, Ctrl-Z), the command and everything it
    started are asked to stop (SIGTERM), and killed two seconds later. The command has this
    program's standard input, so it can ask a person at the terminal.

    Args:
        command: Program and arguments, `{plan}` among them.
        plan: What is to be executed; its hash is checked first, and the command gets a copy.
        time_limit: In [s].
        arm: Name of the arm, where this computer moves several.
        show: Called with its output as it comes.

    Raises:
        ConfigurationError: A command or a limit that cannot be used, or a program that cannot be
            started; nothing has run then.
        FileFormatError: The plan is not what its hash says; nothing has run.
        TrialStateError: The arm is moved by somebody else; nothing has run.
        KeyboardInterrupt: Interrupted before anything ran, or later, once all has ended.
        BaseException: What `show` or a signal's handler raised, once all has ended.
    """
    with (
        tempfile.TemporaryDirectory() as folder,
        executing_lock(arm=arm) as lock,
        Interruptions() as interruptions,
    ):
        return execute_command(
            command,
            plan,
            Path(folder),
            time_limit=time_limit,
            lock=lock,
            interruptions=interruptions,
            show=show,
        )


def execute_command(
    command: str,
    plan: PlanFile,
    folder: Path,
    *,
    time_limit: float,
    lock: ExecutingLock,
    interruptions: Interruptions,
    show: Callable[[str], None] | None = None,
) -> MotionResult:
    """`run_command` under a lock that is held, with an empty folder for `{result}`.

    If it raises ConfigurationError, FileFormatError or KeyboardInterrupt, nothing has run.
    """
    check_command(command, time_limit=time_limit)
    copy = write_once(_copy_in(folder, plan), plan.verify())
    arguments = split_command(command, copy, folder)
    if interruptions.came:
        raise KeyboardInterrupt
    ended = supervise(
        arguments, folder, time_limit=time_limit, interruptions=interruptions, lock=lock, show=show
    )
    with suppress(OSError):  # a driver may delete its files; that it ran must stay to be found
        folder.mkdir(exist_ok=True)
        if not folder.is_symlink():
            (folder / OUTPUT_FILE).touch()
    if ended is not None and ended.not_started and not ended.interrupted:
        raise ConfigurationError(
            f"cannot start {arguments[0]!r} ({ended.not_started}); give the path of a program that "
            "can run"
        )
    return _result(ended, folder, plan)


def ask_arm(command: str, arguments: tuple[str, ...], folder: Path, *, time_limit: float) -> None:
    """Run a command that moves nothing, to its end, within a time limit in [s].

    `command` is what messages call it, `folder` is empty, for what watches over it.
    ConfigurationError if it cannot be started, fails, or takes too long; KeyboardInterrupt once all
    has ended.
    """
    with Interruptions() as noted:
        ended = supervise(arguments, folder, time_limit=time_limit, interruptions=noted)
    ended = ended or Ended(not_started="what watched over it was killed")
    if ended.not_started or ended.fault or ended.timed_out or ended.exit_status:
        said = ended.not_started or ended.fault or ended.output_tail.strip() or "no output"
        why = f"no answer within {time_limit:g} s" if ended.timed_out else said.splitlines()[-1]
        raise ConfigurationError(
            f"{command!r} did not say where the arm stands: {why}; mend that, then ask again"
        )


def read_result(folder: Path, plan: PlanFile) -> MotionResult | None:
    """How the command of a folder ended, where its supervisor wrote it down; None if it did not."""
    ended = _ended(folder)
    if ended is None or ended.not_started or ended.fault:
        return None  # a person has to say what moved
    return _result(ended, folder, plan)


def was_executed(folder: Path) -> bool:
    """Whether a folder's command may have moved the arm."""
    ended = _ended(folder)
    return (folder / OUTPUT_FILE).exists() and (ended is None or not ended.not_started)


def _ended(folder: Path) -> Ended | None:
    try:
        with (folder / ENDED_FILE).open("rb") as file:
            return read_ended(file)
    except OSError:
        return None


def _copy_in(folder: Path, plan: PlanFile) -> Path:
    """The plan that the command reads, which nothing but the command knows of."""
    return folder / f"plan{plan.path.suffix}"


def _result(ended: Ended | None, folder: Path, plan: PlanFile) -> MotionResult:
    """What became of a motion, from how its command ended and what the driver says."""
    if ended is None:
        why = "what watched over the command was killed, or found no room on the disk"
        return MotionResult(outcome="unknown", reason=why)
    if ended.not_started:
        return MotionResult(outcome="not_moved", reason=ended.not_started)
    if ended.fault:
        why = f"it could not be watched ({plain(ended.fault)}) and was stopped"
        return MotionResult(outcome="unknown", reason=why)
    status = ended.exit_status
    try:
        said = read_driver_result(folder)
    except FileFormatError as error:
        said = DriverResult("aborted", str(error))
    outcome: Outcome = "done" if status == 0 else "aborted"
    reason = "" if status == 0 else f"the command ended with status {status}"
    if status == NOT_MOVED_STATUS:
        outcome, reason = "not_moved", "the command says that the arm did not move"
    if said is not None and status in (0, NOT_MOVED_STATUS):
        outcome, reason = said.outcome, said.reason
    elif said is not None and said.outcome != "done":
        outcome, reason = "aborted", said.reason or reason
    copy = _copy_in(folder, plan)
    if outcome == "done" and copy.exists():  # a driver may delete its folder
        try:
            replace(plan, path=copy).verify()
        except FileFormatError as error:
            outcome, reason = "aborted", f"the plan was changed while it was executed: {error}"
    # Stopped, it may have moved since it wrote anything.
    if ended.timed_out or ended.interrupted:
        when = "at its time limit" if ended.timed_out else "by Ctrl-C, Stop or another signal"
        left = f"; still running were {ended.left_running}" if ended.left_running else ""
        outcome, reason = "aborted", f"the command was stopped {when}{left}"
        if ended.unstoppable:
            reason = f"it could not be stopped {when}: {ended.unstoppable} of another user"
    return MotionResult(
        exit_status=status,
        timed_out=ended.timed_out,
        seconds=ended.seconds,
        output_tail=ended.output_tail,
        interrupted=ended.interrupted,
        outcome=outcome,
        reason=plain(reason),
        start_error={} if said is None else by_unit(said.start_error),
        tracking_rms={} if said is None else by_unit(said.tracking_rms),
    )

"""Executing a plan by a command: whatever drives the arm, in processes of its own.

Bindings of robot libraries exclude each other in one process, and the session must outlive a
driver that crashes or hangs; so the plan's file is given to a command. A supervisor
(`supervisor.py`) runs it and lives until everything that the command started has ended, whatever
becomes of this program.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from msgspec import structs

from prior_reinforce.bench.robots.executors.arguments import check_command, split, split_command
from prior_reinforce.bench.robots.executors.lock import ExecutingLock, executing_lock
from prior_reinforce.bench.robots.executors.result import (
    NOT_MOVED_STATUS,
    DriverResult,
    MotionResult,
    Outcome,
    by_unit,
    read_driver_result,
)
from prior_reinforce.bench.robots.executors.supervision import (
    ENDED_FILE,
    OUTPUT_FILE,
    Interruptions,
    supervise,
)
from prior_reinforce.bench.robots.plan_files import PlanFile
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.files import write_once
from prior_reinforce.wording import plain


class CommandResult(MotionResult, frozen=True, kw_only=True):
    """How a command that was given a plan ended."""

    command: tuple[str, ...]
    """Program and arguments as they were started."""

    @property
    def succeeded(self) -> bool:
        """Whether the plan was executed to its end."""
        return self.outcome == "done"

    def as_json(self) -> dict[str, Any]:
        """The same as plain data for the journal, without the command: it may hold passwords."""
        return {key: value for key, value in structs.asdict(self).items() if key != "command"}


def run_command(
    command: str,
    plan: PlanFile,
    *,
    time_limit: float,
    arm: str = "",
    show: Callable[[str], None] | None = None,
) -> CommandResult:
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
        result, raised = execute_command(
            command,
            plan,
            Path(folder),
            time_limit=time_limit,
            lock=lock,
            interruptions=interruptions,
            show=show,
        )
    if raised is not None:
        raise raised
    if interruptions.came:
        raise KeyboardInterrupt
    return result


def execute_command(
    command: str,
    plan: PlanFile,
    folder: Path,
    *,
    time_limit: float,
    lock: ExecutingLock,
    interruptions: Interruptions,
    show: Callable[[str], None] | None = None,
) -> tuple[CommandResult, BaseException | None]:
    """`run_command` under a lock that is held, with an empty folder for `{result}`.

    Returns:
        How it ended, and what `show` or a signal's handler raised, which stopped the command.

    Raises:
        ConfigurationError, FileFormatError, KeyboardInterrupt: Nothing has run.
    """
    check_command(command, time_limit=time_limit)
    copy = write_once(_copy_in(folder, plan), plan.verify())
    arguments = split_command(command, copy, folder)
    if interruptions.came:
        raise KeyboardInterrupt
    ended, raised = supervise(
        arguments, folder, time_limit=time_limit, interruptions=interruptions, lock=lock, show=show
    )
    with suppress(OSError):  # a driver may delete its files; that it ran must stay to be found
        folder.mkdir(exist_ok=True)
        if not folder.is_symlink():
            (folder / OUTPUT_FILE).touch()
    if ended is not None and not ended["started"]:
        raise ConfigurationError(
            f"cannot start {arguments[0]!r} ({ended['error']}); give the path of a program that "
            "can run"
        )
    return _result(arguments, ended, folder, plan), raised


def read_ended(folder: Path, command: str, plan: PlanFile) -> CommandResult | None:
    """How the command of a folder ended, where its supervisor wrote it down; None if it did not."""
    with suppress(OSError, ValueError, KeyError, TypeError):  # a person has to say what moved
        ended = json.loads((folder / ENDED_FILE).read_bytes())
        if ended["started"]:
            return _result(tuple(split(command)), ended, folder, plan)
    return None


def was_executed(folder: Path) -> bool:
    """Whether a folder's command may have moved the arm."""
    try:
        begun = (folder / OUTPUT_FILE).exists()
        return begun and not (folder / ENDED_FILE).read_bytes().startswith(b'{"started": false')
    except OSError:
        return begun


def _copy_in(folder: Path, plan: PlanFile) -> Path:
    """The plan that the command reads, which nothing but the command knows of."""
    return folder / f"plan{plan.path.suffix}"


def _result(
    arguments: tuple[str, ...], ended: dict[str, Any] | None, folder: Path, plan: PlanFile
) -> CommandResult:
    """What became of a motion, from how its command ended and what the driver says."""
    if ended is None:
        why = "what watched over the command was killed, or found no room on the disk"
        return CommandResult(command=arguments, outcome="unknown", reason=why)
    status = int(ended["exit_status"])
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
    if ended["timed_out"] or ended["interrupted"]:
        when = "at its time limit" if ended["timed_out"] else "by a signal"
        left = f"; still running were {ended['left_running']}" if ended["left_running"] else ""
        outcome, reason = "aborted", f"the command was stopped {when}{left}"
        if ended["unstoppable"]:
            reason = f"it could not be stopped {when}: {ended['unstoppable']} of another user"
    return CommandResult(
        command=arguments,
        exit_status=status,
        timed_out=bool(ended["timed_out"]),
        seconds=float(ended["seconds"]),
        output_tail=str(ended["output_tail"]),
        interrupted=bool(ended["interrupted"]),
        outcome=outcome,
        reason=plain(reason),
        start_error={} if said is None else by_unit(said.start_error),
        tracking_rms={} if said is None else by_unit(said.tracking_rms),
    )

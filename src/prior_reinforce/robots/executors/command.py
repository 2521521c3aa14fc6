"""Executing a plan by a command: whatever drives the arm, in a process of its own.

Bindings of robot libraries exclude each other in one process, and the session must outlive a
driver that crashes or hangs; so the plan's file is given to a command, and its exit status and the
end of its output come back.
"""

from __future__ import annotations

import contextlib
import math
import os
import shlex
import shutil
import signal
import subprocess
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.files import PlanFile

_PLAN = "{plan}"
_TAIL_BYTES = 4000
"""Kept of the command's output: the last screenful, where a driver says why it stopped."""
_GRACE = 2.0
"""Between asking a command to stop and killing it, in [s]: time to bring an arm to rest."""
_LOOK = 0.02
"""How often it is looked at meanwhile, in [s]."""


@dataclass(frozen=True)
class CommandResult:
    """How a command that was given a plan ended."""

    command: tuple[str, ...]
    """Program and arguments as they were started."""
    exit_status: int
    """Status the command ended with; minus the signal's number if a signal ended it."""
    timed_out: bool
    """Whether it was stopped at its time limit. The arm may have moved."""
    seconds: float
    """How long it ran."""
    output_tail: str
    """The end of what it wrote to its output and error streams, in order."""

    @property
    def succeeded(self) -> bool:
        """Whether the command ended by itself with status 0."""
        return self.exit_status == 0 and not self.timed_out

    def as_json(self) -> dict[str, Any]:
        """The same as plain data for the journal."""
        return asdict(self) | {"command": list(self.command)}


def split_command(command: str, plan: Path) -> tuple[str, ...]:
    """Program and arguments, with `{plan}` replaced by the file's path within one argument.

    The text is split as a shell would, but no shell ever sees it: nothing in a path can become a
    second command.

    Raises:
        ConfigurationError: Quotes that do not match, no program, or no `{plan}`.
    """
    try:
        arguments = shlex.split(command)
    except ValueError as error:
        raise ConfigurationError(
            f"cannot split the command {command!r} ({error}); close its quotes"
        ) from error
    if not any(_PLAN in argument for argument in arguments[1:]):
        raise ConfigurationError(
            f"the command {command!r} must name a program and hold {_PLAN} where the plan's path "
            'goes, for instance "mycontroller {plan}"'
        )
    path = str(plan.resolve())
    return tuple(argument.replace(_PLAN, path) for argument in arguments)


def check_command(command: str, *, time_limit: float) -> None:
    """Do nothing if a command and its limit could be used; arguments as in `run_command`.

    Raises:
        ConfigurationError: It cannot be split, names no program that can run, or lacks `{plan}`;
            or the limit is not a positive number.
    """
    if not (math.isfinite(time_limit) and time_limit > 0):
        raise ConfigurationError(f"the time limit must be a positive number, got {time_limit} s")
    program = split_command(command, Path("plan"))[0]
    if shutil.which(program) is None:
        raise ConfigurationError(
            f"cannot start {program!r}; give the path of a program that can run"
        )


def run_command(
    command: str, plan: PlanFile, *, time_limit: float, keep_open: tuple[int, ...] = ()
) -> CommandResult:
    """Run `mycontroller {plan}` in a process of its own and wait for it.

    At the time limit the command and everything it started are asked to stop (SIGTERM), and killed
    two seconds later.

    Args:
        command: Program and arguments, `{plan}` among them.
        plan: What is to be executed; its hash is checked first.
        time_limit: In [s].
        keep_open: File descriptors that the command inherits, so that a lock on them lasts as long
            as it runs.

    Raises:
        ConfigurationError: A command or a limit that cannot be used, or a program that cannot be
            started; nothing has run then.
        FileFormatError: The plan is no longer what its hash says; nothing has run.
    """
    check_command(command, time_limit=time_limit)
    plan.verify()
    arguments = split_command(command, plan.path)
    with tempfile.TemporaryFile() as output:
        start = time.monotonic()
        try:
            process = subprocess.Popen(
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                pass_fds=keep_open,
            )
        except (OSError, ValueError) as error:
            raise ConfigurationError(
                f"cannot start {arguments[0]!r} ({error}); give the path of a program that can run"
            ) from error
        timed_out = False
        try:
            process.wait(time_limit)
        except subprocess.TimeoutExpired:
            timed_out = True
            _stop(process)
        except BaseException:
            # Ctrl-C: a driver must not go on without its session.
            _stop(process)
            raise
        return CommandResult(
            command=arguments,
            exit_status=process.returncode,
            timed_out=timed_out,
            seconds=time.monotonic() - start,
            output_tail=_tail(output),
        )


def _stop(process: subprocess.Popen[bytes]) -> None:
    """Stop the command and everything it started: ask, wait, kill; then collect its status."""
    # The group is gone when all of it went by itself (macOS says so by PermissionError). A shell
    # goes at once and leaves its driver behind: it is the group that is waited for.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGTERM)
        end = time.monotonic() + _GRACE
        while time.monotonic() < end:
            process.poll()  # a process that nobody collected still counts as one of its group
            os.killpg(process.pid, 0)
            time.sleep(_LOOK)
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _tail(output: IO[bytes]) -> str:
    size = output.seek(0, os.SEEK_END)
    output.seek(max(0, size - _TAIL_BYTES))
    return output.read().decode(errors="replace")

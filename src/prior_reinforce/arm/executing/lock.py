"""Whether an arm moves right now, or a trial is being executed: by us, or by what we started.

The journal cannot tell: its last word on such a trial is `moving`, whether the program that
wrote it still runs or died. Locks can, because the system frees them when their last holder is
gone, and the supervisor and the command hold them too. There are two: `flock` on the workspace's
folder, and, for the arm, a Linux abstract socket: one for all workspaces and users of a computer.
Neither is a file that somebody could delete.

A command that closes what it inherited, as Python's `subprocess` does, holds neither. What executes
is therefore marked in its environment, which children inherit, and found by that mark in /proc.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from prior_reinforce.arm.executing.supervisor import processes
from prior_reinforce.errors import ConfigurationError, TrialStateError, WorkspaceError

ARM_VARIABLE = "PRIOR_REINFORCE_ARM"
"""Environment variable that names the arm where nothing else does."""
MARK = "PRIOR_REINFORCE_EXECUTION"
"""Environment variable of what executes: the names of its locks."""
GRACE = 2.0
"""Between asking a command to stop and killing it, in [s]: time to bring an arm to rest."""
STOP_FILE = ".stopped"
"""In a workspace; its time is that of the last stop."""
_HANGS = 60.0
"""In [s]; ours: no computer takes so long to start a program, be it ever so busy."""
# Ours: longer than a look at a lock ever holds it, shorter than any execution.
_WAIT_S = 1.0
_POLL_S = 0.01


@dataclass(frozen=True)
class ExecutingLock:
    """The right to move an arm, for what is started to share."""

    descriptors: tuple[int, ...]
    """To keep open: as long as anything does, the lock is held."""
    names: tuple[str, ...]
    """To be marked with."""
    revoked: Callable[[], bool]
    """Whether the workspace was stopped since this was asked for: nothing begins or goes on."""


@contextmanager
def executing_lock(
    folder: Path | None = None, arm: str = "", stop_seen: int | None = None
) -> Iterator[ExecutingLock]:
    """Hold the right to move an arm, and, with the `folder` of a workspace, to execute its trial.

    Without a name, the arm is the one that PRIOR_REINFORCE_ARM names, or the one that all without a
    name share. `stop_seen` is `last_stop` of when the motion was asked for; now if not given.
    TrialStateError if somebody else holds it, or something that was executed still runs;
    WorkspaceError if the folder cannot be opened, or its file system has no locks.
    """
    deadline = time.monotonic() + _WAIT_S
    arm = arm or os.environ.get(ARM_VARIABLE, "")
    name = f"arm-{hashlib.sha256(arm.encode()).hexdigest()[:32]}"
    seen = last_stop(folder) if stop_seen is None else stop_seen
    with ExitStack() as stack:
        names, descriptors = [name], []
        if folder is not None:
            descriptors.append(stack.enter_context(_opened(folder)))
            names.append(_name_of_folder(folder))
            while not _flock(folder, descriptors[0], shared=False):
                _wait(deadline, f"a trial of {folder} is being executed")
        busy = (
            "this arm is moved by another workspace or program; if it is another arm, name each in "
            f"its manifest ([robot] arm) or in {ARM_VARIABLE}: a motion is being executed"
        )
        if sys.platform.startswith("linux"):  # elsewhere nothing is executed
            owner = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
            while not _bind(owner, name):
                _wait(deadline, busy)
            descriptors.append(owner.fileno())
        while any(map(marked, names)):
            _wait(deadline, busy)
        yield ExecutingLock(tuple(descriptors), tuple(names), lambda: last_stop(folder) != seen)


def is_executing(folder: Path) -> bool:
    """Whether a trial of the workspace in `folder` is being executed right now.

    WorkspaceError if the folder cannot be opened, or its file system has no locks.
    """
    with _opened(folder) as descriptor:
        return not _flock(folder, descriptor, shared=True) or bool(marked(_name_of_folder(folder)))


def programs_executing(folder: Path) -> list[tuple[int, str]]:
    """Process id and command line of what executes a trial of a workspace, supervisors left out.

    ConfigurationError if no processes can be looked at.
    """
    found = []
    for pid in marked(_name_of_folder(folder)):
        with suppress(OSError):  # it ended meanwhile
            words = Path("/proc", str(pid), "cmdline").read_bytes().split(b"\0")
            if not any(word.endswith(b"supervisor.py") for word in words):
                line = os.fsdecode(b" ".join(words)).strip()
                own = re.search(r" -c import sys; .*import (\S+);", line)  # see `drive.program`
                found.append((pid, f"python -m {own[1]}" if own else line))
    return found


def stop_executing(folder: Path) -> None:
    """Stop what executes a trial of a workspace, whoever started it, and wait for its end.

    The stop is noted, so that what was asked for before begins no further motion (`last_stop`).

    Its supervisor is asked, which asks the command, once, kills it after the grace, and notes how
    it ended; or whatever is left of both is asked. What else runs after twice the grace is killed,
    and a supervisor that hangs, much later: on a busy computer it may only be slow. WorkspaceError
    if the stop cannot be noted, ConfigurationError if what runs cannot be found.
    """
    try:
        _note_stop(folder)
    finally:  # what moves is stopped, whatever the disk says
        _stop_what_runs(_name_of_folder(folder))


def last_stop(folder: Path | None) -> int:
    """When a workspace was stopped last, in [ns]; 0 if never. Another value is a stop since."""
    try:
        return 0 if folder is None else os.lstat(folder / STOP_FILE).st_mtime_ns
    except FileNotFoundError:
        return 0


def _note_stop(folder: Path) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        with os.fdopen(os.open(folder / STOP_FILE, flags, 0o644), "wb") as file:
            os.utime(file.fileno(), ns=(time.time_ns(),) * 2)
    except OSError as error:
        raise WorkspaceError(
            f"{folder}: the stop cannot be noted ({error.strerror}); stop waiting commands too"
        ) from error


def _stop_what_runs(name: str) -> None:
    start = time.monotonic()
    asked = marked(name)
    for pid in asked:
        with suppress(OSError):
            status = Path("/proc", str(pid), "stat").read_text()  # pid (name) state parent ...
            if int(status.rpartition(")")[2].split()[1]) not in asked:
                os.kill(pid, signal.SIGTERM)
    while running := marked(name):
        late = time.monotonic() - start
        for pid in running:
            with suppress(OSError):
                supervises = b"supervisor.py" in Path("/proc", str(pid), "cmdline").read_bytes()
                if late > (_HANGS if supervises else 2 * GRACE):
                    os.kill(pid, signal.SIGKILL)
                os.kill(pid, signal.SIGCONT)  # a supervisor that somebody stopped (SIGSTOP)
        time.sleep(_POLL_S)


def marked(name: str) -> list[int]:
    """Processes whose environment bears a name; those of other users cannot be looked at.

    ConfigurationError if no processes can be looked at.
    """
    if not sys.platform.startswith("linux"):
        return []  # nothing is executed there
    found = []
    try:
        for pid in processes():
            with suppress(FileNotFoundError, ProcessLookupError, PermissionError):
                for variable in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0"):
                    key, _, value = variable.partition(b"=")
                    if key == MARK.encode() and name.encode() in value.split():
                        found.append(pid)
    except OSError as error:
        raise ConfigurationError(
            f"what moves cannot be found ({error.strerror}: {error.filename or '/proc'}); mount "
            "/proc, or close other programs; use the arm's own stop button if it moves"
        ) from error
    return found


def stop_marked(name: str, kill_at: float) -> None:
    """Stop all processes that bear a name, from a `time.monotonic` on by SIGKILL; wait for them.

    ConfigurationError if no processes could be looked at until then.
    """
    asked: set[tuple[int, int]] = set()
    while True:
        late = time.monotonic() > kill_at
        number = signal.SIGKILL if late else signal.SIGTERM
        try:
            running = marked(name)
        except ConfigurationError:
            if late:
                raise
        else:
            if not running:
                return
            for pid in running:
                if (pid, number) not in asked:
                    asked.add((pid, number))
                    with suppress(OSError):
                        os.kill(pid, number)
                        os.kill(pid, signal.SIGCONT)
        time.sleep(_POLL_S)


def _name_of_folder(folder: Path) -> str:
    stat = folder.stat()
    return f"folder-{stat.st_dev}-{stat.st_ino}"


def _wait(deadline: float, why: str) -> None:
    if time.monotonic() >= deadline:
        raise TrialStateError(f"{why} right now; wait for it, or stop its command")
    time.sleep(_POLL_S)


def _bind(owner: socket.socket, name: str) -> bool:
    """Take the arm; False if it is taken."""
    try:
        owner.bind(f"\0prior-reinforce-{name}")
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise ConfigurationError(
                f"the arm cannot be locked ({error.strerror}); let this program use Unix sockets"
            ) from error
        return False
    return True


@contextmanager
def _opened(folder: Path) -> Iterator[int]:
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise WorkspaceError(f"{folder}: {error.strerror}; make it a readable folder") from error
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _flock(folder: Path, descriptor: int, *, shared: bool) -> bool:
    """Take a lock; False if another program holds it."""
    import fcntl  # not on Windows, where all commands but a workspace's work

    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        raise WorkspaceError(
            f"{folder} cannot be locked ({error.strerror}); move the workspace to a local disk"
        ) from error
    return True

"""Whether a trial is being executed right now: by a program that lives, or by what it started.

The journal cannot tell: its last word on such a trial is `executing`, whether the program that
wrote it still runs or died. A lock can, because the system frees it when its last holder is gone.
The command that moves the arm holds it too: where our program is killed and the controller goes
on, the trial is still being executed. That takes `flock`, whose lock belongs to the open file that
both share; SQLite's, as in the journal, would end with our program.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from prior_reinforce.errors import TrialStateError, WorkspaceError

_FILE = "executing.lock"
# Ours: longer than `is_executing` ever holds it, shorter than any execution.
_WAIT_S = 1.0
_POLL_S = 0.01


@contextmanager
def executing_lock(folder: Path) -> Iterator[int]:
    """Hold the right to execute a trial of the workspace in `folder`.

    Yields:
        A file descriptor for the command to keep open: as long as it does, it holds the right too,
        even where this program is killed. Leaving the block takes the right back from everyone.

    Raises:
        TrialStateError: Another program holds it.
        WorkspaceError: The folder is read-only, or its file system has no locks.
    """
    path = folder / _FILE
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise WorkspaceError(f"{path}: {error.strerror}; make the folder writable") from error
    try:
        if not _lock(path, descriptor, "alone", wait=_WAIT_S):
            raise TrialStateError(
                f"a trial of {folder} is being executed right now; wait for it, or stop its command"
            )
        try:
            yield descriptor
        finally:
            _free(descriptor)
    finally:
        os.close(descriptor)


def is_executing(folder: Path) -> bool:
    """Whether a trial of the workspace in `folder` is being executed right now.

    Raises:
        WorkspaceError: The lock cannot be read, or the file system has no locks.
    """
    path = folder / _FILE
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise WorkspaceError(f"{path}: {error.strerror}; make it readable") from error
    try:
        return not _lock(path, descriptor, "shared", wait=0.0)
    finally:
        os.close(descriptor)


def _lock(path: Path, descriptor: int, kind: Literal["alone", "shared"], *, wait: float) -> bool:
    """Take a lock within `wait` seconds; False if another program holds it."""
    import fcntl  # not on Windows, where all commands but a workspace's work

    operation = fcntl.LOCK_EX if kind == "alone" else fcntl.LOCK_SH
    deadline = time.monotonic() + wait
    while True:
        try:
            fcntl.flock(descriptor, operation | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= deadline:
                return False
            time.sleep(_POLL_S)
        except OSError as error:
            raise WorkspaceError(
                f"{path} cannot be locked ({error.strerror}); move the workspace to a local disk"
            ) from error
        else:
            return True


def _free(descriptor: int) -> None:
    """Free a lock for all who share it, unlike closing the file."""
    import fcntl

    fcntl.flock(descriptor, fcntl.LOCK_UN)

"""Whether a trial is being executed right now: by a program that lives, or by what it started.

The journal cannot tell: its last word on such a trial is `executing`, whether the program that
wrote it still runs or died. A lock can, because the system frees it when its last holder is gone.
The supervisor and the command that moves the arm hold it too: where our program is killed and the
controller goes on, the trial is still being executed. That takes `flock`, whose lock belongs to the
open file that all share; SQLite's, as in the journal, would end with our program.

What is locked is the workspace's folder itself: there is no file that somebody could delete.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from prior_reinforce.errors import TrialStateError, WorkspaceError

# Ours: longer than `is_executing` ever holds it, shorter than any execution.
_WAIT_S = 1.0
_POLL_S = 0.01


@contextmanager
def executing_lock(folder: Path) -> Iterator[int]:
    """Hold the right to execute a trial of the workspace in `folder`.

    Yields:
        A file descriptor for what is started to keep open: as long as anything does, it holds the
        right too, even where this program is killed or leaves the block.

    Raises:
        TrialStateError: Another program holds it.
        WorkspaceError: The folder cannot be opened, or its file system has no locks.
    """
    descriptor = _open(folder)
    try:
        if not _lock(folder, descriptor, "alone", wait=_WAIT_S):
            raise TrialStateError(
                f"a trial of {folder} is being executed right now; wait for it, or stop its command"
            )
        yield descriptor
    finally:
        os.close(descriptor)


def is_executing(folder: Path) -> bool:
    """Whether a trial of the workspace in `folder` is being executed right now.

    Raises:
        WorkspaceError: The folder cannot be opened, or its file system has no locks.
    """
    descriptor = _open(folder)
    try:
        return not _lock(folder, descriptor, "shared", wait=0.0)
    finally:
        os.close(descriptor)


def _open(folder: Path) -> int:
    try:
        return os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise WorkspaceError(f"{folder}: {error.strerror}; make it a readable folder") from error


def _lock(folder: Path, descriptor: int, kind: Literal["alone", "shared"], *, wait: float) -> bool:
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
                f"{folder} cannot be locked ({error.strerror}); move the workspace to a local disk"
            ) from error
        else:
            return True

"""Whether a trial is being executed right now, by a program that lives.

The journal cannot tell: its last word on such a trial is `executing`, whether the program that
wrote it still runs or died. A lock can, because the system frees it when its holder dies. It is an
SQLite file's, since those work on every system that the journal works on.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from prior_reinforce.errors import TrialStateError, WorkspaceError

_FILE = "executing.lock"
# Ours: longer than `is_executing` ever holds it, shorter than any execution.
_WAIT_S = 1.0


@contextmanager
def executing_lock(folder: Path) -> Iterator[None]:
    """Hold the right to execute a trial of the workspace in `folder`.

    Raises:
        TrialStateError: Another program holds it.
        WorkspaceError: The folder is read-only.
    """
    connection: sqlite3.Connection | None = None
    try:
        try:
            connection = sqlite3.connect(folder / _FILE, timeout=_WAIT_S, isolation_level=None)
            connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            if _held(error):
                raise TrialStateError(
                    f"another command executes a trial of {folder} right now; wait for it"
                ) from error
            raise WorkspaceError(f"{folder / _FILE}: {error}; make the folder writable") from error
        yield
    finally:
        if connection is not None:
            connection.close()


def is_executing(folder: Path) -> bool:
    """Whether a program that lives executes a trial of the workspace in `folder`."""
    if not (folder / _FILE).exists():
        return False
    connection = sqlite3.connect(folder / _FILE, timeout=0.0, isolation_level=None)
    try:
        connection.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        return _held(error)
    finally:
        connection.close()
    return False


def _held(error: sqlite3.Error) -> bool:
    return "locked" in str(error)

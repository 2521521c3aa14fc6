"""Files that are there whole or not at all, however a run ends.

What is being written has a name of its own, `.unfinished-<host>-<pid>-...`, beside where it will
stand, and is moved there in one step. What a killed process leaves under such a name is never read;
`sweep` removes it. The name says whose it is, so that runs can share a folder.
"""

from __future__ import annotations

import errno
import os
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PREFIX = ".unfinished-"


def write_atomically(path: Path, text: str) -> None:
    """Put a text in place whole or not at all, durable."""
    with in_place(path) as unfinished, unfinished.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def in_place(path: Path) -> Iterator[Path]:
    """Give a place to write a file or a folder to, and move it to `path` when it is complete.

    A file that stands there is replaced. A folder that stands there stays: another process was
    quicker, and who writes here writes what depends on the name alone.

    Args:
        path: Where it shall stand; the folder around it must exist.
    """
    owner = f"{_PREFIX}{socket.gethostname()}-{os.getpid()}-"
    around = Path(tempfile.mkdtemp(dir=path.parent, prefix=owner))
    try:
        yield around / path.name
        finished = around / path.name
        for file in (finished, *finished.rglob("*")):
            _keep(file)
        try:
            os.replace(finished, path)
        except OSError:
            if not path.is_dir():
                raise
        _keep(path.parent)
    finally:
        shutil.rmtree(around, ignore_errors=True)


def sweep(folder: Path) -> None:
    """Remove from a folder what processes of this machine left when they were killed.

    Elsewhere than on POSIX systems nothing tells whether a process lives, and all of it stays.
    """
    if os.name != "posix":
        return
    mine = f"{_PREFIX}{socket.gethostname()}-"
    for left in folder.glob(f"{mine}*"):
        pid = left.name.removeprefix(mine).partition("-")[0]
        if not (pid.isdecimal() and _lives(int(pid))):
            shutil.rmtree(left, ignore_errors=True)


def _keep(path: Path) -> None:
    """Have a file, or the names in a folder, survive a power cut."""
    if os.name != "posix":
        return  # elsewhere a folder cannot be opened
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        # Some shared file systems keep folders in their own way, and say so.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(handle)


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True

"""Files that are there wholly or not at all, and are never replaced."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

from prior_reinforce.errors import FileFormatError, WorkspaceError


def write_once(path: Path, content: bytes) -> None:
    """Put content at a path, durable and read-only.

    Args:
        path: An existing file with the same content is kept.
        content: Of the file.

    Raises:
        FileFormatError: Another file is there already.
        WorkspaceError: The disk is full or the folder read-only; nothing is left behind.
    """
    temporary: str | None = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o444)
        _put_in_place(temporary, path)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except FileExistsError:
        if not (path.is_file() and path.read_bytes() == content):
            raise FileFormatError(
                f"{path} is there already with another content; plans are never overwritten: "
                "choose another name"
            ) from None
    except OSError as error:
        remedy = {
            errno.ENOSPC: "free some space",
            errno.ENOENT: "make the folder first",
        }.get(error.errno or 0, "choose a folder that can be written to")
        raise WorkspaceError(f"cannot write {path} ({error.strerror}); {remedy}") from error
    finally:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)


def _put_in_place(temporary: str, path: Path) -> None:
    """Give the finished file its name.

    Raises:
        FileExistsError: A file of that name is there already.
    """
    try:
        # A link, unlike a rename, fails where a file is there already.
        os.link(temporary, path)
    except FileExistsError:
        raise
    except OSError as error:
        # Memory sticks (FAT) have no links.
        if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS):
            raise
        if path.exists():
            raise FileExistsError(errno.EEXIST, "File exists", str(path)) from error
        os.rename(temporary, path)

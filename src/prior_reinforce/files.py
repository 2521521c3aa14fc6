"""Files that are there whole or not at all, durable, and known by their hash: the one writer.

What is being written has a name of its own, `.unfinished-<host>-<pid>-...`, beside where it will
stand, and is moved there in one step once it is on the disk. What a killed process leaves under
such a name is never read; `sweep` removes it. The name says whose it is, so that runs can share a
folder.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import socket
import tempfile
import unicodedata
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

import numpy as np

from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    PriorReinforceError,
    WorkspaceError,
)

_PREFIX = ".unfinished-"
_CLAIM = ".prior-reinforce"
"""In every folder of results: what is in it may be replaced."""
_MARK_WITHIN = 200_000
"""Bytes of a file that are searched for a mark: a page's styles stand before its words."""
_LARGEST_NPZ = 4_000_000_000
"""Bytes of all arrays in a file; ours: an hour of an arm at 1 kHz is a tenth of it. A small file
that unpacks to more is a trap."""

_POINTER = b"version https://git-lfs.github.com/spec/"
_LARGEST_POINTER, _MOST_FILES = 1024, 5_000
"""Bytes of a Git LFS pointer (its specification), and files that are looked through for one."""
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet takes for the start of a formula, which may run a program (OWASP, CSV
injection)."""


def sha256(content: bytes) -> str:
    """Return the hash of some bytes, 64 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def sha256_of_folder(folder: Path) -> str:
    """Return the hash of the names and contents of a folder's files; hidden files do not count.

    FileFormatError if a file cannot be read.
    """
    digest = hashlib.sha256()
    try:
        for path in sorted(folder.iterdir()):
            if not path.name.startswith("."):
                digest.update(path.name.encode())
                digest.update(path.read_bytes())
    except OSError as error:
        raise FileFormatError(
            f"cannot read {error.filename} ({error.strerror}); restore it from a copy"
        ) from error
    return digest.hexdigest()


@contextmanager
def open_npz(path: Path, remedy: str, largest: int | None = None) -> Iterator[np.lib.npyio.NpzFile]:
    """Open arrays that numpy saved, as data: no pickle is read, and no flood unpacked.

    It may unpack to the `largest` number of bytes; None takes those of an hour of any arm, and
    more. FileFormatError, with the remedy, if reading it fails, in the block as well: what can go
    wrong in damaged or crafted bytes are a dozen kinds of errors of zipfile, zlib and numpy.
    """
    try:
        with path.open("rb") as file, zipfile.ZipFile(file) as packed:
            size = sum(member.file_size for member in packed.infolist())
            largest = largest or _LARGEST_NPZ
            if size > largest:
                raise ValueError(f"it unpacks to {size:.2g} bytes, at most {largest:.2g} are read")
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            yield archive
    except PriorReinforceError:
        raise
    except Exception as error:
        raise FileFormatError(
            f"{path} cannot be read ({without_advice(error)}); {remedy}"
        ) from error


def refuse_pointers(source: Path) -> None:
    """Raise FileFormatError if a file is what Git LFS leaves in the place of one."""
    for path in [source] if source.is_file() else islice(sorted(source.rglob("*")), _MOST_FILES):
        if path.is_file() and path.stat().st_size < _LARGEST_POINTER:
            with path.open("rb") as file:
                if file.read(len(_POINTER)) == _POINTER:
                    raise FileFormatError(
                        f"{path} is a Git LFS pointer, not the file itself; fetch it: git lfs pull"
                    )


def as_cell(text: str) -> str:
    """Return a text for a cell of a table, of which no spreadsheet makes a formula."""
    return f"'{text}" if text.startswith(_FORMULAS) else text


def from_cell(text: str) -> str:
    """Return what `as_cell` was given."""
    return text[1:] if text[:1] == "'" and text[1:].startswith(_FORMULAS) else text


def without_advice(error: BaseException) -> str:
    """What an error of numpy says, without its advice to load a file in a way that runs code."""
    return "it holds Python objects" if "pickle" in str(error) else str(error)


@contextmanager
def in_place(path: Path) -> Iterator[Path]:
    """Give a place to write a file or a folder to, and move it to `path` when it is complete.

    The folder around it is made if need be. A file that stands there is replaced. A folder that
    stands there stays: another process was quicker, and who writes folders here names them by what
    is in them.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with _unfinished(path) as unfinished:
        yield unfinished
        for file in (unfinished, *unfinished.rglob("*")):
            _sync(file)
        try:
            os.replace(unfinished, path)
        except OSError:
            if not path.is_dir():
                raise
        _sync(path.parent)


def write(path: Path, content: str | bytes) -> Path:
    """Put a text (UTF-8) or bytes in place, whole; return the path. A file there is replaced."""
    with in_place(path) as unfinished:
        unfinished.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def write_once(path: Path, content: bytes) -> Path:
    """Put bytes in place as a read-only file that is never replaced, and return its path.

    An existing file with the same content is kept; the folder around it must exist. FileFormatError
    if another file is there already; WorkspaceError if the disk is full or the folder read-only:
    nothing is left behind.
    """
    with named_disk_errors(path.parent), _unfinished(path) as unfinished:
        unfinished.write_bytes(content)
        unfinished.chmod(unfinished.stat().st_mode & 0o444)
        _sync(unfinished)
        try:
            _link(unfinished, path)
        except FileExistsError:
            if not (path.is_file() and path.read_bytes() == content):
                raise FileFormatError(
                    f"{path} is there already with another content and is never overwritten; "
                    "choose another name"
                ) from None
        _sync(path.parent)
    return path


@contextmanager
def named_disk_errors(folder: Path) -> Iterator[None]:
    """Turn a full disk or a read-only folder into one line.

    WorkspaceError if the disk is full, or the folder cannot be written to.
    """
    try:
        yield
    except OSError as error:
        remedy = "make the folder writable, or choose another"
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            remedy = "free some disk space"
        elif error.errno == errno.EFBIG:
            remedy = "files may not grow as large here: raise the limit (ulimit -f), or ask for it"
        raise WorkspaceError(
            f"cannot write to {folder} ({error.strerror}); {remedy}; what was written before is "
            "safe"
        ) from error


def refuse_foreign(path: Path, mark: str) -> None:
    """Refuse to replace a file that lacks the mark which all of ours bear: FileFormatError."""
    if path.is_symlink() or path.exists():
        try:
            with path.open("rb") as file:
                ours = mark.encode() in file.read(_MARK_WITHIN)
        except OSError:
            ours = False
        if not ours:
            raise FileFormatError(
                f"{path} is there already and was not written by this command; choose another name"
            )


def claim_folder(folder: Path) -> None:
    """Make a folder for results, or take one that was claimed so: what is in it may be replaced.

    WorkspaceError if it holds what this program did not write, or cannot be written to.
    """
    with named_disk_errors(folder):
        claimed = (folder / _CLAIM).exists()
        if not claimed and folder.is_dir() and any(folder.iterdir()):
            raise WorkspaceError(
                f"{folder} holds files that this program did not write and might replace; choose "
                "an empty or a new folder"
            )
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _CLAIM).touch()


def check_path(path: Path) -> Path:
    """Return a path that a person named, unless printing it would move the cursor.

    ConfigurationError if it would.
    """
    if any(unicodedata.category(char) == "Cc" for char in str(path)):
        raise ConfigurationError(f"the path {path} holds control characters; rename it")
    return path


def require_inside(path: Path, folder: Path) -> Path:
    """Return a path within a folder, unless a link leads it out.

    FileFormatError if a link does: who gave the folder away would have other files read or written.
    """
    if not path.resolve().is_relative_to(folder.resolve()):
        raise FileFormatError(
            f"{path} is a link out of {folder}, which is not followed; put the file itself there"
        )
    return path


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


@contextmanager
def _unfinished(path: Path) -> Iterator[Path]:
    """A place of the same name in a folder beside it, which is gone afterwards.

    WorkspaceError if none can be made there.
    """
    owner = f"{_PREFIX}{socket.gethostname()}-{os.getpid()}-"
    with named_disk_errors(path.parent):
        around = Path(tempfile.mkdtemp(dir=path.parent, prefix=owner))
    try:
        yield around / path.name
    finally:
        shutil.rmtree(around, ignore_errors=True)


def _link(finished: Path, path: Path) -> None:
    """Give a finished file its name; unlike renaming, this fails where a file is there already.

    FileExistsError if a file of that name is there.
    """
    try:
        os.link(finished, path)
    except OSError as error:
        # Memory sticks (FAT) have no links.
        if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS):
            raise
        if path.exists():
            raise FileExistsError(errno.EEXIST, "File exists", str(path)) from error
        os.rename(finished, path)


def _sync(path: Path) -> None:
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
    except OSError as error:
        return not isinstance(error, ProcessLookupError)
    return True

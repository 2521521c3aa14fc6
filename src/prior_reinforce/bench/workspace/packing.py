"""A workspace in one file, with where it comes from: packed here, opened on another machine.

    pack.json             version of the program, time, SHA-256 of every other file
    workspace.toml        the manifest without [arm], which is this machine's
    journal.jsonl         the events with their digests; the journal is made again from them
    demonstrations/, models/, plans/    the files that events name

Nothing else goes in: no output of drivers beyond what the journal has, no pictures, no settings of
this machine. What comes in is taken for hostile: names are of this list, nothing is compressed (so
that a file cannot unpack to more than its own size), no link is made, no foreign SQLite file is
opened, and all is checked before a folder of the wanted name is there.
"""

from __future__ import annotations

import hashlib
import re
import struct
import zipfile
from collections.abc import Iterable
from contextlib import closing
from datetime import datetime, timezone
from pathlib import Path

import msgspec

import prior_reinforce
from prior_reinforce.bench.workspace.journal import JOURNAL_VERSION, Journal, Row
from prior_reinforce.bench.workspace.log import DemonstrationsImported, ModelTrained
from prior_reinforce.bench.workspace.manifest import MANIFEST_FILE, read_manifest, without_arm
from prior_reinforce.bench.workspace.store import Store
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import FileFormatError, PriorReinforceError, WorkspaceError
from prior_reinforce.files import in_place, named_disk_errors, sha256
from prior_reinforce.session.events import Asked

_CONTENTS, _EVENTS = "pack.json", "journal.jsonl"
_KIND = "prior-reinforce workspace, packed"
_NAME = re.compile(
    rf"{re.escape(MANIFEST_FILE)}|{re.escape(_EVENTS)}|demonstrations/[0-9a-f]{{16}}\.npz|"
    r"models/[0-9a-f]{16}/\w[\w.-]{0,99}|plans/trial-\d{3,9}-[0-9a-f]{8}\.npz",
    re.ASCII,
)
_DAMAGED = (zipfile.BadZipFile, ValueError, RuntimeError, EOFError, struct.error)
"""What zipfile, msgspec and tomllib raise for a file that is damaged."""
_MOST_FILES = 100_000
"""Ours: a trial a minute for two months."""


class Pack(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a packed workspace says of itself."""

    kind: str
    program: str
    """Version of the program that packed it."""
    journal: int
    """Version of the journal's events."""
    packed: str
    """When, ISO 8601, UTC."""
    files: dict[str, str]
    """SHA-256 of every other file."""


def pack(workspace: Workspace, path: Path) -> str:
    """Write a workspace into one file; see `Workspace.pack`."""
    if workspace.log.is_executing():
        raise WorkspaceError("a trial is executing; pack when it has ended")
    if path.exists():
        raise FileFormatError(f"{path} is there already; choose another name")
    with workspace.log.exclusive():
        rows = workspace.log.rows()
        named = _named(entry.event for entry in workspace.events)
    manifest = without_arm(read_manifest(workspace.folder / MANIFEST_FILE))
    contents = {
        MANIFEST_FILE: manifest.encode(),
        _EVENTS: b"\n".join([*map(msgspec.json.encode, rows), b""]),
    }
    for folder in (workspace.folder / name for name in named):
        for file in sorted(folder.iterdir()) if folder.is_dir() else [folder]:
            if not file.name.startswith("."):
                name = file.relative_to(workspace.folder).as_posix()
                contents[name] = workspace.store.read(name)
    about = Pack(
        _KIND,
        prior_reinforce.__version__,
        JOURNAL_VERSION,
        datetime.now(timezone.utc).isoformat(timespec="seconds"),
        {name: sha256(content) for name, content in contents.items()},
    )
    described = msgspec.json.format(msgspec.json.encode(about), indent=1)
    with named_disk_errors(path.parent), in_place(path) as unfinished:
        with zipfile.ZipFile(unfinished, "w", zipfile.ZIP_STORED) as archive:
            for name, content in {_CONTENTS: described, **contents}.items():
                archive.writestr(zipfile.ZipInfo(name), content)
        return _sha256_of(unfinished)


def unpack(path: Path, folder: Path) -> str:
    """Make a workspace of what `pack` wrote; see `Workspace.unpack`.

    Returns:
        SHA-256 of the file.
    """
    if folder.exists() or folder.is_symlink():
        raise WorkspaceError(f"{folder} exists; choose a new folder")
    try:
        with zipfile.ZipFile(path) as archive:
            about = _checked(archive, path.stat().st_size)
            with named_disk_errors(folder.parent), in_place(folder) as unfinished:
                _write(archive, about, unfinished)
                with Workspace(unfinished) as workspace:
                    if workspace.state.demonstrations is not None:
                        workspace.demonstrations  # noqa: B018  (whether they are whole)
        return _sha256_of(path)
    except FileNotFoundError:
        raise
    except (PriorReinforceError, *_DAMAGED) as error:
        reason = re.sub(r"\S*\.unfinished-[^/]*/", "", str(error))
        raise FileFormatError(f"{path} cannot be unpacked: {reason}") from error


def _sha256_of(path: Path) -> str:
    """Of a file that may be larger than memory."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _named(events: Iterable[object]) -> list[str]:
    """Files and folders that events name, once each."""
    names = []
    for event in events:
        match event:
            case DemonstrationsImported(sha256=digest):
                names.append(f"demonstrations/{digest[:16]}.npz")
            case ModelTrained(model=model, demonstrations_sha256=digest):
                names += [f"demonstrations/{digest[:16]}.npz", f"models/{model}"]
            case Asked(plan=kept) if kept is not None:
                names.append(f"plans/{kept.file}")
    return list(dict.fromkeys(names))


def _checked(archive: zipfile.ZipFile, size: int) -> Pack:
    """What an archive says of itself, if it holds what that names and nothing else.

    Raises:
        FileFormatError: It does not, or it could unpack to more than its size.
    """
    infos = archive.infolist()
    names = [info.filename for info in infos]
    if len(infos) > _MOST_FILES or len(set(names)) < len(names):
        raise FileFormatError("it holds too many files, or one twice; it was not packed by pack")
    if any(info.compress_type or info.flag_bits & 1 for info in infos):
        raise FileFormatError("it is compressed or encrypted; it was not packed by pack")
    if sum(info.file_size for info in infos) > size:
        raise FileFormatError("it would unpack to more than its size; it was not packed by pack")
    if _CONTENTS not in names:
        raise FileFormatError(f"it holds no {_CONTENTS}; it was not packed by pack")
    about = msgspec.json.decode(archive.read(_CONTENTS), type=Pack)
    if about.kind != _KIND or about.journal != JOURNAL_VERSION:
        raise FileFormatError(
            f"it was packed by version {about.program[:40]} of this program, whose journal is "
            f"another; use that version, this is {prior_reinforce.__version__}"
        )
    if odd := [name for name in about.files if not _NAME.fullmatch(name)]:
        raise FileFormatError(f"{odd[0][:80]!r} is no file of a workspace; nothing was unpacked")
    if {_CONTENTS, *about.files} != set(names) or not {MANIFEST_FILE, _EVENTS} <= set(names):
        raise FileFormatError("it holds other files than it says; nothing was unpacked")
    return about


def _write(archive: zipfile.ZipFile, about: Pack, folder: Path) -> None:
    """Write every file of an archive whose hash is right, and the journal that its events make."""
    folder.mkdir()
    with closing(Journal(folder, Store(folder))) as journal:  # while there are no files yet
        for name, digest in about.files.items():
            content = archive.read(name)
            if sha256(content) != digest:
                raise FileFormatError(f"{name} is not what was packed; get it again")
            if name == _EVENTS:
                rows = [msgspec.json.decode(line, type=Row) for line in content.splitlines()]
                journal.restore(rows)
                continue
            if name == MANIFEST_FILE and without_arm(content.decode()) != content.decode():
                raise FileFormatError("its manifest names an [arm]; it was not packed by pack")
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)

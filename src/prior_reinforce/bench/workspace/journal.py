"""The trial journal: append-only events in SQLite, each durable before a command returns.

Nothing is ever changed or deleted; what happened is the list of events, and everything else is a
fold over it (`log.WorkspaceState`). One program at a time may read-then-append
(`Journal.exclusive`). Every event carries a digest of itself and of all before it, so that a
damaged copy is an error rather than a reading that is slightly another one.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime, timezone
from pathlib import Path
from threading import RLock
from typing import Any, NoReturn

import msgspec

from prior_reinforce.errors import WorkspaceError
from prior_reinforce.session.events import Entry, Event
from prior_reinforce.session.trials import Log

JOURNAL_FILE = "journal.sqlite"
JOURNAL_VERSION = 3
# Ours: an operator's second window should wait out a command, not a training.
_LOCK_TIMEOUT_S = 10.0

_SCHEMA = """
CREATE TABLE IF NOT EXISTS events (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    time TEXT NOT NULL,
    event TEXT NOT NULL,
    digest TEXT NOT NULL
) STRICT;
CREATE TRIGGER IF NOT EXISTS events_are_never_changed BEFORE UPDATE ON events
BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
CREATE TRIGGER IF NOT EXISTS events_are_never_deleted BEFORE DELETE ON events
BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
"""
_INSERT = "INSERT INTO events (time, event, digest) VALUES (?, ?, ?)"
_HEADER_BYTES = 100
"""Of any SQLite file that has something in it (sqlite.org/fileformat.html, section 1.3)."""


class Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An event as it is written."""

    time: str
    digest: str
    """Of it and of all before it."""
    event: msgspec.Raw
    """JSON, to the byte."""


class Journal(Log):
    """Events of one workspace, on disk."""

    def __init__(self, path: Path, events: Any) -> None:
        """Open a journal; made if there is none.

        Args:
            path: Its file.
            events: Union of the events that it may hold.

        Raises:
            WorkspaceError: It cannot be opened, is damaged, or was written by a newer version.
        """
        super().__init__()
        self._path = path
        self._last_digest = ""
        self._data_version: int | None = None
        self._decoder = msgspec.json.Decoder(events)
        self._lock = RLock()
        self.appended = False
        """Whether anything became durable since it was opened here."""
        # SQLite takes a file of a few bytes for an empty one, and would write over it.
        if path.exists() and 0 < path.stat().st_size < _HEADER_BYTES:
            raise WorkspaceError(
                f"the journal {path} is damaged (shorter than its header); restore it from a copy"
            )
        with self._named_errors():
            self._connection = sqlite3.connect(
                path, timeout=_LOCK_TIMEOUT_S, isolation_level=None, check_same_thread=False
            )
            # A commit returns only when the rollback journal and its folder are on the disk.
            self._connection.execute("PRAGMA synchronous = EXTRA")
            version = self._connection.execute("PRAGMA user_version").fetchone()[0]
            if version == 0:
                self._connection.executescript(
                    f"BEGIN IMMEDIATE; {_SCHEMA} PRAGMA user_version = {JOURNAL_VERSION}; COMMIT;"
                )
            elif version != JOURNAL_VERSION:
                raise WorkspaceError(
                    f"{path} was written by another version of this program (journal {version}, "
                    f"this is {JOURNAL_VERSION}); use that version"
                )
            # A view or a virtual table may never end.
            found = self._connection.execute("SELECT sql FROM sqlite_master WHERE name = 'events'")
            if not str((found.fetchone() or ("",))[0]).startswith("CREATE TABLE"):
                raise WorkspaceError(
                    f"the journal {path} is damaged (it has no table of events); restore it from a "
                    "copy"
                )

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied, with whatever holds it: what happened is in the folder."""
        folder = str(self._path.parent)
        raise WorkspaceError(f"a workspace is not copied; open it again: Workspace({folder!r})")

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def entries(self) -> Sequence[Entry]:
        """All events, in order; they are read anew only where another program has added some.

        Raises:
            WorkspaceError: The file is damaged, or another version wrote it.
        """
        with self._lock, self._named_errors():
            (version,) = self._connection.execute("PRAGMA data_version").fetchone()
            if version != self._data_version:
                self._read()
                self._data_version = version
        return self._entries

    def rows(self) -> list[Row]:
        """All events as they are written, after they were checked."""
        self.entries()
        rows = self._connection.execute("SELECT time, digest, event FROM events ORDER BY id")
        return [Row(time, digest, msgspec.Raw(text.encode())) for time, digest, text in rows]

    def _read(self) -> None:
        rows = self._connection.execute(
            "SELECT id, time, event, digest FROM events WHERE id > ? ORDER BY id",
            (self._entries[-1].id if self._entries else 0,),
        )
        for id_, time, text, written in rows:
            texts = isinstance(time, str) and isinstance(text, str)  # damaged, they may be none
            digest = _digest(self._last_digest, time, text) if texts else None
            if digest is None or digest != written:
                raise WorkspaceError(
                    f"{self._path}: event {id_} is not what was written; restore the journal "
                    "from a copy"
                )
            try:
                event = self._decoder.decode(text)
            except msgspec.ValidationError as error:
                raise WorkspaceError(
                    f"event {id_} does not say what it should ({error}); use the version that "
                    "wrote it, or restore the journal from a copy"
                ) from error
            self._entries.append(Entry(id_, event, time))
            self._last_digest = digest

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Hold the journal for reading and then appending; others wait, and then say so.

        Appends inside become durable together when the block ends; none does if it raises. What is
        not durable yet is no event: `entries` has it once the block has ended.

        Raises:
            WorkspaceError: Another program holds it, or the disk refuses.
        """
        with self._lock:
            with self._named_errors():
                self._connection.execute("BEGIN IMMEDIATE")
            try:
                self.entries()
                yield
                with self._named_errors():
                    self._connection.execute("COMMIT")
            finally:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                else:  # committed, maybe interrupted since; or rolled back for a full disk
                    n, self._data_version = len(self._entries), None
                    with suppress(WorkspaceError):
                        self.appended |= len(self.entries()) > n

    def append(self, event: Event) -> None:
        """Add an event; call it inside `exclusive`.

        Raises:
            WorkspaceError: The disk is full, or the folder is read-only.
        """
        assert self._connection.in_transaction, "append inside Journal.exclusive"
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        text = msgspec.json.encode(event).decode()
        with self._named_errors():
            last = self._connection.execute("SELECT digest FROM events ORDER BY id DESC").fetchone()
            digest = _digest(last[0] if last else "", now, text)
            self._connection.execute(_INSERT, (now, text, digest))

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        try:
            yield
        # A damaged file has texts that are none, also in the errors themselves.
        except (sqlite3.Error, UnicodeDecodeError, msgspec.DecodeError, RecursionError) as error:
            text = str(error)
            if "closed database" in text:
                raise WorkspaceError(f"{self._path.parent} is closed; open it again") from error
            remedy = "restore it from a copy"
            if "locked" in text or "busy" in text:
                remedy = "another command works on this workspace; wait for it, then try again"
            elif "readonly" in text or "unable to open" in text:
                remedy = "make the folder writable"
            elif "full" in text or "disk I/O" in text:
                remedy = "free some disk space; what was told before is safe"
            raise WorkspaceError(f"{self._path}: {text}; {remedy}") from error


def restore(path: Path, rows: Sequence[Row]) -> None:
    """Make a journal again from its rows; opened as any journal, it checks them.

    Raises:
        WorkspaceError: The disk refuses.
    """
    journal = Journal(path, object)
    with journal._named_errors():
        journal._connection.execute("BEGIN IMMEDIATE")
        journal._connection.executemany(
            _INSERT, ((row.time, bytes(row.event).decode(), row.digest) for row in rows)
        )
        journal._connection.execute("COMMIT")
    journal.close()


def _digest(before: str, time: str, event: str) -> str:
    return hashlib.sha256("\0".join((before, time, event)).encode()).hexdigest()

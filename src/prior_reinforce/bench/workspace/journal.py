"""The trial journal: append-only events in SQLite, each durable before a command returns.

Nothing is ever changed or deleted; what happened is the list of events, and everything else is a
fold over it (`trials.py`). One program at a time may read-then-append (`Journal.exclusive`). Every
event carries a digest of itself and of all before it, so that a damaged copy is an error rather
than a reading that is slightly another one.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from threading import RLock
from typing import Any

from prior_reinforce.errors import WorkspaceError
from prior_reinforce.session.trials import Event

JOURNAL_FILE = "journal.sqlite"
_VERSION = 1
# Ours: an operator's second window should wait out a command, not a training.
_LOCK_TIMEOUT_S = 10.0

_SCHEMA = """
CREATE TABLE IF NOT EXISTS events (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    time TEXT NOT NULL,
    kind TEXT NOT NULL,
    data TEXT NOT NULL,
    digest TEXT NOT NULL
) STRICT;
CREATE TRIGGER IF NOT EXISTS events_are_never_changed BEFORE UPDATE ON events
BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
CREATE TRIGGER IF NOT EXISTS events_are_never_deleted BEFORE DELETE ON events
BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
"""
_HEADER_BYTES = 100
"""Of any SQLite file that has something in it (sqlite.org/fileformat.html, section 1.3)."""


class Journal:
    """Events of one workspace."""

    def __init__(self, path: Path) -> None:
        """Open a journal; made if there is none.

        Raises:
            WorkspaceError: It cannot be opened, is damaged, or was written by a newer version.
        """
        self._path = path
        self._events: list[Event] = []
        self._last_digest = ""
        self._lock = RLock()
        self.appended = False
        """Whether anything became durable since it was opened here."""
        self._pending = False
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
                    f"BEGIN IMMEDIATE; {_SCHEMA} PRAGMA user_version = {_VERSION}; COMMIT;"
                )
            elif version != _VERSION:
                raise WorkspaceError(
                    f"{path} was written by another version of this program (journal {version}, "
                    f"this is {_VERSION}); use that version"
                )

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    @property
    def empty(self) -> bool:
        """Whether nothing has happened."""
        with self._named_errors():
            return self._connection.execute("SELECT 1 FROM events LIMIT 1").fetchone() is None

    def events(self) -> Sequence[Event]:
        """All events, in order; only what came since the last time is read from the disk.

        Raises:
            WorkspaceError: The file is damaged.
        """
        with self._lock, self._named_errors():
            rows = self._connection.execute(
                "SELECT id, time, kind, data, digest FROM events WHERE id > ? ORDER BY id",
                (self._events[-1].id if self._events else 0,),
            )
            for id_, time, kind, data, written in rows:
                digest = _digest(self._last_digest, time, kind, data)
                if digest != written:
                    raise WorkspaceError(
                        f"{self._path}: event {id_} is not what was written; restore the journal "
                        "from a copy"
                    )
                self._events.append(Event(id_, kind, json.loads(data), time))
                self._last_digest = digest
        return self._events

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Hold the journal for reading and then appending; others wait, and then say so.

        Appends inside become durable together when the block ends; none does if it raises. Read
        before the first append: what is not durable yet is no event.

        Raises:
            WorkspaceError: Another program holds it, or the disk refuses.
        """
        with self._lock:
            with self._named_errors():
                self._connection.execute("BEGIN IMMEDIATE")
            self._pending = False
            try:
                yield
                with self._named_errors():
                    self._connection.execute("COMMIT")
                self.appended |= self._pending
            except BaseException:
                # A full disk has made SQLite roll back by itself already.
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                else:
                    self.appended |= self._pending  # committed, then interrupted
                raise

    def append(self, kind: str, data: Mapping[str, Any]) -> None:
        """Add an event; call it inside `exclusive`.

        Raises:
            WorkspaceError: The disk is full, or the folder is read-only.
        """
        assert self._connection.in_transaction, "append inside Journal.exclusive"
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        text = json.dumps(data, allow_nan=False)
        with self._named_errors():
            last = self._connection.execute(
                "SELECT digest FROM events ORDER BY id DESC LIMIT 1"
            ).fetchone()
            digest = _digest(last[0] if last else "", now, kind, text)
            self._connection.execute(
                "INSERT INTO events (time, kind, data, digest) VALUES (?, ?, ?, ?)",
                (now, kind, text, digest),
            )
        self._pending = True

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        try:
            yield
        # A damaged file has texts that are none, also in the errors themselves.
        except (sqlite3.Error, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
            text = str(error)
            remedy = "restore it from a copy"
            if "locked" in text or "busy" in text:
                remedy = "another command works on this workspace; wait for it, then try again"
            elif "readonly" in text or "unable to open" in text:
                remedy = "make the folder writable"
            elif "full" in text or "disk I/O" in text:
                remedy = "free some disk space; what was told before is safe"
            raise WorkspaceError(f"{self._path}: {text}; {remedy}") from error


def _digest(before: str, time: str, kind: str, data: str) -> str:
    return hashlib.sha256("\0".join(map(str, (before, time, kind, data))).encode()).hexdigest()

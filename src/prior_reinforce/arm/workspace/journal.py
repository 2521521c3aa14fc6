"""The trial journal: append-only events in SQLite, each durable before a command returns.

Nothing is ever changed or deleted; what happened is the list of events, and everything else is a
fold over it (`WorkspaceState`). One program at a time may read-then-append
(`Journal.exclusive`).

A damaged copy is an error rather than a reading that is slightly another one, or one fewer. Every
event carries a digest of itself and of all before it. SQLite's own counter (AUTOINCREMENT) lies on
another page than the events and says how many were written. The structure of the pages is checked
on opening. The file holds nothing but the table of events and its triggers.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from datetime import datetime, timezone
from functools import cache
from pathlib import Path
from threading import RLock
from typing import NoReturn

import msgspec
from msgspec import structs

from prior_reinforce.adapters.base import Adapter, State
from prior_reinforce.arm.workspace.events import KeptPlan, PlanAsked, WorkspaceEvent
from prior_reinforce.arm.workspace.state import WorkspaceState
from prior_reinforce.arm.workspace.store import Store
from prior_reinforce.arrays import Frames
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.session.events import Asked, Entry, Event
from prior_reinforce.session.trials import Log, Trial

JOURNAL_FILE = "journal.sqlite"
JOURNAL_VERSION = 5
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


class Journal(Log):
    """The log of a workspace's session: events in its journal, plans in its store."""

    _state: WorkspaceState

    def __init__(self, folder: Path, store: Store) -> None:
        """Open the journal in a folder; made if there is none.

        WorkspaceError if it cannot be opened, is damaged, was written by another version, or is
        missing beside files that it named.
        """
        super().__init__()
        self._state = WorkspaceState()
        self._folder, self._store = folder, store
        self._path = path = folder / JOURNAL_FILE
        self._file: tuple[int, int] | None = None
        self._last_digest = ""
        self._data_version: int | None = None
        self._decoder = msgspec.json.Decoder(WorkspaceEvent)
        self._lock = RLock()
        self.appended = False
        """Whether anything became durable since it was opened here."""
        size = path.stat().st_size if path.exists() else 0
        if size == 0:  # a new workspace's has no event until the first import has ended
            self._refuse_files("demonstrations", "models", "plans")
        # SQLite takes a file of a few bytes for an empty one, and would write over it.
        elif size < _HEADER_BYTES:
            raise self._damaged("it is shorter than its header")
        with self._named_errors():
            self._connection = sqlite3.connect(
                path, timeout=_LOCK_TIMEOUT_S, isolation_level=None, check_same_thread=False
            )
        try:
            with self._named_errors():
                self._open()
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        """Make the table in a new file, or check all that is in the file."""
        self._file = _identity(self._path)
        # A commit returns only when the rollback journal and its folder are on the disk.
        self._connection.execute("PRAGMA synchronous = EXTRA")
        # Whoever was killed while making it left nothing, which SQLite finds out when it reads.
        if self._connection.execute("PRAGMA page_count").fetchone() == (0,):
            self._connection.executescript(
                f"BEGIN IMMEDIATE; {_SCHEMA} PRAGMA user_version = {JOURNAL_VERSION}; COMMIT;"
            )
        (version,) = self._connection.execute("PRAGMA user_version").fetchone()
        if version != JOURNAL_VERSION:
            raise WorkspaceError(
                f"{self._path} was written by another version of this program (journal {version}, "
                f"this is {JOURNAL_VERSION}); use that version, or restore it from a copy"
            )
        if not self.entries():
            self._refuse_files("models", "plans")
        # What a damaged page holds may be read rightly, and written over by the next event.
        if self._connection.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
            raise self._damaged("its pages do not fit together")

    def _refuse_files(self, *parts: str) -> None:
        """Refuse to begin anew beside what an earlier journal named."""
        for folder in (self._folder / part for part in parts):
            if folder.is_dir() and any(path.name[0] != "." for path in folder.iterdir()):
                raise WorkspaceError(
                    f"{self._path} is missing or empty, but {folder} holds files that it named; "
                    "restore the journal from a copy, or make another workspace"
                )

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied, with whatever holds it: what happened is in the folder."""
        raise WorkspaceError(
            f"a workspace is not copied; open it again: Workspace({str(self._folder)!r})"
        )

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def entries(self) -> Sequence[Entry]:
        """All events, in order; they are read anew only where another program has added some.

        WorkspaceError if the file is damaged or was replaced, or another version wrote it.
        """
        self._catch_up()
        return self._entries

    def state(self) -> WorkspaceState:
        """See `Log.state`."""
        self._catch_up()
        return self._state

    def _catch_up(self) -> None:
        """Fold in what was added since; within `exclusive` nothing is."""
        with self._lock, self._named_errors():
            if not self._connection.in_transaction:
                self._connection.execute("BEGIN")  # what is read is of one moment
                try:
                    self._read()
                finally:
                    self._connection.execute("ROLLBACK")

    def _read(self) -> None:
        """Fold in what was added since; called within a transaction."""
        if _identity(self._path) != self._file:
            raise self._replaced()
        (version,) = self._connection.execute("PRAGMA data_version").fetchone()
        if version == self._data_version:
            return
        self._check_schema()
        n = len(self._entries)
        rows = self._connection.execute(
            "SELECT id, time, event, digest FROM events WHERE id >= ? ORDER BY id", (n,)
        )
        if n and (rows.fetchone() or ("",))[-1] != self._last_digest:
            raise self._replaced()
        for id_, time, text, digest in rows:
            self._read_event(id_, time, text, digest)
        n = len(self._entries)
        counted = self._connection.execute("SELECT name, seq FROM sqlite_sequence").fetchall()
        if counted != ([("events", n)] if n else []):
            raise self._damaged(f"{n} events are in it, which is not how many were written")
        self._data_version = version

    def _check_schema(self) -> None:
        """Refuse a file that holds anything else: a view may never end, a trigger drop events."""
        found, ours = _schema(self._connection), _own_schema()
        if strange := [f"{kind} {name!a:.80}" for kind, name, *_ in found - ours]:
            raise self._damaged(f"its {min(strange)} is not of this program")
        if missing := [f"{kind} {name}" for kind, name, *_ in ours - found]:
            raise self._damaged(f"it has no {min(missing)}")

    def _read_event(self, id_: int, time: object, text: object, digest: str) -> None:
        """Fold in the next event, if it is what was written."""
        number = len(self._entries) + 1
        if id_ != number:
            raise self._damaged(f"event {number} is missing")
        # Damaged, they may be no texts.
        if not (
            isinstance(time, str)
            and isinstance(text, str)
            and _digest(self._last_digest, time, text) == digest
        ):
            raise self._damaged(f"event {number} is not what was written")
        try:
            event = self._decoder.decode(text)
        except msgspec.ValidationError as error:
            raise WorkspaceError(
                f"event {number} does not say what it should ({error}); use the version that "
                "wrote it, or restore the journal from a copy"
            ) from error
        self._add(Entry(number, event, time))
        self._last_digest = digest

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Hold the journal for reading and then appending; others wait, and then say so.

        Appends inside become durable together when the block ends; none does if it raises. What is
        not durable yet is no event: `entries` has it once the block has ended. WorkspaceError if
        another program holds it, it was replaced, or the disk refuses.
        """
        with self._lock:
            with self._named_errors():
                self._connection.execute("BEGIN IMMEDIATE")
            try:
                with self._named_errors():
                    self._read()
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
            self._catch_up()  # which raises what could not be read back

    def append(self, event: Event) -> None:
        """Add an event; call it inside `exclusive`.

        WorkspaceError if the disk is full, or the folder is read-only.
        """
        assert self._connection.in_transaction, "append inside Journal.exclusive"
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        text = msgspec.json.encode(event).decode()
        with self._named_errors():
            last = self._connection.execute("SELECT digest FROM events ORDER BY id DESC").fetchone()
            digest = _digest(last[0] if last else "", now, text)
            self._connection.execute(_INSERT, (now, text, digest))

    def append_asked(self, event: Asked, plan: Frames, form: PlanFormat) -> None:
        """Write the plan's file, then add the event that names it."""
        named = {kept.file for kept in self._state.plan_files.values()}
        file = self._store.save_plan(Plan(plan, form), event.trial, named)
        kept = KeptPlan(file.path.name, file.sha256)
        self.append(PlanAsked(**structs.asdict(event), plan=kept))

    def keep_adapter(self, adapter: Adapter) -> None:
        """Write what an adapter knows."""
        self._store.save_adapter(adapter)

    def kept_adapter(self) -> State | None:
        """Read what was kept of an adapter."""
        return self._store.adapter()

    def plan(self, trial: Trial) -> Frames:
        """Read a trial's plan, checked against its hash."""
        return self._store.plan(self._state.plan_files[trial.number]).actions

    def _damaged(self, what: str) -> WorkspaceError:
        return WorkspaceError(
            f"the journal {self._path} is damaged ({what}); restore it from a copy"
        )

    def _replaced(self) -> WorkspaceError:
        return WorkspaceError(
            f"the journal {self._path} was replaced while this program had it open; start again"
        )

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        try:
            yield
        # A damaged file has texts that are none, also in the errors themselves.
        except (sqlite3.Error, UnicodeDecodeError, msgspec.DecodeError, RecursionError) as error:
            text = str(error)
            if "closed database" in text:
                raise WorkspaceError(f"{self._folder} is closed; open it again") from error
            if self._file not in (None, _identity(self._path)):
                raise self._replaced() from error
            remedy = "restore it from a copy"
            if "locked" in text or "busy" in text:
                remedy = "another command works on this workspace; wait for it, then try again"
            elif "readonly" in text or "unable to open" in text:
                remedy = "make the folder writable, or restore the journal from a copy"
            elif "full" in text or "disk I/O" in text:
                remedy = "free some disk space; what was told before is safe"
            raise WorkspaceError(f"{self._path}: {text}; {remedy}") from error


def _identity(path: Path) -> tuple[int, int] | None:
    """Which file it is, whatever its name and content; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _schema(connection: sqlite3.Connection) -> set[tuple[object, ...]]:
    """All tables, triggers and whatever else a file says that it has."""
    return {*connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_master")}


@cache
def _own_schema() -> set[tuple[object, ...]]:
    """What is in a journal."""
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.executescript(_SCHEMA)
        return _schema(connection)


def _digest(before: str, time: str, event: str) -> str:
    return hashlib.sha256("\0".join((before, time, event)).encode()).hexdigest()

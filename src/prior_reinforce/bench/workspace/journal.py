"""The trial journal: append-only events in SQLite, each durable before a command returns.

Nothing is ever changed or deleted; what happened is the list of events, and everything else is a
fold over it (`WorkspaceState`). One program at a time may read-then-append
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
from typing import NoReturn

import msgspec

from prior_reinforce.arrays import Frames
from prior_reinforce.bench.robots.executors.lock import is_executing
from prior_reinforce.bench.workspace.log import (
    Executed,
    NotExecuted,
    WorkspaceEvent,
    WorkspaceState,
)
from prior_reinforce.bench.workspace.store import Store
from prior_reinforce.errors import TrialStateError, WorkspaceError
from prior_reinforce.plans.motions import Plan
from prior_reinforce.session.events import Entry, Event, KeptPlan
from prior_reinforce.session.trials import Log, Trial

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
    """The log of a workspace's session: events in its journal, plans in its store."""

    _state: WorkspaceState

    def __init__(self, folder: Path, store: Store) -> None:
        """Open the journal in a folder; made if there is none.

        Raises:
            WorkspaceError: It cannot be opened, is damaged, was written by another version, or is
                missing beside files that it named.
        """
        super().__init__()
        self._state = WorkspaceState()
        self._folder, self._store = folder, store
        self._path = path = folder / JOURNAL_FILE
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
        try:
            if not self.entries():
                self._refuse_files("models", "plans")
        except WorkspaceError:
            self.close()
            raise

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

        Raises:
            WorkspaceError: The file is damaged, or another version wrote it.
        """
        with self._lock, self._named_errors():
            (version,) = self._connection.execute("PRAGMA data_version").fetchone()
            if version != self._data_version:
                self._read()
                self._data_version = version
        return self._entries

    def state(self) -> WorkspaceState:
        """See `Log.state`."""
        super().state()
        return self._state

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
            if not texts or _digest(self._last_digest, time, text) != written:
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
            self._last_digest = written

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

    def restore(self, rows: Sequence[Row]) -> None:
        """Take rows into a journal that has none; opened again, it checks them."""
        with self._named_errors():
            self._connection.execute("BEGIN IMMEDIATE")
            self._connection.executemany(
                _INSERT, ((row.time, bytes(row.event).decode(), row.digest) for row in rows)
            )
            self._connection.execute("COMMIT")

    def keep_plan(self, number: int, plan: Plan) -> KeptPlan:
        """Write the plan's file, before the event that names it."""
        named = {trial.kept.file for trial in self._state.trials if trial.kept is not None}
        file = self._store.save_plan(plan, number, named)
        return KeptPlan(file.path.name, file.sha256)

    def plan(self, trial: Trial) -> Frames:
        """Read a trial's plan, checked against its hash."""
        return self._store.plan(trial).actions

    def is_executing(self) -> bool:
        """Whether a trial is being executed right now, by any program."""
        return is_executing(self._folder)

    def settle(self, trial: Trial, *, arm_did_not_move: bool) -> None:
        """See `Log.settle`."""
        if self.is_executing():
            raise TrialStateError(f"trial {trial.number} is executing now; wait for it")
        began = self._state.executions[trial.number]
        if isinstance(began, Executed) and began.outcome != "aborted":
            raise TrialStateError(
                f"trial {trial.number} was executed to its end, as its command says: tell or void "
                "it"
            )
        if not arm_did_not_move:
            raise TrialStateError(
                f"trial {trial.number} was executing when the program stopped; did the arm move? "
                f"If it did, tell or void trial {trial.number}; if it did not, ask again with "
                "--arm-did-not-move"
            )
        self.append(NotExecuted(trial=trial.number))

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        try:
            yield
        # A damaged file has texts that are none, also in the errors themselves.
        except (sqlite3.Error, UnicodeDecodeError, msgspec.DecodeError, RecursionError) as error:
            text = str(error)
            if "closed database" in text:
                raise WorkspaceError(f"{self._folder} is closed; open it again") from error
            remedy = "restore it from a copy"
            if "locked" in text or "busy" in text:
                remedy = "another command works on this workspace; wait for it, then try again"
            elif "readonly" in text or "unable to open" in text:
                remedy = "make the folder writable"
            elif "full" in text or "disk I/O" in text:
                remedy = "free some disk space; what was told before is safe"
            raise WorkspaceError(f"{self._path}: {text}; {remedy}") from error


def _digest(before: str, time: str, event: str) -> str:
    return hashlib.sha256("\0".join((before, time, event)).encode()).hexdigest()

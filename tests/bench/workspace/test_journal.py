"""The journal: append-only, one writer at a time, and no damage is believed."""

import sqlite3
import threading

import pytest

from prior_reinforce.bench.workspace.journal import JOURNAL_VERSION, Journal
from prior_reinforce.bench.workspace.store import Store
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import TrialStateError, WorkspaceError
from prior_reinforce.session.events import Voided
from prior_reinforce.session.trials import Stage
from tests.bench.workspace.planar import ask, tell, trials, void


def test_the_journal_is_append_only(workspace):
    ask(workspace)
    connection = sqlite3.connect(workspace.folder / "journal.sqlite")
    for statement in ("DELETE FROM events", "UPDATE events SET event = 'x'"):
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            connection.execute(statement)
    connection.close()


def test_two_programs_exclude_each_other(workspace, monkeypatch):
    monkeypatch.setattr("prior_reinforce.bench.workspace.journal._LOCK_TIMEOUT_S", 0.1)
    other = Workspace(workspace.folder)
    with workspace.log.exclusive(), pytest.raises(WorkspaceError, match="another command"):
        ask(other)
    ask(other)
    other.close()
    assert len(trials(workspace)) == 1


def test_a_refused_disk_is_named_and_the_journal_stays_good(workspace):
    """A page limit stands for the full disk: SQLite then says `database or disk is full`."""
    number = ask(workspace).number
    connection = workspace.log._connection
    pages = connection.execute("PRAGMA page_count").fetchone()[0]
    connection.execute(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(WorkspaceError, match="free some disk space"):
        void(workspace, number, "x" * 100_000)
    connection.execute("PRAGMA max_page_count = 1000000")
    assert trials(workspace)[0].stage is Stage.ASKED
    tell(workspace, number, [0.0, 0.0])


def test_a_damaged_journal_is_named(workspace):
    workspace.close()
    (workspace.folder / "journal.sqlite").write_bytes(b"not a database at all" * 300)
    with pytest.raises(WorkspaceError, match="restore it from a copy"):
        Workspace(workspace.folder)


@pytest.mark.parametrize("column", ["time", "event"])
def test_an_event_that_is_no_text_is_named(workspace, column):
    """SQLite itself would not write it: a damaged page holds it."""
    ask(workspace)
    workspace.close()
    path = workspace.folder / "journal.sqlite"
    for statement in (
        "UPDATE sqlite_master SET sql = replace(sql, 'NOT NULL', '') WHERE type = 'table'",
        "DELETE FROM sqlite_master WHERE type = 'trigger'",
        f"UPDATE events SET {column} = NULL WHERE id = 2",
    ):
        connection = sqlite3.connect(path)
        connection.execute("PRAGMA writable_schema = ON")
        assert connection.execute(statement).rowcount > 0
        connection.commit()
        connection.close()
    with pytest.raises(WorkspaceError, match="event 2 is not what was written"):
        Workspace(workspace.folder).state.trials  # noqa: B018


def test_a_reading_that_was_damaged_on_the_disk_is_never_believed(workspace):
    tell(workspace, ask(workspace).number, [0.0512, 0.0])
    workspace.close()
    path = workspace.folder / "journal.sqlite"
    content = path.read_bytes()
    assert content.count(b"0.0512") > 0
    path.write_bytes(content.replace(b"0.0512", b"0.0112"))
    with pytest.raises(WorkspaceError, match="not what was written; restore"):
        Workspace(workspace.folder)


def test_a_commit_waits_for_the_disk(workspace):
    """EXTRA (3): the rollback journal's folder is synced too; a power cut cannot be tested here."""
    connection = workspace.log._connection
    assert connection.execute("PRAGMA synchronous").fetchone() == (3,)


def test_threads_may_share_a_workspace(workspace):
    session, problems = workspace.session(), []

    def work():
        for _ in range(5):
            try:
                session.tell(session.ask().number, [0.05, 0.0])
            except TrialStateError:
                pass  # another was quicker
            except Exception as error:
                problems.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not problems
    assert all(trial.stage is Stage.TOLD for trial in trials(workspace))


def test_it_knows_whether_anything_became_durable(workspace):
    with Workspace(workspace.folder) as other:
        assert not other.log.appended
        with pytest.raises(TypeError), other.log.exclusive():
            other.log.append(Voided(trial=1, reason=object()))
        assert not other.log.appended
        ask(other)
        assert other.log.appended


def test_a_journal_whose_events_are_a_view_is_refused(tmp_path):
    """One that counts without end would never be read."""
    journal = sqlite3.connect(tmp_path / "journal.sqlite")
    journal.execute("CREATE VIEW events AS SELECT 1 AS id")
    journal.execute(f"PRAGMA user_version = {JOURNAL_VERSION}")
    journal.commit()
    with pytest.raises(WorkspaceError, match="no table of events"):
        Journal(tmp_path, Store(tmp_path))

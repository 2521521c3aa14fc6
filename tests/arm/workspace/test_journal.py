"""The journal: append-only, one writer at a time, and no damage is believed."""

import contextlib
import os
import random
import shutil
import sqlite3
import threading

import pytest

from prior_reinforce.arm.workspace.execute import execute
from prior_reinforce.arm.workspace.journal import JOURNAL_VERSION, Journal
from prior_reinforce.arm.workspace.state import WorkspaceState
from prior_reinforce.arm.workspace.store import Store
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import TrialStateError, WorkspaceError
from prior_reinforce.session.events import Voided
from prior_reinforce.session.trials import Stage, Trial
from tests.arm.workspace.planar import ask, tell, trials, void
from tests.attacks import flips
from tests.attacks.harness import HELD, prepare

TRIGGERS = """
CREATE TRIGGER events_are_never_changed BEFORE UPDATE ON events
BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
CREATE TRIGGER events_are_never_deleted BEFORE DELETE ON events
BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
"""


@contextlib.contextmanager
def changed(workspace):
    """The journal as somebody else opens and changes it, without its triggers meanwhile."""
    connection = sqlite3.connect(workspace.folder / "journal.sqlite")
    with contextlib.closing(connection):
        for trigger in ("changed", "deleted"):
            connection.execute(f"DROP TRIGGER events_are_never_{trigger}")
        yield connection
        connection.executescript(TRIGGERS)
        connection.commit()


@pytest.mark.slow
def test_the_journal_is_append_only(workspace):
    ask(workspace)
    connection = sqlite3.connect(workspace.folder / "journal.sqlite")
    for statement in ("DELETE FROM events", "UPDATE events SET event = 'x'"):
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            connection.execute(statement)
    connection.close()


def test_two_programs_exclude_each_other(workspace, monkeypatch):
    monkeypatch.setattr("prior_reinforce.arm.workspace.journal._LOCK_TIMEOUT_S", 0.1)
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
    with changed(workspace) as connection:
        find = "SELECT sql FROM sqlite_master WHERE name = 'events'"
        (schema,) = connection.execute(find).fetchone()
    for sql in (schema.replace("NOT NULL", ""), schema):
        with changed(workspace) as connection:
            connection.execute("PRAGMA writable_schema = ON")
            connection.execute("UPDATE sqlite_master SET sql = ? WHERE name = 'events'", (sql,))
        if sql != schema:
            with changed(workspace) as connection:
                connection.execute(f"UPDATE events SET {column} = NULL WHERE id = 2")
    with pytest.raises(WorkspaceError, match="event 2 is not what was written"):
        Workspace(workspace.folder)


def test_a_reading_that_was_damaged_on_the_disk_is_never_believed(workspace):
    tell(workspace, ask(workspace).number, [0.0512, 0.0])
    workspace.close()
    path = workspace.folder / "journal.sqlite"
    content = path.read_bytes()
    assert content.count(b"0.0512") > 0
    path.write_bytes(content.replace(b"0.0512", b"0.0112"))
    with pytest.raises(WorkspaceError, match=r"not what was written\); restore"):
        Workspace(workspace.folder)


def test_a_commit_waits_for_the_disk(workspace):
    """EXTRA (3): the rollback journal's folder is synced too; a power cut cannot be tested here."""
    connection = workspace.log._connection
    assert connection.execute("PRAGMA synchronous").fetchone() == (3,)


@pytest.mark.slow
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
    with pytest.raises(WorkspaceError, match="its view 'events' is not of this program"):
        Journal(tmp_path, Store(tmp_path))


def test_an_event_that_is_missing_from_the_end_is_noticed(workspace):
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    void(workspace, 1, "the ball was pushed")
    with changed(workspace) as connection:
        connection.execute("DELETE FROM events WHERE id = (SELECT max(id) FROM events)")
    with pytest.raises(WorkspaceError, match="replaced while this program had it open"):
        void(workspace, 1, "again")
    workspace.close()
    with pytest.raises(WorkspaceError, match=r"is not how many were written\); restore it"):
        Workspace(workspace.folder)


def test_an_event_that_is_missing_from_the_middle_is_noticed(workspace):
    ask(workspace)
    workspace.close()
    with changed(workspace) as connection:
        connection.execute("DELETE FROM events WHERE id = 2")
    with pytest.raises(WorkspaceError, match="event 2 is missing"):
        Workspace(workspace.folder)


def test_events_that_were_written_after_one_was_lost_are_not_believed(workspace):
    """Their digests fit to what is left; their numbers do not."""
    ask(workspace)
    workspace.close()
    with changed(workspace) as connection:
        lost = connection.execute("SELECT * FROM events ORDER BY id DESC").fetchone()
        connection.execute("DELETE FROM events WHERE id = ?", lost[:1])
        connection.execute("INSERT INTO events (time, event, digest) VALUES (?, ?, ?)", lost[1:])
    with pytest.raises(WorkspaceError, match=f"event {lost[0]} is missing"):
        Workspace(workspace.folder)


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE TRIGGER t BEFORE INSERT ON events BEGIN SELECT RAISE(IGNORE); END",
        "CREATE TABLE t (x)",
        "CREATE VIEW t AS SELECT 1",
        "CREATE INDEX t ON events (time)",
    ],
)
def test_whatever_else_is_in_the_file_is_refused_also_while_it_is_open(workspace, statement):
    number = ask(workspace).number
    with contextlib.closing(sqlite3.connect(workspace.folder / "journal.sqlite")) as connection:
        connection.execute(statement)
    with pytest.raises(WorkspaceError, match=r"'t' is not of this program\); restore it"):
        tell(workspace, number, [0.0, 0.0])
    workspace.close()
    with pytest.raises(WorkspaceError, match="'t' is not of this program"):
        Workspace(workspace.folder)


def test_a_trigger_that_is_gone_is_refused(workspace):
    with contextlib.closing(sqlite3.connect(workspace.folder / "journal.sqlite")) as connection:
        connection.execute("DROP TRIGGER events_are_never_deleted")
    workspace.close()
    with pytest.raises(WorkspaceError, match="has no trigger events_are_never_deleted"):
        Workspace(workspace.folder)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["moved over", "copied over", "removed", "folder moved over"])
def test_a_journal_that_is_replaced_while_it_is_open_is_named_and_nothing_is_executed(
    workspace, how, tmp_path
):
    journal, copy = workspace.folder / "journal.sqlite", tmp_path / "copy"
    before = shutil.copytree(workspace.folder, tmp_path / "before")
    number = ask(workspace).number
    shutil.copytree(workspace.folder, copy)
    if how == "moved over":
        os.replace(copy / "journal.sqlite", journal)
    elif how == "copied over":
        shutil.copyfile(before / "journal.sqlite", journal)
    elif how == "removed":
        journal.unlink()
    else:
        shutil.rmtree(workspace.folder)
        copy.rename(workspace.folder)
    moved = tmp_path / "moved"
    for act in (
        lambda: workspace.state,
        lambda: workspace.events,
        lambda: tell(workspace, number, [0.0, 0.0]),
        lambda: execute(workspace, number, f"touch {moved} {{plan}}", time_limit=10),
    ):
        with pytest.raises(WorkspaceError, match="replaced while this program had it open; start"):
            act()
    assert not moved.exists()


def test_a_journal_that_is_replaced_while_an_event_is_written_is_named(workspace, tmp_path):
    number = ask(workspace).number
    journal, copy = workspace.folder / "journal.sqlite", tmp_path / "copy"
    shutil.copyfile(journal, copy)
    replaced = pytest.raises(WorkspaceError, match="replaced while this program had it open")
    with replaced, workspace.log.exclusive():
        workspace.log.append(Voided(trial=number, reason="lost"))
        os.replace(copy, journal)


def test_a_journal_that_shrinks_to_no_table_is_not_begun_anew(workspace):
    """The number of cells of the first page is 4; one bit makes it 0."""
    workspace.close()
    journal = workspace.folder / "journal.sqlite"
    content = bytearray(journal.read_bytes())
    assert content[104] == 4
    content[104] = 0
    journal.write_bytes(content)
    with pytest.raises(WorkspaceError, match="restore it from a copy"):
        Workspace(workspace.folder)
    assert journal.read_bytes() == content


@pytest.mark.slow
def test_no_flipped_bit_loses_an_event_in_silence(tmp_path):
    asked = prepare(tmp_path)
    whole, content, before = flips.several(asked)
    verdicts = {
        seed: flips.check(whole, flips.damaged(random.Random(seed), content), before)
        for seed in range(100)
    }
    assert {seed: said for seed, said in verdicts.items() if said != HELD} == {}


@pytest.fixture
def queries(monkeypatch):
    """What SQLite is asked by journals that are opened now."""
    asked = []
    connect = sqlite3.connect

    def traced(*args, **options):
        connection = connect(*args, **options)
        connection.set_trace_callback(asked.append)
        return connection

    monkeypatch.setattr(sqlite3, "connect", traced)
    return asked


@pytest.mark.slow
def test_events_are_folded_once_and_read_once(tmp_path, queries, monkeypatch):
    folder, _, before = flips.several(prepare(tmp_path))
    folded = []
    monkeypatch.setattr(
        WorkspaceState,
        "add",
        lambda state, entry, add=WorkspaceState.add: folded.append(entry) or add(state, entry),
    )
    queries.clear()
    with Workspace(folder) as workspace:
        workspace.status()
        ask(workspace)
        tell(workspace, flips.TRIALS + 1, [0.0, 0.0])
        assert [entry.id for entry in folded] == [*range(1, len(before) + 3)]
    selected = [query for query in queries if query.startswith("SELECT id")]
    assert len(selected) == 3  # at opening, and after each of the two events


@pytest.mark.slow
def test_an_event_costs_the_same_however_many_came_before(tmp_path, monkeypatch):
    """Counted in looks at trials: `Trial.open` is what the square was made of."""
    folder, _, before = flips.several(prepare(tmp_path))
    looks = []
    monkeypatch.setattr(
        Trial,
        "open",
        property(lambda trial, open=Trial.open: looks.append(trial) or open.fget(trial)),
    )
    with Workspace(folder) as workspace:
        assert len(looks) <= 4 * len(before)
        workspace.status()
        assert len(looks) <= 5 * len(before)

"""A read-only folder and a full disk: a clear error, and a journal that is good."""

import subprocess
import sys
from pathlib import Path

import pytest

from prior_reinforce.bench.workspace.workspace import Workspace

pytestmark = pytest.mark.slow


@pytest.fixture
def folder(workspace):
    """Of a workspace with an open trial, in a place that only its owner may read."""
    workspace.session().ask()
    workspace.close()
    workspace.folder.parent.chmod(0o700)
    return workspace.folder


def refused(how, *command):
    program = Path(__file__).with_name("refused_disk.py")
    done = subprocess.run(
        [sys.executable, program, how, *map(str, command)], capture_output=True, text=True
    )
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    return done.stderr


def test_a_read_only_folder_is_named_and_nothing_is_lost(folder):
    folder.chmod(0o555)
    (folder / "journal.sqlite").chmod(0o444)
    before = (folder / "journal.sqlite").read_bytes()
    assert "make the folder writable" in refused("read-only", "tell", folder, 1, "--hit")
    assert (folder / "journal.sqlite").read_bytes() == before


def test_a_full_disk_is_named_and_the_journal_goes_on(folder):
    message = refused("full", "void", folder, 1, "--reason", "x" * 5000)
    assert "free some disk space" in message
    workspace = Workspace(folder)
    assert [event.kind for event in workspace.events][-1] == "asked"
    workspace.session().tell(1, [0.05, 0.0])
    workspace.close()
    assert "cannot write" in refused("full", "ask", folder)
    workspace = Workspace(folder)
    assert [event.kind for event in workspace.events][-1] == "told"
    assert workspace.session().ask().number == 2
    workspace.close()

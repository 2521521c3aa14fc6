"""The lock of an execution: one at a time."""

import subprocess

import pytest

from prior_reinforce.bench.robots.executors.lock import executing_lock, is_executing
from prior_reinforce.errors import TrialStateError, WorkspaceError


def test_one_holds_it_and_leaving_frees_it(tmp_path):
    assert not is_executing(tmp_path)
    with executing_lock(tmp_path):
        assert is_executing(tmp_path)
        with pytest.raises(TrialStateError, match="wait for it"), executing_lock(tmp_path):
            pass
        assert is_executing(tmp_path)
    assert not is_executing(tmp_path)


def test_looking_keeps_nobody_from_executing(tmp_path):
    for _ in range(2):
        with executing_lock(tmp_path):
            pass
        assert not is_executing(tmp_path)


def test_what_holds_it_outlives_who_took_it(tmp_path):
    """A driver that inherited it goes on, though we left the block."""
    with executing_lock(tmp_path) as lock:
        driver = subprocess.Popen(["sleep", "60"], pass_fds=(lock,))
    try:
        assert is_executing(tmp_path)
    finally:
        driver.kill()
        driver.wait()
    assert not is_executing(tmp_path)


def test_there_is_no_file_to_delete(tmp_path):
    with executing_lock(tmp_path):
        assert not list(tmp_path.iterdir())
        (tmp_path / "executing.lock").touch()  # what older versions used
        (tmp_path / "executing.lock").unlink()
        assert is_executing(tmp_path)


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with (
        pytest.raises(WorkspaceError, match="make it a readable folder"),
        executing_lock(tmp_path / "none"),
    ):
        pass

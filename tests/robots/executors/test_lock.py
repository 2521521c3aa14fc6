"""The lock of an execution: one at a time."""

import subprocess

import pytest

from prior_reinforce.errors import TrialStateError, WorkspaceError
from prior_reinforce.robots.executors.lock import executing_lock, is_executing


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


def test_what_a_command_left_running_does_not_hold_it(tmp_path):
    """A driver may start a daemon that inherits everything; it executes no trial."""
    with executing_lock(tmp_path) as lock:
        daemon = subprocess.Popen(["sleep", "60"], pass_fds=(lock,))
    try:
        assert not is_executing(tmp_path)
    finally:
        daemon.kill()
        daemon.wait()


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with (
        pytest.raises(WorkspaceError, match="make the folder writable"),
        executing_lock(tmp_path / "none"),
    ):
        pass

"""The lock of an execution: one at a time, on a workspace and on an arm."""

import errno
import os
import signal
import socket
import subprocess
import sys
import time

import pytest

from prior_reinforce.arm.executing.drive import program
from prior_reinforce.arm.executing.lock import (
    MARK,
    executing_lock,
    is_executing,
    marked,
    programs_executing,
    stop_executing,
    stop_marked,
)
from prior_reinforce.errors import ConfigurationError, TrialStateError, WorkspaceError

on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="sockets and /proc")


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


@on_linux
def test_an_arm_is_one_whatever_workspace_moves_it(tmp_path):
    (tmp_path / "copy").mkdir()
    with executing_lock(tmp_path):
        with (
            pytest.raises(TrialStateError, match=r"\[robot\] arm"),
            executing_lock(tmp_path / "copy"),
        ):
            pass
        assert not is_executing(tmp_path / "copy")
        with executing_lock(tmp_path / "copy", arm="left"):
            pass


@pytest.mark.slow
@on_linux
def test_a_program_of_ours_is_named_by_its_module(tmp_path):
    (tmp_path / "sleeper.py").write_text("import time\n\n\ndef main():\n    time.sleep(60)\n")
    with executing_lock(tmp_path) as lock:
        own = {MARK: " ".join(lock.names), "PYTHONPATH": str(tmp_path)}
        ours = subprocess.Popen(program("sleeper"), env=os.environ | own)
        try:
            assert programs_executing(tmp_path) == [(ours.pid, "python -m sleeper")]
        finally:
            ours.kill()
            ours.wait()


@pytest.mark.slow
@on_linux
@pytest.mark.parametrize("close", [False, True])
def test_what_holds_it_outlives_who_took_it(tmp_path, close):
    """A driver that inherited it goes on, though we left the block; or closed what it inherited."""
    with executing_lock(tmp_path) as lock:
        driver = subprocess.Popen(
            ["sleep", "60"],
            pass_fds=() if close else lock.descriptors,
            env=os.environ | ({MARK: " ".join(lock.names)} if close else {}),
        )
    try:
        assert is_executing(tmp_path)
        assert programs_executing(tmp_path) == [(driver.pid, "sleep 60")] * close
        for folder in (tmp_path, None):
            with pytest.raises(TrialStateError, match="wait for it"), executing_lock(folder):
                pass
    finally:
        driver.kill()
        driver.wait()
    assert not is_executing(tmp_path)


@pytest.mark.slow
@on_linux
def test_what_bears_a_mark_is_stopped_whatever_it_ignores():
    drivers = [
        subprocess.Popen(["sh", "-c", text], env=os.environ | {MARK: f"arm-0 {name}"})
        for text, name in (("sleep 60", "run-1"), ("trap '' TERM; exec sleep 60", "run-1"))
        for name in (name, name.replace("1", "2"))
    ]
    try:
        assert len(marked("run-1")) >= 2
        stop_marked("run-1", time.monotonic() + 0.2)
        assert not marked("run-1")
        assert [driver.poll() is None for driver in drivers] == [False, True, False, True]
    finally:
        stop_marked("arm-0", 0.0)
        for driver in drivers:
            driver.wait()


@on_linux
def test_who_started_it_is_asked_to_stop_once_and_asks_what_it_started(tmp_path):
    inner = "trap 'echo asked >> said; exit' TERM; while :; do sleep 0.05; done"
    outer = f"sh -c '{inner.replace(chr(39), chr(34))}' & trap 'kill $!; wait; exit' TERM; wait"
    with executing_lock(tmp_path) as lock:
        env = os.environ | {MARK: " ".join(lock.names)}
        started = subprocess.Popen(["sh", "-c", outer], env=env, cwd=tmp_path)
        while len(marked(lock.names[1])) < 2:
            pass
        time.sleep(0.3)  # both have set their traps
        stop_executing(tmp_path)
        started.wait()
        assert not marked(lock.names[1])
    assert (tmp_path / "said").read_text() == "asked\n"


@pytest.mark.slow
@on_linux
def test_what_does_not_stop_when_it_is_asked_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr("prior_reinforce.arm.executing.lock.GRACE", 0.1)
    with executing_lock(tmp_path) as lock:
        env = os.environ | {MARK: " ".join(lock.names)}
        started = subprocess.Popen(["sh", "-c", "trap '' TERM; exec sleep 60"], env=env)
        while not marked(lock.names[1]):
            pass
        stop_executing(tmp_path)
        assert started.wait() == -signal.SIGKILL


def test_there_is_no_file_to_delete(tmp_path):
    with executing_lock(tmp_path):
        assert not list(tmp_path.iterdir())
        assert is_executing(tmp_path)


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with (
        pytest.raises(WorkspaceError, match="make it a readable folder"),
        executing_lock(tmp_path / "none"),
    ):
        pass


@on_linux
def test_a_stop_that_cannot_be_noted_says_so(tmp_path):
    (tmp_path / ".stopped").symlink_to("elsewhere")
    with pytest.raises(WorkspaceError, match=r"the stop cannot be noted .*waiting commands too"):
        stop_executing(tmp_path)
    assert not (tmp_path / "elsewhere").exists()


@on_linux
def test_a_file_system_without_locks_is_named(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", refuse)
    with pytest.raises(WorkspaceError, match=r"No locks available.*to a local disk"):
        is_executing(tmp_path)


@on_linux
def test_a_system_that_forbids_sockets_locks_no_arm(monkeypatch):
    class Forbidden(socket.socket):
        def bind(self, address):
            raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr("socket.socket", Forbidden)
    with (
        pytest.raises(
            ConfigurationError, match=r"not permitted.*let this program use Unix sockets"
        ),
        executing_lock(),
    ):
        pass

"""One trial at a time, even where our program is killed and the controller it started goes on."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from prior_reinforce.errors import TrialStateError, WorkspaceError
from prior_reinforce.robots.executors.lock import executing_lock, is_executing
from prior_reinforce.workspace.execution import execute
from prior_reinforce.workspace.history import TrialStage
from prior_reinforce.workspace.trials import ask, tell
from prior_reinforce.workspace.workspace import Workspace


def wait_for(what):
    deadline = time.monotonic() + 60
    while not what():
        assert time.monotonic() < deadline, "waited a minute in vain"
        time.sleep(0.02)


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


CONTROLLER = """
import pathlib, sys, time
here = pathlib.Path(sys.argv[1])
with open(here / "runs", "a") as file:
    file.write("moved\\n")
until = time.monotonic() + 60
while not (here / "stop").exists() and time.monotonic() < until:
    time.sleep(0.02)
"""
PROGRAM = """
import sys
from prior_reinforce.workspace.execution import execute
from prior_reinforce.workspace.workspace import Workspace
execute(Workspace(sys.argv[1]), 1, sys.argv[2], time_limit=120)
"""


@pytest.mark.slow
def test_a_controller_that_outlives_our_program_keeps_the_arm_to_itself(workspace, tmp_path):
    (tmp_path / "arm.py").write_text(CONTROLLER)
    command = f"{sys.executable} {tmp_path}/arm.py {tmp_path} {{plan}}"
    program = subprocess.Popen([sys.executable, "-c", PROGRAM, workspace.folder, command])
    wait_for((tmp_path / "runs").exists)
    os.kill(program.pid, signal.SIGKILL)
    program.wait()

    for moved_or_not in ({}, {"arm_did_not_move": True}):
        with pytest.raises(TrialStateError, match="executing now"):
            ask(workspace, **moved_or_not)
    # Even told trials make no room for the next while the arm moves.
    tell(workspace, 1, [0.05, 0.0])
    assert ask(workspace).number == 2
    with pytest.raises(TrialStateError, match="executed right now"):
        execute(workspace, 2, command, time_limit=1)

    (tmp_path / "stop").touch()
    wait_for(lambda: not is_executing(workspace.folder))
    assert (tmp_path / "runs").read_text() == "moved\n"
    assert execute(workspace, 2, command, time_limit=60).succeeded
    assert workspace.record(2).stage is TrialStage.EXECUTED


@pytest.fixture
def workspace(learned_folder, tmp_path):
    shutil.copytree(learned_folder, tmp_path / "planar")
    workspace = Workspace(tmp_path / "planar")
    workspace.set_goal([0.9, 0.05])
    ask(workspace)
    yield workspace
    workspace.close()

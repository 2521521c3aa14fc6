"""One trial at a time, even where our program is killed and the controller it started goes on."""

import os
import signal
import subprocess
import sys
import time

import pytest

from prior_reinforce.errors import TrialStateError
from prior_reinforce.trials import Stage


def wait_for(what):
    deadline = time.monotonic() + 60
    while not what():
        assert time.monotonic() < deadline, "waited a minute in vain"
        time.sleep(0.02)


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
from prior_reinforce.workspace.workspace import Workspace
Workspace(sys.argv[1]).execute(1, sys.argv[2], time_limit=120)
"""


@pytest.mark.slow
def test_a_controller_that_outlives_our_program_keeps_the_arm_to_itself(workspace, tmp_path):
    workspace.session().ask()
    (tmp_path / "arm.py").write_text(CONTROLLER)
    command = f"{sys.executable} {tmp_path}/arm.py {tmp_path} {{plan}}"
    program = subprocess.Popen([sys.executable, "-c", PROGRAM, workspace.folder, command])
    wait_for((tmp_path / "runs").exists)
    os.kill(program.pid, signal.SIGKILL)
    program.wait()

    for moved_or_not in ({}, {"arm_did_not_move": True}):
        with pytest.raises(TrialStateError, match="executing now"):
            workspace.session().ask(**moved_or_not)
    # Even told trials make no room for the next while the arm moves.
    workspace.session().tell(1, [0.05, 0.0])
    assert workspace.session().ask().number == 2
    with pytest.raises(TrialStateError, match="executed right now"):
        workspace.execute(2, command, time_limit=1)

    (tmp_path / "stop").touch()
    wait_for(lambda: not workspace.log.is_executing())
    assert (tmp_path / "runs").read_text() == "moved\n"
    assert workspace.execute(2, command, time_limit=60).succeeded
    assert workspace.session().trial(2).stage is Stage.EXECUTED

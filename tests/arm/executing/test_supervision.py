"""What happens here while a command runs: nothing that is raised leaves the arm moving."""

import errno
import io
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.arm.executing.command import run_command
from prior_reinforce.arm.executing.supervision import read_ended
from prior_reinforce.arm.robots.plan_files import write_plan
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="prctl and /proc")
MOVES = "echo $$ > {here}/pid; echo moves; sleep 60; touch {here}/moved"


@pytest.fixture
def moves(tmp_path):
    plan = Plan(np.zeros((5, 2)), PlanFormat(("a", "b"), ("rad", "rad"), 0.01))
    (tmp_path / "drive.sh").write_text(MOVES.replace("{here}", str(tmp_path)))
    return f"sh {tmp_path}/drive.sh {{plan}}", write_plan(plan, tmp_path / "plan.npz")


def has_begun(here):
    return (here / "pid").exists() and (here / "pid").read_text()


def has_ended(here):
    assert has_begun(here)
    return not Path("/proc", (here / "pid").read_text().strip()).exists()


@pytest.mark.parametrize("said", [b"", b"{", b'{"fault": "\xff"}', b'{"fault": "why"}'])
def test_a_supervisor_that_wrote_nothing_whole_said_nothing(said):
    assert read_ended(io.BytesIO(said)) is None


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_what_show_raises_stops_the_command_first(moves, tmp_path, error):
    def show(text):
        raise error("shown")

    with pytest.raises(error, match="shown"):
        run_command(*moves, time_limit=120, show=show)
    assert has_ended(tmp_path)
    assert not (tmp_path / "moved").exists()


def test_what_a_signals_handler_raises_stops_the_command_first(moves, tmp_path):
    raised = []

    def expire(*_):
        if not has_begun(tmp_path):
            return
        if len(raised) < 5:  # again and again, but not after all has ended
            raised.append(1)
            raise TimeoutError("of a test")

    before = signal.signal(signal.SIGALRM, expire)
    signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
    try:
        with pytest.raises(TimeoutError, match="of a test"):
            run_command(*moves, time_limit=120)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert has_ended(tmp_path)


def test_a_reader_that_left_ends_no_motion(moves, tmp_path):
    def show(text):
        raise BrokenPipeError

    command = "sh -c 'echo moves; sleep 0.2; exit 3' {plan}"
    assert run_command(command, moves[1], time_limit=60, show=show).exit_status == 3


def test_where_the_system_starts_nothing_nothing_has_run(moves, tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr("subprocess.Popen", refuse)
    with pytest.raises(
        ConfigurationError, match=r"nothing can be started .*unavailable.*make room"
    ):
        run_command(*moves, time_limit=30)
    assert not (tmp_path / "pid").exists()

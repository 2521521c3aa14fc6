"""The supervisor: whatever is signalled to whom, nothing that it started outlives the lock."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.bench.robots.executors.command import run_command
from prior_reinforce.bench.robots.executors.lock import executing_lock, is_executing
from prior_reinforce.bench.robots.plan_files import write_plan
from prior_reinforce.errors import TrialStateError
from prior_reinforce.plans.motions import Plan, PlanFormat

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="prctl and /proc")

PROGRAM = """
import sys
from pathlib import Path
from prior_reinforce.bench.robots.plan_files import PlanFile
from prior_reinforce.bench.robots.executors.command import run_command
from prior_reinforce.bench.robots.executors.lock import executing_lock
folder, path, sha256, command, limit = sys.argv[1:]
with executing_lock(Path(folder)) as lock:
    run_command(command, PlanFile(Path(path), sha256), time_limit=float(limit), keep_open=(lock,))
"""
MOVES = "trap '' TERM; echo $$ > {here}/pid; while [ ! -e {here}/stop ]; do sleep 0.02; done"
RESTS = """
import pathlib, signal, sys, time
here = pathlib.Path("{here}")
def rest(*_):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    time.sleep(0.5)
    (here / "rested").touch()
    sys.exit(0)
signal.signal(signal.SIGTERM, rest)
(here / "pid").write_text("1")
time.sleep(60)
"""


def wait_for(what, seconds=30):
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


@pytest.fixture
def plan_file(tmp_path):
    plan = Plan(np.zeros((5, 2)), PlanFormat(("a", "b"), ("rad", "rad"), 0.01))
    return write_plan(plan, tmp_path / "plan.npz")


def _hear_signals():
    """Tests that run in the background of a shell, or under nohup, inherit signals as ignored."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


@pytest.fixture
def start(tmp_path, plan_file):
    """Start a program that executes a script under the lock; ends whatever is left of it."""
    script, started = tmp_path / "drive.sh", []

    def begin(text, limit=60.0, how="sh {script} {plan}"):
        script.write_text(text.replace("{here}", str(tmp_path)))
        command = how.replace("{script}", str(script))
        arguments = (tmp_path, plan_file.path, plan_file.sha256, command, limit)
        program = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *map(str, arguments)],
            start_new_session=True,
            stderr=subprocess.PIPE,
            preexec_fn=_hear_signals,
        )
        started.append(program)
        wait_for((tmp_path / "pid").exists)
        wait_for((tmp_path / "pid").read_text)
        return program

    yield begin
    (tmp_path / "stop").touch()
    for program in started:
        program.kill()
        program.communicate()
    wait_for(lambda: not is_executing(tmp_path))


def supervisor_of(program):
    """The program's only child."""
    children = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
    assert len(children) == 1
    return int(children[0])


def test_a_driver_that_detaches_is_found_at_the_time_limit(tmp_path, plan_file):
    script = tmp_path / "drive.sh"
    script.write_text(f"setsid sh -c '(sleep 60 & echo $! > {tmp_path}/pid) &'")
    start = time.monotonic()
    result = run_command(f"sh {script} {{plan}}", plan_file, time_limit=1.5)
    assert result.timed_out
    assert result.outcome == "aborted"
    assert "sleep" in result.reason
    assert "still runs: sleep" in result.output_tail
    assert time.monotonic() - start < 30
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_a_driver_that_detaches_is_waited_for(tmp_path, plan_file):
    script = tmp_path / "drive.sh"
    script.write_text(f"setsid sh -c 'sleep 0.5; touch {tmp_path}/moved' &")
    result = run_command(f"sh {script} {{plan}}", plan_file, time_limit=30)
    assert result.outcome == "done"
    assert (tmp_path / "moved").exists()


@pytest.mark.parametrize("killed", ["program", "supervisor", "both"])
def test_nobody_else_may_execute_while_a_driver_goes_on(start, tmp_path, killed):
    program = start(MOVES)
    watcher = supervisor_of(program)
    if killed != "program":
        os.kill(watcher, signal.SIGKILL)
    if killed != "supervisor":
        program.kill()
    program.wait(30)
    for path in tmp_path.glob("*.lock"):  # a deleted lock changes nothing: none is a file
        path.unlink()
    assert is_executing(tmp_path)
    with pytest.raises(TrialStateError, match="executed right now"), executing_lock(tmp_path):
        pass
    (tmp_path / "stop").touch()
    wait_for(lambda: not is_executing(tmp_path))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("whole_group", [False, True])
def test_a_driver_comes_to_rest_however_often_we_are_interrupted(
    start, tmp_path, number, whole_group
):
    """A terminal's Ctrl-C reaches the whole group; `kill` only the program."""
    program = start(RESTS, how=f"{sys.executable} {{script}} {{plan}}")
    for _ in range(5):
        (os.killpg if whole_group else os.kill)(program.pid, number)
        assert is_executing(tmp_path)
        time.sleep(0.05)
    assert program.wait(30) != 0
    assert not is_executing(tmp_path)
    assert (tmp_path / "rested").exists()


def test_a_driver_that_will_not_stop_is_killed(start, tmp_path):
    program = start(MOVES, limit=60)
    os.kill(program.pid, signal.SIGINT)
    os.kill(program.pid, signal.SIGINT)
    program.wait(30)
    assert not is_executing(tmp_path)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_what_a_command_writes_is_shown_before_it_ends(tmp_path, plan_file):
    """Python writes line by line only to a terminal; the driver does not flush."""
    script = tmp_path / "drive.py"
    script.write_text(
        "import pathlib, sys, time\nprint('approaching')\n"
        f"until = time.monotonic() + 30\nwhile not pathlib.Path({str(tmp_path / 'seen')!r})"
        ".exists() and time.monotonic() < until: time.sleep(0.01)\n"
        "print('é' * 3)\n"
    )
    shown = []

    def show(text):
        shown.append(text)
        (tmp_path / "seen").touch()

    result = run_command(f"{sys.executable} {script} {{plan}}", plan_file, time_limit=60, show=show)
    assert shown[0]
    assert "approaching\n".startswith(shown[0])  # a busy machine may show the line in two parts
    assert "".join(shown) == result.output_tail == "approaching\nééé\n"
    assert result.seconds < 20


def test_a_driver_can_ask_a_person(tmp_path, plan_file):
    script = tmp_path / "ask.py"
    script.write_text("import sys; print('heard', input('ready? '), sys.stdin.isatty())")
    ours, theirs = os.openpty()
    try:
        command = f"sh -c '{sys.executable} {script} > {tmp_path}/heard' {{plan}}"
        arguments = (tmp_path, plan_file.path, plan_file.sha256, command, 60)
        program = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *map(str, arguments)], stdin=theirs
        )
        os.write(ours, b"yes\n")
        assert program.wait(60) == 0
    finally:
        os.close(ours)
        os.close(theirs)
    assert "heard yes True" in (tmp_path / "heard").read_text()


def test_endless_output_fills_no_disk(tmp_path, plan_file):
    folder = tmp_path / "result"
    folder.mkdir()
    result = run_command(
        "sh -c 'head -c 30000000 /dev/zero; echo end' {plan}",
        plan_file,
        time_limit=60,
        folder=folder,
    )
    assert result.output_tail.endswith("end\n")
    assert (folder / "output.txt").stat().st_size < 17_000_000


def test_a_command_that_fails_before_anybody_looks_has_failed(tmp_path):
    program = (
        "import json, subprocess, sys, time\n"
        "from prior_reinforce.bench.robots.executors import supervisor\n"
        "start = subprocess.Popen.__init__\n"
        "def slow(self, *args, **more):\n"
        "    start(self, *args, **more)\n"
        "    time.sleep(0.3)\n"
        "subprocess.Popen.__init__ = slow\n"
        "supervisor.main(json.loads(sys.argv[1]))\n"
    )
    ended = tmp_path / "ended.json"
    with (tmp_path / "output").open("wb") as output:
        request = {
            "arguments": ["false"], "output": output.fileno(), "ended": str(ended),
            "keep_open": [], "time_limit": 5.0, "grace": 1.0,
        }  # fmt: skip
        subprocess.run(
            [sys.executable, "-c", program, json.dumps(request)],
            check=True,
            pass_fds=[output.fileno()],
        )
    assert json.loads(ended.read_text())["exit_status"] == 1

"""The supervisor: whatever is signalled to whom, nothing that it started outlives the lock."""

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.arm.executing.command import run_command
from prior_reinforce.arm.executing.lock import (
    executing_lock,
    is_executing,
    stop_executing,
)
from prior_reinforce.arm.robots.plan_files import write_plan
from prior_reinforce.errors import TrialStateError
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="prctl and /proc")

PROGRAM = """
import sys
from pathlib import Path
from prior_reinforce.arm.robots.plan_files import PlanFile
from prior_reinforce.arm.executing.command import execute_command
from prior_reinforce.arm.executing.lock import executing_lock
from prior_reinforce.arm.executing.supervision import Interruptions
folder, path, sha256, command, limit = sys.argv[1:]
result = Path(folder, "result")
result.mkdir()
try:
    with executing_lock(Path(folder)) as lock, Interruptions() as interruptions:
        execute_command(
            command, PlanFile(Path(path), sha256), result, time_limit=float(limit), lock=lock,
            interruptions=interruptions,
        )
except KeyboardInterrupt:
    sys.exit(1)
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


# What a wrapper in Python starts has none of the descriptors that the wrapper inherited.
WRAPS = "import subprocess, sys; sys.exit(subprocess.run(sys.argv[1:]).returncode)"


def tree_of(program):
    """What a program started: the supervisor, the command, ..."""
    found = [int(program.pid)]
    for pid in found:
        with contextlib.suppress(OSError):  # it has ended
            found += map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
    return found[1:]


@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.parametrize(
    ("killed", "goes_on"),
    [(("program",), True), (("supervisor",), False), (("program", "supervisor"), True)],
)
def test_whoever_is_killed_the_motion_ends_or_the_lock_stands(
    start, tmp_path, killed, goes_on, wrapped
):
    how = f'{sys.executable} -c "{WRAPS}" sh {{script}} {{plan}}' if wrapped else None
    program = start(MOVES, **({"how": how} if how else {}))
    pids = {"program": program.pid, "supervisor": tree_of(program)[0]}
    driver = int((tmp_path / "pid").read_text())
    for name in killed:
        os.kill(pids[name], signal.SIGKILL)
    program.wait(30)
    if goes_on:
        assert is_executing(tmp_path)
        for folder in (tmp_path, None):  # the workspace's, and the arm's
            with pytest.raises(TrialStateError, match="right now"), executing_lock(folder):
                pass
        assert running(driver)
        (tmp_path / "stop").touch()
    # The lock is free no sooner than the motion has ended.
    wait_for(lambda: not is_executing(tmp_path))
    assert not running(driver)


def running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


BEGIN = "supervisor.main(json.loads(sys.argv[1]))"


@contextlib.contextmanager
def supervised(here, arguments, prelude="", ended="ended", **request):
    """The supervisor of a command, after some code of its own; it is let to begin."""
    program = f"import errno, json, os, sys, time\n{IMPORTS}\n{prelude}\n{BEGIN}"
    ours, theirs = socket.socketpair()
    with ours, theirs, (here / "output").open("wb") as output, (here / ended).open("wb") as report:
        files = [output.fileno(), report.fileno(), theirs.fileno()]
        given = dict(zip(("output", "ended", "channel"), files, strict=True))
        given |= {"keep_open": [], "time_limit": 30.0, "grace": 0.5, "arguments": arguments}
        started = subprocess.Popen(
            [sys.executable, "-c", program, json.dumps(given | request)],
            pass_fds=files,
            stderr=subprocess.PIPE,
            text=True,
        )
        ours.send(b"!")
        try:
            yield started
        finally:
            for pid in reversed([started.pid, *tree_of(started)]):
                with contextlib.suppress(OSError):
                    os.kill(pid, signal.SIGKILL)
            started.communicate()


IMPORTS = "from prior_reinforce.arm.executing import supervisor"
REFUSED = """
kill = os.kill
def refused(pid, number):
    if open(f'/proc/{pid}/comm').read() == 'moves\\n': raise PermissionError
    kill(pid, number)
os.kill = refused
"""


def report_of(here):
    return json.loads((here / "ended").read_text())


def test_a_driver_of_another_user_is_told_of_at_once_and_waited_for(tmp_path):
    """As with `sudo` in the command: what may not be signalled goes on."""
    (tmp_path / "moves").symlink_to(shutil.which("sleep"))
    start = time.monotonic()
    command = ["sh", "-c", f"trap '' TERM; exec {tmp_path}/moves 3"]
    with supervised(tmp_path, command, REFUSED, time_limit=0.3, grace=0.1) as supervisor:
        said = supervisor.stderr.readline()
        assert "CANNOT STOP moves" in said
        assert "use its stop button" in said
        (driver,) = tree_of(supervisor)
        assert running(driver)
        assert supervisor.communicate(timeout=60)[1] == ""
        assert not running(driver)
    assert time.monotonic() - start >= 3
    assert "moves" in report_of(tmp_path)["unstoppable"]


def test_a_driver_may_delete_its_folder(tmp_path, plan_file):
    command = "sh -c 'rm -r $0; echo gone' {result} {plan}"
    result = run_command(command, plan_file, time_limit=60)
    assert (result.outcome, result.output_tail) == ("done", "gone\n")


def test_a_driver_that_is_stopped_and_continued_ends_as_what_it_was(tmp_path, plan_file):
    text = "(sleep 0.3; kill -CONT $$) & kill -STOP $$; echo on; exit 4"
    result = run_command(f"sh -c '{text}' {{plan}}", plan_file, time_limit=60)
    assert (result.exit_status, result.timed_out, result.interrupted) == (4, False, False)
    assert result.output_tail == "on\n"


def test_what_is_over_at_once_ends_as_what_it_was(plan_file):
    for status in (0, 3, 75) * 3:
        result = run_command(f"sh -c 'echo x; exit {status}' {{plan}}", plan_file, time_limit=60)
        assert (result.exit_status, result.output_tail) == (status, "x\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP])
@pytest.mark.parametrize("whole_group", [False, True])
def test_a_driver_comes_to_rest_however_often_we_are_interrupted(
    start, tmp_path, number, whole_group
):
    """A terminal's Ctrl-C and Ctrl-Z reach the whole group; `kill` only the program."""
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
    size = f"wc -c < $0/output.txt > {tmp_path}/size"
    text = "head -c 30000000 /dev/zero; echo end; sleep 0.3"
    result = run_command(f"sh -c '{text}; {size}' {{result}} {{plan}}", plan_file, time_limit=60)
    assert result.output_tail.endswith("end\n")
    assert int((tmp_path / "size").read_text()) < 17_000_000


def test_a_full_disk_lets_nobody_say_how_it_ended_and_raises_nothing(tmp_path):
    (tmp_path / "full").symlink_to("/dev/full")
    with supervised(tmp_path, ["true"], ended="full") as supervisor:
        assert supervisor.communicate(timeout=60)[1] == ""
        assert supervisor.returncode == 0


def test_a_command_that_fails_before_anybody_looks_has_failed(tmp_path):
    slow = (
        "start = supervisor.subprocess.Popen.__init__\n"
        "def slow(self, *args, **more):\n"
        "    start(self, *args, **more)\n"
        "    time.sleep(0.3)\n"
        "supervisor.subprocess.Popen.__init__ = slow\n"
    )
    with supervised(tmp_path, ["false"], slow) as supervisor:
        supervisor.communicate(timeout=60)
    assert report_of(tmp_path)["exit_status"] == 1


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize("how", ["limit", "interrupt", "stop"])
def test_a_supervisor_that_somebody_stopped_stops_the_motion_all_the_same(
    start, tmp_path, how, again
):
    """SIGSTOP, as of a debugger; again and again, as of a cgroup that is frozen."""
    program = start(MOVES, limit=1.0 if how == "limit" else 60.0)
    (supervisor, *_), driver = tree_of(program), int((tmp_path / "pid").read_text())
    ended = threading.Event()

    def stop():
        with contextlib.suppress(ProcessLookupError):
            os.kill(supervisor, signal.SIGSTOP)
            while again and not ended.wait(0.001):
                os.kill(supervisor, signal.SIGSTOP)

    stopping = threading.Thread(target=stop)
    stopping.start()
    if how == "interrupt":
        program.send_signal(signal.SIGINT)
    if how == "stop":
        stop_executing(tmp_path)
    program.wait(50)
    ended.set()
    stopping.join()
    assert not is_executing(tmp_path)
    assert not running(driver)


CALLS = ("os.listdir", "os.read", "os.readlink", "os.waitpid", "select.select", "Path.read_text")
FAILS = """
import select
from pathlib import Path
name, begun, for_good = {name!r}, {begun!r}, {for_good!r}
holder, name = globals()[name.partition('.')[0]], name.partition('.')[2]
call = getattr(holder, name)
def failing(*args, **more):
    if os.path.exists(begun):
        if not for_good:
            setattr(holder, name, call)
        raise OSError(errno.ENOMEM, 'Cannot allocate memory')
    return call(*args, **more)
setattr(holder, name, failing)
"""


@pytest.mark.parametrize("for_good", [False, True])
@pytest.mark.parametrize("name", CALLS)
def test_whatever_call_fails_while_it_is_watched_it_has_started_and_is_stopped(
    tmp_path, name, for_good
):
    begun = tmp_path / "begun"
    fails = FAILS.format(name=name, begun=str(begun), for_good=for_good)
    # Output that comes, an end that is taken and a limit that passes: each calls what may fail.
    command = ["sh", "-c", f"sleep 60 & touch {begun}; while echo moves; do sleep 0.1; done"]
    with supervised(tmp_path, command, fails, time_limit=1.0, grace=0.3) as supervisor:
        wait_for(begun.exists)
        tree = tree_of(supervisor)
        said = supervisor.communicate(timeout=60)[1]
        still = [pid for pid in tree if running(pid)]
        report = report_of(tmp_path)
        assert "not_started" not in report
        assert report["fault"] == "[Errno 12] Cannot allocate memory"
        assert said.startswith("\aprior-reinforce: the watch failed ([Errno 12]")
        assert not still or "THE ARM MAY GO ON MOVING" in said
        assert for_good or not still


def test_a_start_that_fails_once_the_command_is_there_is_a_start(tmp_path):
    fails = (
        "start = supervisor.subprocess.Popen.__init__\n"
        "def failing(self, *args, **more):\n"
        "    start(self, *args, **more)\n"
        "    raise MemoryError\n"
        "supervisor.subprocess.Popen.__init__ = failing\n"
    )
    with supervised(tmp_path, ["sleep", "60"], fails, grace=0.3) as supervisor:
        assert "the watch failed" in supervisor.communicate(timeout=60)[1]
    assert report_of(tmp_path)["fault"] == "MemoryError()"


def test_what_no_proc_would_list_is_not_started(tmp_path):
    fails = (
        "link = os.readlink\nos.readlink = lambda path: '1' if path[:5] == '/proc' else link(path)"
    )
    with supervised(tmp_path, ["touch", str(tmp_path / "ran")], fails) as supervisor:
        assert supervisor.communicate(timeout=60)[1] == ""
    assert "/proc does not list this program" in report_of(tmp_path)["not_started"]
    assert not (tmp_path / "ran").exists()

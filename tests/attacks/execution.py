"""Attacks on the way from a plan to the arm: signals, kills, hangs, doubles, edits.

    python -m tests.attacks.execution [CASES] [SEED]

Whatever is done, no plan that is refused moves, none moves twice, two never move at once, and every
motion stands in the journal.
"""

from __future__ import annotations

import collections
import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

from prior_reinforce.bench.robots.executors.lock import is_executing
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import PriorReinforceError
from tests.attacks.harness import HELD, wait_until
from tests.attacks.table import prepare

PROGRAM = """
import sys
from prior_reinforce.bench.workspace.workspace import Workspace
with Workspace(sys.argv[1]) as workspace:
    number = workspace.session().ask().number
    print("ready", flush=True)
    sys.stdin.readline()
    workspace.execute(number, sys.argv[2], time_limit=float(sys.argv[3]))
"""
DRIVER = """
import os, pathlib, signal, sys, time
here, kind = pathlib.Path(sys.argv[1]), sys.argv[2]
if kind == "detaches" and os.fork():
    sys.exit(0)
if kind == "double fork":
    if os.fork():
        sys.exit(0)
    os.setsid()
    if os.fork():
        os._exit(0)
if kind == "detaches":
    os.setsid()
if kind in ("hangs", "will not stop"):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
if kind == "stopped":
    os.kill(os.getpid(), signal.SIGSTOP)
def alive(pid):
    try:
        os.kill(pid, 0)
        return open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
with open(here / "motions", "a") as motions:
    others = [int(p) for p in (here / "motions").read_text().split() if p.isdigit()]
    if any(alive(pid) for pid in others):
        motions.write("AT ONCE\\n")
    motions.write(f"{os.getpid()}\\n")
if kind == "many" and os.fork() == 0:
    time.sleep(0.3)
    os._exit(0)
time.sleep({"quick": 0.02, "hangs": 60}.get(kind, 0.4))
if kind == "says no":
    pathlib.Path(sys.argv[4], "result.json").write_text('{"outcome": "not_moved"}')
if kind == "lies":
    pathlib.Path(sys.argv[4], "result.json").write_text('{"outcome": "not_moved"}')
    sys.exit(1)
sys.exit(3 if kind == "crashes" else 0)
"""
KINDS = ("quick", "slow", "detaches", "double fork", "hangs", "will not stop", "stopped", "many")
KINDS += ("crashes", "lies")
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGKILL)
_EXITING = 4
"""PF_EXITING (linux/sched.h): the kernel closes its files, and with them the lock, before it is a
zombie."""
NARROW = """model = "given"
joint_names = ["joint1", "joint2"]
lower = [-3, -3]
upper = [3, 3]
velocity = [{limit}, {limit}]
acceleration = [1000, 1000]
jerk = [1000000, 1000000]
"""


def attack(rng: random.Random, here: Path, asked: Path) -> str:
    """One attack; `held`, or what went wrong."""
    folder, refused = here / "planar", False
    shutil.copytree(asked, folder)
    (here / "driver.py").write_text(DRIVER)
    kind = rng.choice(KINDS)
    command = f"{sys.executable} {here}/driver.py {here} '{kind}' {{plan}} {{result}}"
    limit = "1" if kind in ("hangs", "will not stop", "stopped") else "20"
    programs = [_start(folder, command, limit) for _ in range(rng.choice([1, 1, 2]))]
    edit = rng.choice(["nothing", "nothing", "limit", "plan", "both lost"])
    if edit == "limit":  # one per cent below what the plan asks for
        peak = _peak_velocity(folder)
        factor = rng.choice([0.99, 1.01])
        refused = factor < 1
        path = folder / "workspace.toml"
        narrow = NARROW.format(limit=peak * factor)
        path.write_text(path.read_text().replace('model = "none"', narrow, 1))
    if edit == "plan":
        refused = True
        (plan,) = (folder / "plans").iterdir()
        plan.chmod(0o644)
        content = bytearray(plan.read_bytes())
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        plan.write_bytes(content)
    if edit == "both lost":
        for path in folder.glob("*lock*"):
            path.unlink()
    for program in programs:
        with contextlib.suppress(OSError):
            program.stdin.write("go\n")
            program.stdin.flush()
    for _ in range(rng.choice([0, 1, 1, 3])):
        time.sleep(rng.uniform(0, 0.5))
        _signal(rng, rng.choice(programs))
    try:
        return _judge(here, folder, programs, refused, kind)
    finally:
        for program in programs:
            program.kill()
            program.communicate()
        for pid in _motions(here):
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)


def _start(folder: Path, command: str, limit: str) -> subprocess.Popen[str]:
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(folder), command, limit],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    program.stdout.readline()
    return program


def _signal(rng: random.Random, program: subprocess.Popen[str]) -> None:
    """Send some signal to a program, its group, or its supervisor."""
    number, to = rng.choice(SIGNALS), rng.choice(["program", "group", "supervisor"])
    with contextlib.suppress(OSError):
        if to == "group":
            os.killpg(program.pid, number)
        elif to == "program":
            os.kill(program.pid, number)
        else:
            text = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text()
            for child in text.split():
                os.kill(int(child), number)


def _motions(here: Path) -> list[int]:
    path = here / "motions"
    text = path.read_text() if path.exists() else ""
    return [int(word) for word in text.split() if word.isdigit()]


def _peak_velocity(folder: Path) -> float:
    from prior_reinforce.plans.interpolation import interpolate

    with Workspace(folder) as workspace:
        plan = workspace.plan(workspace.session().trial(1))
    return float(abs(interpolate(plan.actions, plan.format.dt).dq).max())


def _alive(pid: int) -> bool:
    """Whether a process still runs code of its own."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    fields = stat.rsplit(")", 1)[1].split()
    return fields[0] != "Z" and not int(fields[6]) & _EXITING


def _judge(
    here: Path, folder: Path, programs: list[subprocess.Popen[str]], refused: bool, kind: str
) -> str:
    """What became of it."""
    for program in programs:
        try:
            program.wait(30)
        except subprocess.TimeoutExpired:
            return "a program hangs"
    if not wait_until(lambda: not is_executing(folder), 80):
        # Stopped, and its supervisor killed: it is there, and so is its lock.
        return HELD if kind == "stopped" else "the lock is never given back"
    # A supervisor that was killed takes nothing with it: what goes on must hold the lock.
    if any(_alive(pid) for pid in _motions(here)):
        return "a motion goes on without the lock"
    if "AT ONCE" in ((here / "motions").read_text() if _motions(here) else ""):
        return "two motions at once"
    with Workspace(folder) as workspace, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        kinds = collections.Counter(event.kind for event in workspace.events)
        moved = len(_motions(here))
        if refused and moved:
            return "a refused plan moved"
        if moved > kinds["executing"]:
            return "a motion is not recorded"
        if moved > 1:
            return "a plan moved twice"
        # One of two programs may have been interrupted before it began, and the other not.
        if moved > kinds["executing"] - kinds["not_executed"]:
            return "a motion is recorded as none"
        before = len(workspace.events)
        with contextlib.suppress(PriorReinforceError):
            workspace.recover()
        if kinds["executing"] == 0 and len(workspace.events) != before:
            return "something is recovered that never was"
    return HELD


def main(cases: int, seed: int) -> int:
    """Print what broke; how many."""
    counted: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as place:
        asked = prepare(Path(place))
        for case in range(cases):
            with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as here:
                verdict = attack(random.Random(f"execution {seed + case}"), Path(here), asked)
            counted[verdict] += 1
            if verdict != HELD:
                print(f"execution {seed + case}: {verdict}", flush=True)
    held = counted.pop(HELD, 0)
    print(f"{'execution':<12} {cases:>6} {held:>6} {counted.total():>6}")
    return counted.total()


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:]]
    sys.exit(main(*(numbers + [500, 0][len(numbers) :])) > 0)

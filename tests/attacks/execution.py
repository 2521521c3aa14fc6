"""Attacks on the way from a plan to the arm: signals, kills, hangs, doubles, edits, copies.

Whatever is done, no plan that is refused moves, none moves twice, two never move at once, and every
motion stands in the journal; and nobody is told of harm where there was none.
"""

from __future__ import annotations

import collections
import contextlib
import os
import random
import shutil
import signal
import sys
import time
from pathlib import Path

from prior_reinforce.arm.executing.lock import is_executing
from prior_reinforce.arm.workspace.execute import execute
from prior_reinforce.arm.workspace.workspace import Workspace
from tests.attacks.harness import HELD, wait_until

DRIVER = """
import os, pathlib, shutil, signal, sys, time
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
if kind == "continued" and os.fork() == 0:
    time.sleep(0.1)
    os.kill(os.getppid(), signal.SIGCONT)
    os._exit(0)
if kind in ("stopped", "continued"):
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
if kind == "deletes":
    shutil.rmtree(sys.argv[4])
if kind == "changes":
    os.unlink(sys.argv[3])
    pathlib.Path(sys.argv[3]).write_text("another plan")
sys.exit(3 if kind == "crashes" else 0)
"""
KINDS = ("quick", "slow", "detaches", "double fork", "hangs", "will not stop", "stopped", "many")
KINDS += ("crashes", "lies", "says no", "continued", "deletes", "changes")
WRAPPER = "import subprocess, sys; sys.exit(subprocess.run(sys.argv[1:]).returncode)"
"""What it starts has none of the descriptors that it inherited, and so no lock."""
ENDS = {"says no": "not_moved", "lies": "aborted", "crashes": "aborted", "changes": "aborted"}
"""Outcome in the journal of a driver that nobody disturbs; the others are done."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGKILL)
SIGNALS += (signal.SIGTSTP, signal.SIGKILL)
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


def attack(kind: str, rng: random.Random, here: Path, asked: Path) -> str:
    """One attack with a driver of a kind; `held`, or what went wrong."""
    folder, refused = here / "planar", False
    os.environ["PRIOR_REINFORCE_ARM"] = str(here)  # other attacks run at the same time
    shutil.copytree(asked, folder)
    (here / "driver.py").write_text(DRIVER)
    wrapper = f"{sys.executable} -I -S -c '{WRAPPER}' " if rng.random() < 0.4 else ""
    driver = f"{sys.executable} -I -S {here}/driver.py {here} '{kind}' {{plan}} {{result}}"
    limit = 0.6 if kind in ("hangs", "will not stop", "stopped") else 20.0
    edit = rng.choice(["nothing"] * 3 + ["limit", "plan", "copy", "restore", "restore", "raises"])
    folders = [folder] * rng.choice([1, 1, 2])
    if edit == "copy":
        shutil.copytree(folder, here / "copy")
        folders = [folder, here / "copy"]
    raises = rng.choice(["show", "alarm"]) if edit == "raises" else ""
    programs = [Program(place, wrapper + driver, limit, raises) for place in folders]
    if edit == "limit":  # one per cent below what the plan asks for
        peak = peak_velocity(folder)
        factor = rng.choice([0.99, 1.01])
        refused = factor < 1
        path = folder / "workspace.toml"
        narrow = NARROW.format(limit=peak * factor)
        path.write_text(path.read_text().replace('model = "none"', narrow, 1))
    if edit == "plan":
        refused = True
        damage_plan(rng, folder)
    for program in programs:
        program.go()
    signals = rng.choice([0, 0, 1, 1, 3])
    for _ in range(signals):
        time.sleep(rng.uniform(0, 0.5))
        send_signal(rng, rng.choice(programs))
    try:
        verdict = _judge(here, folders, programs, refused, again=kind == "says no")
        calm = signals == 0 and len(programs) == 1 and edit in ("nothing", "restore")
        if verdict == HELD and calm and limit > 1:
            verdict = _ends_as_it_was(folder, kind)
        if verdict == HELD and edit == "restore" and kind not in ("deletes", "changes", "says no"):
            verdict = _restored(here, folder, asked, driver)
        return verdict
    finally:
        for program in programs:
            program.kill()
        for pid in motions(here):
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)


class Program:
    """A fork of this program that executes a workspace's trial when it is told to."""

    def __init__(self, folder: Path, command: str, limit: float, raises: str = "") -> None:
        """Start it."""
        self.status: int | None = None
        here, self._pipe = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                os.setsid()
                for number in SIGNALS:
                    if number != signal.SIGKILL:
                        signal.signal(number, signal.SIG_DFL)
                null = os.open(os.devnull, os.O_RDWR)
                for descriptor in range(3):
                    os.dup2(null, descriptor)
                os.close(self._pipe)
                os.read(here, 1)
                self.execute(folder, command, limit, raises)
            except BaseException:
                os._exit(1)
            os._exit(0)
        os.close(here)

    def execute(self, folder: Path, command: str, limit: float, raises: str) -> None:
        def fail(*_: object) -> None:
            raise ZeroDivisionError

        if raises == "alarm":
            signal.signal(signal.SIGALRM, fail)
            signal.setitimer(signal.ITIMER_REAL, 0.3, 0.05)
        with Workspace(folder) as workspace:
            number = workspace.session().ask().number
            shown = fail if raises == "show" else None
            execute(workspace, number, command, time_limit=limit, show=shown)

    def go(self) -> None:
        """Let it execute."""
        with contextlib.suppress(OSError):
            os.write(self._pipe, b"x")

    def ended(self) -> bool:
        """Whether it has."""
        if self.status is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.status = status if pid else None
        return self.status is not None

    def kill(self) -> None:
        """End it."""
        if not self.ended():
            os.kill(self.pid, signal.SIGKILL)
            wait_until(self.ended)
        os.close(self._pipe)


def send_signal(rng: random.Random, program: Program) -> None:
    """Send some signal to a program, its group, its supervisor, or both of them."""
    number, to = rng.choice(SIGNALS), rng.choice(["program", "group", "supervisor", "both"])
    with contextlib.suppress(OSError, IndexError):
        if to == "group":
            os.killpg(program.pid, number)
        elif to == "program":
            os.kill(program.pid, number)
        else:
            supervisor = _children(program.pid)[0]
            for pid in [supervisor, program.pid][: 1 + (to == "both")]:
                os.kill(pid, number)


def _children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def motions(here: Path) -> list[int]:
    path = here / "motions"
    text = path.read_text() if path.exists() else ""
    return [int(word) for word in text.split() if word.isdigit()]


def damage_plan(rng: random.Random, folder: Path) -> None:
    """Change a bit of the plan that waits."""
    (plan,) = (folder / "plans").iterdir()
    plan.chmod(0o644)
    content = bytearray(plan.read_bytes())
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    plan.write_bytes(content)


def peak_velocity(folder: Path) -> float:
    from prior_reinforce.plans.interpolation import interpolate

    with Workspace(folder) as workspace:
        plan = workspace.plan(workspace.session().trial(1))
    return float(abs(interpolate(plan.actions, plan.format.dt).dq).max())


def alive(pid: int) -> bool:
    """Whether a process still runs code of its own."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    fields = stat.rsplit(")", 1)[1].split()
    return fields[0] != "Z" and not int(fields[6]) & _EXITING


def _judge(
    here: Path, folders: list[Path], programs: list[Program], refused: bool, *, again: bool
) -> str:
    """What became of it; `again`: the driver says that nothing moved, so it may be called again."""
    for program in programs:
        if not wait_until(program.ended, 40):
            return "a program hangs"
    for folder in set(folders):
        if not wait_until(lambda folder=folder: not is_executing(folder), 80):
            return "the lock is never given back"
    # A supervisor that was killed takes nothing with it: what goes on must hold the lock.
    if any(alive(pid) for pid in motions(here)):
        return "a motion goes on without the lock"
    if "AT ONCE" in ((here / "motions").read_text() if motions(here) else ""):
        return "two motions at once"
    moved = len(motions(here))
    if refused and moved:
        return "a refused plan moved"
    kinds: collections.Counter[str] = collections.Counter()
    for folder in set(folders):
        with Workspace(folder) as workspace:
            for entry in workspace.log.entries():
                none = getattr(entry.event, "outcome", "") == "not_moved"
                kinds["none" if none else entry.kind] += 1
    if moved > kinds["moving"]:
        return "a motion is not recorded"
    if moved > (len(programs) if again else len(set(folders))):
        return "a plan moved twice"
    # One of two programs may have been interrupted before it began, and the other not.
    if moved > kinds["moving"] - kinds["none"] and not _says_no(here):
        return "a motion is recorded as none"
    return HELD


def _says_no(here: Path) -> bool:
    """Whether the driver itself says that nothing moved."""
    return any("not_moved" in path.read_text() for path in here.glob("*/executions/*/result.json"))


def _ends_as_it_was(folder: Path, kind: str) -> str:
    """Nobody cries wolf where nobody disturbed the driver."""
    with Workspace(folder) as workspace:
        last = [entry.event for entry in workspace.log.entries()][-1]
    outcome = getattr(last, "outcome", last.kind)
    return HELD if outcome == ENDS.get(kind, "done") else f"a false alarm: {kind} is {outcome}"


def _restored(here: Path, folder: Path, asked: Path, driver: str) -> str:
    """The journal of before is put back, and the same is asked for again."""
    moved = len(motions(here))
    for path in folder.glob("journal.sqlite*"):
        path.unlink()
    shutil.copy(asked / "journal.sqlite", folder)
    again = Program(folder, driver, 20.0)
    again.go()
    try:
        if not wait_until(again.ended, 40):
            return "a program hangs"
    finally:
        again.kill()
    if moved and len(motions(here)) > moved:
        return "a restored journal moved a plan twice"
    return HELD

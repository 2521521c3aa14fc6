"""Faults in the watching of a motion: failing calls, stopped and killed watchers, full tables.

They are in the supervisor, or in the program that started it and watches beside it.

Whatever fails, the motion ends or a person is told that it does not; and what began to move is
never written down as not executed, nor moved again.
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import sys
import time
from pathlib import Path

from prior_reinforce.arm.executing import lock, supervision, supervisor
from prior_reinforce.arm.executing.lock import is_executing, stop_executing
from prior_reinforce.arm.workspace.workspace import Workspace
from tests.attacks.execution import Program, _children, alive, motions
from tests.attacks.harness import HELD, wait_until

DRIVER = """
import os, signal, sys, time
here, kind = sys.argv[1:3]
if "deaf" in kind:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
if "detached" in kind:
    if os.fork():
        sys.exit(0)
    os.setsid()
    if os.fork():
        os._exit(0)
with open(here + "/motions", "a") as motions:
    motions.write(f"{os.getpid()}\\n")
until = time.monotonic() + (0.3 if "short" in kind else 30)
while time.monotonic() < until:
    print("moves", flush=True)
    time.sleep(0.03)
"""
KINDS = ("short", "plain", "deaf", "detached", "deaf detached", "short detached")
CALLS = ("os.listdir", "os.read", "os.readlink", "os.waitpid", "os.kill", "os.write")
CALLS += ("select.select", "time.sleep", "Path.read_text")
FAULTS = ("call", "call", "call", "for good", "SIGSTOP", "SIGKILL", "files", "memory")
# Some calls fail once the driver moves.
FAILING = """
import os, resource, select, time
from pathlib import Path
name, fault, after, begun = {name!r}, {fault!r}, {after!r}, {begun!r}
holder, name = globals()[name.partition(".")[0]], name.partition(".")[2]
call, calls = getattr(holder, name), 0
def failing(*args, **more):
    global calls
    if os.path.exists(begun):
        calls += 1
        if fault in ("files", "memory") and calls == after:
            kind = resource.RLIMIT_NOFILE if fault == "files" else resource.RLIMIT_AS
            resource.setrlimit(kind, (1, resource.getrlimit(kind)[1]))
        if calls == after and fault == "call" or calls >= after and fault == "for good":
            raise OSError({number}, "of a test")
    return call(*args, **more)
setattr(holder, name, failing)
"""
THEIR_CALLS = (*CALLS[:3], "os.kill", "os.write", "time.sleep", "Path.read_bytes")
"""Of the program that started the supervisor, which watches too."""


def attack(rng: random.Random, here: Path, asked: Path) -> str:
    """Execute a plan once with a fault in the watching, then ask for it again."""
    folder, kind, fault = here / "planar", rng.choice(KINDS), rng.choice(FAULTS)
    os.environ["PRIOR_REINFORCE_ARM"] = str(here)  # other attacks run at the same time
    shutil.copytree(asked, folder)
    (here / "driver.py").write_text(DRIVER)
    theirs = rng.random() < 0.4
    name = rng.choice(THEIR_CALLS if theirs else CALLS)
    if fault in ("files", "memory"):
        name = "time.sleep" if theirs else "select.select"
    watcher, said = Path(supervisor.__file__), here / "said"
    failing = FAILING.format(
        name=name,
        fault=fault,
        after=rng.randrange(1, 8),
        begun=str(here / "motions"),
        number=rng.choice([12, 23, 24, 22, 5]),
    )
    if not theirs:
        watcher, itself = here / "faulty_supervisor.py", str(watcher)
        run = f"import runpy\nrunpy.run_path({itself!r}, run_name='__main__')\n"
        watcher.write_text(failing + run)
    command = f"{sys.executable} -I -S {here}/driver.py {here} '{kind}' {{plan}} {{result}}"
    how = rng.choice(["limit", "interrupt", "stop"])
    limit, name = 0.6 if how == "limit" else 20.0, f"{name}{' of the program' * theirs}"
    program = Watched(folder, command, limit, watcher, said, failing if theirs else "")
    program.go()
    try:
        wait_until(lambda: motions(here) or program.ended(), 30)
        time.sleep(rng.uniform(0, 0.3))
        with contextlib.suppress(OSError, IndexError):
            if fault in ("SIGSTOP", "SIGKILL"):
                os.kill(_children(program.pid)[0], getattr(signal, fault))
            if how == "interrupt":
                os.kill(program.pid, signal.SIGINT)
        if how == "stop":
            stop_executing(folder)
        if not wait_until(program.ended, 40):
            return f"a program hangs: {kind}, {fault} {name}, {how}"
        told = "MAY GO ON MOVING" in said.read_text()
        if any(map(alive, motions(here))) and not told:
            return f"a motion goes on and nobody is told: {kind}, {fault} {name}, {how}"
        for pid in motions(here):
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        wait_until(lambda: not is_executing(folder), 30)
        moved = len(motions(here))
        with Workspace(folder) as workspace:
            last = workspace.log.entries()[-1]
        outcome = getattr(last.event, "outcome", last.kind)
        if moved and outcome not in ("moving", "done", "aborted"):
            return f"a motion is recorded as {outcome}: {kind}, {fault} {name}, {how}"
        again = Watched(folder, command, 20.0, Path(supervisor.__file__), said)
        again.go()
        if moved and wait_until(again.ended, 40) and len(motions(here)) > moved:
            return f"a plan moved twice: {kind}, {fault} {name}, {how}"
        again.kill()
        return HELD
    finally:
        program.kill()
        for pid in motions(here):
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)


class Watched(Program):
    """A program whose supervisor is another file, and whose grace is short."""

    def __init__(
        self,
        folder: Path,
        command: str,
        limit: float,
        watcher: Path,
        said: Path,
        failing: str = "",
    ) -> None:
        """Start it; `failing` makes its own calls fail."""
        self._watcher, self._said, self._failing = watcher, said, failing
        super().__init__(folder, command, limit)

    def execute(self, folder: Path, command: str, limit: float, raises: str) -> None:
        supervision._SUPERVISOR = self._watcher
        supervision.GRACE = lock.GRACE = 0.4
        os.dup2(os.open(self._said, os.O_WRONLY | os.O_CREAT | os.O_APPEND), 2)
        exec(self._failing, {})
        super().execute(folder, command, limit, raises)

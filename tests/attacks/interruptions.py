"""Every command that writes, interrupted: killed at a random moment, or refused by the disk.

Afterwards the workspace opens, its events are those of before or of the whole command, every file
that an event names is whole, and the same command can be called again. A disk that refuses is named
in one line.
"""

from __future__ import annotations

import ctypes
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from prior_reinforce.arm.executing.lock import is_executing
from prior_reinforce.arm.workspace.execute import recover
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.session.events import Entry
from tests.arm.workspace.planar import recordings
from tests.attacks.harness import HELD, tree

PROGRAM = """
import sys
from prior_reinforce.cli import main
# What takes time is not it:
import prior_reinforce.arm.workspace.workspace, prior_reinforce.session.session
print("ready", flush=True)
sys.stdin.readline()
sys.exit(main(sys.argv[1:]))
"""
COMMANDS: dict[str, tuple[str, ...]] = {
    "new": ("new", "other"),
    "import": ("import", "planar", "recorded"),
    "learn": ("learn", "planar", "--generator", "interpolation"),
    "goal": ("goal", "planar", "0.95", "0.1"),
    "ask": ("ask", "planar"),
    "ask --out": ("ask", "planar", "--out", "plan.npz"),
    "ask --run": ("ask", "planar", "--yes", "--run", "sh -c 'echo moved >> motions' {plan}"),
    "tell": ("tell", "planar", "1", "--hit"),
    "amend": ("amend", "planar", "1", "--hit"),
    "void": ("void", "planar", "1"),
    "export": ("export", "planar", "1", "plan.csv"),
    "report": ("report", "planar"),
}
"""What is called, and how; `status` and `log` write nothing."""
OPEN = ("ask --run", "tell", "void", "export", "report", "ask --out")
"""Called with an open trial; the others have none."""


HOW = ("killed", "refused")
"""How a command is interrupted; refused by a disk that is full, or by one that is read-only."""
LONGEST_S = 300.0
"""For a command; ours: a dozen at once on a busy computer."""
_PR_CAPBSET_DROP, _CAP_DAC_OVERRIDE = 24, 1
"""Root's right to write where permissions forbid it; it stays root, and reads what is its own."""


def attack(how: str, name: str, rng: random.Random, here: Path, asked: Path) -> str:
    """Call a command, interrupt it, and check what is left; then finish it."""
    folder = here / "planar"
    shutil.copytree(asked, folder)
    recordings(here / "recorded")
    with Workspace(folder) as workspace:
        if name not in OPEN:
            workspace.session().tell(1, [0.05, 0.0])
        before = list(workspace.events)
    if how == "killed":
        program = _start(here, *COMMANDS[name])
        time.sleep(rng.uniform(0, 1) ** 2 * 0.4)
        program.kill()
        program.communicate()
        time.sleep(0.05)
    else:
        disk = rng.choice(["full", "read-only"])
        _refuse(disk, name, here, 2 ** rng.randrange(8, 16))
    _check(folder, before, here)
    _finish(name, here, folder)
    return HELD


def _refuse(disk: str, name: str, here: Path, limit: int) -> None:
    """Call a command on a disk that holds files of a limited size, in bytes, or none at all."""
    before = tree(here)
    kept = {path: path.stat().st_mode for path in (here, *here.rglob("*"))}

    def full() -> None:  # writing beyond the limit fails as a full disk does, for root as well
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    def read_only() -> None:
        ctypes.CDLL(None).prctl(_PR_CAPBSET_DROP, _CAP_DAC_OVERRIDE)  # fails where we are not root
        for path, mode in kept.items():
            path.chmod(mode & 0o555)

    program = _start(here, *COMMANDS[name], first=full if disk == "full" else read_only)
    _, err = program.communicate(timeout=LONGEST_S)
    for path, mode in kept.items():
        path.chmod(mode)
    says = "free some disk space|cannot write"
    if disk == "read-only":
        says = "make the folder writable"
        assert program.returncode == 2, err
        assert tree(here) == before, "changed by a refusal"
    if program.returncode:
        assert (program.returncode, err.count("\n")) == (2, 1), err
        assert re.search(says, err), err


def _start(
    here: Path, *args: str, first: Callable[[], None] | None = None
) -> subprocess.Popen[str]:
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *args],
        cwd=here,
        # Or a disk that is full would leave half of a module's bytecode, and every later program
        # that imports it would fail.
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=first,
    )
    assert program.stdout is not None
    assert program.stdin is not None
    program.stdout.readline()
    program.stdin.write("go\n")
    program.stdin.flush()
    return program


def _check(folder: Path, before: list[Entry], here: Path) -> list[Entry]:
    """Nothing of before is missing, and what events name is whole."""
    with Workspace(folder) as workspace:
        events = list(workspace.events)
        assert [entry.event for entry in events[: len(before)]] == [entry.event for entry in before]
        assert len(events) <= len(before) + 2, "doubled"
        session = workspace.session()
        for goal in session.goals:
            for trial in session.state.trials_of(goal.number):
                workspace.plan(trial)
        assert workspace.demonstrations.n == 4
        training = workspace.state.training
        assert training is not None
        workspace.store.model(training.model)
    for path in here.glob("plan.*"):
        assert path.stat().st_size > 0
    return events


def _finish(name: str, here: Path, folder: Path) -> None:
    """The same command again does what is left, and no motion is made twice."""
    motions = here / "motions"
    if name == "ask --run":
        with Workspace(folder) as workspace:
            deadline = time.monotonic() + 30
            while is_executing(folder):
                assert time.monotonic() < deadline
                time.sleep(0.02)
            recovered = recover(workspace)
            kinds = [event.kind for event in workspace.events]
        moved = motions.read_text().count("moved") if motions.exists() else 0
        assert moved <= kinds.count("moving"), "a motion is not recorded"
        if recovered is not None or moved:
            _start(here, *COMMANDS[name]).communicate(timeout=LONGEST_S)
            assert motions.read_text().count("moved") == 1, "a plan moved twice"
        return
    again = _start(here, *COMMANDS[name])
    _, err = again.communicate(timeout=LONGEST_S)
    assert "Traceback" not in err, err
    # Either it does what was not done, or it says that it was done already.
    assert again.returncode in (0, 2), err
    with Workspace(folder) as workspace:
        kinds = [event.kind for event in workspace.events]
    expected = {"tell": "told", "amend": "amended", "void": "voided"}.get(name)
    if expected is not None:
        assert kinds.count(expected) == 1 if name != "amend" else kinds.count(expected) in (1, 2)
    if name == "new":
        Workspace(here / "other").close()

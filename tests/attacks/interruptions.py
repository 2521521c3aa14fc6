"""Every command that writes, interrupted: killed at a random moment, or refused by the disk.

Afterwards the workspace opens, its events are those of before or of the whole command, every file
that an event names is whole, and the same command can be called again. A disk that refuses is named
in one line.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import random
import re
import resource
import select
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path

from prior_reinforce.arm.executing.lock import ARM_VARIABLE, is_executing
from prior_reinforce.arm.workspace.execute import recover
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.cli import main
from prior_reinforce.session.events import Entry
from tests.arm.workspace.planar import recordings
from tests.attacks.harness import HELD, tree

_FORK = multiprocessing.get_context("fork")
"""None of the commands uses torch, whose threads do not survive a fork."""

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
_CAPABILITIES, _PR_CAPBSET_DROP, _CAP_DAC_OVERRIDE = 0x20080522, 24, 1
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
        program = _Called(here, *COMMANDS[name])
        time.sleep(rng.uniform(0, 1) ** 2 * 0.4)
        program.end(kill=True)
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
        for path, mode in kept.items():
            path.chmod(mode & 0o555)
        # Of root, in this process and in what it starts; fails where we are not root.
        libc, of_all = ctypes.CDLL(None), (ctypes.c_uint32 * 6)()
        header = (ctypes.c_uint32 * 2)(_CAPABILITIES, 0)
        libc.capget(header, of_all)
        of_all[0] &= ~(1 << _CAP_DAC_OVERRIDE)
        libc.capset(header, of_all)
        libc.prctl(_PR_CAPBSET_DROP, _CAP_DAC_OVERRIDE)

    refusing = full if disk == "full" else read_only
    status, err = _Called(here, *COMMANDS[name], first=refusing).end()
    for path, mode in kept.items():
        path.chmod(mode)
    says = "free some disk space|cannot write"
    if disk == "read-only":
        says = "make the folder writable"
        assert status == 2, err
        assert tree(here) == before, "changed by a refusal"
    if status:
        assert (status, err.count("\n")) == (2, 1), err
        assert re.search(says, err), err


class _Called:
    """A command in a fork of this process, which has loaded what takes time and is not it."""

    def __init__(self, here: Path, *args: str, first: Callable[[], object] = str) -> None:
        self._said, said = os.pipe()
        self._process = _FORK.Process(target=_call, args=(here, args, first, said))
        self._process.start()
        os.close(said)

    def end(self, *, kill: bool = False) -> tuple[int | None, str]:
        """Wait for it, killed or not: its exit status, and what it complained of."""
        if kill:
            self._process.kill()
        err = b""
        while select.select([self._said], [], [], LONGEST_S)[0]:
            if not (more := os.read(self._said, 4096)):
                break
            err += more
        else:
            self._process.kill()
        os.close(self._said)
        self._process.join()
        return self._process.exitcode, err.decode()


def _call(here: Path, args: tuple[str, ...], first: Callable[[], object], said: int) -> None:
    # Bytecode that a full disk cuts off would make every later program fail that imports it.
    sys.dont_write_bytecode = True
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(said, 2)
    os.close(said)
    sys.stdout, sys.stderr = open(1, "w"), open(2, "w")  # noqa: SIM115
    os.environ[ARM_VARIABLE] = str(here)  # other attacks run at the same time
    os.chdir(here)
    first()
    sys.exit(main([*args]))


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
            _Called(here, *COMMANDS[name]).end()
            assert motions.read_text().count("moved") == 1, "a plan moved twice"
        return
    status, err = _Called(here, *COMMANDS[name]).end()
    assert "Traceback" not in err, err
    # Either it does what was not done, or it says that it was done already.
    assert status in (0, 2), err
    with Workspace(folder) as workspace:
        kinds = [event.kind for event in workspace.events]
    expected = {"tell": "told", "amend": "amended", "void": "voided"}.get(name)
    if expected is not None:
        assert kinds.count(expected) == 1 if name != "amend" else kinds.count(expected) in (1, 2)
    if name == "new":
        Workspace(here / "other").close()

"""Kill -9 at random moments of every command that writes.

    python -m tests.attacks.kills [KILLS] [SEED]

After each kill the workspace opens, its events are those of before or of the whole command, every
file that an event names is whole, and the same command can be called again.
"""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.session.events import Entry
from tests.attacks.table import prepare
from tests.bench.workspace.planar import recordings

PROGRAM = """
import sys
from prior_reinforce.cli import main
# What takes time is not it:
import prior_reinforce.bench.workspace.workspace, prior_reinforce.session.session
print("ready", flush=True)
sys.stdin.readline()
sys.exit(main(sys.argv[1:]))
"""
COMMANDS: dict[str, tuple[str, ...]] = {
    "new": ("new", "other"),
    "import": ("import", "planar", "recorded"),
    "learn": ("learn", "planar", "--generator", "nearest"),
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


def kill(name: str, rng: random.Random, here: Path, asked: Path) -> None:
    """Call a command, kill it some time later, and check what is left; then finish it."""
    folder = here / "planar"
    shutil.copytree(asked, folder)
    recordings(here / "recorded")
    with Workspace(folder) as workspace:
        session = workspace.session()
        if name not in OPEN:
            session.tell(1, [0.05, 0.0])
        before = list(workspace.events)
    program = _start(here, *COMMANDS[name])
    time.sleep(rng.uniform(0, 1) ** 2 * 0.4)
    program.kill()
    program.communicate()
    time.sleep(0.05)
    _check(folder, before, here)
    _finish(name, here, folder)


def _start(here: Path, *args: str) -> subprocess.Popen[str]:
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *args],
        cwd=here,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
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
            while workspace.log.is_executing():
                assert time.monotonic() < deadline
                time.sleep(0.02)
            recovered = workspace.recover()
            kinds = [event.kind for event in workspace.events]
        moved = motions.read_text().count("moved") if motions.exists() else 0
        assert moved <= kinds.count("executing"), "a motion is not recorded"
        if recovered is not None or moved:
            _start(here, *COMMANDS[name]).communicate(timeout=60)
            assert motions.read_text().count("moved") == 1, "a plan moved twice"
        return
    again = _start(here, *COMMANDS[name])
    _, err = again.communicate(timeout=60)
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


def main(kills: int, seed: int) -> int:
    """Print what broke; how many."""
    broke = 0
    with tempfile.TemporaryDirectory() as place:
        asked = prepare(Path(place))
        for case in range(kills):
            name = list(COMMANDS)[case % len(COMMANDS)]
            with tempfile.TemporaryDirectory() as here:
                try:
                    kill(name, random.Random(f"{name} {seed + case}"), Path(here), asked)
                except Exception as error:
                    broke += 1
                    print(f"kills {seed + case} {name}: {error!r:.300}", flush=True)
    print(f"{'kills':<12} {kills:>6} {kills - broke:>6} {broke:>6}")
    return broke


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:]]
    sys.exit(main(*(numbers + [300, 0][len(numbers) :])) > 0)

"""Attacks on the way from a plan to the arm through an executor (`ask --execute`).

As in `execution.py`, and beside it: an arm that stands elsewhere, refuses by one per cent, does not
answer, faults, jams, hangs or dies in mid-swing; rehearsals and approaches, which are no trials;
and another arm in the manifest than a person saw.
"""

from __future__ import annotations

import collections
import contextlib
import os
import random
import shutil
import signal
import time
from pathlib import Path

from prior_reinforce.arm.executing.base import ArmSettings, Motion
from prior_reinforce.arm.executing.lock import is_executing
from prior_reinforce.arm.workspace.execute import execute
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.registry import PLUGINS
from tests.arm.executing import toy_arm
from tests.attacks.execution import (
    NARROW,
    Program,
    alive,
    damage_plan,
    motions,
    peak_velocity,
    send_signal,
)
from tests.attacks.harness import HELD, wait_until

KINDS = ("works", "works", "works", "faults", "jams", "raises", "crashes", "hangs", "dead")
OUTCOMES = {
    "works": {"done"},
    "faults": {"aborted"},
    "raises": {"aborted"},
    "crashes": {"aborted"},
    "jams": {"not_moved"},
    "dead": {"not_moved"},
    "hangs": {"aborted"},
}
"""What the journal says of an arm that nobody disturbs."""
BUS = {
    "works": {"done"},
    "unplugged": {"aborted"},
    "crashes": {"aborted"},
    "clips": {"aborted"},
    "blocked": {"aborted"},
    "silent": {"aborted"},
    "not there": {"not_moved"},
}
"""The same of an arm that LeRobot drives, whose bus is dead, or dies in mid-swing."""
TOLERANCE = 0.02
"""`GateSettings.start_error`."""
FOUND = os.pathsep.join(
    filter(None, (str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH")))
)
"""Where the arm's program finds the toy arm, and the package."""


class Arm(Program):
    """A program that executes a workspace's trial on the arm that somebody saw in its manifest."""

    def __init__(self, folder: Path, seen: ArmSettings, limit: float, motion: Motion) -> None:
        self.seen, self.motion = seen, motion
        super().__init__(folder, "", limit)

    def execute(self, folder: Path, command: str, limit: float, raises: str) -> None:
        speed = 0.5 if self.motion == "rehearsal" else 1.0
        with Workspace(folder) as workspace:
            number = workspace.session().ask().number
            execute(workspace, number, self.seen, time_limit=limit, motion=self.motion, speed=speed)


def attack(rng: random.Random, here: Path, asked: Path) -> str:
    """One attack; `held`, or what went wrong."""
    folder, refused = here / "planar", False
    os.environ["PRIOR_REINFORCE_ARM"] = str(here)  # other attacks run at the same time
    os.environ |= {"PYTHONPATH": FOUND, PLUGINS: toy_arm.__name__}
    shutil.copytree(asked, folder)
    kind, options, on_bus = rng.choice(KINDS), {}, rng.random() < 0.3
    motion: Motion = rng.choice(["trial", "trial", "trial", "rehearsal", "approach"])
    edits = ["nothing", "nothing", "fastest", "limit", "pose", "plan", "arm", "copy"]
    edit = rng.choice(edits)
    if on_bus:
        kind, edit = rng.choice(["works", *BUS]), edit.replace("fastest", "nothing")
    factor = rng.choice([0.99, 1.01])
    speed = 0.5 if motion == "rehearsal" else 1.0
    if edit == "fastest":  # the arm's own limit
        options["fastest"] = speed * factor * peak_velocity(folder)
        refused = factor < 1 and motion != "approach"
    if on_bus:
        toy_arm.name_bus(folder, here, kind)
    else:
        toy_arm.name_arm(folder, here, kind=kind, seconds=0.3, **options)
    with Workspace(folder) as workspace:
        seen = workspace.manifest.driven_by
        first = workspace.plan(workspace.session().trial(1)).actions[0]
    far = False
    if edit == "pose":
        away = rng.choice([0.99, 1.01, 10]) * TOLERANCE
        far = away == 10 * TOLERANCE
        (here / "pose").write_text(" ".join(map(str, first + away)))
        refused = away > TOLERANCE and motion != "approach"
    folders = [folder] * rng.choice([1, 1, 2])
    if edit == "copy":
        shutil.copytree(folder, here / "copy")
        folders = [folder, here / "copy"]
    manifest = folder / "workspace.toml"
    if edit == "limit":  # the workspace's
        narrow = NARROW.format(limit=factor * peak_velocity(folder))
        manifest.write_text(manifest.read_text().replace('model = "none"', narrow, 1))
        refused = factor < 1
    if edit == "arm":
        refused = True
        manifest.write_text(manifest.read_text().replace("seconds = 0.3", "seconds = 0.4"))
    if edit == "plan":
        refused = True
        damage_plan(rng, folder)
    limit = 3.0 if kind in ("hangs", "silent") else 100.0  # twelve of them start at once
    programs = [Arm(place, seen, limit, motion) for place in folders]
    for program in programs:
        program.go()
    signals = rng.choice([0, 0, 1, 1, 3])
    for _ in range(signals):
        time.sleep(rng.uniform(0, 1.5))
        send_signal(rng, rng.choice(programs))
    try:
        verdict = judge(here, folders, programs, refused, motion)
        if verdict == HELD and signals == 0 and len(programs) == 1 and not refused:
            outcomes = BUS if on_bus else OUTCOMES
            if motion == "approach" and not far:  # a servo that holds its place blocks nothing
                outcomes = outcomes | {"blocked": {"aborted", "done"}}
            verdict = ends_as_it_was(folder, kind, outcomes)
        return verdict
    finally:
        for program in programs:
            program.kill()
        for pid in motions(here):
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)


def judge(
    here: Path, folders: list[Path], programs: list[Arm], refused: bool, motion: Motion
) -> str:
    """What became of it."""
    for program in programs:
        if not wait_until(program.ended, 120):
            return "a program hangs"
    for folder in set(folders):
        if not wait_until(lambda folder=folder: not is_executing(folder), 80):
            return "the lock is never given back"
    if any(alive(pid) for pid in motions(here)):
        return "a motion goes on without the lock"
    if motions(here) and "AT ONCE" in (here / "motions").read_text():
        return "two motions at once"
    moved = len(set(motions(here)))
    if refused and moved:
        return "a refused plan moved"
    kinds: collections.Counter[str] = collections.Counter()
    for folder in set(folders):
        with Workspace(folder) as workspace:
            for entry in workspace.log.entries():
                none = getattr(entry.event, "outcome", "") == "not_moved"
                kinds["none" if none else entry.kind] += 1
            if motion != "trial" and workspace.state.executions:
                return f"{motion} is in the journal as an execution"
    if moved > kinds["moving"]:
        return "a motion is not recorded"
    if moved > kinds["moving"] - kinds["none"]:
        return "a motion is recorded as none"
    if moved > (len(set(folders)) if motion == "trial" else len(programs)):
        return "a plan moved twice"
    return HELD


def ends_as_it_was(folder: Path, kind: str, outcomes: dict[str, set[str]]) -> str:
    """Nobody cries wolf where nobody disturbed the arm, and a fault is not taken for success."""
    with Workspace(folder) as workspace:
        last = workspace.log.entries()[-1].event
    outcome, why = getattr(last, "outcome", last.kind), getattr(last, "reason", "")
    return HELD if outcome in outcomes[kind] else f"{kind} is recorded as {outcome}: {why}"

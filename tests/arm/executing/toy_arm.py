"""An arm of two joints in a folder: where it stands is a file, and each motion leaves a line.

A plugin: importing it registers the executor `toy`; programs import it by the fixture `toy_plugin`.
"""

from __future__ import annotations

import itertools
import json
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prior_reinforce.arm.executing import EXECUTORS
from prior_reinforce.arm.executing.base import (
    ArmDescription,
    Executor,
    GuidedState,
    MeasuredPath,
)
from prior_reinforce.errors import ConfigurationError, RobotLimitError
from prior_reinforce.plans.interpolation import interpolate

RATE = 100.0
FAULT = "joint 2: overload"


@dataclass(frozen=True)
class ToyConfig:
    """Where it is, and what is wrong with it."""

    folder: str
    kind: str = "works"
    fastest: float = 1e9
    seconds: float = 0.0
    """How long a motion takes at least, and a state while it is guided."""
    led: bool = False
    guiding: str = "as it is"
    checks: str = "velocity"


class ToyArm(Executor):
    """A perfect servo, with the fault that it is told to have."""

    config_type = ToyConfig

    def __init__(self, config: ToyConfig) -> None:
        if config.kind == "dead":
            raise ConfigurationError("the arm does not answer; switch it on")
        if config.kind == "deaf":
            time.sleep(60)
        self.config, self.folder, self.stopping = config, Path(config.folder), False

    def describe(self) -> ArmDescription:
        return ArmDescription(
            model="toy",
            firmware="1.0",
            columns=("joint1", "joint2"),
            units=("rad", "rad"),
            rate=RATE,
            checked=(self.config.checks,),
            unchecked=("self-collision",),
        )

    def where(self):
        path = self.folder / "pose"
        return np.array(path.read_text().split(), float) if path.exists() else np.zeros(2)

    def check(self, plan):
        fastest = np.abs(interpolate(plan.actions, plan.format.dt).dq).max()
        if fastest > self.config.fastest:
            raise RobotLimitError(f"{fastest:.4f} rad/s, more than {self.config.fastest:.4f}")

    def run(self, plan):
        if self.config.kind != "jams":
            note_motion(self.folder)
        fine = interpolate(plan.actions, plan.format.dt, rate=RATE)
        n, kind = len(fine.t), self.config.kind
        for k, q in enumerate(fine.q):
            if kind == "hangs" and k == n // 2:
                time.sleep(60)
            if kind == "crashes" and k == n // 2:
                os._exit(3)
            if kind == "raises" and k == n // 2:
                raise ZeroDivisionError("division by zero")
            if self.stopping or (kind == "faults" and k == n // 2):
                fault = "stopped on request" if self.stopping else FAULT
                return MeasuredPath(fine.t[:k], fine.q[:k], fault)
            if kind == "jams":
                return MeasuredPath(fine.t[:0], fine.q[:0], "brakes are closed", moved=False)
            (self.folder / "pose").write_text(" ".join(map(str, q)))
            time.sleep(max(0.0, self.config.seconds / n))
        return MeasuredPath(fine.t, fine.q)

    @classmethod
    def guiding(cls, config):
        return config.guiding

    def guide(self):
        """A throw from 1.2 to 1.9 s of every two seconds; measured 0.1 s behind the command."""
        for k in itertools.count():
            if self.config.kind == "unplugged" and k == 50:
                raise ConfigurationError("the arm does not answer any more")
            time.sleep(self.config.seconds)
            t = k / RATE
            yield GuidedState(t, _thrown(t), _thrown(t - 0.1) if self.config.led else _thrown(t))

    def stop(self):
        self.stopping = True


def _thrown(t):
    number, share = int(t // 2), min(max((t % 2 - 1.2) / 0.6, 0.0), 1.0)
    course = 10 * share**3 - 15 * share**4 + 6 * share**5
    return course * np.array([0.8 + 0.1 * number, 0.3 - 0.2 * (number % 3)])


TOY = "toy"
EXECUTORS.add(TOY, ToyArm)


def name_arm(folder, arm, **options):
    """Name a toy arm in a workspace's manifest; the arm's folder is made."""
    Path(arm).mkdir(exist_ok=True)
    path = Path(folder) / "workspace.toml"
    lines = [
        f"{key} = {json.dumps(value)}" for key, value in (options | {"folder": str(arm)}).items()
    ]
    before = path.read_text().partition("\n[arm]\n")[0]
    path.write_text("\n".join([before, "[arm]", f'executor = "{TOY}"', *lines, ""]))


def note_motion(folder):
    """Leave this process's number, and say so if another one moves the arm too."""
    others = folder / "motions"
    with others.open("a") as motions:
        pids = [int(word) for word in others.read_text().split() if word.isdigit()]
        if any(pid != os.getpid() and _alive(pid) for pid in pids):
            motions.write("AT ONCE\n")
        motions.write(f"{os.getpid()}\n")


def name_bus(folder, arm, kind="works"):
    """Name in a manifest an arm that LeRobot drives, which `toy_bridge` stands in for."""
    Path(arm).mkdir(exist_ok=True)
    python = Path(arm) / "python"
    bridge = Path(__file__).with_name("toy_bridge.py")
    python.write_text(f'#!/bin/sh\nexec {sys.executable} {bridge} "$@"\n')
    python.chmod(0o755)
    columns = '{ joint1 = "degrees", joint2 = "degrees" }'
    path = Path(folder) / "workspace.toml"
    before = path.read_text().partition("\n[arm]\n")[0]
    lines = [
        'executor = "lerobot"',
        f'python = "{python}"',
        'clock = "cycles"',
        f'robot = {{ type = "toy", kind = "{kind}", folder = "{arm}", columns = {columns}, '
        "seconds = 0.3 }",
    ]
    path.write_text("\n".join([before, "[arm]", *lines, ""]))


def motions(arm):
    """How many programs moved it."""
    path = Path(arm) / "motions"
    return len(set(path.read_text().split())) if path.exists() else 0


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False

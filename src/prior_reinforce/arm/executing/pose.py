"""Where the arm stands: asking its executor, and comparing it with a plan's first frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from prior_reinforce.arm.executing.supervision import Ended, Interruptions, supervise
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.plan_format import PlanFormat


def ask_arm(command: str, arguments: tuple[str, ...], folder: Path, *, time_limit: float) -> str:
    """Run a command that moves nothing, and return the end of what it writes.

    Args:
        command: What it is called in messages.
        arguments: Its program and arguments.
        folder: An empty folder for what watches over it.
        time_limit: In [s].

    Raises:
        ConfigurationError: It cannot be started, fails, or takes too long.
        KeyboardInterrupt: Interrupted, once all has ended.
    """
    with Interruptions() as noted:
        ended, raised = supervise(arguments, folder, time_limit=time_limit, interruptions=noted)
    if raised is not None:
        raise raised
    if noted.came:
        raise KeyboardInterrupt
    ended = ended or Ended(not_started="what watched over it was killed")
    if ended.not_started or ended.fault or ended.timed_out or ended.exit_status:
        said = ended.not_started or ended.fault or ended.output_tail.strip() or "no output"
        why = said.splitlines()[-1]
        if ended.timed_out:
            why = f"no answer within {time_limit:g} s"
        raise ConfigurationError(
            f"{command!r} did not say where the arm stands: {why}; mend that, then ask again"
        )
    return ended.output_tail


def compare_pose(
    pose: Mapping[str, float], first: Sequence[float], form: PlanFormat, settings: GateSettings
) -> tuple[str, bool]:
    """Hold where the arm stands against a plan's first frame, unit by unit.

    Args:
        pose: Where it stands, by column.
        first: The frame, shape (D,), in the plan's units; a whole turn of a periodic dimension, or
            the sign of a quaternion, is no distance.
        form: Of the plan.
        settings: How far it may be off (`errors_of`); a unit of which they say nothing is named,
            and must not be off at all.

    Returns:
        What is off most in each unit, in words; and whether all is near enough.
    """
    worst: dict[str, tuple[float, str]] = {}
    known = np.array([pose.get(name, q) for name, q in zip(form.names, first, strict=True)])
    first = form.toward(np.array([first]), known)[0].tolist()
    for name, unit, q in zip(form.names, form.units, first, strict=True):
        if name in pose:
            off = abs(pose[name] - q)  # what is no number may be anywhere
            off = math.inf if math.isnan(off) else off
            worst[unit] = max((off, name), worst.get(unit, (0.0, name)))
    said, there = [], True
    for unit, (distance, name) in worst.items():
        allowed = settings.errors_of(unit)
        text = f"{distance:.3g} {unit} ({name}) from the start pose"
        if allowed is None:
            text += f", which is held against nothing: add {unit} to errors in [gate]"
            there = there and distance == 0
        elif distance > allowed[0]:
            text, there = f"{text}; {allowed[0]:g} is allowed", False
        said.append(text)
    return f"the arm is {', '.join(said)}", there

"""Asking a command where the arm stands, before a plan is executed."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from prior_reinforce.bench.robots.executors.arguments import check_program, split
from prior_reinforce.bench.robots.executors.supervision import Interruptions, supervise
from prior_reinforce.bench.robots.gate import GateSettings
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import PlanFormat


def read_pose(command: str, form: PlanFormat, *, time_limit: float = 10.0) -> dict[str, float]:
    """Ask a command where the arm stands; it must move nothing.

    Args:
        command: Writes one line of JSON last, in the plan's units: `{"joint1": 0.1, ...}`, or a
            list in the order of the plan's columns.
        form: Of the plan.
        time_limit: In [s].

    Returns:
        Position by column: of every joint (a column in radians; of every column where none is),
        and of others that it names.

    Raises:
        ConfigurationError: It cannot be used, fails, or leaves a joint out.
    """
    check_program(command)
    with tempfile.TemporaryDirectory() as folder:
        output = ask_arm(command, tuple(split(command)), Path(folder), time_limit=time_limit)
    try:
        said = json.loads(output.strip().splitlines()[-1])
        pose = said if isinstance(said, dict) else dict(zip(form.names, said, strict=True))
        pose = {name: float(value) for name, value in pose.items() if name in form.names}
        if not all(map(math.isfinite, pose.values())):
            raise ValueError("a position is not finite")
    except (IndexError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise ConfigurationError(
            f"the command {command!r} must end with a line of JSON such as "
            f'{{"{form.names[0]}": 0.1}}: {error}'
        ) from error
    units = dict(zip(form.names, form.units, strict=True))
    joints = [name for name in form.names if units[name] == "rad"] or form.names
    if missing := [f"{name} [{units[name]}]" for name in joints if name not in pose]:
        raise ConfigurationError(
            f"the command {command!r} says nothing of {', '.join(missing)}; it must name every "
            "joint as the plan does, in the plan's units"
        )
    return pose


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
    ended = ended or {"started": False}
    if not ended["started"] or ended["timed_out"] or ended["exit_status"]:
        said = ended.get("error") or ended.get("output_tail", "").strip()
        why = said.splitlines()[-1] if said else "no output"
        if ended.get("timed_out"):
            why = f"no answer within {time_limit:g} s"
        raise ConfigurationError(
            f"{command!r} did not say where the arm stands: {why}; mend that, then ask again"
        )
    return str(ended["output_tail"])


def compare_pose(
    pose: Mapping[str, float], first: Sequence[float], form: PlanFormat, settings: GateSettings
) -> tuple[str, bool]:
    """Hold where the arm stands against a plan's first frame, unit by unit.

    Args:
        pose: As `read_pose` returns it.
        first: The frame, shape (D,), in the plan's units.
        form: Of the plan.
        settings: How far it may be off (`errors_of`); a unit of which they say nothing is named,
            and must not be off at all.

    Returns:
        What is off most in each unit, in words; and whether all is near enough.
    """
    worst: dict[str, tuple[float, str]] = {}
    for name, unit, q in zip(form.names, form.units, first, strict=True):
        if name in pose:
            off = abs(pose[name] - q)  # what is no number may be anywhere
            off = math.inf if math.isnan(off) else off
            worst[unit] = max((off, name), worst.get(unit, (0.0, name)))
    said, there = [], True
    for unit, (distance, name) in worst.items():
        allowed = settings.errors_of(unit)
        text = f"{distance:.3g} {unit} ({name})"
        if allowed is None:
            text += f", which is held against nothing: add {unit} to errors in [gate]"
            there = there and distance == 0
        elif distance > allowed[0]:
            text, there = f"{text}, more than {allowed[0]:g}", False
        said.append(text)
    return f"the arm is off it by up to {'; '.join(said)}", there

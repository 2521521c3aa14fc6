"""Arms that are known by name: `presets.toml` has their limits and kinematics, with the sources."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arm.robots.limits import RobotLimits, VelocityEnvelope
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.kinematics import Chain
from prior_reinforce.settings import tomllib

_ARMS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["arm"]
PRESETS = tuple(dict.fromkeys(arm["robot"] for arm in _ARMS))
"""Names of the robots that are known here."""
GRIPPERS = {arm["robot"]: tuple(arm["gripper"]) for arm in _ARMS if "gripper" in arm}
"""Name and unit of the gripper that an arm comes with."""


def robot_limits(robot: str, firmware: str = "any") -> RobotLimits:
    """Return the limits of a robot that is known here.

    Args:
        robot: A name of `PRESETS`: `panda` (or `fer`), `fr3`, `ur5e`, `ur10e`, `xarm6`, `xarm7`,
            `so101`.
        firmware: System image of an FR3: `>=5.9`, `<5.9`, or `any` for the narrower of both.

    Raises:
        ConfigurationError: No such robot or firmware; the message lists the known ones.
    """
    called = str(robot).lower()
    name = "panda" if called == "fer" else called
    by_firmware = _presets().get(name)
    if by_firmware is None:
        raise ConfigurationError(
            f"no limits for robot {robot!r}; known are {', '.join(PRESETS)}: for another arm, "
            'prior-reinforce new --robot path/to/arm.urdf, or model = "given" with its numbers'
        )
    if firmware not in by_firmware:
        known = ", ".join(map(repr, by_firmware))
        raise ConfigurationError(
            f"no limits for {name} with firmware {firmware!r}; known are {known}"
        )
    return by_firmware[firmware]


@cache
def _presets() -> dict[str, dict[str, RobotLimits]]:
    """Limits by robot and firmware."""
    found: dict[str, dict[str, RobotLimits]] = {}
    full: dict[str, Mapping[str, Any]] = {}
    for entry in _ARMS:
        arm = full[entry["robot"]] = {**full.get(entry.get("like", ""), {}), **entry}
        limits = _limits(arm)
        found.setdefault(limits.robot, {})[limits.firmware] = limits
    for by_firmware in found.values():
        if "any" not in by_firmware:
            by_firmware["any"] = _narrower(*by_firmware.values())
    return found


def _limits(arm: Mapping[str, Any]) -> RobotLimits:
    unit = np.pi / 180 if arm.get("degrees") else 1.0
    rates = ("lower", "upper", "velocity", "acceleration", "jerk")
    given: dict[str, Any] = {name: unit * np.array(arm[name]) for name in rates if name in arm}
    return RobotLimits(
        robot=arm["robot"],
        firmware=arm.get("firmware", "any"),
        source=arm["source"],
        joint_names=arm["joint_names"],
        **given,
        envelopes=tuple(
            VelocityEnvelope(**{name: np.array(values) for name, values in envelope.items()})
            for envelope in arm.get("envelopes", ())
        ),
        chain=_chain(arm),
    )


def _chain(arm: Mapping[str, Any]) -> Chain | None:
    if "craig" in arm:
        rows = [(a, d, np.deg2rad(alpha)) for a, d, alpha in arm["craig"]["rows"]]
        return Chain.craig(rows, arm["craig"]["flange"])
    if "standard" in arm:
        rows = [(a, d, np.deg2rad(alpha)) for a, d, alpha in arm["standard"]["rows"]]
        return Chain.standard(rows, np.deg2rad(arm["standard"]["yaw"]))
    if "origins" in arm:
        poses = [(*pose[:3], *np.deg2rad(pose[3:]).tolist()) for pose in arm["origins"]]
        return Chain(tuple(poses), ((0.0, 0.0, 1.0),) * len(poses))
    return None


def _narrower(one: RobotLimits, other: RobotLimits) -> RobotLimits:
    """Limits within which a plan holds for both firmwares."""
    return replace(
        one,
        firmware="any",
        source=f"the narrower of: {one.source}; and {other.source}",
        lower=np.maximum(one.lower, other.lower),
        upper=np.minimum(one.upper, other.upper),
        envelopes=one.envelopes + other.envelopes,
    )

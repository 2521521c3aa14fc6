"""Limits and kinematics that makers publish, per firmware, each with its source."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np

from prior_reinforce.bench.robots.kinematics import Chain, Pose
from prior_reinforce.bench.robots.limits import RobotLimits, VelocityEnvelope
from prior_reinforce.errors import ConfigurationError

FRANKA = Chain.craig(
    rows=(
        (0.0, 0.333, 0.0),
        (0.0, 0.0, -pi / 2),
        (0.0, 0.316, pi / 2),
        (0.0825, 0.0, pi / 2),
        (-0.0825, 0.384, -pi / 2),
        (0.0, 0.0, pi / 2),
        (0.088, 0.0, pi / 2),
    ),
    flange=0.107,
)
"""The Panda (FER) and the FR3 share one chain (frankarobotics/docs, robot_specifications.rst,
"Denavit-Hartenberg Parameters", read 21 Nov 2026; frankaemika/docs, control_parameters.rst)."""

PANDA = RobotLimits(
    robot="panda",
    firmware="any",
    source=(
        "frankarobotics/docs, robot_specifications.rst and control-parameters-joint-panda.csv, "
        "read 4 May 2026"
    ),
    joint_names=tuple(f"joint{i}" for i in range(1, 8)),
    lower=np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
    upper=np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
    velocity=np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
    acceleration=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    jerk=np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
    chain=FRANKA,
)
"""The Franka Emika Robot (FER), sold as Panda."""

_FR3_LOWER = np.array([-2.9007, -1.8361, -2.9007, -3.0770, -2.8763, 0.4398, -3.0508])
_FR3_UPPER = np.array([2.9007, 1.8361, 2.9007, -0.1169, 2.8763, 4.6216, 3.0508])
_FR3_DECELERATION = np.array([6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0])

FR3 = RobotLimits(
    robot="fr3",
    firmware=">=5.9",
    source="frankarobotics/docs, control-parameters-joint-fr3.csv, read 21 Nov 2026",
    joint_names=PANDA.joint_names,
    lower=_FR3_LOWER,
    upper=_FR3_UPPER,
    velocity=np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]),
    acceleration=np.full(7, 10.0),
    jerk=np.full(7, 5000.0),
    envelopes=(
        VelocityEnvelope(
            offset=np.array([0.6599, 0.2517, 0.2000, 0.3533, 0.5757, 0.4878, 0.4628]),
            deceleration=_FR3_DECELERATION,
            lower=_FR3_LOWER,
            upper=_FR3_UPPER,
        ),
    ),
    chain=FRANKA,
)
"""Franka Research 3 with system image 5.9.0 or later."""

FR3_BEFORE_5_9 = replace(
    FR3,
    firmware="<5.9",
    source=(
        "positions: Franka's documentation before system 5.9 (also franka_description's URDF of "
        "that time); velocity envelope: libfranka, include/franka/rate_limiting.h"
    ),
    lower=np.array([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159]),
    upper=np.array([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159]),
    envelopes=(
        VelocityEnvelope(
            offset=np.array([0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35]),
            deceleration=_FR3_DECELERATION,
            lower=np.array([-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196]),
            upper=np.array([2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196]),
        ),
    ),
)
"""Franka Research 3 with a system image before 5.9.0."""

FR3_ANY = replace(
    FR3,
    firmware="any",
    source=f"the narrower of: {FR3.source}; and {FR3_BEFORE_5_9.source}",
    lower=np.maximum(FR3.lower, FR3_BEFORE_5_9.lower),
    upper=np.minimum(FR3.upper, FR3_BEFORE_5_9.upper),
    envelopes=FR3.envelopes + FR3_BEFORE_5_9.envelopes,
)
"""Franka Research 3 of unknown firmware: a plan within these numbers holds on both."""

_UR_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
_UR_SOURCE = (
    "UniversalRobots/Universal_Robots_ROS2_Description, config/{}/joint_limits.yaml (user manual "
    "5.8), read 22 Nov 2026; kinematics: universal-robots.com, DH parameters. Accelerations are "
    "not published; the elbow is limited to half a turn by the arm itself"
)


def _ur(robot: str, a: tuple[float, float], d: tuple[float, ...], slow: float) -> RobotLimits:
    """An e-series arm: lengths a2, a3 and d1, d4, d5, d6 in [m], speed of the shoulder in [deg/s].

    The base frame is ROS's `base_link`, x forward; the controller's own is turned by half a turn.
    """
    turns = np.deg2rad([360.0, 360.0, 180.0, 360.0, 360.0, 360.0])
    rows = (
        (0.0, d[0], pi / 2),
        (a[0], 0.0, 0.0),
        (a[1], 0.0, 0.0),
        (0.0, d[1], pi / 2),
        (0.0, d[2], -pi / 2),
        (0.0, d[3], 0.0),
    )
    return RobotLimits(
        robot=robot,
        firmware="any",
        source=_UR_SOURCE.format(robot),
        joint_names=_UR_JOINTS,
        lower=-turns,
        upper=turns,
        velocity=np.deg2rad([slow, slow, 180.0, 180.0, 180.0, 180.0]),
        chain=Chain.standard(rows, yaw=pi),
    )


UR5E = _ur("ur5e", (-0.425, -0.3922), (0.1625, 0.1333, 0.0997, 0.0996), 180.0)
"""Universal Robots UR5e."""

UR10E = _ur("ur10e", (-0.6127, -0.57155), (0.1807, 0.17415, 0.11985, 0.11655), 120.0)
"""Universal Robots UR10e."""

_XARM_SOURCE = (
    "xArm-Developer/xarm_ros2, xarm_description/urdf/{0}/{0}.urdf.xacro and "
    "config/kinematics/default/{0}_default_kinematics.yaml, read 22 Nov 2026. Accelerations are "
    "not published there"
)


def _xarm(
    robot: str, lower: list[float], upper: list[float], origins: tuple[Pose, ...]
) -> RobotLimits:
    """An xArm: every joint turns about its own z axis, at 180 deg/s at most."""
    d = len(origins)
    return RobotLimits(
        robot=robot,
        firmware="any",
        source=_XARM_SOURCE.format(robot),
        joint_names=tuple(f"joint{i}" for i in range(1, d + 1)),
        lower=np.array(lower),
        upper=np.array(upper),
        velocity=np.full(d, 3.14),
        chain=Chain(origins, ((0.0, 0.0, 1.0),) * d),
    )


XARM6 = _xarm(
    "xarm6",
    [-2 * pi, -2.059, -3.927, -2 * pi, -1.69297, -2 * pi],
    [2 * pi, 2.0944, 0.19198, 2 * pi, pi, 2 * pi],
    (
        (0.0, 0.0, 0.267, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, -pi / 2, 0.0, 0.0),
        (0.0535, -0.2845, 0.0, 0.0, 0.0, 0.0),
        (0.0775, 0.3425, 0.0, -pi / 2, 0.0, 0.0),
        (0.0, 0.0, 0.0, pi / 2, 0.0, 0.0),
        (0.076, 0.097, 0.0, -pi / 2, 0.0, 0.0),
    ),
)
"""UFACTORY xArm 6."""

XARM7 = _xarm(
    "xarm7",
    [-2 * pi, -2.059, -2 * pi, -0.19198, -2 * pi, -1.69297, -2 * pi],
    [2 * pi, 2.0944, 2 * pi, 3.927, 2 * pi, pi, 2 * pi],
    (
        (0.0, 0.0, 0.267, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, -pi / 2, 0.0, 0.0),
        (0.0, -0.293, 0.0, pi / 2, 0.0, 0.0),
        (0.0525, 0.0, 0.0, pi / 2, 0.0, 0.0),
        (0.0775, -0.3425, 0.0, pi / 2, 0.0, 0.0),
        (0.0, 0.0, 0.0, pi / 2, 0.0, 0.0),
        (0.076, 0.097, 0.0, -pi / 2, 0.0, 0.0),
    ),
)
"""UFACTORY xArm 7."""

_SO101_TURNS = np.deg2rad([110.0, 100.0, 95.0, 95.0, 160.0])
"""Half of what each joint can turn, since LeRobot's zero is the middle of the calibrated range."""
SO101 = RobotLimits(
    robot="so101",
    firmware="any",
    source=(
        "positions: SO-ARM101-USD.urdf of isaaclab-so101 0.1.0, half of each range either way; "
        "velocity: servo STS3215, 42 rpm at 6 V, the slowest that is published (45 rpm at 12 V, "
        "52 rpm at 7.4 V); read 23 Nov 2026. Accelerations are not published"
    ),
    joint_names=tuple(
        f"{name}.pos"
        for name in ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
    ),
    lower=-_SO101_TURNS,
    upper=_SO101_TURNS,
    velocity=np.full(5, 42 * 2 * pi / 60),
)
"""SO-101, joints as LeRobot calls them. No kinematics: an arm's own calibration sets its zeros."""

GRIPPERS = {"so101": ("gripper.pos", "percent")}
"""Name and unit of the gripper that an arm comes with, as LeRobot records it: 0 is closed."""

_KNOWN = (PANDA, FR3, FR3_BEFORE_5_9, FR3_ANY, UR5E, UR10E, XARM6, XARM7, SO101)
PRESETS = tuple(dict.fromkeys(limits.robot for limits in _KNOWN))
"""Names of the robots that are known here."""


def robot_limits(robot: str, firmware: str = "any") -> RobotLimits:
    """Return the limits of a robot that is known here.

    Args:
        robot: A name of `PRESETS`: `panda` (or `fer`), `fr3`, `ur5e`, `ur10e`, `xarm6`, `xarm7`,
            `so101`.
        firmware: System image of an FR3: `>=5.9`, `<5.9`, or `any` for the narrower of both.

    Raises:
        ConfigurationError: No such robot or firmware; the message lists the known ones.
    """
    name = "panda" if robot.lower() in ("panda", "fer") else robot.lower()
    by_firmware = {limits.firmware: limits for limits in _KNOWN if limits.robot == name}
    if not by_firmware:
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

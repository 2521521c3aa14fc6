"""Limits of robot arms, per firmware, each with its source."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.robots.kinematics import FRANKA, Chain


@dataclass(frozen=True, eq=False)
class VelocityEnvelope:
    """A velocity bound that shrinks towards the stops; arrays have shape (D,).

    min(velocity, max(0, -offset + sqrt(max(0, 2 deceleration (upper - q))))), mirrored at the lower
    end (frankarobotics/docs, robot_specifications.rst, "Position-Based Velocity Limits").
    """

    offset: np.ndarray
    """[rad/s]."""
    deceleration: np.ndarray
    """[rad/s^2]."""
    lower: np.ndarray
    """Lower end in the formula, [rad]; libfranka's differs a little from the position limit."""
    upper: np.ndarray
    """Upper end in the formula, [rad]."""


@dataclass(frozen=True, eq=False)
class RobotLimits:
    """What a plan may ask of an arm with D joints."""

    robot: str
    """For instance `panda` or `fr3`."""
    firmware: str
    """Which firmware the numbers hold for."""
    source: str
    """Where the numbers are published."""
    joint_names: tuple[str, ...]
    """Names of the D joints; a plan's columns are matched to them by name."""
    lower: np.ndarray
    """Lowest joint positions, shape (D,), [rad]."""
    upper: np.ndarray
    """Highest joint positions, shape (D,), [rad]."""
    velocity: np.ndarray
    """Largest joint speeds, shape (D,), [rad/s]."""
    acceleration: np.ndarray
    """Largest joint accelerations, shape (D,), [rad/s^2]."""
    jerk: np.ndarray
    """Largest joint jerks, shape (D,), [rad/s^3]."""
    envelopes: tuple[VelocityEnvelope, ...] = ()
    """Position-dependent velocity bounds, where the robot has them; the narrowest counts."""
    chain: Chain | None = None
    """Kinematics, for the tool tip; None leaves the workspace box unchecked."""

    def __post_init__(self) -> None:
        """Copy and check.

        Raises:
            ConfigurationError: A wrong number of values, or values that no arm has.
        """
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        d = len(self.joint_names)
        if d == 0 or len(set(self.joint_names)) != d:
            raise ConfigurationError(
                f"limits of {self.robot} need joint names that differ, got {self.joint_names}"
            )
        for name in ("lower", "upper", "velocity", "acceleration", "jerk"):
            object.__setattr__(self, name, _numbers(self.robot, name, getattr(self, name), d))
        for name in ("velocity", "acceleration", "jerk"):
            if np.any(getattr(self, name) <= 0):
                raise ConfigurationError(
                    f"{name} limits of {self.robot} must be positive, got "
                    f"{getattr(self, name).tolist()}"
                )
        if np.any(self.lower >= self.upper):
            joint = self.joint_names[int(np.argmax(self.lower >= self.upper))]
            raise ConfigurationError(
                f"the lower limit of {joint} of {self.robot} must be below its upper limit"
            )
        for envelope in self.envelopes:
            for item in fields(envelope):
                _numbers(self.robot, item.name, getattr(envelope, item.name), d)
        if self.chain is not None and len(self.chain.rows) != d:
            raise ConfigurationError(
                f"the kinematics of {self.robot} have {len(self.chain.rows)} joints, its limits {d}"
            )

    def velocity_bounds(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lowest (negative) and highest velocities allowed at positions q, shape (..., D)."""
        high = np.broadcast_to(self.velocity, np.shape(q))
        low = -high
        for e in self.envelopes:
            upward = np.sqrt(np.maximum(0.0, 2 * e.deceleration * (e.upper - q))) - e.offset
            downward = np.sqrt(np.maximum(0.0, 2 * e.deceleration * (q - e.lower))) - e.offset
            high = np.minimum(high, np.maximum(0.0, upward))
            low = np.maximum(low, np.minimum(0.0, -downward))
        return low, high


def _numbers(robot: str, name: str, values: object, d: int) -> np.ndarray:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"{name} limits of {robot} must be numbers: {error}") from error
    if array.shape != (d,) or not np.all(np.isfinite(array)):
        raise ConfigurationError(
            f"{name} limits of {robot} must be {d} finite numbers, one a joint, got {values!r}"
        )
    array.setflags(write=False)
    return array


_JOINTS = tuple(f"joint{i}" for i in range(1, 8))

PANDA = RobotLimits(
    robot="panda",
    firmware="any",
    source=(
        "frankarobotics/docs, robot_specifications.rst and control-parameters-joint-panda.csv, "
        "read 4 May 2026"
    ),
    joint_names=_JOINTS,
    lower=np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
    upper=np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
    velocity=np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
    acceleration=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    jerk=np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
    chain=FRANKA,
)
"""The Franka Emika Robot (FER), sold as Panda."""

_FR3_VELOCITY = np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26])
_FR3_ACCELERATION = np.full(7, 10.0)
_FR3_JERK = np.full(7, 5000.0)
_FR3_DECELERATION = np.array([6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0])
_FR3_NEW_SOURCE = "frankarobotics/docs, control-parameters-joint-fr3.csv, read 21 Nov 2026"
_FR3_OLD_SOURCE = (
    "positions: Franka's documentation before system 5.9 (also franka_description's URDF of that "
    "time); velocity envelope: libfranka, include/franka/rate_limiting.h"
)

FR3 = RobotLimits(
    robot="fr3",
    firmware=">=5.9",
    source=_FR3_NEW_SOURCE,
    joint_names=_JOINTS,
    lower=np.array([-2.9007, -1.8361, -2.9007, -3.0770, -2.8763, 0.4398, -3.0508]),
    upper=np.array([2.9007, 1.8361, 2.9007, -0.1169, 2.8763, 4.6216, 3.0508]),
    velocity=_FR3_VELOCITY,
    acceleration=_FR3_ACCELERATION,
    jerk=_FR3_JERK,
    envelopes=(
        VelocityEnvelope(
            offset=np.array([0.6599, 0.2517, 0.2000, 0.3533, 0.5757, 0.4878, 0.4628]),
            deceleration=_FR3_DECELERATION,
            lower=np.array([-2.9007, -1.8361, -2.9007, -3.0770, -2.8763, 0.4398, -3.0508]),
            upper=np.array([2.9007, 1.8361, 2.9007, -0.1169, 2.8763, 4.6216, 3.0508]),
        ),
    ),
    chain=FRANKA,
)
"""Franka Research 3 with system image 5.9.0 or later."""

FR3_BEFORE_5_9 = replace(
    FR3,
    firmware="<5.9",
    source=_FR3_OLD_SOURCE,
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
    source=f"the narrower of: {_FR3_NEW_SOURCE}; and {_FR3_OLD_SOURCE}",
    lower=np.maximum(FR3.lower, FR3_BEFORE_5_9.lower),
    upper=np.minimum(FR3.upper, FR3_BEFORE_5_9.upper),
    envelopes=FR3.envelopes + FR3_BEFORE_5_9.envelopes,
)
"""Franka Research 3 of unknown firmware: a plan within these numbers holds on both."""

_KNOWN = (PANDA, FR3, FR3_BEFORE_5_9, FR3_ANY)


def robot_limits(robot: str, firmware: str = "any") -> RobotLimits:
    """Limits of a robot that is known here.

    Args:
        robot: `panda` (or `fer`), or `fr3`.
        firmware: System image of an FR3: `>=5.9`, `<5.9`, or `any` for the narrower of both.

    Raises:
        ConfigurationError: No such robot or firmware; the message lists the known ones.
    """
    name = "panda" if robot.lower() in ("panda", "fer") else robot.lower()
    candidates = [limits for limits in _KNOWN if limits.robot == name]
    if not candidates:
        raise ConfigurationError(
            f"no limits for robot {robot!r}; known are panda and fr3: for another arm give its "
            "limits as numbers"
        )
    for limits in candidates:
        if limits.firmware == firmware:
            return limits
    known = ", ".join(repr(limits.firmware) for limits in candidates)
    raise ConfigurationError(f"no limits for {name} with firmware {firmware!r}; known are {known}")

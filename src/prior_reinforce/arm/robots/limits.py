"""What a plan may ask of a robot arm, and which of its columns moves which joint."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from jaxtyping import Float

from prior_reinforce.errors import ConfigurationError, InvalidPlanError
from prior_reinforce.plans.channels import is_of_finger, says_no_position
from prior_reinforce.plans.kinematics import Chain, JointPositions
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.whole_turns import attitudes, whole_circles

PerJoint = Float[np.ndarray, " D"]
"""One number for each of an arm's D joints."""
ENDLESS = 4 * math.pi
"""What any joint may turn either way, in [rad]. Ours: two turns, since a throw that needs more is a
wrong unit, and a range beyond it a lost decimal point. A joint of that range turns endlessly."""


@dataclass(frozen=True, eq=False)
class VelocityEnvelope:
    """A velocity bound that shrinks towards the stops.

    min(velocity, max(0, -offset + sqrt(max(0, 2 deceleration (upper - q))))), mirrored at the lower
    end (frankarobotics/docs, robot_specifications.rst, "Position-Based Velocity Limits").
    """

    offset: PerJoint
    """[rad/s]."""
    deceleration: PerJoint
    """[rad/s^2]."""
    lower: PerJoint
    """Lower end in the formula, [rad]; libfranka's differs a little from the position limit."""
    upper: PerJoint
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
    lower: PerJoint
    """Lowest joint positions, [rad]."""
    upper: PerJoint
    """Highest joint positions, [rad]."""
    velocity: PerJoint
    """Largest joint speeds, [rad/s]."""
    acceleration: PerJoint | None = None
    """Largest joint accelerations, [rad/s^2]; None where the maker publishes none."""
    jerk: PerJoint | None = None
    """Largest joint jerks, [rad/s^3]; None where the maker publishes none."""
    envelopes: tuple[VelocityEnvelope, ...] = ()
    """Position-dependent velocity bounds, where the robot has them; the narrowest counts."""
    chain: Chain | None = None
    """Kinematics, for the tool tip; None where they are not known, so that no box can be kept."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Joints that stand still, and where, in [rad] and [m]: a lift below the arm, as `chain` has
    it."""

    def __post_init__(self) -> None:
        """Copy and check.

        ConfigurationError for a wrong number of values, or values that no arm has.
        """
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        d = len(self.joint_names)
        if d == 0 or len(set(self.joint_names)) != d:
            raise ConfigurationError(
                f"limits of {self.robot} need joint names that differ, got {self.joint_names}"
            )
        published = [n for n in ("acceleration", "jerk") if getattr(self, n) is not None]
        for name in ("lower", "upper", "velocity", *published):
            values = _per_joint(self.robot, name, getattr(self, name), d)
            object.__setattr__(self, name, values)
            if name not in ("lower", "upper") and np.any(values <= 0):
                raise ConfigurationError(
                    f"{name} limits of {self.robot} must be positive, got {values.tolist()}"
                )
        if np.any(self.lower >= self.upper):
            joint = self.joint_names[int(np.argmax(self.lower >= self.upper))]
            raise ConfigurationError(
                f"the lower limit of {joint} of {self.robot} must be below its upper limit"
            )
        for envelope in self.envelopes:
            for item in fields(envelope):
                _per_joint(self.robot, item.name, getattr(envelope, item.name), d)
        if self.chain is not None and not len(self.chain.origins) == len(self.chain.axes) == d:
            raise ConfigurationError(
                f"the kinematics of {self.robot} have {len(self.chain.origins)} joints, its limits "
                f"{d}; give one row a joint"
            )

    def velocity_bounds(self, q: JointPositions) -> tuple[JointPositions, JointPositions]:
        """Return the lowest (negative) and highest velocities allowed at positions q, [rad/s]."""
        high = np.broadcast_to(self.velocity, q.shape)
        low = -high
        for e in self.envelopes:
            upward = np.sqrt(np.maximum(0.0, 2 * e.deceleration * (e.upper - q))) - e.offset
            downward = np.sqrt(np.maximum(0.0, 2 * e.deceleration * (q - e.lower))) - e.offset
            high = np.minimum(high, np.maximum(0.0, upward))
            low = np.maximum(low, np.minimum(0.0, -downward))
        return low, high


def is_joint(column: str, joint: str) -> bool:
    """Whether a column moves a joint: `joint4`, `panda_joint4` (ROS) and `joint4.pos` (LeRobot) do.

    Nothing else does, so that no column is held against another joint's limits. A gripper numbers
    its own: `fr3_finger_joint1` (franka_description) is no joint of the arm. Nor is a rate or an
    increment its position: `d_joint1`, `torque/joint1` (`says_no_position`).
    """
    for name in (column, column.removesuffix(".pos")):
        before = name.removesuffix(joint)
        if before != name and (not before or before[-1] in "_/."):
            return not (is_of_finger(before) or says_no_position(before))
    return False


def joint_of(column: str, joints: Sequence[str]) -> int | None:
    """Return which joint a column moves, by `is_joint`; None if none.

    Of joints of which one's name ends another's, `Pitch` and `Wrist_Pitch`, it is the longer one.
    """
    found = [i for i, joint in enumerate(joints) if is_joint(column, joint)]
    return max(found, key=lambda i: len(joints[i]), default=None)


def other_quantities(format: PlanFormat, limits: RobotLimits) -> tuple[str, ...]:
    """Columns that name a joint of the robot and, beside it, another quantity than its position."""
    return tuple(
        column
        for column in format.names
        if any(
            joint in column
            and not is_joint(column, joint)
            and says_no_position(column.replace(joint, " "))
            for joint in limits.joint_names
        )
    )


def match_joints(format: PlanFormat, limits: RobotLimits) -> dict[int, int]:
    """Match a plan's columns to a robot's joints: by name (`is_joint`), never guessed.

    Returns the column of each joint that has one, by the joint's index, in order. InvalidPlanError
    if two columns look like one joint, or a joint is in another unit than [rad].
    """
    columns: dict[int, int] = {}
    of_joint = [joint_of(column, limits.joint_names) for column in format.names]
    for joint, name in enumerate(limits.joint_names):
        found = [i for i, own in enumerate(of_joint) if own == joint]
        if len(found) > 1:
            raise InvalidPlanError(
                f"columns {[format.names[i] for i in found]} all look like {name} of "
                f"{limits.robot}; rename those that are not"
            )
        if found:
            columns[joint] = found[0]
    for column in columns.values():
        if format.units[column] != "rad":
            raise InvalidPlanError(
                f"{format.names[column]} is in {format.units[column]!r}, but limits of "
                f"{limits.robot} are in rad; convert the plan first"
            )
    return columns


def with_turns(format: PlanFormat, limits: RobotLimits | None) -> PlanFormat:
    """Return a format that knows which of its numbers are one pose (`plans.whole_turns`).

    Periodic are joints of the robot that turn endlessly, and angles called yaw, roll or heading.
    """
    endless = {
        column: limits.upper[joint] - limits.lower[joint] > 1.99 * ENDLESS
        for column in format.names
        if limits is not None and (joint := joint_of(column, limits.joint_names)) is not None
    }
    own = [column for column in format.names if endless.get(column)]
    named = [n for n in whole_circles(format.names, format.units) if n not in endless]
    return replace(format, periodic=(*own, *named), attitudes=attitudes(format.names))


def missing_joints(
    columns: dict[int, int], limits: RobotLimits, absent: Sequence[str]
) -> tuple[str, ...]:
    """Name the joints without a column (`match_joints`) that plans do not leave out on purpose.

    ConfigurationError if a joint is said to be absent that the robot has not, or the plan moves.
    """
    moved = {limits.joint_names[joint] for joint in columns}
    for name in absent:
        if name not in limits.joint_names or name in moved:
            why = "the plan moves it" if name in moved else f"{limits.robot} has no such joint"
            raise ConfigurationError(
                f"absent_joints names {name!r}, but {why}; drop it there (joints are "
                f"{', '.join(limits.joint_names)})"
            )
    return tuple(name for name in limits.joint_names if name not in moved and name not in absent)


def _per_joint(robot: str, name: str, values: object, d: int) -> PerJoint:
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

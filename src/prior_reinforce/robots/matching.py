"""Which of a plan's columns moves which of the robot's joints: matched by name, never guessed."""

from __future__ import annotations

import re
from collections.abc import Sequence

from prior_reinforce.errors import ConfigurationError, InvalidPlanError
from prior_reinforce.plans.motions import PlanFormat
from prior_reinforce.robots.limits import RobotLimits


def match_joints(format: PlanFormat, limits: RobotLimits) -> dict[int, int]:
    """Match a plan's columns to a robot's joints.

    Args:
        format: Of the plan. `joint4`, `panda_joint4` (ROS) and `joint4.pos` (LeRobot) are joint4;
            nothing else is, so that no column is held against another joint's limits.
        limits: Of the robot.

    Returns:
        Column of the plan by index of the robot's joint, for the joints that have one.

    Raises:
        InvalidPlanError: Two columns look like one joint, or a joint is in another unit than [rad].
    """
    columns: dict[int, int] = {}
    for joint, name in enumerate(limits.joint_names):
        ending = re.compile(rf"(^|[_/.]){re.escape(name)}(\.pos)?$")
        found = [i for i, column in enumerate(format.names) if ending.search(column)]
        exact = [i for i in found if format.names[i] == name]
        if len(found) > 1 and not exact:
            raise InvalidPlanError(
                f"columns {[format.names[i] for i in found]} all look like {name} of "
                f"{limits.robot}; rename those that are not"
            )
        if found:
            columns[joint] = (exact or found)[0]
    for column in columns.values():
        if format.units[column] != "rad":
            raise InvalidPlanError(
                f"{format.names[column]} is in {format.units[column]!r}, but limits of "
                f"{limits.robot} are in rad; convert the plan first"
            )
    return columns


def missing_joints(
    columns: dict[int, int], limits: RobotLimits, absent: Sequence[str]
) -> tuple[str, ...]:
    """Name the joints that should have a column and have none.

    Args:
        columns: What `match_joints` found.
        limits: Of the robot.
        absent: Joints that plans leave out on purpose.

    Raises:
        ConfigurationError: A joint is said to be absent that the robot has not, or the plan moves.
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

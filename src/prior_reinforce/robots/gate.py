"""The gate: every plan that leaves the program is held against the robot's limits at 1 kHz.

It refuses or warns. It never clamps and never retimes: a retimed throw is another throw. It is no
safety function: torques, collisions and people in reach are not its business.
"""

from __future__ import annotations

import re

from prior_reinforce.errors import InvalidPlanError
from prior_reinforce.motions import Demonstrations, Plan
from prior_reinforce.robots.interpolation import interpolate
from prior_reinforce.robots.joint_checks import JointChecks, check_rest
from prior_reinforce.robots.limits import RobotLimits
from prior_reinforce.robots.reach_checks import check_demonstrations, check_workspace
from prior_reinforce.robots.report import LimitReport
from prior_reinforce.robots.settings import GateSettings

_HOLD = 0.01
"""Held before and after the motion, in [s], so that the steps where they meet are seen."""


def check_plan(
    plan: Plan,
    limits: RobotLimits,
    demonstrations: Demonstrations | None = None,
    settings: GateSettings | None = None,
) -> LimitReport:
    """Hold a plan against the limits, at rest before and after, sampled at 1 kHz.

    Args:
        plan: What is to be executed. Its columns are matched to the robot's joints by name
            (`joint4` also matches `panda_joint4`); columns that are no joint of it, such as a
            gripper, are only held against the demonstrations.
        limits: Of the robot.
        demonstrations: What was shown; None leaves the distance from them unchecked.
        settings: Where the gate draws its own lines; None takes the defaults.

    Returns:
        Eight lines: position, velocity, acceleration, jerk, rest at either end, distance from the
        demonstrations, workspace box.

    Raises:
        InvalidPlanError: A joint in another unit than [rad], or demonstrations of another format.
    """
    settings = settings or GateSettings()
    columns = _match(plan, limits)
    fine = interpolate(plan.actions, plan.format.dt, hold_before=_HOLD, hold_after=_HOLD)
    joints = JointChecks(columns, limits, fine, settings)
    lines = [
        *joints.lines(),
        check_rest("rest at start", plan, columns, limits, settings, first=True),
        check_rest("rest at end", plan, columns, limits, settings, first=False),
        check_demonstrations(plan, demonstrations, settings),
        check_workspace(columns, limits, fine, settings),
    ]
    return LimitReport(limits.robot, limits.firmware, limits.source, tuple(lines))


def _match(plan: Plan, limits: RobotLimits) -> dict[int, int]:
    """Column of the plan by index of the robot's joint, for the joints that the plan moves."""
    columns: dict[int, int] = {}
    for joint, name in enumerate(limits.joint_names):
        # `panda_joint4` in ROS, `joint4.pos` in LeRobot.
        ending = re.compile(rf"(^|[_/.]){re.escape(name)}(\.pos)?$")
        found = [i for i, column in enumerate(plan.format.names) if ending.search(column)]
        exact = [i for i in found if plan.format.names[i] == name]
        if len(found) > 1 and not exact:
            raise InvalidPlanError(
                f"columns {[plan.format.names[i] for i in found]} all look like {name} of "
                f"{limits.robot}; rename those that are not"
            )
        if found:
            columns[joint] = (exact or found)[0]
    for column in columns.values():
        if plan.format.units[column] != "rad":
            raise InvalidPlanError(
                f"{plan.format.names[column]} is in {plan.format.units[column]!r}, but limits of "
                f"{limits.robot} are in rad; convert the plan first"
            )
    return columns

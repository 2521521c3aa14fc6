"""The gate: every plan that leaves the program is held against the robot's limits at 1 kHz.

It refuses or warns. It never clamps and never retimes: a retimed throw is another throw. It is no
safety function: torques, collisions and people in reach are not its business.
"""

from __future__ import annotations

from prior_reinforce.plans.interpolation import interpolate
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.robots.joint_checks import JointChecks, check_joints, check_rest
from prior_reinforce.robots.limits import RobotLimits
from prior_reinforce.robots.matching import match_joints
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
            gripper, are only held against the demonstrations. A joint without a column cannot be
            checked, which warns unless `settings.absent_joints` names it.
        limits: Of the robot.
        demonstrations: What was shown; None leaves the distance from them unchecked.
        settings: Where the gate draws its own lines; None takes the defaults.

    Returns:
        Nine lines: joints in the plan, position, velocity, acceleration, jerk, rest at either end,
        distance from the demonstrations, workspace box.

    Raises:
        InvalidPlanError: A joint in another unit than [rad], two columns that look like one joint,
            or demonstrations of another format.
        ConfigurationError: `absent_joints` names no joint of the robot, or one that the plan moves.
    """
    settings = settings or GateSettings()
    columns = match_joints(plan.format, limits)
    fine = interpolate(plan.actions, plan.format.dt, hold_before=_HOLD, hold_after=_HOLD)
    joints = JointChecks(columns, limits, fine, settings)
    lines = [
        check_joints(columns, limits, settings),
        *joints.lines(),
        check_rest("rest at start", plan, columns, limits, settings, first=True),
        check_rest("rest at end", plan, columns, limits, settings, first=False),
        check_demonstrations(plan, demonstrations, settings),
        check_workspace(columns, limits, fine, settings),
    ]
    return LimitReport(limits.robot, limits.firmware, limits.source, tuple(lines))

"""Robots: the limits their makers publish, and the gate that holds every plan against them."""

from prior_reinforce.plans.interpolation import FineMotion, interpolate
from prior_reinforce.robots.gate import check_plan
from prior_reinforce.robots.limits import RobotLimits, VelocityEnvelope, robot_limits
from prior_reinforce.robots.matching import match_joints, missing_joints
from prior_reinforce.robots.report import LimitLine, LimitReport
from prior_reinforce.robots.settings import GateSettings

__all__ = [
    "FineMotion",
    "GateSettings",
    "LimitLine",
    "LimitReport",
    "RobotLimits",
    "VelocityEnvelope",
    "check_plan",
    "interpolate",
    "match_joints",
    "missing_joints",
    "robot_limits",
]

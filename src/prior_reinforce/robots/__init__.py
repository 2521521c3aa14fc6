"""Robots: the limits their makers publish, and the gate that holds every plan against them."""

from prior_reinforce.robots.gate import GateSettings, LimitLine, LimitReport, check_plan
from prior_reinforce.robots.limits import RobotLimits, robot_limits

__all__ = [
    "GateSettings",
    "LimitLine",
    "LimitReport",
    "RobotLimits",
    "check_plan",
    "robot_limits",
]

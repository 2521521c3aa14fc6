"""Robots: the limits their makers publish, and the gate that holds every plan against them."""

from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.limits import (
    RobotLimits,
    VelocityEnvelope,
    match_joints,
    missing_joints,
)
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.arm.robots.report import LimitLine, LimitReport

__all__ = [
    "GateSettings",
    "LimitLine",
    "LimitReport",
    "RobotLimits",
    "VelocityEnvelope",
    "check_plan",
    "match_joints",
    "missing_joints",
    "robot_limits",
]

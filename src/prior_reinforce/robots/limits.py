"""Limits of robot arms, per firmware, each with its source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class RobotLimits:
    """What a plan may ask of an arm."""

    robot: str
    """For instance `panda` or `fr3`."""
    firmware: str
    """Which firmware the numbers hold for, in the maker's words."""
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


def robot_limits(robot: str, firmware: str | None = None) -> RobotLimits:
    """Limits of a robot that is known here: `panda` or `fr3`.

    Raises:
        ConfigurationError: No such robot or firmware; the message lists the known ones.
    """
    raise NotImplementedError

"""Forward kinematics of a serial arm: where the tool tip is for given joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np


@dataclass(frozen=True)
class Chain:
    """Denavit-Hartenberg parameters in Craig's convention, a row a joint: (a [m], d [m], alpha).

    Row i is the transform Rot_x(alpha) Trans_x(a) Rot_z(theta_i) Trans_z(d) from frame i-1.
    """

    rows: tuple[tuple[float, float, float], ...]
    flange: float
    """Distance from the last joint's frame to the flange along its z axis, in [m]."""


FRANKA = Chain(
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


def tool_tip(
    chain: Chain, joints: np.ndarray, tip: Sequence[float] = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """Position of a point that is fixed to the flange, in the base frame.

    Args:
        chain: The arm.
        joints: Joint positions, shape (..., D) in [rad].
        tip: The point in the flange's frame, in [m].

    Returns:
        Shape (..., 3), in [m].
    """
    joints = np.asarray(joints, dtype=np.float64)
    point = np.broadcast_to(np.asarray(tip, dtype=np.float64), (*joints.shape[:-1], 3))
    point = point + np.array([0.0, 0.0, chain.flange])
    # From the flange back to the base, each row's transform is applied to the point.
    for index in reversed(range(len(chain.rows))):
        a, d, alpha = chain.rows[index]
        cos, sin = np.cos(joints[..., index]), np.sin(joints[..., index])
        x = cos * point[..., 0] - sin * point[..., 1] + a
        y = sin * point[..., 0] + cos * point[..., 1]
        z = point[..., 2] + d
        point = np.stack(
            [x, np.cos(alpha) * y - np.sin(alpha) * z, np.sin(alpha) * y + np.cos(alpha) * z],
            axis=-1,
        )
    return point

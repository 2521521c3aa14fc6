"""Forward kinematics of a serial arm: where the tool tip is for given joint positions.

Ours rather than MuJoCo's, which gives the same numbers: this is shorter, takes a whole motion at
once, and spares `ask` the loading of a physics engine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

JointPositions = Float[np.ndarray, "*n D"]
"""Positions of an arm's D joints, [rad]."""
Places = Float[np.ndarray, "*n 3"]
"""As many points in the base frame, [m]."""


@dataclass(frozen=True)
class Chain:
    """Denavit-Hartenberg parameters in Craig's convention, a row a joint: (a [m], d [m], alpha).

    Row i is the transform Rot_x(alpha) Trans_x(a) Rot_z(theta_i) Trans_z(d) from frame i-1.
    """

    rows: tuple[tuple[float, float, float], ...]
    flange: float
    """Distance from the last joint's frame to the flange along its z axis, in [m]."""


def tool_tip(
    chain: Chain, joints: JointPositions, tip: Sequence[float] = (0.0, 0.0, 0.0)
) -> Places:
    """Return where a point that is fixed to the flange is, in the base frame.

    Args:
        chain: The arm.
        joints: Joint positions.
        tip: The point in the flange's frame, in [m].
    """
    x, y, z = (np.full(joints.shape[:-1], value) for value in tip)
    z = z + chain.flange
    # From the flange back to the base, each row's transform is applied to the point.
    for index in reversed(range(len(chain.rows))):
        a, d, alpha = chain.rows[index]
        cos, sin = np.cos(joints[..., index]), np.sin(joints[..., index])
        x, y, z = cos * x - sin * y + a, sin * x + cos * y, z + d
        y, z = np.cos(alpha) * y - np.sin(alpha) * z, np.sin(alpha) * y + np.cos(alpha) * z
    return np.stack([x, y, z], axis=-1)

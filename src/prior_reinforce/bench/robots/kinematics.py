"""Forward kinematics of a serial arm: where the tool tip is for given joint positions.

Ours rather than MuJoCo's, which gives the same numbers: this is shorter, takes a whole motion at
once, and spares `ask` the loading of a physics engine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

JointPositions = Float[np.ndarray, "*n D"]
"""Positions of an arm's D joints, [rad]."""
Places = Float[np.ndarray, "*n 3"]
"""As many points in the base frame, [m]."""
Pose = tuple[float, float, float, float, float, float]
"""x, y, z in [m] and roll, pitch, yaw in [rad], as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""
_Z = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Chain:
    """Revolute joints from the base to the flange, each a pose in the frame before and an axis.

    That is URDF's way to say it, and holds any arm; `craig` and `standard` take the tables of
    Denavit and Hartenberg.
    """

    origins: tuple[Pose, ...]
    """Pose of each joint's frame in the frame before it."""
    axes: tuple[tuple[float, float, float], ...]
    """About which each joint turns, in its own frame; of length 1."""
    flange: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Pose of the flange in the last joint's frame."""

    @classmethod
    def craig(cls, rows: Sequence[tuple[float, float, float]], flange: float) -> Chain:
        """Make one from rows (a, d, alpha): Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d).

        Args:
            rows: a and d in [m], alpha in [rad].
            flange: Distance from the last joint's frame to the flange along its z axis, in [m].
        """
        origins = tuple(
            (a, -math.sin(alpha) * d, math.cos(alpha) * d, alpha, 0.0, 0.0) for a, d, alpha in rows
        )
        return cls(origins, (_Z,) * len(rows), flange=(0.0, 0.0, flange, 0.0, 0.0, 0.0))

    @classmethod
    def standard(cls, rows: Sequence[tuple[float, float, float]], yaw: float = 0.0) -> Chain:
        """Make one from rows (a, d, alpha): Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha).

        Args:
            rows: a and d in [m], alpha in [rad].
            yaw: By which the maker's base frame is turned in the one that is wanted, in [rad].
        """
        poses = tuple((a, 0.0, d, alpha, 0.0, 0.0) for a, d, alpha in rows)
        base = (0.0, 0.0, 0.0, 0.0, 0.0, yaw)
        return cls((base, *poses[:-1]), (_Z,) * len(rows), poses[-1])


def tool_tip(chain: Chain, joints: JointPositions, tip: Sequence[float] = (0.0,) * 3) -> Places:
    """Return where a point of the flange's frame, `tip` in [m], is in the base frame."""
    place = _moved(chain.flange, np.broadcast_to(tip, (*joints.shape[:-1], 3)))
    # From the flange back to the base, each joint turns the point and its origin moves it.
    for index in reversed(range(len(chain.origins))):
        axis = np.array(chain.axes[index])
        cos, sin = np.cos(joints[..., index, None]), np.sin(joints[..., index, None])
        along = (place @ axis)[..., None] * axis
        turned = along + cos * (place - along) + sin * np.cross(axis, place)
        place = _moved(chain.origins[index], turned)
    return place


def link_places(chain: Chain, joints: JointPositions) -> Float[np.ndarray, "*n links 3"]:
    """Return where the base, every joint's frame and the flange are, in the base frame: the arm."""
    # A joint's frame stands behind those before it as the flange behind all.
    ends = (*chain.origins, chain.flange)
    before = [Chain(ends[:n], chain.axes[:n], flange=end) for n, end in enumerate(ends)]
    base = np.zeros((*joints.shape[:-1], 3))
    return np.stack([base, *(tool_tip(each, joints) for each in before)], axis=-2)


def rotation(roll: float, pitch: float, yaw: float) -> Float[np.ndarray, "3 3"]:
    """Return Rz(yaw) Ry(pitch) Rx(roll), angles in [rad]."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _moved(pose: Pose, points: Places) -> Places:
    """Points of a frame, in the frame that its pose is given in."""
    return np.asarray(points @ rotation(*pose[3:]).T + pose[:3])

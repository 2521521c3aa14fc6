"""Forward and inverse kinematics of a serial arm.

Ours rather than MuJoCo's, which gives the same numbers: this is shorter, takes a whole motion at
once, and spares `ask` the loading of a physics engine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from prior_reinforce.errors import OutOfReachError

JointPositions = Float[np.ndarray, "*n D"]
"""Positions of an arm's D joints, [rad]."""
Places = Float[np.ndarray, "*n 3"]
"""As many points in the base frame, [m]."""
Pose = tuple[float, float, float, float, float, float]
"""x, y, z in [m] and roll, pitch, yaw in [rad], as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""
UPRIGHT = math.radians(3.0)
"""Largest lean of an axis that counts as vertical, [rad]. Ours: a motion turned about it is wrong
by 5 % of a distance, as much as plans are believed to be off anyway (`offset_sd`)."""
_Z = (0.0, 0.0, 1.0)
_HELD = 1e-3
"""A joint that moves less than this in a path is held, [rad] (ours)."""
_TURN_STEP, _NEWTON_STEPS, _LARGEST_STEP, _DAMPING = 0.1, 12, 0.2, 1e-4
"""Settings of `turned_path` (ours): [rad], steps for each, [rad] a step, [m^2]."""
_SOLVED = 1e-7
"""Error of a pose, [m] and [rad] alike, at which it is solved (ours)."""
_PLACE_TOLERANCE, _ATTITUDE_TOLERANCE = 5e-4, 2e-3
"""Largest error of a flange pose that is in reach, [m] and [rad]. Ours: a thirtieth of 1.5 cm, and
the angle that moves an object held 25 cm away as far; where a path passes a singular pose, an axis
that leans by 0.01 rad leaves 0.7 mrad."""


@dataclass(frozen=True)
class Chain:
    """Revolute joints from the base to the flange: each a pose in its parent frame and an axis.

    That is URDF's convention, which describes any arm; `craig` and `standard` convert tables of
    Denavit-Hartenberg parameters.
    """

    origins: tuple[Pose, ...]
    """Pose of each joint's frame in its parent frame."""
    axes: tuple[tuple[float, float, float], ...]
    """Axis of each joint in its own frame, of length 1."""
    flange: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Pose of the flange in the last joint's frame."""

    @classmethod
    def craig(cls, rows: Sequence[tuple[float, float, float]], flange: float) -> Chain:
        """Convert Craig's rows (a, d, alpha): Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d).

        In [m] and [rad]; `flange` is the distance of the flange along the last joint's z axis.
        """
        origins = tuple(
            (a, -math.sin(alpha) * d, math.cos(alpha) * d, alpha, 0.0, 0.0) for a, d, alpha in rows
        )
        return cls(origins, (_Z,) * len(rows), flange=(0.0, 0.0, flange, 0.0, 0.0, 0.0))

    @classmethod
    def standard(cls, rows: Sequence[tuple[float, float, float]], yaw: float = 0.0) -> Chain:
        """Convert standard rows (a, d, alpha): Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha).

        In [m] and [rad]; `yaw` is that of the maker's base frame in the desired base frame.
        """
        poses = tuple((a, 0.0, d, alpha, 0.0, 0.0) for a, d, alpha in rows)
        base = (0.0, 0.0, 0.0, 0.0, 0.0, yaw)
        return cls((base, *poses[:-1]), (_Z,) * len(rows), poses[-1])


def tool_tip(chain: Chain, joints: JointPositions, tip: Sequence[float] = (0.0,) * 3) -> Places:
    """Return the place of the tool tip in the base frame; `tip` is in the flange's frame, [m]."""
    place = _in_parent(chain.flange, np.broadcast_to(tip, (*joints.shape[:-1], 3)))
    # From the flange to the base: each joint turns the point, and its origin moves it.
    for index in reversed(range(len(chain.origins))):
        axis = np.array(chain.axes[index])
        cos, sin = np.cos(joints[..., index, None]), np.sin(joints[..., index, None])
        along = (place @ axis)[..., None] * axis
        turned = along + cos * (place - along) + sin * np.cross(axis, place)
        place = _in_parent(chain.origins[index], turned)
    return place


def link_places(chain: Chain, joints: JointPositions) -> Float[np.ndarray, "*n links 3"]:
    """Return the places of the base, every joint's frame and the flange, in the base frame."""
    # Each frame is the flange of the chain that ends there.
    poses = (*chain.origins, chain.flange)
    chains = [Chain(poses[:n], chain.axes[:n], flange=pose) for n, pose in enumerate(poses)]
    base = np.zeros((*joints.shape[:-1], 3))
    return np.stack([base, *(tool_tip(each, joints) for each in chains)], axis=-2)


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


def _in_parent(pose: Pose, points: Places) -> Places:
    """Transform points from a frame to its parent frame, in which its pose is given."""
    return np.asarray(points @ rotation(*pose[3:]).T + pose[:3])


@dataclass(frozen=True, eq=False)
class FlangePath:
    """Poses of the flange along a joint path, and their Jacobians."""

    places: Places
    """(n, 3), base frame, [m]."""
    attitudes: Float[np.ndarray, "*n 3 3"]
    """Rotation matrices: columns are the flange's axes in the base frame."""
    jacobians: Float[np.ndarray, "*n 6 D"]
    """Joint speeds [rad/s] to linear [m/s] and angular velocity [rad/s], in the base frame."""


def flange_path(chain: Chain, joints: JointPositions) -> FlangePath:
    """Return the flange's poses and geometric Jacobians at joint positions (n, D)."""
    place, attitude = np.zeros((len(joints), 3)), np.broadcast_to(np.eye(3), (len(joints), 3, 3))
    axes, points = [], []
    for (*xyz, roll, pitch, yaw), axis, angle in zip(
        chain.origins, chain.axes, joints.T, strict=True
    ):
        place = place + attitude @ np.array(xyz)
        attitude = attitude @ rotation(roll, pitch, yaw)
        axes.append(attitude @ np.array(axis))
        points.append(place)
        attitude = attitude @ rotations_about(axis, angle)
    place = place + attitude @ np.array(chain.flange[:3])
    attitude = attitude @ rotation(*chain.flange[3:])
    angular = np.stack(axes, axis=2)
    linear = np.cross(angular, place[:, :, None] - np.stack(points, axis=2), axis=1)
    return FlangePath(place, attitude, np.concatenate([linear, angular], axis=1))


def first_axis(chain: Chain) -> tuple[Float[np.ndarray, "3"], tuple[float, float]]:
    """Return the direction of the first joint's axis in the base frame, and its (x, y)."""
    x, y, *_ = chain.origins[0]
    along = flange_path(chain, np.zeros((1, len(chain.axes)))).jacobians[0, 3:, 0]
    return along, (float(x), float(y))


def leaning(along: Float[np.ndarray, "3"]) -> float:
    """Return the angle between an axis and the vertical, whichever way it points, [rad]."""
    return float(np.arctan2(np.hypot(along[0], along[1]), abs(along[2])))


def turned_path(
    chain: Chain, joints: JointPositions, angle: float, centre: tuple[float, float]
) -> JointPositions:
    """Turn the flange's path about a vertical axis and solve for the joints, all frames at once.

    Inverse kinematics by damped least squares from the given path (H, D), turned in small steps: a
    smooth path stays smooth, and elbows stay where they were. Joints that the path holds stay held
    as long as six others move. The axis is at `centre`, (x, y) in the base frame; angles are in
    [rad]. OutOfReachError if a pose of the turned path cannot be reached.
    """
    from scipy.spatial.transform import Rotation

    given, axis, q = flange_path(chain, joints), np.array([*centre, 0.0]), np.array(joints)
    free = np.ptp(joints, axis=0) > _HELD
    weight = (free if free.sum() >= 6 else np.ones(len(free), dtype=bool)).astype(float)[:, None]
    error = np.zeros((len(joints), 6))
    for part in np.linspace(0, angle, math.ceil(abs(angle) / _TURN_STEP) + 1)[1:]:
        turn = rotation(0.0, 0.0, part)
        for _ in range(_NEWTON_STEPS):
            path = flange_path(chain, q)
            rotation_error = turn @ given.attitudes @ np.swapaxes(path.attitudes, 1, 2)
            error[:, :3] = (given.places - axis) @ turn.T + axis - path.places
            error[:, 3:] = Rotation.from_matrix(rotation_error).as_rotvec()
            if np.abs(error).max() < _SOLVED:
                break
            transposed = np.swapaxes(path.jacobians, 1, 2) * weight
            normal = path.jacobians @ transposed + _DAMPING * np.eye(6)
            step = (transposed @ np.linalg.solve(normal, error[:, :, None]))[:, :, 0]
            q = q + np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
    tolerance = np.repeat([_PLACE_TOLERANCE, _ATTITUDE_TOLERANCE], 3)
    worst = int(np.argmax((np.abs(error) / tolerance).max(axis=1)))
    if np.any(np.abs(error[worst]) > tolerance):
        raise OutOfReachError(
            f"turned by {angle:.3g} rad about ({centre[0]:g}, {centre[1]:g}) m, "
            f"frame {worst} is {np.abs(error[worst, :3]).max():.2g} m and "
            f"{np.abs(error[worst, 3:]).max():.2g} rad away from where the arm comes",
            remedy="demonstrate nearer to the goal",
        )
    return q


def rotations_about(
    axis: Sequence[float], angles: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3 3"]:
    """Return the rotations about an axis of length 1 (Rodrigues), angles in [rad]."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sin, cos = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.asarray(np.eye(3) + sin * cross + (1.0 - cos) * (cross @ cross))

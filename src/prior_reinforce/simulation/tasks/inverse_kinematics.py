"""Flange poses to joint paths of the Panda, with its limits respected, by mink.

A pose is six numbers: the flange's position (x, y, z) in [m] in the table frame, and a rotation
vector (rx, ry, rz) in [rad], axes of the table frame, away from the nominal attitude in which the
flange looks straight down with its x axis forward. So a yaw to the left is +rz, and tipping the
tool's end backwards is +ry. Near the nominal attitude a rotation vector has no singularity and its
components blend like any other action dimension; Euler angles or quaternions would not.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import mink
import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from prior_reinforce.simulation.tasks.panda import N_JOINTS, VELOCITY_LIMIT

POSE_NAMES = ("x", "y", "z", "rx", "ry", "rz")
POSE_UNITS = ("m", "m", "m", "rad", "rad", "rad")
NOMINAL = np.diag([1.0, -1.0, -1.0])
"""Attitude of the flange at rotation vector zero: columns are its axes in the table frame."""
READY = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, np.pi / 4])
"""Posture in which the search for the first frame begins, elbow up, in [rad]; ours."""
_POSITION_COST, _ATTITUDE_COST = 100.0, 30.0
"""Costs of a metre and of a radian off the pose. Far above one, or the solver's tolerance would
hide the elbow's cost and leave the elbow to drift and jump."""
_ELBOW_COST = np.array([0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0])
"""Cost of a radian of joint 3, which a pose leaves free: zero keeps the elbow in the vertical
plane. Small beside the pose's cost: it moves the flange by less than 0.1 mm."""
_STEPS_A_FRAME = 2
"""One Newton step leaves up to 1 mm where the arm is fast, the second leaves micrometres."""
_STEPS_TO_START = 100
"""At most, for the first frame; from `READY` six steps are usual, more only where it is hard to
reach."""
_ARRIVED = 1e-9
"""Largest joint motion of a step that counts as none, in [rad]."""


def to_matrix(rotation_vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """Flange attitudes as rotation matrices, from rotation vectors in [rad]."""
    vectors = np.array(rotation_vectors, dtype=float)  # SciPy wants a writable array
    return Rotation.from_rotvec(vectors).as_matrix() @ NOMINAL


def joint_paths(poses: Float[np.ndarray, "n H 6"], dt: float) -> Float[np.ndarray, "n H 7"]:
    """Joint paths in [rad] that carry the flange along pose paths, a frame each dt [s].

    Every frame is solved from the one before it as a quadratic program (mink, DAQP) with the
    Panda's position and velocity limits as bounds. Where a path asks for more than they allow the
    arm lags behind or stops short, as a real one would, and catches up when it can.
    """
    return np.stack([_followed(path.tobytes(), len(path), dt) for path in poses])


@lru_cache(maxsize=1)
def _arm() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("panda.xml")))


@lru_cache(maxsize=256)
def _followed(path: bytes, horizon: int, dt: float) -> Float[np.ndarray, "H 7"]:
    """Solve one path; demonstrations are executed again and again, and take 0.2 s each."""
    poses = np.frombuffer(path).reshape(horizon, 6)
    out = np.empty((horizon, N_JOINTS))
    arm = _arm()
    configuration = mink.Configuration(arm, q=READY)
    reach = mink.FrameTask("flange", "site", _POSITION_COST, _ATTITUDE_COST)
    elbow = mink.PostureTask(arm, cost=_ELBOW_COST)
    elbow.set_target(READY)
    bounds = mink.ConfigurationLimit(arm)
    names = [arm.joint(j).name for j in range(N_JOINTS)]
    speed = mink.VelocityLimit(arm, dict(zip(names, VELOCITY_LIMIT, strict=True)))
    attitudes = to_matrix(poses[:, 3:])

    def step(limits: list[mink.Limit], seconds: float) -> float:
        velocity = mink.solve_ik(
            configuration, [reach, elbow], seconds, solver="daqp", limits=limits
        )
        configuration.integrate_inplace(velocity, seconds)
        return float(np.abs(velocity).max() * seconds)

    for frame, (position, attitude) in enumerate(zip(poses[:, :3], attitudes, strict=True)):
        reach.set_target(
            mink.SE3.from_rotation_and_translation(mink.SO3.from_matrix(attitude), position)
        )
        if frame == 0:
            # Where the arm is before the motion is free: it is driven there slowly.
            for _ in range(_STEPS_TO_START):
                if step([bounds], dt) < _ARRIVED:
                    break
        else:
            for _ in range(_STEPS_A_FRAME):
                step([bounds, speed], dt / _STEPS_A_FRAME)
        out[frame] = configuration.q
    out.setflags(write=False)
    return out

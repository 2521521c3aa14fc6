"""The Franka Emika Panda: published kinematics and limits, its servo, and how a task mounts it.

Frames of reference: the base frame is the table frame, because the robot stands at table height.
A plan is a path of the seven joint positions q_d in [rad]; the servo's control sequence is made
from it here, once, so that a whole batch of executions is pure physics.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from prior_reinforce.plans.interpolation import join_frames
from prior_reinforce.plans.kinematics import Chain

N_JOINTS = 7
JOINT_NAMES = tuple(f"joint{i}" for i in range(1, N_JOINTS + 1))
VELOCITY_LIMIT = (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61)
"""Largest speed of each joint, in [rad/s]: Franka Emika, Control Parameters Documentation, limits
for Panda."""
STEP = 0.001
"""Physics and servo period, in [s]: the real arm's control loop runs at 1 kHz."""


def build_scene(path: Path, flange: str = "panda/flange") -> mujoco.MjModel:
    """Compile a task's scene with its tool on the site of its arm that is the flange.

    The MJCF's body `tool`, written at the top level in the flange's frame, moves onto the flange;
    everything else stays where it is written.
    """
    scene = mujoco.MjSpec.from_file(str(path))
    scene.delete(scene.body("tool"))
    tool = mujoco.MjSpec.from_file(str(path)).body("tool")
    scene.site(flange).attach_body(tool, "tool/", "")
    return scene.compile()


def chain_of(model: mujoco.MjModel, n_joints: int = N_JOINTS) -> Chain:
    """Read the kinematics of a scene's arm, its first joints, up to the last one's frame."""
    data = mujoco.MjData(model)  # all joints at zero
    mujoco.mj_kinematics(model, data)
    place, attitude, origins = np.zeros(3), np.eye(3), []
    for joint in range(n_joints):
        body = model.jnt_bodyid[joint]
        to, turned = data.xpos[body], data.xmat[body].reshape(3, 3)
        yaw, pitch, roll = Rotation.from_matrix(attitude.T @ turned).as_euler("ZYX")
        x, y, z = (attitude.T @ (to - place)).tolist()
        origins.append((x, y, z, float(roll), float(pitch), float(yaw)))
        place, attitude = to, turned
    axes = model.jnt_axis[:n_joints].tolist()
    return Chain(tuple(origins), tuple((x, y, z) for x, y, z in axes))


@lru_cache(maxsize=8)
def _interpolation(
    horizon: int, dt: float, lead_in: float, n_steps: int
) -> tuple[Float[np.ndarray, "steps H"], Float[np.ndarray, "steps H"]]:
    """Matrices from frames to positions and to velocities at 1 kHz.

    A cubic spline is linear in its frames, so interpolating the identity gives the matrix.
    """
    spline = join_frames(np.eye(horizon), dt)
    times = np.clip(np.arange(n_steps) * STEP - lead_in, 0.0, (horizon - 1) * dt)
    return spline(times), spline(times, 1)


def setpoints(
    plans: Float[np.ndarray, "n H d"], dt: float, n_steps: int, *, lead_in: float = 0.0
) -> tuple[Float[np.ndarray, "n steps d"], Float[np.ndarray, "n steps d"]]:
    """Joint positions and velocities asked for at every servo period.

    Frames, dt [s] apart, are joined by a cubic spline with continuous acceleration, at rest at both
    ends; the first one is held for `lead_in` [s] before it, the last one until `n_steps` periods
    are over. Plans and positions are in [rad], velocities in [rad/s].
    """
    position, velocity = _interpolation(plans.shape[1], dt, lead_in, n_steps)
    return position @ plans, velocity @ plans


def servo_controls(
    model: mujoco.MjModel,
    plans: Float[np.ndarray, "n H 7"],
    dt: float,
    n_steps: int,
    *,
    lead_in: float = 0.0,
) -> Float[np.ndarray, "n steps 7"]:
    """Controls in [rad] that make the position servos follow the plans with velocity feed-forward.

    A MuJoCo position servo gives kp (ctrl - q) - kv dq; with ctrl = q_d + kv / kp dq_d that is
    kp (q_d - q) + kv (dq_d - dq), the law of the real arm's joint position controllers.
    """
    position, velocity = setpoints(plans, dt, n_steps, lead_in=lead_in)
    position += velocity * (
        -model.actuator_biasprm[:N_JOINTS, 2] / model.actuator_gainprm[:N_JOINTS, 0]
    )
    return position

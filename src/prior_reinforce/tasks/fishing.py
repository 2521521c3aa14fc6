"""Fishing Rod Swinging: the Panda casts a hook on a soft rope onto a tiny magnet on the table.

A plan is a path of end-effector poses, as in the paper: the flange's position and a rotation
vector (`inverse_kinematics.py` says which), which mink turns into joint motion within the arm's
limits. The outcome is where the hook first touches the plane of the table: there and then the
magnet catches it or not. Where the hook comes to lie later depends on how the table's surface lets
it bounce and on how the rope drags it, which no magnet would allow and no fisherman aims with.
The scene is in `fishing.xml`, the arm in `panda.xml`; lengths in [m], table frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import mujoco
import numpy as np

from prior_reinforce.plans.motions import PlanFormat
from prior_reinforce.rollouts import KeyFrame, Rollout
from prior_reinforce.tasks.inverse_kinematics import POSE_NAMES, POSE_UNITS, joint_paths
from prior_reinforce.tasks.panda import STEP
from prior_reinforce.tasks.panda_task import ArmDisturbances, Draws, PandaTask

HOOK_RADIUS = 0.006
"""In [m]; in `fishing.xml` too. The hook touches the table where its centre is so high."""
TABLE = np.array([[0.35, -0.5], [1.35, 0.5]])
"""Lower and upper corner of the table top, (x, y) in [m]; the paper's 1 m x 1 m."""
_PULL, _GRIP = 200.0, 1.5
"""The magnet's force on a hook within its reach, in [N/m] and [N s/m]; for films only, and ours: it
stops the hook within a centimetre and then holds against the rope."""
_LOST = np.zeros(2)
"""Outcome of a hook that never touches the table: the robot's own base."""


@dataclass(frozen=True)
class Disturbances:
    """What differs between two executions of one plan; standard deviations, ours.

    Together they spread the hook's first touch by about 0.3 cm (docs/tasks/fishing.md).
    """

    arm: ArmDisturbances = field(default_factory=ArmDisturbances)
    sway: float = 0.008
    """Angle at which the rope still hangs off the vertical at the start, about x and y, in [rad]:
    3 mm at the hook, what an operator calls still."""
    rope: float = 0.1
    """Relative error of the rope's bending stiffness and damping: cords stiffen and soften."""


class Fishing(PandaTask):
    """Fishing Rod Swinging (paper, Section III and Figure 3), in MuJoCo."""

    name: ClassVar[str] = "fishing"
    format: ClassVar[PlanFormat] = PlanFormat(POSE_NAMES, POSE_UNITS, 0.02)
    tolerance: ClassVar[float] = 0.01  # the paper's magnet catches the hook within about 1 cm
    region: ClassVar[np.ndarray] = np.array([[0.78, -0.20], [0.98, 0.20]])
    scene: ClassVar[str] = "fishing"
    recordings: ClassVar[str] = "fishing"
    lead_in: ClassVar[float] = 0.1
    lead_out: ClassVar[float] = 0.4

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene.

        Args:
            disturbances: How repeated executions differ; the documented ones when not given.
        """
        self.disturbances = disturbances or Disturbances()
        super().__init__()
        self._swivel = self.model.jnt_qposadr[self.model.joint("tool/swivel").id]
        self._hook = self.model.sensor("tool/hook").adr[0]
        balls = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_BALL)
        self._bends = balls[self.model.jnt_stiffness[balls] > 0]

    def joint_plans(self, plans: np.ndarray) -> np.ndarray:
        """Follow the poses with the arm, within its limits."""
        return joint_paths(plans, self.format.dt)

    def _draw(self, n: int, rng: np.random.Generator) -> Draws:
        pose, servo = self.disturbances.arm.draw(n, rng)
        rope = 1.0 + rng.normal(0.0, self.disturbances.rope, (n, 2))
        return Draws(pose, servo, rope, rng.normal(0.0, self.disturbances.sway, (n, 2)))

    def _disturb(self, model: mujoco.MjModel, scene: np.ndarray) -> None:
        stiffness, damping = scene
        model.jnt_stiffness[self._bends] *= stiffness
        dofs = (model.jnt_dofadr[self._bends][:, None] + np.arange(3)).ravel()
        model.dof_damping[dofs] *= damping

    def _place(self, data: mujoco.MjData, start: np.ndarray | None) -> None:
        """Let the rope hang: the swivel undoes the rod's attitude, every segment is straight.

        This is the settled state itself, because the swivel has no spring and the others are
        relaxed, so nothing has to be simulated to reach it.
        """
        sway = np.zeros(3)
        if start is not None:
            sway[:2] = start
        upright, rod, hanging = np.empty(4), np.empty(4), np.empty(4)
        mujoco.mju_mat2Quat(rod, data.site("tool/tip").xmat)
        mujoco.mju_negQuat(upright, rod)
        mujoco.mju_quatIntegrate(quat := np.array([1.0, 0.0, 0.0, 0.0]), sway, 1.0)
        mujoco.mju_mulQuat(hanging, upright, quat)
        data.qpos[self._swivel : self._swivel + 4] = hanging

    def _act_at_goal(self, data: mujoco.MjData, goal: np.ndarray) -> None:
        """The magnet holds a hook that is within its reach."""
        hook = data.geom("tool/hook")
        off = np.append(goal, HOOK_RADIUS) - hook.xpos
        body = self.model.geom("tool/hook").bodyid[0]
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_GEOM, hook.id, velocity, 0)
        near = np.linalg.norm(off) <= self.tolerance
        data.xfrc_applied[body, :3] = near * (_PULL * off - _GRIP * velocity[3:])

    def _result(self, states: np.ndarray, sensors: np.ndarray) -> Rollout:
        """Where the hook first touches the table, between two steps by linear interpolation."""
        hook = sensors[:, self._hook : self._hook + 3]
        touches = np.flatnonzero((hook[:-1, 2] > HOOK_RADIUS) & (hook[1:, 2] <= HOOK_RADIUS))
        if touches.size:
            first = int(touches[0])
            before, after = hook[first], hook[first + 1]
            part = (before[2] - HOOK_RADIUS) / (before[2] - after[2])
            place = before[:2] + part * (after[:2] - before[:2])
            if np.all((TABLE[0] <= place) & (place <= TABLE[1])):
                qpos = states[first, 1 : 1 + self.model.nq].copy()  # after first + 1 steps
                time = float((first + part) * STEP - self.lead_in)
                return Rollout(place, True, KeyFrame(self.model, qpos, time))
        qpos = states[-1, 1 : 1 + self.model.nq].copy()
        frame = KeyFrame(self.model, qpos, len(states) * STEP - self.lead_in)
        return Rollout(_LOST.copy(), valid=False, key_frame=frame)

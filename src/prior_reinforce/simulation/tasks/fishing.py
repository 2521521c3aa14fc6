"""Fishing Rod Swinging: the Panda casts a hook on a soft rope onto a tiny magnet on the table.

A plan is a path of end-effector poses, as in the paper: the flange's position and a rotation
vector (`inverse_kinematics.py` says which), which mink turns into joint motion within the arm's
limits. The outcome is where the hook first touches the plane of the table: there and then the
magnet catches it or not. Where the hook comes to lie later depends on how the table's surface lets
it bounce and on how the rope drags it, which no magnet would allow and no fisherman aims with.
The scene is in `fishing.xml`, the arm in `panda.xml`; lengths in [m], table frame.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Plans
from prior_reinforce.environment import Rollout, SeenObject, TableScene
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Symmetry, shift
from prior_reinforce.simulation.tasks.inverse_kinematics import POSE_NAMES, POSE_UNITS, joint_paths
from prior_reinforce.simulation.tasks.panda_task import Disturbances, PandaTask, first_descent

HOOK_RADIUS = 0.006
"""In [m]; in `fishing.xml` too. The hook touches the table where its centre is so high."""
TABLE = np.array([[0.35, -0.5], [1.35, 0.5]])
"""Lower and upper corner of the table top, (x, y) in [m]; the paper's 1 m x 1 m."""
_PULL, _GRIP = 200.0, 1.5
"""The magnet's force on a hook within its reach, in [N/m] and [N s/m]; for films only, and ours: it
stops the hook within a centimetre and then holds against the rope."""


class Fishing(PandaTask):
    """Fishing Rod Swinging (paper, Section III and Figure 3), in MuJoCo."""

    name = "fishing"
    format = PlanFormat(POSE_NAMES, POSE_UNITS, 0.02)
    tolerance: float = 0.01  # the paper's magnet catches the hook within about 1 cm
    region = np.array([[0.78, -0.20], [0.98, 0.20]])
    # The hook is a bead of 12 mm that touches the table; the magnet lies on a disc of 2 cm.
    scene = TableScene(
        SeenObject("the red hook", 2 * HOOK_RADIUS),
        SeenObject("the yellow disc", 0.02),
        plane_height=0.003,
    )
    # Of the rope's bending stiffness and damping: cords stiffen and soften. Of the angle at which
    # it hangs off the vertical, about x and y, in [rad]: 3 mm at the hook, what an operator calls
    # still. Together these spread the hook's first touch by 0.3 cm (docs/tasks/fishing.md).
    disturbances = Disturbances(pose=0.001, servo=0.03, scene=0.1, start=0.008)
    n_constants = 2
    xml = "fishing.xml"
    recordings = "fishing"
    lead_in = 0.1
    lead_out = 0.4

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene; argument as in `PandaTask`."""
        super().__init__(disturbances)
        self._swivel = self.model.jnt_qposadr[self.model.joint("tool/swivel").id]
        self._hook = self.model.sensor("tool/hook").adr[0]
        balls = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_BALL)
        self._bends = balls[self.model.jnt_stiffness[balls] > 0]

    @property
    def symmetry(self) -> Symmetry:
        """The cast may happen anywhere above the table."""
        return shift()

    def joint_plans(self, plans: Plans) -> Float[np.ndarray, "n H 7"]:
        """Follow the poses with the arm, within its limits."""
        return joint_paths(plans, self.format.dt)

    def _disturb(self, model: mujoco.MjModel, scene: Float[np.ndarray, "2"]) -> None:
        stiffness, damping = scene
        model.jnt_stiffness[self._bends] *= stiffness
        dofs = (model.jnt_dofadr[self._bends][:, None] + np.arange(3)).ravel()
        model.dof_damping[dofs] *= damping

    def _place(self, data: mujoco.MjData, start: Float[np.ndarray, "2"]) -> None:
        """Let the rope hang: the swivel undoes the rod's attitude, every segment is straight.

        This is the settled state itself, because the swivel has no spring and the others are
        relaxed, so nothing has to be simulated to reach it.
        """
        upright, rod, hanging = np.empty((3, 4))
        mujoco.mju_mat2Quat(rod, data.site("tool/tip").xmat)
        mujoco.mju_negQuat(upright, rod)
        mujoco.mju_quatIntegrate(quat := np.array([1.0, 0.0, 0.0, 0.0]), np.append(start, 0.0), 1.0)
        mujoco.mju_mulQuat(hanging, upright, quat)
        data.qpos[self._swivel : self._swivel + 4] = hanging

    def _act_at_goal(self, data: mujoco.MjData, goal: Float[np.ndarray, "2"]) -> None:
        """The magnet holds a hook that is within its reach."""
        hook = data.geom("tool/hook")
        off = np.append(goal, HOOK_RADIUS) - hook.xpos
        body = self.model.geom("tool/hook").bodyid[0]
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_GEOM, hook.id, velocity, 0)
        near = np.linalg.norm(off) <= self.tolerance
        data.xfrc_applied[body, :3] = near * (_PULL * off - _GRIP * velocity[3:])

    def _result(
        self, states: Float[np.ndarray, "steps s"], sensors: Float[np.ndarray, "steps m"]
    ) -> Rollout:
        """Where the hook first touches the table, between two steps by linear interpolation."""
        descent = first_descent(sensors[:, self._hook : self._hook + 3], HOOK_RADIUS)
        if descent is not None:
            row, part, place = descent
            if np.all((TABLE[0] <= place) & (place <= TABLE[1])):
                # The sensors of a row are those of the state before it.
                return Rollout(place, True, self._key_frame(states[row], row + part))
        return self._lost(states)

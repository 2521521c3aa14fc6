"""Basketball Shot V1: the Panda throws a ball from a spoon into a hoop on the table.

The ball lies in the spoon and leaves it because the spoon brakes and tips; nothing else holds or
frees it. The outcome is where the ball's centre comes down through the plane of the hoop's rim.
The scene is in `basketball.xml`, the arm in `panda.xml`; lengths in [m], table frame. V2 and V3
are the same throw with other hardware: `basketball_v2.py`, `basketball_v3.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from prior_reinforce.plans.motions import PlanFormat
from prior_reinforce.rollouts import KeyFrame, Rollout
from prior_reinforce.tasks.panda import JOINT_NAMES, N_JOINTS, STEP
from prior_reinforce.tasks.panda_task import Draws, PandaTask

RIM_HEIGHT = 0.10
"""Height of the rim's plane (V3: the cup's) above the table, in [m]; ours, the paper does not
give it."""
_LOST = np.zeros(2)
"""Outcome of a ball that never comes down through the rim's plane: the robot's own base."""


@dataclass(frozen=True)
class Disturbances:
    """What differs between two executions of one plan; standard deviations, ours.

    Together they spread the landing point of a repeated plan by about half a centimetre along
    each axis (docs/tasks/basketball.md), which is what a good throwing arm does.
    """

    pose: float = 0.003
    """Offset of every joint, kept through the execution (its zero, its friction), in [rad]."""
    servo: float = 0.06
    """Relative error of every joint's servo stiffness and damping."""
    ball: float = 0.001
    """Where the ball is put in the spoon, along each of the bowl's two axes, in [m]."""
    friction: float = 0.10
    """Relative error of the friction between ball and spoon."""


class BasketballShot(PandaTask):
    """Basketball Shot V1 (paper, Section III and Figure 3), in MuJoCo."""

    name: ClassVar[str] = "basketball-v1"
    format: ClassVar[PlanFormat] = PlanFormat(JOINT_NAMES, ("rad",) * N_JOINTS, 0.0125)
    outcome_names: ClassVar[tuple[str, ...]] = ("x", "y")
    tolerance: ClassVar[float] = 0.015  # clean pass: (9.0 cm - 6.0 cm) / 2
    region: ClassVar[np.ndarray] = np.array([[0.92, -0.26], [1.18, 0.26]])
    scene: ClassVar[str] = "basketball"
    recordings: ClassVar[str] = "basketball"  # V2 and V3 are thrown with V1's demonstrations
    lead_in: ClassVar[float] = 0.2  # the ball settles in the spoon
    lead_out: ClassVar[float] = 0.9  # the longest fall takes 0.5 s
    batch: ClassVar[int] = 64  # 40 MB of recorded states

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene.

        Args:
            disturbances: How repeated executions differ; the documented ones when not given.
        """
        self.disturbances = disturbances or Disturbances()
        super().__init__()
        self._bowl = np.flatnonzero(self.model.geom_bodyid == self.model.body("tool/bowl").id)
        self._ball = self.model.jnt_qposadr[self.model.joint("ball").id]

    def joint_plans(self, plans: np.ndarray) -> np.ndarray:
        """A plan is the joint path."""
        return plans

    def _draw(self, n: int, rng: np.random.Generator) -> Draws:
        size = self.disturbances
        pose = rng.normal(0.0, size.pose, (n, N_JOINTS))
        ball = rng.normal(0.0, size.ball, (n, 2))
        servo = 1.0 + rng.normal(0.0, size.servo, (n, N_JOINTS))
        return Draws(pose, servo, 1.0 + rng.normal(0.0, size.friction, (n, 1)), ball)

    def _disturb(self, model: mujoco.MjModel, scene: np.ndarray) -> None:
        model.geom_friction[self._bowl, 0] *= scene[0]

    def _place(self, data: mujoco.MjData, start: np.ndarray | None) -> None:
        """The ball lies in the spoon."""
        seat = data.site("tool/seat")
        offset = 0.0 if start is None else seat.xmat.reshape(3, 3)[:, :2] @ start
        data.qpos[self._ball : self._ball + 3] = seat.xpos + offset

    def _result(self, states: np.ndarray, sensors: np.ndarray) -> Rollout:
        """Where the ball's centre first passes the rim's plane downwards, the hoop out of the way.

        A ball that never does is lost, with outcome (0, 0), where no goal can be.
        """
        qpos = states[:, 1 : 1 + self.model.nq]
        ball = qpos[:, self._ball : self._ball + 3]
        down = np.flatnonzero((ball[:-1, 2] >= RIM_HEIGHT) & (ball[1:, 2] < RIM_HEIGHT))
        if not down.size:
            frame = KeyFrame(self.model, qpos[-1].copy(), len(qpos) * STEP - self.lead_in)
            return Rollout(_LOST.copy(), valid=False, key_frame=frame)
        before, after = ball[down[0]], ball[down[0] + 1]
        part = (before[2] - RIM_HEIGHT) / (before[2] - after[2])
        outcome = before[:2] + part * (after[:2] - before[:2])
        # State k of a rollout is the one after k + 1 steps.
        time = (down[0] + 1 + part) * STEP - self.lead_in
        return Rollout(outcome, True, KeyFrame(self.model, qpos[down[0] + 1].copy(), float(time)))

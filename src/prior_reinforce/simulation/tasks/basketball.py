"""Basketball Shot: the Panda throws a ball from a spoon into a hoop on the table.

The ball lies in the spoon and leaves it because the spoon brakes and tips; nothing else holds or
frees it. The outcome is where the ball's centre comes down through the plane of the hoop's rim.
There are three sets of hardware (paper, Section V-A and hardware figure). V2 and V3 use
V1's demonstrations with the outcomes they had on V1, unchanged: there the same plans land shorter,
and adaptation has to find out by how much.
The scenes are in `basketball.xml`, `basketball_v2.xml` and `basketball_v3.xml`, the arm in
`panda.xml`; lengths in [m], table frame.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from prior_reinforce.environment import Rollout, SeenObject, TableScene
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Symmetry, Tempo, TurnJoint, turn_and_scale
from prior_reinforce.simulation.tasks.panda import JOINT_NAMES, N_JOINTS
from prior_reinforce.simulation.tasks.panda_task import Disturbances, PandaTask, first_descent

RIM_HEIGHT = 0.10
"""Height of the rim's plane (V3: the cup's) above the table, in [m]; ours, the paper does not
give it."""


class Shot(PandaTask):
    """A ball that lies in a bowl on the arm is thrown through the plane of a rim on the table."""

    scene: TableScene
    first_joint = 1.0
    """Whether the first joint counts as the bearing does: 1, or -1."""
    exponent = 1.0
    """p of distance ~ speed^p, by the geometry alone: the ball leaves level, near the base's axis
    and 1.2 m above the rim, and falls for as long at any speed."""
    # Of the friction between ball and bowl; of the ball in the bowl, along the bowl's axes, in [m].
    # Together these spread the landing point of a repeated plan by about half a centimetre along
    # each axis (docs/tasks/basketball.md), which is what a good throwing arm does.
    disturbances = Disturbances(pose=0.003, servo=0.06, scene=0.10, start=0.001)
    drawn = ("pose", "start", "servo", "scene")
    lead_in = 0.2  # the ball settles in the bowl
    lead_out = 0.9  # the longest fall takes 0.5 s
    batch = 64  # 40 MB of recorded states

    @property
    def symmetry(self) -> Symmetry:
        """The arm carries the ball: all turns about the base with the first joint."""
        return turn_and_scale(TurnJoint(gain=self.first_joint), scale=Tempo(self.exponent))

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene; argument as in `PandaTask`."""
        super().__init__(disturbances)
        self._bowl = np.flatnonzero(self.model.geom_bodyid == self.model.body("tool/bowl").id)
        self.ball = int(self.model.jnt_qposadr[self.model.joint("ball").id])
        """Where the ball's position begins in the state `qpos`."""

    def _disturb(self, model: mujoco.MjModel, scene: Float[np.ndarray, "1"]) -> None:
        model.geom_friction[self._bowl, 0] *= scene[0]

    def _place(self, data: mujoco.MjData, start: Float[np.ndarray, "2"]) -> None:
        """The ball lies in the bowl."""
        seat = data.site("tool/seat")
        offset = seat.xmat.reshape(3, 3)[:, :2] @ start
        data.qpos[self.ball : self.ball + 3] = seat.xpos + offset

    def _result(
        self, states: Float[np.ndarray, "steps s"], sensors: Float[np.ndarray, "steps m"]
    ) -> Rollout:
        """Where the ball's centre first falls through the rim's plane, nothing in the way."""
        descent = first_descent(states[:, 1 + self.ball : 4 + self.ball], self.scene.plane_height)
        if descent is None:
            return self._lost(states)
        row, part, place = descent
        # State k of a rollout is the one after k + 1 steps.
        return Rollout(place, True, self._key_frame(states[row + 1], row + 1 + part))


class BasketballShot(Shot):
    """Basketball Shot (paper, Section III and Figure 3), in MuJoCo, with the hardware V1."""

    name = "basketball-v1"
    format = PlanFormat(JOINT_NAMES, ("rad",) * N_JOINTS, 0.0125)
    tolerance: float = 0.015  # for a clean pass: (9 - 6) cm / 2 of free diameter and ball
    region = np.array([[0.92, -0.26], [1.18, 0.26]])
    scene = TableScene(
        SeenObject("the orange ball", 0.06),
        SeenObject("the red hoop", 0.10),
        plane_height=RIM_HEIGHT,
    )
    xml = "basketball.xml"
    recordings = "basketball"


class BasketballV2(BasketballShot):
    """V1 with a shorter spoon."""

    name = "basketball-v2"
    xml = "basketball_v2.xml"


class BasketballV3(BasketballShot):
    """V2 with a smaller, lighter ball and a smaller white cup, its rim 8.3 cm wide outside."""

    name = "basketball-v3"
    tolerance = 0.0125  # (7.5 - 5) cm / 2
    scene = TableScene(
        SeenObject("the orange ball", 0.05),
        SeenObject("the red rim of the cup", 0.083),
        plane_height=RIM_HEIGHT,
    )
    xml = "basketball_v3.xml"


HARDWARE = (BasketballShot, BasketballV2, BasketballV3)
"""The task with each of the paper's three sets of hardware."""

"""Curling: a bar on the Panda's flange pushes a stone, which slides on and stops by friction.

Nothing holds the stone: it leaves the bar when the bar brakes harder than friction brakes the
stone. Pushed by a straight bar a round stone goes along the bar's normal, so the heading of the
push is the direction of the slide, and the speed of the push its length, v^2 / (2 mu g). The
outcome is where the stone comes to rest. The scene is in `curling.xml`, the arm in `panda.xml`;
lengths in [m], table frame.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from prior_reinforce.environment import Rollout, SeenObject, TableScene
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Symmetry, TurnPath, turn_and_scale
from prior_reinforce.simulation.tasks.panda import JOINT_NAMES, N_JOINTS, chain_of
from prior_reinforce.simulation.tasks.panda_task import Disturbances, PandaTask

STONE_START = np.array([0.43, 0.0])
"""Where the stone waits, (x, y) in [m]; in `curling.xml` too. Ours: near enough to the base that
the arm can accelerate it over 20 cm, far enough that it can be reached from behind."""
STONE_RADIUS = 0.03
"""In [m]; ours, a table-top stone as in the paper's picture."""
FRICTION = 0.12
"""Friction of the stone on the table [-]; in `curling.xml` too. Ours: a waxed board. Less would
need gentler pushes whose length is more sensitive to speed, more would need a faster arm."""
TARGET_BEHIND = 0.08
"""From a goal to the centre of the target stone behind it, along x, in [m]; in `curling.xml` too.
Ours: a gap of 2 cm between two stones, so that a success never touches the target."""


class Curling(PandaTask):
    """Curling (paper, Section III and Figure 3), in MuJoCo."""

    name = "curling"
    format = PlanFormat(JOINT_NAMES, ("rad",) * N_JOINTS, 0.0125)
    tolerance = 0.01  # ours (docs/tasks/curling.md)
    region = np.array([[0.78, -0.20], [1.03, 0.20]])
    scene = TableScene(
        SeenObject("the curling stone with the blue handle", 2 * STONE_RADIUS),
        SeenObject("the curling stone with the red handle", 2 * STONE_RADIUS),
        plane_height=0.02,  # both stones lie on the table and are 3 cm high
        goal_offset=(-TARGET_BEHIND, 0.0),
    )
    # Of the friction between stone and table; of where the stone is put, along each axis, in [m].
    # Together these spread the resting place of a repeated plan by 0.34 cm along x and 0.12 cm
    # along y (docs/tasks/curling.md).
    disturbances = Disturbances(pose=0.001, servo=0.03, scene=0.005, start=0.0005)
    xml = "curling.xml"
    recordings = "curling"
    lead_in = 0.1
    lead_out = 1.5  # the fastest stone slides for 1 s

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene; argument as in `PandaTask`."""
        super().__init__(disturbances)
        stone = self.model.body("stone")
        self._stone = self.model.jnt_qposadr[stone.jntadr[0]]
        self._feet = np.flatnonzero(
            (self.model.geom_bodyid == stone.id)
            & (self.model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE)
        )

    @property
    def symmetry(self) -> Symmetry:
        """The bar pushes a stone that lies at a place: the push turns about it."""
        centre = (float(STONE_START[0]), float(STONE_START[1]))
        turn = TurnPath(chain_of(self.model), centre, tuple(range(N_JOINTS)))
        return turn_and_scale(turn, centre)

    def _disturb(self, model: mujoco.MjModel, scene: Float[np.ndarray, "1"]) -> None:
        model.geom_friction[self._feet, 0] *= scene[0]

    def _place(self, data: mujoco.MjData, start: Float[np.ndarray, "2"]) -> None:
        """The stone starts at `STONE_START`, where the scene has it."""
        data.qpos[self._stone : self._stone + 2] += start

    def _result(
        self, states: Float[np.ndarray, "steps s"], sensors: Float[np.ndarray, "steps m"]
    ) -> Rollout:
        """Where the stone is at the end of an execution, at rest on the table."""
        stone = states[-1, 1 + self._stone : 4 + self._stone]
        if stone[2] < 0.0:
            return self._lost(states)
        return Rollout(stone[:2].copy(), True, self._key_frame(states[-1], len(states)))


class CurlingRound(Curling):
    """Curling from beyond the stone: the bar goes round it first, by the left or the right; ours.

    What lies between the two ways sweeps the stone off before it is pushed.
    """

    name = "curling-round"
    recordings = "curling_round"

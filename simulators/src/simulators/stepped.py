"""A Panda task that somebody else steps, set point by set point, as an arm's controller does."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from prior_reinforce.environment import Rollout
from prior_reinforce.simulation.tasks.panda import N_JOINTS, STEP
from prior_reinforce.simulation.tasks.panda_task import FULL, PandaTask, full_state


class SteppedTask:
    """The physics of `PandaTask.rollout`, a step at a time: same scene, same servo.

    The velocity that the servo is fed forward is a second-order backward difference of the set
    points, since nobody says their derivative: of a plan's spline it is exact to 1e-5 rad/s.
    """

    def __init__(self, task: PandaTask, joints: Float[np.ndarray, "7"]) -> None:
        """Put the arm at `joints`, in [rad], with the task's objects where they start."""
        self.task, self.model = task, task.model
        self.data = mujoco.MjData(self.model)
        servo = slice(N_JOINTS)
        self._feed_forward = (
            -self.model.actuator_biasprm[servo, 2] / self.model.actuator_gainprm[servo, 0] / STEP
        )
        self._recorded: list[tuple[Float[np.ndarray, " s"], Float[np.ndarray, " m"]]] | None = None
        self.load(joints)

    @property
    def q(self) -> Float[np.ndarray, "7"]:
        """Joint positions, in [rad]."""
        return self.data.qpos[:N_JOINTS].copy()

    @property
    def dq(self) -> Float[np.ndarray, "7"]:
        """Joint velocities, in [rad/s]."""
        return self.data.qvel[:N_JOINTS].copy()

    def load(self, joints: Float[np.ndarray, "7"]) -> None:
        """Put the objects back, as a person does between trials, the arm at rest at `joints`."""
        mujoco.mj_setState(self.model, self.data, self.task._start(joints), FULL)
        self.hold(joints)
        for _ in range(round(self.task.lead_in / STEP)):
            self.step(joints)

    def hold(self, joints: Float[np.ndarray, "7"]) -> None:
        """Take a set point that follows on no other: it is fed forward as at rest."""
        self._targets = [joints, joints]

    def step(self, target: Float[np.ndarray, "7"]) -> None:
        """Follow a set point for one servo period, in [rad]."""
        last, before = self._targets
        change = 1.5 * target - 2.0 * last + 0.5 * before
        self.data.ctrl[:N_JOINTS] = target + self._feed_forward * change
        self._targets = [target, last]
        sensors = self.data.sensordata.copy()
        mujoco.mj_step(self.model, self.data)
        if self._recorded is not None:
            self._recorded.append((full_state(self.model, self.data), sensors))

    def begin(self) -> None:
        """What happens from now on decides an outcome."""
        self._recorded = []

    def end(self) -> Rollout:
        """What came of all since `begin`."""
        assert self._recorded
        states, sensors = zip(*self._recorded, strict=True)
        self._recorded = None
        return self.task._result(np.array(states), np.array(sensors))

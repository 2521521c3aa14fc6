"""Basketball Shot V1: the Panda throws a ball from a spoon into a hoop on the table.

The ball lies in the spoon and leaves it because the spoon brakes and tips; nothing else holds or
frees it. The outcome is where the ball's centre comes down through the plane of the hoop's rim.
The scene is in `basketball.xml`, the arm in `panda.xml`; lengths in [m], table frame. V2 and V3
are the same throw with other hardware: `basketball_v2.py`, `basketball_v3.py`.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import mujoco
import mujoco.rollout
import numpy as np

from prior_reinforce.arrays import as_plans
from prior_reinforce.errors import ConfigurationError, InvalidGoalError
from prior_reinforce.motions import Demonstrations, PlanFormat
from prior_reinforce.rollouts import KeyFrame, Rollout
from prior_reinforce.tasks.base import Task
from prior_reinforce.tasks.panda import (
    JOINT_NAMES,
    N_JOINTS,
    STEP,
    build_scene,
    servo_controls,
)
from prior_reinforce.tasks.rendering import open_renderer

_FOLDER = Path(__file__).parent
RIM_HEIGHT = 0.10
"""Height of the rim's plane (V3: the cup's) above the table, in [m]; ours, the paper does not
give it."""
_LEAD_IN = 0.2
"""The arm stands in its first frame for so long, and the ball settles in the spoon, in [s]."""
_FLIGHT = 0.9
"""Physics goes on for so long after the last frame; the longest fall takes 0.5 s, in [s]."""
_LOST = np.zeros(2)
"""Outcome of a ball that never comes down through the rim's plane: the robot's own base."""
_BATCH = 64
"""Executions simulated at once: bounds memory at about 40 MB of recorded states."""


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


class BasketballShot(Task):
    """Basketball Shot V1 (paper, Section III and Figure 3), in MuJoCo."""

    name: ClassVar[str] = "basketball-v1"
    format: ClassVar[PlanFormat] = PlanFormat(JOINT_NAMES, ("rad",) * N_JOINTS, 0.0125)
    outcome_names: ClassVar[tuple[str, ...]] = ("x", "y")
    tolerance: ClassVar[float] = 0.015  # clean pass: (9.0 cm - 6.0 cm) / 2
    region: ClassVar[np.ndarray] = np.array([[0.92, -0.26], [1.18, 0.26]])
    scene: ClassVar[str] = "basketball"
    """File name of the hardware's scene, without `.xml`."""

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene.

        Args:
            disturbances: How repeated executions differ; the documented ones when not given.
        """
        self.disturbances = disturbances or Disturbances()
        self.model = build_scene(_FOLDER / f"{self.scene}.xml")
        self.model.opt.timestep = STEP
        self._bowl = np.flatnonzero(self.model.geom_bodyid == self.model.body("tool/bowl").id)
        self._ball = self.model.jnt_qposadr[self.model.joint("ball").id]
        self._workers = [mujoco.MjData(self.model) for _ in range(_count_cores())]

    def rollout(self, plans: np.ndarray, rng: np.random.Generator | None) -> list[Rollout]:
        """Execute plans open loop, each from rest in its own first frame, the ball in the spoon.

        `outcome` is where the ball's centre first passes the rim's plane downwards, (x, y) in
        [m], with the hoop out of the way. A ball that never does is `valid=False` with outcome
        (0, 0), the robot's base, where no goal can be. See `Task.rollout` for the rest.
        """
        plans = as_plans(plans, N_JOINTS)
        results: list[Rollout] = []
        for first in range(0, len(plans), _BATCH):
            results += self._rollout_batch(plans[first : first + _BATCH], rng)
        return results

    def demonstrations(self, name: str) -> Demonstrations:
        """Load the shipped prior set `name`."""
        if name not in self.demonstration_sets:
            raise ConfigurationError(
                f"{self.name} has no demonstration set {name!r}; use one of "
                f"{', '.join(self.demonstration_sets)}"
            )
        return Demonstrations.load(_FOLDER / "demonstrations" / f"basketball_{name}.npz")

    def film(
        self,
        plan: np.ndarray,
        goal: np.ndarray,
        rng: np.random.Generator | None = None,
        *,
        width: int = 640,
        height: int = 480,
        frames_per_second: int = 30,
        camera: str = "film",
    ) -> Iterator[np.ndarray]:
        """Execute one plan with the hoop standing at the goal and draw it; see `Task.film`.

        The ball flies as in `rollout` with the same rng, and now meets the hoop on its way.
        """
        plans = as_plans(plan, N_JOINTS, name="plan", single=True)[None]
        goal = np.array(goal, dtype=float)
        if goal.shape != (2,) or not np.all(np.isfinite(goal)):
            raise InvalidGoalError(f"a goal to film must be finite (x, y) in metres, got {goal}")
        models, states, controls = self._prepare(plans, rng)
        model, data = models[0], mujoco.MjData(models[0])
        mujoco.mj_setState(model, data, states[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        data.mocap_pos[model.body("goal").mocapid[0]] = [*goal, 0.0]
        mujoco.mj_forward(model, data)
        with open_renderer(model, width, height) as renderer:
            n_pictures = 0
            for control in controls[0]:
                if data.time * frames_per_second >= n_pictures:
                    n_pictures += 1
                    renderer.update_scene(data, camera)
                    yield renderer.render().copy()
                data.ctrl[:] = control
                mujoco.mj_step(model, data)

    def _rollout_batch(self, plans: np.ndarray, rng: np.random.Generator | None) -> list[Rollout]:
        models, states, controls = self._prepare(plans, rng)
        trajectories, _ = mujoco.rollout.rollout(models, self._workers, states, controls)
        qpos = trajectories[:, :, 1 : 1 + self.model.nq]
        return [self._result(path) for path in qpos]

    def _prepare(
        self, plans: np.ndarray, rng: np.random.Generator | None
    ) -> tuple[list[mujoco.MjModel], np.ndarray, np.ndarray]:
        """Models, initial full-physics states (n, s) and controls (n, steps, 7) of a batch."""
        n, horizon, _ = plans.shape
        n_steps = round((_LEAD_IN + (horizon - 1) * self.format.dt + _FLIGHT) / STEP)
        pose, ball = np.zeros((n, N_JOINTS)), np.zeros((n, 2))
        models = [self.model]
        if rng is not None:
            size = self.disturbances
            pose = rng.normal(0.0, size.pose, (n, N_JOINTS))
            ball = rng.normal(0.0, size.ball, (n, 2))
            servo = 1.0 + rng.normal(0.0, size.servo, (n, N_JOINTS))
            friction = 1.0 + rng.normal(0.0, size.friction, (n,))
            models = [self._disturbed(servo[i], friction[i]) for i in range(n)]
        controls = servo_controls(self.model, plans, self.format.dt, n_steps, lead_in=_LEAD_IN)
        controls += pose[:, None, :]
        states = np.stack([self._start(plans[i, 0] + pose[i], ball[i]) for i in range(n)])
        return models, states, controls

    def _disturbed(self, servo: np.ndarray, friction: float) -> mujoco.MjModel:
        model = copy.copy(self.model)
        model.actuator_gainprm[:, 0] *= servo
        model.actuator_biasprm[:, 1:3] *= servo[:, None]
        model.geom_friction[self._bowl, 0] *= friction
        return model

    def _start(self, joints: np.ndarray, ball: np.ndarray) -> np.ndarray:
        """Full physics state with the arm at `joints` (7,) and the ball in the spoon."""
        data = self._workers[0]
        mujoco.mj_resetData(self.model, data)
        data.qpos[:N_JOINTS] = joints
        mujoco.mj_kinematics(self.model, data)
        seat = data.site("tool/seat")
        offset = seat.xmat.reshape(3, 3)[:, :2] @ ball
        data.qpos[self._ball : self._ball + 3] = seat.xpos + offset
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty(mujoco.mj_stateSize(self.model, full))
        mujoco.mj_getState(self.model, data, state, full)
        return state

    def _result(self, qpos: np.ndarray) -> Rollout:
        """Outcome of one execution from its positions at every step, shape (steps, nq)."""
        ball = qpos[:, self._ball : self._ball + 3]
        down = np.flatnonzero((ball[:-1, 2] >= RIM_HEIGHT) & (ball[1:, 2] < RIM_HEIGHT))
        if not down.size:
            frame = KeyFrame(self.model, qpos[-1].copy(), len(qpos) * STEP - _LEAD_IN)
            return Rollout(_LOST.copy(), valid=False, key_frame=frame)
        before, after = ball[down[0]], ball[down[0] + 1]
        part = (before[2] - RIM_HEIGHT) / (before[2] - after[2])
        outcome = before[:2] + part * (after[:2] - before[:2])
        # State k of a rollout is the one after k + 1 steps.
        time = (down[0] + 1 + part) * STEP - _LEAD_IN
        return Rollout(outcome, True, KeyFrame(self.model, qpos[down[0] + 1].copy(), float(time)))


def _count_cores() -> int:
    """Cores this process may use; macOS and Windows cannot tell, and give all there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1

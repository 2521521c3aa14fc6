"""What every task with the simulated Panda shares: batched executions, disturbances, the film.

A task adds its scene, where its objects start, what differs between repetitions and how an
outcome is read from the recorded path; see `curling.py`.
"""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import mujoco
import mujoco.rollout
import numpy as np

from prior_reinforce.arrays import as_plans
from prior_reinforce.cores import available_cores
from prior_reinforce.errors import ConfigurationError, InvalidGoalError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.rendering import open_renderer
from prior_reinforce.rollouts import Rollout
from prior_reinforce.tasks.base import Task
from prior_reinforce.tasks.panda import N_JOINTS, STEP, build_scene, servo_controls

_FOLDER = Path(__file__).parent
_FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
_Batch = tuple[list[mujoco.MjModel], np.ndarray, np.ndarray]


@dataclass(frozen=True)
class ArmDisturbances:
    """What differs in the arm between two executions of one plan; standard deviations, ours."""

    pose: float = 0.001
    """Offset of every joint, kept through the execution (its zero, its friction), in [rad]."""
    servo: float = 0.03
    """Relative error of every joint's servo stiffness and damping."""

    def draw(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Pose offsets and servo factors of n executions, shape (n, 7) each."""
        pose = rng.normal(0.0, self.pose, (n, N_JOINTS))
        return pose, 1.0 + rng.normal(0.0, self.servo, (n, N_JOINTS))


@dataclass(frozen=True, eq=False)
class Draws:
    """What differs between the executions of one batch; row i belongs to execution i."""

    pose: np.ndarray
    """Offset of every joint, shape (n, 7), in [rad]."""
    servo: np.ndarray
    """Factor on every joint's servo stiffness and damping, shape (n, 7)."""
    scene: np.ndarray
    """The task's own numbers for `_disturb`, shape (n, p)."""
    start: np.ndarray
    """The task's own numbers for `_place`, shape (n, q)."""


class PandaTask(Task):
    """A task in which the Panda executes a plan from rest, and physics decides the rest."""

    scene: ClassVar[str]
    """File name of the scene without `.xml`."""
    recordings: ClassVar[str]
    """Shipped prior sets are `demonstrations/<recordings>_<set>.npz`."""
    lead_in: ClassVar[float]
    """The arm stands in its first frame for so long before the plan begins, in [s]."""
    lead_out: ClassVar[float]
    """Physics goes on for so long after the last frame, in [s]."""
    batch: ClassVar[int] = 32
    """Executions simulated at once: bounds memory at about 100 MB of recorded states. Draws are
    made batch by batch, so the number is part of what a seed means."""

    def __init__(self) -> None:
        """Compile the scene."""
        self.model = build_scene(_FOLDER / f"{self.scene}.xml")
        self.model.opt.timestep = STEP
        self._workers = [mujoco.MjData(self.model) for _ in range(available_cores())]
        self._scratch = mujoco.MjData(self.model)  # the workers' are busy while it is used

    @abstractmethod
    def joint_plans(self, plans: np.ndarray) -> np.ndarray:
        """Joint paths (n, H, 7) in [rad] that plans (n, H, D) stand for."""

    @abstractmethod
    def _draw(self, n: int, rng: np.random.Generator) -> Draws:
        """Draw what differs between n executions; the order is part of what a seed means."""

    @abstractmethod
    def _disturb(self, model: mujoco.MjModel, scene: np.ndarray) -> None:
        """Change the task's own constants in a copy of the model by an execution's draws (p,)."""

    @abstractmethod
    def _place(self, data: mujoco.MjData, start: np.ndarray | None) -> None:
        """Put the task's objects where they start; the arm already stands in its first frame.

        Args:
            data: The state to be changed.
            start: The execution's draws, shape (q,); None where nothing is disturbed.
        """

    @abstractmethod
    def _result(self, states: np.ndarray, sensors: np.ndarray) -> Rollout:
        """Read the outcome of one execution.

        Args:
            states: Full physics states, shape (steps, 1 + nq + nv); row k is after k + 1 steps.
            sensors: The scene's sensors, shape (steps, n), at the beginning of each step, so that
                row k belongs to the state after k steps.
        """

    def rollout(self, plans: np.ndarray, rng: np.random.Generator | None) -> list[Rollout]:
        """Execute plans open loop; see `Task.rollout`, and the task for its outcome."""
        plans = as_plans(plans, self.format.action_dim)
        results: list[Rollout] = []
        for models, states, controls in self._batches(plans, rng):
            paths, sensors = mujoco.rollout.rollout(models, self._workers, states, controls)
            results += [self._result(*pair) for pair in zip(paths, sensors, strict=True)]
        return results

    def demonstrations(self, name: str) -> Demonstrations:
        """Load the shipped prior set `name`."""
        if name not in self.demonstration_sets:
            raise ConfigurationError(
                f"{self.name} has no demonstration set {name!r}; use one of "
                f"{', '.join(self.demonstration_sets)}"
            )
        return Demonstrations.load(_FOLDER / "demonstrations" / f"{self.recordings}_{name}.npz")

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
        """Execute one plan with the goal's object in place and draw it; see `Task.film`."""
        plan = as_plans(plan, self.format.action_dim, name="plan", single=True)
        goal = np.array(goal, dtype=float)
        if goal.shape != (2,) or not np.all(np.isfinite(goal)):
            raise InvalidGoalError(f"goal must be two finite numbers (x, y) in [m], got {goal}")
        models, states, controls = self._prepare(plan[None], rng)
        model, data = models[0], mujoco.MjData(models[0])
        mujoco.mj_setState(model, data, states[0], _FULL)
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
                self._act_at_goal(data, goal)
                mujoco.mj_step(model, data)

    def _act_at_goal(self, data: mujoco.MjData, goal: np.ndarray) -> None:
        """What the goal's object does beyond standing in the way, at each step of a film."""

    def _batches(self, plans: np.ndarray, rng: np.random.Generator | None) -> Iterator[_Batch]:
        """Prepare batch after batch, each while the engine simulates the one before.

        The engine leaves Python free meanwhile. It pays where plans are end-effector poses, whose
        inverse kinematics takes a fifth of the time that the physics takes on one core.
        """
        with ThreadPoolExecutor(max_workers=1) as ahead:
            coming: Future[_Batch] | None = None
            for first in range(0, len(plans), self.batch):
                following = ahead.submit(self._prepare, plans[first : first + self.batch], rng)
                if coming is not None:
                    yield coming.result()
                coming = following
            if coming is not None:
                yield coming.result()

    def _prepare(self, plans: np.ndarray, rng: np.random.Generator | None) -> _Batch:
        """Models, initial full physics states (n, s) and controls (n, steps, 7) of a batch."""
        n, horizon, _ = plans.shape
        n_steps = round((self.lead_in + (horizon - 1) * self.format.dt + self.lead_out) / STEP)
        joints = self.joint_plans(plans)
        controls = servo_controls(self.model, joints, self.format.dt, n_steps, lead_in=self.lead_in)
        if rng is None:
            states = np.stack([self._start(frame, None) for frame in joints[:, 0]])
            return [self.model], states, controls
        draws = self._draw(n, rng)
        models = [self._disturbed(*own) for own in zip(draws.servo, draws.scene, strict=True)]
        controls += draws.pose[:, None, :]
        frames = joints[:, 0] + draws.pose
        states = np.stack([self._start(*own) for own in zip(frames, draws.start, strict=True)])
        return models, states, controls

    def _disturbed(self, servo: np.ndarray, scene: np.ndarray) -> mujoco.MjModel:
        model = copy.copy(self.model)
        model.actuator_gainprm[:, 0] *= servo
        model.actuator_biasprm[:, 1:3] *= servo[:, None]
        self._disturb(model, scene)
        return model

    def _start(self, joints: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        """Full physics state with the arm at `joints` (7,) and the objects in place."""
        data = self._scratch
        mujoco.mj_resetData(self.model, data)
        data.qpos[:N_JOINTS] = joints
        mujoco.mj_kinematics(self.model, data)
        self._place(data, start)
        state = np.empty(mujoco.mj_stateSize(self.model, _FULL))
        mujoco.mj_getState(self.model, data, state, _FULL)
        return state

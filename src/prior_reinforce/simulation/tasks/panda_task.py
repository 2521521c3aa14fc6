"""What every task with a simulated arm shares: batched executions, disturbances, the film.

A task adds its scene, where its objects start, what differs between repetitions and how an
outcome is read from the recorded path; see `curling.py`.
"""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import joblib
import mujoco
import mujoco.rollout
import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Plans, as_goal, as_plans
from prior_reinforce.environment import KeyFrame, Picture, Rollout, Task, make_renderer
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks.panda import STEP, build_scene, servo_controls

_FOLDER = Path(__file__).parent
_UNDISTURBED = np.zeros(2)
FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
_Batch = tuple[list[mujoco.MjModel], Float[np.ndarray, "n s"], Float[np.ndarray, "n steps d"]]
"""Models (one, or one an execution), initial full physics states, and controls in [rad]."""


@dataclass(frozen=True)
class Disturbances:
    """What differs between two executions of one plan; standard deviations, ours."""

    pose: float
    """Offset of every joint, kept through the execution (its zero, its friction), in [rad]."""
    servo: float
    """Relative error of every joint's servo stiffness and damping."""
    scene: float
    """Relative error of the task's own constants, see its `_disturb`."""
    start: float
    """Of the task's object at the start, about or along two axes, see its `_place`."""


class PandaTask(Task):
    """A task in which an arm, here the Panda, executes a plan from rest; physics decides."""

    xml: str
    """File name of the scene."""
    flange: str = "panda/flange"
    """Site of the scene's arm that carries its tool."""
    recordings: str
    """Shipped prior sets are `demonstrations/<recordings>_<set>.npz`."""
    lead_in: float
    """The arm stands in its first frame for so long before the plan begins, in [s]."""
    lead_out: float
    """Physics goes on for so long after the last frame, in [s]."""
    disturbances: Disturbances
    """How repeated executions differ."""
    drawn: tuple[str, ...] = ("pose", "servo", "scene", "start")
    """The order in which disturbances are drawn, which is part of what a seed means."""
    n_constants: int = 1
    """How many constants of its own `_disturb` changes."""
    batch: int = 32
    """Executions simulated at once: bounds memory at about 100 MB of recorded states. Draws are
    made batch by batch, so the number is part of what a seed means."""

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene; repeated executions differ as documented unless told."""
        self.disturbances = disturbances or type(self).disturbances
        self.model = build_scene(_FOLDER / self.xml, self.flange)
        self.model.opt.timestep = STEP
        self._workers = [mujoco.MjData(self.model) for _ in range(joblib.cpu_count())]
        self._scratch = mujoco.MjData(self.model)  # the workers' are busy while it is used

    def joint_plans(self, plans: Plans) -> Float[np.ndarray, "n H d"]:
        """Joint paths in [rad] that plans stand for; here a plan is the joint path."""
        return plans

    def _controls(
        self, joints: Float[np.ndarray, "n H d"], n_steps: int
    ) -> Float[np.ndarray, "n steps d"]:
        """What the model's servos are told so that the arm executes joint paths, [rad], 1 kHz."""
        return servo_controls(self.model, joints, self.format.dt, n_steps, lead_in=self.lead_in)

    @abstractmethod
    def _disturb(self, model: mujoco.MjModel, scene: Float[np.ndarray, " p"]) -> None:
        """Multiply the task's own constants in a copy of the model by an execution's factors."""

    @abstractmethod
    def _place(self, data: mujoco.MjData, start: Float[np.ndarray, "2"]) -> None:
        """Put the task's objects where they start; the arm already stands in its first frame.

        Args:
            data: The state to be changed.
            start: What the execution drew; zero where nothing is disturbed.
        """

    @abstractmethod
    def _result(
        self, states: Float[np.ndarray, "steps s"], sensors: Float[np.ndarray, "steps m"]
    ) -> Rollout:
        """Read the outcome of one execution.

        Args:
            states: Full physics states: time, nq positions, velocities; row k is after k + 1 steps.
            sensors: The scene's sensors at the beginning of each step, so that row k belongs to the
                state after k steps.
        """

    def rollout(self, plans: ArrayLike, rng: np.random.Generator | None) -> list[Rollout]:
        """See `Task.rollout`, and the task for its outcome."""
        plans = as_plans(plans, self.format.action_dim)
        results: list[Rollout] = []
        for models, states, controls in self._batches(plans, rng):
            paths, sensors = mujoco.rollout.rollout(models, self._workers, states, controls)
            results += [self._result(*pair) for pair in zip(paths, sensors, strict=True)]
        return results

    def demonstrations(self, name: str) -> Demonstrations:
        """See `Task.demonstrations`."""
        if name not in self.demonstration_sets:
            raise ConfigurationError(
                f"{self.name} has no demonstration set {name!r}; use one of "
                f"{', '.join(self.demonstration_sets)}"
            )
        path = _FOLDER / "demonstrations" / f"{self.recordings}_{name}.npz"
        loaded, symmetry = Demonstrations.load(path), self.symmetry
        return loaded if symmetry is None else loaded.with_symmetry(symmetry)

    def film(
        self,
        plan: ArrayLike,
        goal: ArrayLike,
        rng: np.random.Generator | None = None,
        *,
        width: int = 640,
        height: int = 480,
        frames_per_second: int = 30,
        camera: str = "film",
    ) -> Iterator[Picture]:
        """See `Task.film`."""
        plan = as_plans(plan, self.format.action_dim, name="plan", single=True)
        goal = as_goal(goal, self.outcome_format.names)
        models, states, controls = self._prepare(plan[None], rng)
        model, data = models[0], mujoco.MjData(models[0])
        mujoco.mj_setState(model, data, states[0], FULL)
        data.mocap_pos[model.body("goal").mocapid[0]] = [*goal, 0.0]
        mujoco.mj_forward(model, data)
        with closing(make_renderer(model, width, height)) as renderer:
            n_pictures = 0
            for control in controls[0]:
                if data.time * frames_per_second >= n_pictures:
                    n_pictures += 1
                    renderer.update_scene(data, camera)
                    yield renderer.render().copy()
                data.ctrl[:] = control
                self._act_at_goal(data, goal)
                mujoco.mj_step(model, data)

    def _act_at_goal(self, data: mujoco.MjData, goal: Float[np.ndarray, "2"]) -> None:
        """What the goal's object does beyond standing in the way, at each step of a film."""

    def _key_frame(self, state: Float[np.ndarray, " s"], n_steps: float) -> KeyFrame:
        """The key frame of a full physics state, and of when it was, in steps from the start."""
        return KeyFrame(
            self.model, state[1 : 1 + self.model.nq].copy(), float(n_steps * STEP - self.lead_in)
        )

    def _lost(self, states: Float[np.ndarray, "steps s"]) -> Rollout:
        """The object never came where an outcome is: the robot's own base, where no goal can be."""
        return Rollout(np.zeros(2), False, self._key_frame(states[-1], len(states)))

    def _batches(self, plans: Plans, rng: np.random.Generator | None) -> Iterator[_Batch]:
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

    def _prepare(self, plans: Plans, rng: np.random.Generator | None) -> _Batch:
        n, horizon, _ = plans.shape
        n_steps = round((self.lead_in + (horizon - 1) * self.format.dt + self.lead_out) / STEP)
        joints = self.joint_plans(plans)
        controls = self._controls(joints, n_steps)
        if rng is None:
            states = np.stack([self._start(frame) for frame in joints[:, 0]])
            return [self.model], states, controls
        d = joints.shape[2]
        width = {"pose": d, "servo": d, "scene": self.n_constants, "start": 2}
        draws = {
            what: rng.normal(0.0, getattr(self.disturbances, what), (n, width[what]))
            for what in self.drawn
        }
        factors = zip(1.0 + draws["servo"], 1.0 + draws["scene"], strict=True)
        models = [self._disturbed(*own) for own in factors]
        controls += draws["pose"][:, None, :]
        frames = joints[:, 0] + draws["pose"]
        states = np.stack([self._start(*own) for own in zip(frames, draws["start"], strict=True)])
        return models, states, controls

    def _disturbed(
        self, servo: Float[np.ndarray, " d"], scene: Float[np.ndarray, " p"]
    ) -> mujoco.MjModel:
        model = copy.copy(self.model)
        model.actuator_gainprm[:, 0] *= servo
        model.actuator_biasprm[:, 1:3] *= servo[:, None]
        self._disturb(model, scene)
        return model

    def _start(
        self, joints: Float[np.ndarray, " d"], start: Float[np.ndarray, "2"] = _UNDISTURBED
    ) -> Float[np.ndarray, " s"]:
        """Full physics state with the arm at `joints` and the objects in place."""
        data = self._scratch
        mujoco.mj_resetData(self.model, data)
        data.qpos[: len(joints)] = joints
        mujoco.mj_kinematics(self.model, data)
        self._place(data, start)
        return full_state(self.model, data)


def full_state(model: mujoco.MjModel, data: mujoco.MjData) -> Float[np.ndarray, " s"]:
    """A copy of the full physics state."""
    state = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, state, FULL)
    return state


def first_descent(
    path: Float[np.ndarray, "steps 3"], height: float
) -> tuple[int, float, Float[np.ndarray, "2"]] | None:
    """Return where a path in [m] first passes a height downwards, by linear interpolation, or None.

    That is the last row above, the part of a row after it, and (x, y) there.
    """
    down = np.flatnonzero((path[:-1, 2] >= height) & (path[1:, 2] < height))
    if not down.size:
        return None
    row = int(down[0])
    before, after = path[row], path[row + 1]
    part = float((before[2] - height) / (before[2] - after[2]))
    return row, part, before[:2] + part * (after[:2] - before[:2])

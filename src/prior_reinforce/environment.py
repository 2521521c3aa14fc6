"""Env: what executes a plan, what comes of it, and what a camera sees of that.

`Task` is the interface of Env: action plans in, true outcomes out. A simulated task is one `.py`
with one `.xml` of the same name, in a fixed order: constants with their provenance, the scene, the
rollout, the outcome. It never sees a condition or an adapter.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, UInt8
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Point, Points
from prior_reinforce.errors import ConfigurationError, RenderingUnavailableError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Symmetry

if TYPE_CHECKING:
    import mujoco

Picture = UInt8[np.ndarray, "_height _width 3"]
"""RGB, row by row from the top."""

_without_opengl: list[str] = []
"""Why this process draws nothing: asked again for a platform library, MuJoCo's default aborts."""

# Nine places around a 1 m x 1 m table whose near edge is 0.35 m from the robot's base axis (ours):
# four would do, nine also tell how good the calibration is.
_TABLE_MARKS = tuple((x, y) for x in (0.5, 0.85, 1.2) for y in (-0.4, 0.0, 0.4))


@dataclass(frozen=True)
class SeenObject:
    """An object, in words that a model understands."""

    words: str
    """For instance `the orange ball`; they must fit one thing in the picture only."""
    size: float
    """Longer side of a box around it, in [m]. A box of less than half of it, or more than twice,
    is not around this object, however often the model repeats it."""
    round: bool = True
    """Whether it looks as wide from all sides, so that a flatter box is around a part of it."""

    def __post_init__(self) -> None:
        if not (self.words.strip() and self.words.isprintable() and self.size > 0):
            raise ConfigurationError(
                f"object {self.words!r} of {self.size} m cannot be looked for; give it words in "
                "one line and its size in metres"
            )


@dataclass(frozen=True)
class TableScene:
    """The two objects whose centres tell the error.

    The error seen is the reached object's centre minus the goal; the goal is the goal object's
    centre plus `goal_offset`.
    """

    reached: SeenObject
    """The object whose place is the outcome."""
    goal: SeenObject
    """The object that stands at the goal."""
    plane_height: float
    """Height above the table of the plane in which both centres lie at the key frame, in [m]."""
    goal_offset: tuple[float, float] = (0.0, 0.0)
    """From the centre of the goal's object to the goal, (x, y) in the table frame, in [m]."""
    marks: tuple[tuple[float, float], ...] = _TABLE_MARKS
    """Known points (x, y) of that plane to calibrate the camera on, table frame, in [m]."""


@dataclass(frozen=True, eq=False)
class KeyFrame:
    """The instant that decides a trial, ready to be drawn by anyone who has the goal.

    The goal's object is the model's mocap body `goal`; whoever draws the frame moves it to the
    goal first. The paper calls it the collision frame (throws) or final stable frame (slides).
    """

    model: mujoco.MjModel
    """The scene; shared between rollouts, never changed by a reader."""
    state: Float[np.ndarray, " nq"]
    """Positions `qpos` of the model at this instant."""
    time: float
    """Time since the plan's first frame, in [s]."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """Result of one open-loop execution (paper eq. r = rollout_Env(A))."""

    outcome: Point
    """True outcome r, mostly [m] in the table frame: x forward and y left of the robot's base axis.
    Always finite."""
    valid: bool
    """False where the object never reached the place that defines the outcome (a lost ball);
    `outcome` is then a sensible place, stated by the task, that no goal can be near."""
    key_frame: KeyFrame | None = None
    """What a camera sees; None where nothing can be drawn (a real arm, a synthetic task)."""


class Task(ABC):
    """A goal-conditioned dynamic manipulation task (paper, Section III).

    Outcomes and goals are in the table frame: origin on the robot's base axis at table height,
    x forward, y left, z up, in [m].
    """

    name: str
    """Name in results and messages, for instance `basketball-v1`."""
    format: PlanFormat
    """What a frame of a plan means, and how fast frames follow each other."""
    outcome_format: OutcomeFormat = OutcomeFormat.metres(2)
    """What the k numbers of an outcome mean."""
    tolerance: float | tuple[float, ...]
    """epsilon of the paper: largest true error that counts as reached, in the outcomes' unit, or
    one for each component, which mixed units need (see `formats.in_tolerances`)."""
    region: Float[np.ndarray, "2 k"]
    """Reachable region of goals, a box: lower and upper corner, in the outcomes' units."""
    demonstration_sets: tuple[str, ...] = ("A", "B")
    """Names of the prior sets that it is usually learned from."""
    scene: TableScene | None = None
    """What tells the error in a picture from above; None where no picture does."""

    @property
    def symmetry(self) -> Symmetry | None:
        """What may be done to its motions so that the physics stays the same; None if unknown."""
        return None

    @abstractmethod
    def rollout(self, plans: ArrayLike, rng: np.random.Generator | None) -> list[Rollout]:
        """Execute plans open loop, each from rest in its own first frame.

        Args:
            plans: Action plans, shape (n, H, D), in the units of `format`. Any H.
            rng: Source of the execution's small disturbances; None switches them off.

        Returns:
            One rollout a plan, in order. The same plans and seed give the same numbers.

        Raises:
            InvalidPlanError: Wrong shape, or values that are not finite.
        """

    @abstractmethod
    def demonstrations(self, name: str) -> Demonstrations:
        """Load the prior set `name`, one of `demonstration_sets` or another that the task knows.

        It carries the task's symmetry, if it has one (`Demonstrations.without_symmetry`).

        Raises:
            ConfigurationError: There is no such set.
        """

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
        """Execute one plan with the goal's object in place and draw it, frame by frame.

        A task that is computed without a scene leaves this out.

        Args:
            plan: Action plan, shape (H, D).
            goal: Where the goal's object stands, shape (k,), in [m].
            rng: Disturbances, as in `rollout`.
            width: Picture width, in pixels.
            height: Picture height, in pixels.
            frames_per_second: Of simulated time.
            camera: A camera of the scene: `film` or `birdseye`.

        Raises:
            RenderingUnavailableError: The task has no pictures, or there is no OpenGL on this
                machine.
            InvalidPlanError: Wrong shape, or values that are not finite.
            InvalidGoalError: Wrong shape, or values that are not finite.
        """
        raise RenderingUnavailableError(
            f"{self.name} has no pictures; it is computed without a scene"
        )

    def sample_goals(self, n: int, rng: np.random.Generator) -> Points:
        """Draw n goals uniformly from the reachable region (paper, Evaluation Protocol)."""
        low, high = self.region
        return rng.uniform(low, high, size=(n, low.shape[0]))


def make_renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    """Make a renderer of `width` x `height` pixels; its `close` frees the graphics memory.

    RenderingUnavailableError if there is no OpenGL on this machine.
    """
    import mujoco

    if _without_opengl:
        raise RenderingUnavailableError(_without_opengl[0])
    # The frame buffer's size is part of the model, and the model is shared: draw a copy.
    drawn = copy.copy(model)
    screen = drawn.vis.global_
    screen.offwidth = max(screen.offwidth, width)
    screen.offheight = max(screen.offheight, height)
    try:
        return mujoco.Renderer(drawn, height, width)
    except Exception as error:  # each OpenGL backend fails with exceptions of its own
        reason = (
            f"no picture can be drawn, OpenGL is not available ({error}); on a machine without a "
            "display set MUJOCO_GL=egl and install libegl1 (or MUJOCO_GL=osmesa and libosmesa6)"
        )
        if "platform library" in str(error):
            _without_opengl.append(reason)
        raise RenderingUnavailableError(reason) from error

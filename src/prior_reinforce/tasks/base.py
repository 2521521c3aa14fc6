"""The interface of Env: action plans in, true outcomes out.

A task is one `.py` with one `.xml` of the same name, in a fixed order: constants with their
provenance, the scene, the rollout, the outcome. It never sees a condition or an adapter.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Points
from prior_reinforce.errors import RenderingUnavailableError
from prior_reinforce.plans.motions import Demonstrations, PlanFormat
from prior_reinforce.rendering import Picture
from prior_reinforce.rollouts import Rollout
from prior_reinforce.scene import TableScene


class Task(ABC):
    """A goal-conditioned dynamic manipulation task (paper, Section III).

    Outcomes and goals are in the table frame: origin on the robot's base axis at table height,
    x forward, y left, z up, in [m].
    """

    name: str
    """Name in results and messages, for instance `basketball-v1`."""
    format: PlanFormat
    """What a frame of a plan means, and how fast frames follow each other."""
    outcome_names: tuple[str, ...] = ("x", "y")
    """Names of the k components of an outcome."""
    outcome_units: tuple[str, ...] = ()
    """Unit of each component; metres where none are given."""
    tolerance: float
    """epsilon of the paper: largest true error that counts as reached, in [m]. Where units differ,
    the error is the length of a vector of plain numbers: a second weighs as much as a metre."""
    region: Float[np.ndarray, "2 k"]
    """Reachable region of goals, a box: lower and upper corner, in the outcomes' units."""
    demonstration_sets: tuple[str, ...] = ("A", "B")
    """Names of the prior sets that it is usually learned from."""
    scene: TableScene | None = None
    """What tells the error in a picture from above; None where no picture does."""

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

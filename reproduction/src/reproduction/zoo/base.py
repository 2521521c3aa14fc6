"""What the tasks of the zoo share: disturbances, demonstrations by name, one plan at a time."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Frames, Point, as_plans
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.plans.motions import Demonstrations
from reproduction.following import follow
from reproduction.zoo.human import Strategy, demonstrate

_GONE = 100.0
"""An outcome farther off than this, in its unit, is of an object that is lost. Ours: goals are
within a few metres and seconds."""


def joints(n: int) -> tuple[str, ...]:
    """Names of an arm's joints, in a plan."""
    return tuple(f"joint{i + 1}" for i in range(n))


class ZooTask(Task):
    """A small task that is computed, not drawn; a rollout takes milliseconds.

    A lost object's outcome is zero in every component, where no region of the zoo is.
    """

    demonstration_sets = ("clean-6-0", "delayed-6-0", "warped-8-0", "mixed-8-0")
    """A selection; `demonstrations` makes any `KIND-COUNT-SEED` (`human.KINDS`)."""
    horizon: ClassVar[int]
    """Frames of a demonstration."""
    release: ClassVar[str]
    """What decides when the object leaves, in a few words."""
    pose: ClassVar[float] = 0.0005
    """Offset of every joint through an execution, standard deviation, in [rad]; half of what the
    Panda's tasks have, as nothing else of an arm is disturbed here. Ours."""
    spread: ClassVar[tuple[float, ...]] = (0.002,)
    """Standard deviations of what else differs between executions, as `_execute` takes them: by
    default the relative speed with which the object leaves. Ours."""
    bandwidth: ClassVar[float | None] = None
    """Bandwidth of the arm's servos, in [Hz]; None where the arm is where the plan says."""
    lead_out: ClassVar[float] = 0.3
    """A following arm is given so long to come to rest in the last frame, in [s]."""
    slack: ClassVar[float | None] = None
    """How far the end of a demonstrated motion may move, in [s]; None: through all of the frames
    that it leaves free. Less where a clock decides."""
    posture: ClassVar[tuple[float, ...]]
    """How much each channel differs between people's postures, standard deviation, in its unit."""
    aim_range: ClassVar[tuple[tuple[float, float], ...]]
    """Lowest and highest value of each aim of a demonstrator; as many as an outcome has
    components."""

    @abstractmethod
    def strategy(self, aims: Point, style: int) -> Strategy:
        """How a person does it: the usual way (style 0), or another (1)."""

    @abstractmethod
    def _execute(self, plan: Frames, disturbed: Float[np.ndarray, " m"]) -> ArrayLike | None:
        """Outcome of one execution; None where the object is lost.

        Args:
            plan: What the arm does, frame by frame.
            disturbed: Draws with the standard deviations of `spread`.
        """

    @property
    def is_angle(self) -> Bool[np.ndarray, " D"]:
        """Which channels are angles."""
        return np.array([unit == "rad" for unit in self.format.units])

    def recorded(self, path: Frames) -> Frames:
        """The plan that a led path is recorded as; here the path itself."""
        return path

    def held(self, plan: Frames) -> Float[np.ndarray, " D"]:
        """The frame that stops the arm after the plan; here its last."""
        return plan[-1]

    def aims(self, shares: Point) -> Point:
        """Aims at shares of their range."""
        low, high = np.array(self.aim_range).T
        return low + shares * (high - low)

    def execute(self, plan: Frames, draws: Float[np.ndarray, " w"] | None = None) -> Point | None:
        """Outcome of one plan; None where the object is lost.

        Args:
            plan: Shape (H, D).
            draws: D + m draws of a standard normal distribution; None: no disturbances.
        """
        d = self.format.action_dim
        if draws is None:
            draws = np.zeros(d + len(self.spread))
        plan = plan + self.pose * self.is_angle * draws[:d]
        if self.bandwidth is not None:
            still = np.tile(self.held(plan), (round(self.lead_out / self.format.dt), 1))
            plan = follow(np.vstack([plan, still]), self.format.dt, self.bandwidth)
        try:
            outcome = self._execute(plan, draws[d:] * self.spread)
        except OverflowError:  # a wild plan throws it out of all numbers
            return None
        if outcome is None or not np.all(np.abs(outcome) <= _GONE):
            return None
        return np.array(outcome, dtype=np.float64)

    def rollout(self, plans: ArrayLike, rng: np.random.Generator | None) -> list[Rollout]:
        """See `Task.rollout`, and the task for its outcome."""
        plans = as_plans(plans, self.format.action_dim)
        size = (len(plans), self.format.action_dim + len(self.spread))
        draws = [None] * len(plans) if rng is None else rng.normal(size=size)
        outcomes = [self.execute(*pair) for pair in zip(plans, draws, strict=True)]
        k = self.outcome_format.outcome_dim
        return [Rollout(np.zeros(k) if r is None else r, r is not None) for r in outcomes]

    def demonstrations(self, name: str) -> Demonstrations:
        """Make the set of a name, `KIND-COUNT-SEED`; see `human`.

        Raises:
            ConfigurationError: There is no such set.
        """
        made, symmetry = demonstrate(self, name), self.symmetry
        return made if symmetry is None else made.with_symmetry(symmetry)

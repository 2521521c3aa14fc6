"""Which goals can be reached: from what was demonstrated, within limits that are passed in.

A goal can be reached if the plan that a generator makes for it passes the check, the gate's for
instance. So a region can be drawn, and a goal be refused, before the first trial.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Frames, Point, Points
from prior_reinforce.errors import OutOfReachError
from prior_reinforce.generators.base import Generator
from prior_reinforce.plans.motions import Demonstrations

Check = Callable[[Frames, Point], str]
"""Why a plan (H, D) for a goal (k,) must not be executed; empty where it may."""
_MARGIN = 3.0
"""Of that box, in the demonstrations' spreads (ours)."""
_HALVINGS = 8
"""Of the way between a goal that can be reached and one that cannot (ours): 0.4 % of it is left."""


def refusal(generator: Generator, goal: ArrayLike, check: Check) -> str:
    """Return why a goal cannot be reached, in one sentence; empty where it can.

    Args:
        generator: Fitted.
        goal: Shape (k,), in the outcomes' units.
        check: Of the plan that is made for it.
    """
    try:
        place = np.asarray(goal, dtype=np.float64)
        (plan,) = generator.generate(place[None])
    except OutOfReachError as error:
        return str(error)
    return check(plan, place)


@dataclass(frozen=True, eq=False)
class Reach:
    """Which goals of a grid can be reached, over two components of the outcome."""

    x: Float[np.ndarray, " columns"]
    """Values of the first component."""
    y: Float[np.ndarray, " rows"]
    """Values of the second; one number where k = 1."""
    reached: Bool[np.ndarray, "rows columns"]
    """A row for each y, a column for each x: as matplotlib's `contourf` takes it."""
    goals: Points
    """The same goals in a list, y by y, shape (rows columns, k)."""

    def nearest(self, generator: Generator, goal: ArrayLike, check: Check) -> Point:
        """Return the goal itself if it can be reached, else the nearest found that can.

        It lies on the line from the nearest goal of the grid that can be reached.

        Raises:
            OutOfReachError: No goal of the grid can be reached, and the goal cannot.
        """
        wanted = np.asarray(goal, dtype=np.float64)
        if not (why := refusal(generator, wanted, check)):
            return wanted
        possible = self.goals[self.reached.ravel()]
        if not len(possible):
            raise OutOfReachError(f"no goal can be reached from these demonstrations: {why}")
        within = possible[np.argmin(np.linalg.norm(possible - wanted, axis=1))]
        return farthest_between(generator, within, wanted, check)


def farthest_between(generator: Generator, within: Point, wanted: Point, check: Check) -> Point:
    """Return the last goal that can be reached on the way from one that can to one that cannot."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        if refusal(generator, within + share * (wanted - within), check):
            high = share
        else:
            low = share
    return np.asarray(within + low * (wanted - within))


def region_around(demonstrations: Demonstrations) -> Float[np.ndarray, "2 k"]:
    """Return the box in which goals are looked for: the outcomes, and three spreads around."""
    outcomes, margin = demonstrations.outcomes_seen, _MARGIN * demonstrations.spread
    return np.stack([outcomes.min(axis=0) - margin, outcomes.max(axis=0) + margin])


def reach(
    generator: Generator, region: Float[np.ndarray, "2 k"], check: Check, steps: int = 9
) -> Reach:
    """Try goals on a grid over a box.

    Args:
        generator: Fitted.
        region: Lower and upper corner. Components after the second stay in the middle.
        check: Of each goal's plan.
        steps: Of the grid, along each of the first two components.
    """
    low, high = np.asarray(region, dtype=np.float64)
    x = np.linspace(low[0], high[0], steps)
    y = np.linspace(low[1], high[1], steps) if len(low) > 1 else np.zeros(1)
    goals = np.tile((low + high) / 2, (len(y) * len(x), 1))
    goals[:, 0] = np.tile(x, len(y))
    if len(low) > 1:
        goals[:, 1] = np.repeat(y, len(x))
    reached = np.array([not refusal(generator, goal, check) for goal in goals])
    return Reach(x, y, reached.reshape(len(y), len(x)), goals)

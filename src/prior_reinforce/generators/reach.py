"""Reachable goals: those whose plan, by a fitted generator, passes a given check.

The check is the gate's, for instance. So a region can be drawn, and a goal be refused, before the
first trial.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import OutOfReachError
from prior_reinforce.generators.base import Generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import Polar

Check = Callable[[Frames, Point], str]
"""Returns why a plan (H, D) for a goal (k,) must not be executed; empty if it may."""
Rounding = Callable[[Point], Point]
"""Rounds a goal to what a person reads and enters."""
_MARGIN = 3.0
"""Margin of the region of goals around the outcomes, in the demonstrations' spreads (ours)."""
_GRID = 9, 13
"""Goals along each of the first two components (ours)."""
_BISECTIONS = 8
"""Of the line between a reachable goal and another (ours): 0.4 % of it is left."""


def refusal(generator: Generator, goal: ArrayLike, check: Check) -> str:
    """Return why a goal cannot be reached by a fitted generator's plan; empty if it can."""
    try:
        place = np.asarray(goal, dtype=np.float64)
        (plan,) = generator.generate(place[None])
    except OutOfReachError as error:
        return error.problem  # without the remedy, which the caller gives
    return check(plan, place)


@dataclass(frozen=True, eq=False)
class Reach:
    """A grid of goals, and which of them can be reached."""

    goals: Float[np.ndarray, "rows columns k"]
    """Neighbours in a row or a column are neighbours in space."""
    reached: Bool[np.ndarray, "rows columns"]

    def nearest(
        self, generator: Generator, goal: ArrayLike, check: Check, rounded: Rounding = np.asarray
    ) -> Point:
        """Return the goal itself if it can be reached, else the nearest rounded one found.

        That lies on the line from the nearest reachable goal of the grid. OutOfReachError if
        neither the goal nor any of the grid can be reached.
        """
        desired = np.asarray(goal, dtype=np.float64)
        if not (why := refusal(generator, desired, check)):
            return desired
        reachable = self.goals[self.reached]
        if not len(reachable):
            raise OutOfReachError(
                f"no goal can be reached from these demonstrations: {why}; give others"
            )
        start = reachable[np.argmin(np.linalg.norm(reachable - desired, axis=1))]
        return farthest_between(generator, start, desired, check, rounded)


def farthest_between(
    generator: Generator, start: Point, end: Point, check: Check, rounded: Rounding = np.asarray
) -> Point:
    """Return the last reachable goal on the line from a reachable start to an unreachable end.

    By bisection. Goals are rounded before they are checked, so that the rounded goal is reachable.
    """
    low, high, last = 0.0, 1.0, start
    for _ in range(_BISECTIONS):
        share = (low + high) / 2
        goal = rounded(start + share * (end - start))
        if refusal(generator, goal, check):
            high = share
        else:
            low, last = share, goal
    return np.asarray(last)


def region_around(demonstrations: Demonstrations) -> Float[np.ndarray, "2 k"]:
    """Return the box in which goals are searched: the outcomes, and three spreads around."""
    outcomes, margin = demonstrations.outcomes_seen, _MARGIN * demonstrations.spread
    return np.stack([outcomes.min(axis=0) - margin, outcomes.max(axis=0) + margin])


def goals_around(demonstrations: Demonstrations) -> Float[np.ndarray, "rows columns k"]:
    """Return a grid of goals as far as a symmetry is trusted: a ring about an axis, or a box.

    Components after the second stay in the middle of the outcomes.
    """
    assert demonstrations.symmetry is not None
    chart = demonstrations.symmetry.chart
    z = chart.to(demonstrations.outcomes_seen)
    farthest = demonstrations.symmetry.farthest_from(z)
    low, high = z.min(axis=0) - farthest, z.max(axis=0) + farthest
    if isinstance(chart, Polar):  # one turn: bearings beyond it are the same goals
        middle = (low[1] + high[1]) / 2
        low[1], high[1] = max(low[1], middle - np.pi), min(high[1], middle + np.pi)
    axes = [np.linspace(*span) for span in zip(low, high, _GRID, strict=False)]
    rows, columns = np.meshgrid(axes[0], axes[1] if len(axes) > 1 else [0.0], indexing="ij")
    grid = np.tile((low + high) / 2, (*rows.shape, 1))
    grid[..., 0] = rows
    if len(axes) > 1:
        grid[..., 1] = columns
    return np.asarray(chart.back(grid))


def reach(generator: Generator, goals: Float[np.ndarray, "rows columns k"], check: Check) -> Reach:
    """Check a fitted generator's plans for a grid of goals, such as `goals_around`."""
    reached = [[not refusal(generator, goal, check) for goal in row] for row in goals]
    return Reach(goals, np.array(reached))

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

from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import OutOfReachError
from prior_reinforce.generators.base import Generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import Polar

Check = Callable[[Frames, Point], str]
"""Why a plan (H, D) for a goal (k,) must not be executed; empty where it may."""
Said = Callable[[Point], Point]
"""A goal as a person reads and enters it."""
_MARGIN = 3.0
"""Of that box, in the demonstrations' spreads (ours)."""
_STEPS = 9, 13
"""Goals along each of the first two components (ours)."""
_HALVINGS = 8
"""Of the way between a goal that can be reached and one that cannot (ours): 0.4 % of it is left."""


def refusal(generator: Generator, goal: ArrayLike, check: Check) -> str:
    """Return why a goal cannot be reached by a fitted generator's plan; empty where it can."""
    try:
        place = np.asarray(goal, dtype=np.float64)
        (plan,) = generator.generate(place[None])
    except OutOfReachError as error:
        return error.problem  # who asked says what to do
    return check(plan, place)


@dataclass(frozen=True, eq=False)
class Reach:
    """Which of some goals can be reached."""

    goals: Float[np.ndarray, "rows columns k"]
    """Neighbours in a row or a column are neighbours in space."""
    reached: Bool[np.ndarray, "rows columns"]

    def nearest(
        self, generator: Generator, goal: ArrayLike, check: Check, said: Said = np.asarray
    ) -> Point:
        """Return the goal itself if it can be reached, else the nearest found that can.

        It lies on the line from the nearest of the goals that can be reached; as it is said.
        OutOfReachError if neither one of the goals can be reached nor the goal.
        """
        wanted = np.asarray(goal, dtype=np.float64)
        if not (why := refusal(generator, wanted, check)):
            return wanted
        possible = self.goals[self.reached]
        if not len(possible):
            raise OutOfReachError(
                f"no goal can be reached from these demonstrations: {why}; give others"
            )
        within = possible[np.argmin(np.linalg.norm(possible - wanted, axis=1))]
        return farthest_between(generator, within, wanted, check, said)


def farthest_between(
    generator: Generator, within: Point, wanted: Point, check: Check, said: Said = np.asarray
) -> Point:
    """Return the last goal that can be reached on the way from one that can to one that cannot.

    It is `said` as a goal is, rounded: what is said is what can be reached.
    """
    low, high, last = 0.0, 1.0, within
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        goal = said(within + share * (wanted - within))
        if refusal(generator, goal, check):
            high = share
        else:
            low, last = share, goal
    return np.asarray(last)


def region_around(demonstrations: Demonstrations) -> Float[np.ndarray, "2 k"]:
    """Return the box in which goals are looked for: the outcomes, and three spreads around."""
    outcomes, margin = demonstrations.outcomes_seen, _MARGIN * demonstrations.spread
    return np.stack([outcomes.min(axis=0) - margin, outcomes.max(axis=0) + margin])


def goals_around(demonstrations: Demonstrations) -> Float[np.ndarray, "rows columns k"]:
    """Return goals as far as a symmetry is believed: a ring about an axis, or a box.

    Components after the second stay in the middle of what was shown.
    """
    assert demonstrations.symmetry is not None
    chart = demonstrations.symmetry.chart
    z = chart.to(demonstrations.outcomes_seen)
    farthest = demonstrations.symmetry.farthest_from(z)
    low, high = z.min(axis=0) - farthest, z.max(axis=0) + farthest
    if isinstance(chart, Polar):  # once round: bearings beyond that are the same goals
        middle = (low[1] + high[1]) / 2
        low[1], high[1] = max(low[1], middle - np.pi), min(high[1], middle + np.pi)
    spans = zip(low, high, _STEPS, strict=False)
    axes = [np.linspace(*span) for span in spans]
    rows, columns = np.meshgrid(axes[0], axes[1] if len(axes) > 1 else [0.0], indexing="ij")
    grid = np.tile((low + high) / 2, (*rows.shape, 1))
    grid[..., 0] = rows
    if len(axes) > 1:
        grid[..., 1] = columns
    return np.asarray(chart.back(grid))


def reach(generator: Generator, goals: Float[np.ndarray, "rows columns k"], check: Check) -> Reach:
    """Try goals, such as those of `goals_around`, by the check of a fitted generator's plans."""
    reached = [[not refusal(generator, goal, check) for goal in row] for row in goals]
    return Reach(goals, np.array(reached))

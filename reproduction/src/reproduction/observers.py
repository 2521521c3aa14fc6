"""Noisy observers: perceptions for comparisons, not for users to pick.

Named by their class, as your own are: `reproduction.observers:ErringEye`. They
see two components. What models err by is made up, not measured with any model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.calibration import CAMERA_SD
from prior_reinforce.perception.eye import Eye
from prior_reinforce.readings import Reading

_SIZE, _DIRECTION = 0.2, 5.0
"""Standard deviations of what is seen before it is rounded: a factor, and [deg]. Ours: nobody has
measured people at such a table."""
_MISREAD = 0.05
"""Share of trials in which one component is taken for its opposite (ours)."""


class ErringEye(Eye):
    """Errs by a fifth in size and by five degrees in direction before rounding."""

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """See `Perception.perceive`."""
        error = rollout.outcome - goal
        angle = np.deg2rad(_DIRECTION) * rng.normal()
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        wrong = (1.0 + _SIZE * rng.normal()) * turn @ error
        return super().perceive(replace(rollout, outcome=goal + wrong), goal, rng)


class MisreadingEye(Eye):
    """Takes long for short, or left for right, once in twenty trials."""

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """See `Perception.perceive`."""
        error = rollout.outcome - goal
        swap = np.where(np.arange(error.size) == rng.integers(error.size), -1.0, 1.0)
        wrong = np.where(rng.uniform() < _MISREAD, swap * error, error)
        return super().perceive(replace(rollout, outcome=goal + wrong), goal, rng)


_BIAS = (0.02, -0.015)
"""How far a biased model's boxes lie from objects, in [m]: a shadow boxed with the ball, a table
calibrated at another height (ours)."""
_SCATTER, _ELSEWHERE = 0.03, 0.3
"""Standard deviations of a scattered model's boxes, in [m]; the second where it boxes something
else, as often as an eye misreads (ours)."""


class BiasedModel(Perception):
    """A vision-language model whose boxes are off by 2.5 cm, and which does not know it."""

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """See `Perception.perceive`."""
        return Reading.measured(rollout.outcome - goal + np.array(_BIAS), CAMERA_SD)


class ScatteredModel(Perception):
    """A vision-language model whose boxes scatter by 3 cm, once in twenty by 30 cm, unknowingly."""

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """See `Perception.perceive`."""
        sd = _ELSEWHERE if rng.uniform() < _MISREAD else _SCATTER
        return Reading.measured(rollout.outcome - goal + sd * rng.normal(size=2), CAMERA_SD)

"""An observer's estimate by eye, as coarse as the paper's (Section V-A, "Perception Process")."""

from __future__ import annotations

import numpy as np

from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.perception.base import Perception
from prior_reinforce.readings import EYE_BETWEEN, EYE_NEAR, EYE_STEP, Reading

_LEAST = EYE_NEAR[1]
"""Reported for the larger component where the miss is `EYE_BETWEEN[0]` or more, but every
component rounds to 0, in [m]."""
_RESOLUTION_DECIMALS = 9
"""Errors are compared to the nanometre, so that 0.92 - 0.91 is a tie as 1 cm is on paper."""


class Eye(Perception):
    """Each component of the error, rounded to the nearest of 0, 2, 5, 10, 20, 30, ... cm.

    The sign is kept. A tie (1, 3.5, 7.5, 15, ... cm) is rounded up. A miss of 1 cm or more is never
    reported as zero because each component alone rounds to zero, as 0.9 cm and 0.8 cm do: the
    larger one is then reported as 2 cm (ours; "no error" would repeat the miss for ever). Nothing
    is random: the paper describes the rounding and no other error.
    """

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """Return the rounded error, and what it stands for; draws nothing from `rng`."""
        error = rollout.outcome - goal
        size = np.round(np.abs(error), _RESOLUTION_DECIMALS)
        near = EYE_NEAR[np.searchsorted(EYE_BETWEEN, size, side="right")]
        far = EYE_STEP * np.floor(np.round(size / EYE_STEP + 0.5, _RESOLUTION_DECIMALS))
        seen = np.where(size < EYE_NEAR[-1], near, far)
        distance = np.round(np.linalg.norm(size), _RESOLUTION_DECIMALS)
        if not seen.any() and distance >= EYE_BETWEEN[0]:
            seen[np.argmax(size)] = _LEAST
        # Adding 0 turns the -0.0 of a small negative error into 0.0.
        return Reading.by_eye(np.sign(error) * seen + 0.0)

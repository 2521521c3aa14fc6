"""Normalised units of adapters: outcomes of mean 0 and standard deviation about 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Point
from prior_reinforce.plans.motions import Demonstrations


@dataclass(frozen=True, eq=False)
class Normalisation:
    """An affine map, fixed by the demonstrations and independent of trials."""

    offset: Point
    """Mean of the demonstrated outcomes, in the outcomes' units."""
    scale: Point
    """Unit, in the outcomes' units."""

    @classmethod
    def of(cls, demonstrations: Demonstrations) -> Normalisation:
        """Return the map that takes off the demonstrations' mean and divides by their deviation.

        Components of one unit share one scale (the root mean square of their deviations), so that
        the kernel stays isotropic on a table: 5 cm to the side are as far as 5 cm ahead. Metres and
        seconds have separate scales, without which a sum of squares would mean nothing.
        """
        outcomes, variance = demonstrations.outcomes_seen, demonstrations.spread**2
        units = np.array(demonstrations.outcome_format.units)
        scale = np.sqrt([variance[units == unit].mean() for unit in units])
        return cls(offset=outcomes.mean(axis=0), scale=scale)

    def apply(self, values: Float[np.ndarray, "*n k"]) -> Float[np.ndarray, "*n k"]:
        """Convert outcomes or conditions to normalised units."""
        return (values - self.offset) / self.scale

    def undo(self, values: Float[np.ndarray, "*n k"]) -> Float[np.ndarray, "*n k"]:
        """Convert normalised values to the outcomes' units."""
        return values * self.scale + self.offset

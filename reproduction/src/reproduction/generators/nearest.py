"""The nearest demonstrations, mixed frame by frame: the paper's simplest baseline, "I.N.N.".

    A(c) = sum_i w_i(c) A_i,    w_i proportional to |c - r_i|^-p over the m nearest outcomes

Notation:
    A_i  plans       in their units
    r_i  outcomes    in their units
    c    conditions  in the outcomes' units
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import SAME_OUTCOME, Points
from prior_reinforce.generators.interpolation import Mixture
from prior_reinforce.settings import Checked, Count, Positive


@dataclass(frozen=True)
class NearestNeighboursConfig(Checked):
    """How neighbours are weighted; reproduction/docs/baselines.md tells what was tried."""

    neighbours: Count = 3
    """m, how many of the nearest demonstrations take part; all where there are fewer."""
    power: Positive = 2.0
    """p, how fast a demonstration's weight falls with the distance of its outcome."""


class NearestNeighbours(Mixture):
    """Inverse-distance interpolation of the nearest plans (paper, "I.N.N.")."""

    name: ClassVar[str] = "nearest"
    config_type: ClassVar[type[NearestNeighboursConfig]] = NearestNeighboursConfig
    config: NearestNeighboursConfig

    def _weights(self, conditions: Points) -> Float[np.ndarray, "n N"]:
        """Weigh the nearest plans; at a demonstration's outcome, its own alone."""
        return inverse_distance_weights(
            conditions, self._outcomes, neighbours=self.config.neighbours, power=self.config.power
        )


def inverse_distance_weights(
    conditions: Float[np.ndarray, "n k"],
    outcomes: Float[np.ndarray, "N k"],
    *,
    neighbours: int,
    power: float,
) -> Float[np.ndarray, "n N"]:
    r"""Return Shepard's weights over the nearest demonstrations.

    .. math:: w_i \propto \|c - r_i\|^{-p}, \quad i \in \text{the nearest } m, \quad w_i = 0
        \text{ else}

    All weights are in [0, 1]: a convex combination, which never extrapolates. They are continuous
    in c where m = N; where m < N they jump when the m-th neighbour changes.

    Args:
        conditions: c.
        outcomes: r.
        neighbours: m; all demonstrations where there are fewer.
        power: p > 0.

    Returns:
        w; at an outcome of a demonstration, exactly that demonstration, or the mean of those that
        have it.

    Source: Shepard, "A two-dimensional interpolation function for irregularly-spaced data",
    ACM National Conference 1968; the paper says only "computed based on distances".
    """
    from scipy.spatial.distance import cdist

    scale = np.ptp(outcomes, axis=0)
    distances = cdist(conditions / scale, outcomes / scale)
    nearest = np.argsort(distances, axis=1, kind="stable")[:, :neighbours]
    near = np.take_along_axis(distances, nearest, axis=1)
    # Relative to the nearest, so that no power over- or underflows; 0/0 is an exact hit.
    with np.errstate(invalid="ignore", divide="ignore"):
        kept = (near[:, :1] / near) ** power
    hit = near[:, 0] == 0
    kept[hit] = near[hit] <= SAME_OUTCOME
    weights = np.zeros_like(distances)
    np.put_along_axis(weights, nearest, kept / kept.sum(axis=1, keepdims=True), axis=1)
    return weights

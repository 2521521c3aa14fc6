"""From where a plan for an aim is moved: one demonstration, or a mixture of several.

Generators move plans by w = z - z_base, adapters learn what such moves do: both ask here, so that
they mean the same.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.outcome_weights import smooth_weights
from prior_reinforce.plans.symmetry.symmetry import Symmetry

_NEIGHBOURS_APART = 1.0
"""Labels that are off by more than the gaps between demonstrated values, in these, tell which of
two comes first no more: mixing them makes plans steep (ours)."""


_EVENLY = 0.2
"""Where a clock releases and two demonstrations are equally near an aim to this part, both are
moved to it, and mixed (ours): else outcomes would jump from one to the other, and what lies between
not be reached. Only there are motions as recorded at the same time."""


class Anchors:
    """Demonstrations in the chart of their symmetry.

    Two ways to be a base. *Mixed*: demonstrations differ enough in what is not exact, so that a
    plan for any value within their hull can be mixed of all, and is moved from the hull's nearest
    point beyond it; what is learned is extrapolated instead. *Picked*: the nearest
    demonstration is moved; so with one demonstration, where all components are exact, where labels
    are coarser than the gaps, and where a clock releases: people are at different points of their
    motion then, and what is mixed of them is nobody's throw.
    """

    def __init__(self, symmetry: Symmetry, outcomes: Points, noise: Points) -> None:
        """Place demonstrations in the chart, by outcomes and their standard deviations, (N, k)."""
        self.symmetry = symmetry
        self.z: Points = symmetry.chart.to(outcomes)
        """Demonstrated outcomes in the chart, (N, k)."""
        into = np.linalg.inv(symmetry.chart.jacobian(self.z))
        self.sd: Points = np.sqrt(np.einsum("nij,nj->ni", into**2, noise**2))
        """How uncertain they are, in the chart, (N, k)."""
        self.left = np.flatnonzero(~symmetry.exact)
        """Components that no symmetry carries along exactly."""
        self.mixed = self._can_be_mixed()
        """Whether plans within the hull are mixed; else the nearest demonstration is moved."""
        if self.mixed:
            left = self.left
            self._weights = smooth_weights(self.z[:, left], noise=self.sd[:, left])

    def base(self, aims: Points) -> tuple[Points, Float[np.ndarray, "n N"]]:
        """Return where plans for aims z (n, k) are moved from, and how much each one shown counts.

        These are z_base (n, k), and weights (n, N) that sum to one.
        """
        if not self.mixed:
            weights = self._picked(aims)
            return weights @ self.z, weights
        wanted, z = aims[:, self.left], self.z[:, self.left]
        beyond = self.symmetry.farthest_from(self.z)[self.left]
        extrapolated = np.clip(wanted, z.min(axis=0) - beyond, z.max(axis=0) + beyond)
        learned = self.symmetry.learned[self.left]
        within = np.where(learned, extrapolated, into_hull(wanted, z))
        weights = self._weights(within)
        base = weights @ self.z
        base[:, self.left] = within
        return base, weights

    def moves(self, aim: Point) -> tuple[Points, Point]:
        """Return how far demonstrations are moved where a plan for an aim z (k,) is made of them.

        Exact components are brought to the aim, the others moved as far as the plan is: w of each
        demonstration (N, k), and of the plan (k,). A demonstration that such a plan is not made of
        is at infinity.
        """
        (base,), (weights,) = self.base(aim[None])
        exact, farthest = self.symmetry.exact, self.symmetry.farthest
        w = np.where(exact, aim - base, np.clip(aim - base, -farthest, farthest))
        if self.mixed:
            return np.where(exact, aim - self.z, w), w
        each = np.where(exact, aim - self.z, np.clip(aim - self.z, -farthest, farthest))
        return np.where(weights[:, None] > 0, each, np.inf), w

    def _picked(self, aims: Points) -> Float[np.ndarray, "n N"]:
        """The nearest counts all; where a clock releases, others that are as near count as well."""
        apart = (aims[:, None] - self.z[None]) / self.symmetry.farthest
        far = np.linalg.norm(apart, axis=2)
        if not self.symmetry.clocked:
            return np.eye(len(self.z))[far.argmin(axis=1)]
        least = far.min(axis=1, keepdims=True)
        evenly = (far - least) / np.maximum(_EVENLY * (far + least), np.finfo(float).tiny)
        weights = np.maximum(1.0 - evenly, 0.0)
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))

    def _can_be_mixed(self) -> bool:
        n, left = len(self.z), self.left
        if not len(left) or n <= len(left):
            return False
        values = self.z[:, left] - self.z[:, left].mean(axis=0)
        extent = np.ptp(values, axis=0)
        if np.any(extent < 1e-6) or np.linalg.svd(values / extent)[1][-1] < 1e-3:
            return False
        if np.all(self.symmetry.learned[left]):
            return True  # whatever the labels: nothing else gives plans for what is asked
        if self.symmetry.clocked and not np.any(self.symmetry.learned):
            return False  # what is learned is learned from several, whatever releases
        gaps = extent / (n ** (1 / len(left)) - 1)  # as if they lay on a grid
        return bool(np.all(np.median(self.sd[:, left], axis=0) <= _NEIGHBOURS_APART * gaps))


def into_hull(points: Points, corners: Float[np.ndarray, "N k"]) -> Points:
    """Return the nearest points of the convex hull of `corners`, in any dimension."""
    if points.shape[1] == 1:
        return np.asarray(np.clip(points, corners.min(axis=0), corners.max(axis=0)))
    from scipy.optimize import nnls

    # min |C' s - p| over s >= 0 with sum s = 1, which a heavy row holds.
    extent = np.ptp(corners, axis=0)
    heavy = 1e4 * np.ones((1, len(corners)))
    system = np.vstack([(corners / extent).T, heavy])
    shares = np.array([nnls(system, np.append(p / extent, 1e4))[0] for p in points])
    return np.asarray(shares.reshape(len(points), len(corners)) @ corners)

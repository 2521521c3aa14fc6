"""The base from which a plan for an aim is moved: one demonstration, or a mixture of several.

Generators move plans by w = z - z_base, and adapters learn the effect of such moves, from the same
bases.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.outcome_weights import smooth_weights
from prior_reinforce.plans.symmetry.symmetry import Symmetry

_LARGEST_NOISE = 1.0
"""Largest noise of labels, in gaps between demonstrated values, at which demonstrations are mixed
(ours): noisier labels no longer order neighbours, and mixing them makes plans steep."""

_EQUALLY_NEAR = 0.2
"""If a clock releases, and two demonstrations are equally near an aim to this part, both are moved
to it and mixed (ours): else outcomes would jump from one to the other, and none between would be
reached. Only with a clock do recorded motions coincide in time."""


class Anchors:
    """Demonstrations in the chart of their symmetry, as bases of moved plans.

    *Mixed* bases: demonstrations differ enough in the inexact components, so a plan for any value
    within their hull is a mixture of all; for a value beyond, it is moved from the hull's nearest
    point, and in learned components extrapolated instead. *Picked* bases: the nearest demonstration
    is moved. Bases are picked with one demonstration, if all components are exact, if labels are
    coarser than the gaps, and if a clock releases: people are at different points of their motion
    then, and a mixture is nobody's throw.
    """

    def __init__(self, symmetry: Symmetry, outcomes: Points, noise: Points) -> None:
        """Map demonstrated outcomes and their standard deviations, (N, k), to the chart."""
        self.symmetry = symmetry
        self.z: Points = symmetry.chart.to(outcomes)
        """Demonstrated outcomes in the chart, (N, k)."""
        dz_dr = np.linalg.inv(symmetry.chart.jacobian(self.z))
        self.sd: Points = np.sqrt(np.einsum("nij,nj->ni", dz_dr**2, noise**2))
        """Their standard deviations in the chart, (N, k)."""
        self.left = np.flatnonzero(~symmetry.exact)
        """The inexact components."""
        self.mixed = self._can_be_mixed()
        """Whether plans within the hull are mixed; else the nearest demonstration is moved."""
        if self.mixed:
            self._weights = smooth_weights(self.z[:, self.left], noise=self.sd[:, self.left])

    def base(self, aims: Points) -> tuple[Points, Float[np.ndarray, "n N"]]:
        """Return z_base (n, k) for aims z (n, k), and the demonstrations' weights (n, N) in it.

        Weights sum to one.
        """
        if not self.mixed:
            weights = self._picked(aims)
            return weights @ self.z, weights
        aimed, z = aims[:, self.left], self.z[:, self.left]
        beyond = self.symmetry.farthest_from(self.z)[self.left]
        extrapolated = np.clip(aimed, z.min(axis=0) - beyond, z.max(axis=0) + beyond)
        learned = self.symmetry.learned[self.left]
        supported = np.where(learned, extrapolated, into_hull(aimed, z))
        weights = self._weights(supported)
        base = weights @ self.z
        base[:, self.left] = supported
        return base, weights

    def moves(self, aim: Point) -> tuple[Points, Point]:
        """Return the moves w of each demonstration (N, k) and of the plan (k,) for an aim z (k,).

        Exact components are moved to the aim, the others as far as the plan is. A demonstration
        that has no weight in the plan is at infinity.
        """
        (base,), (weights,) = self.base(aim[None])
        exact, farthest = self.symmetry.exact, self.symmetry.farthest
        w = np.where(exact, aim - base, np.clip(aim - base, -farthest, farthest))
        if self.mixed:
            return np.where(exact, aim - self.z, w), w
        each = np.where(exact, aim - self.z, np.clip(aim - self.z, -farthest, farthest))
        return np.where(weights[:, None] > 0, each, np.inf), w

    def _picked(self, aims: Points) -> Float[np.ndarray, "n N"]:
        """Weigh the nearest demonstration alone; if a clock releases, also others equally near."""
        scaled = (aims[:, None] - self.z[None]) / self.symmetry.farthest
        distance = np.linalg.norm(scaled, axis=2)
        if not self.symmetry.clocked:
            return np.eye(len(self.z))[distance.argmin(axis=1)]
        least = distance.min(axis=1, keepdims=True)
        tolerance = np.maximum(_EQUALLY_NEAR * (distance + least), np.finfo(float).tiny)
        weights = np.maximum(1.0 - (distance - least) / tolerance, 0.0)
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
            return True  # whatever the noise: nothing else gives plans for these components
        if self.symmetry.clocked and not np.any(self.symmetry.learned):
            return False  # a learned component needs several, even with a clock
        gaps = extent / (n ** (1 / len(left)) - 1)  # as if they lay on a grid
        return bool(np.all(np.median(self.sd[:, left], axis=0) <= _LARGEST_NOISE * gaps))


def into_hull(points: Points, corners: Float[np.ndarray, "N k"]) -> Points:
    """Return the nearest points of the convex hull of `corners`, in any dimension."""
    if points.shape[1] == 1:
        return np.asarray(np.clip(points, corners.min(axis=0), corners.max(axis=0)))
    from scipy.optimize import nnls

    # min |C' s - p| over s >= 0 with sum s = 1, which a row of large weight enforces.
    extent = np.ptp(corners, axis=0)
    system = np.vstack([(corners / extent).T, 1e4 * np.ones((1, len(corners)))])
    shares = np.array([nnls(system, np.append(p / extent, 1e4))[0] for p in points])
    return np.asarray(shares.reshape(len(points), len(corners)) @ corners)

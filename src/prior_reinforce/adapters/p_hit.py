"""The probability of a hit, and what trials that missed tell of it.

Displacements are Gaussian, so that the probability of a hit is the share of a normal distribution
that lies in a ball (`share_within`).

A miss says that an error lies outside of a ball, which no interval and no Gaussian says. So the
displacements at the conditions that missed are drawn, each draw is weighed by the probability that
all of them would have missed, and a candidate's displacement follows from each draw:

    P(hit at c | misses) = sum_q w_q P(|d_c - aim_c| < radius | draw q) / sum_q w_q,
    w_q = prod_i [1 - (1 - e) P(|d_i - aim_i| < radius_i | draw q)]

With a share e of trials whose result says nothing. Where only one condition is concerned this is
the search for a lost object: what was searched is unlikely, so search beside it.

Source: Koopman, The theory of search, Operations Research 4 and 5, 1956-57, for the idea; the
importance weights are standard (Robert and Casella, Monte Carlo Statistical Methods, 2004, 3.3).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

_POINTS = 192
"""Where the share within a ball is evaluated (ours): right to 0.002, for k up to 3."""
_DRAWS = 1024
"""Of all models together (ours). After six misses the standard error of P(hit) is then 0.02 with
two components, at most 0.03, and 0.07 with one, at most 0.09 (twelve sets, twenty seeds)."""
_FEWEST = 16
"""Draws of an improbable model, which may be the one that explains the misses (ours)."""
_LEAST_SHARE = 1e-3
"""Models less probable than this are left out (ours)."""
_SINGULAR = 1e-9
"""Eigenvalues of a covariance are this share of the greatest at least."""


@dataclass(frozen=True, eq=False)
class Belief:
    """Gaussian displacements at n candidates and M missed conditions, under each of m models."""

    share: Float[np.ndarray, " m"]
    """Probability of each model."""
    at_missed: Float[np.ndarray, "m k M"]
    """Means there."""
    among_missed: Float[np.ndarray, "m k M M"]
    """Covariances."""
    mean: Float[np.ndarray, "m k n"]
    """At the candidates."""
    variance: Float[np.ndarray, "m k n"]
    """Of each of them."""
    cross: Float[np.ndarray, "m k n M"]
    """Covariances of candidates with missed conditions."""


@dataclass(frozen=True, eq=False)
class Targets:
    """Where displacements at p conditions hit."""

    aims: Float[np.ndarray, "p k"]
    """Middles: goal minus condition."""
    radii: Float[np.ndarray, " p"]
    """Tolerances."""
    execution_sd: Float[np.ndarray, " p"]
    """Standard deviations of an execution, which blur the radii."""

    def share_within(self, drawn: Float[np.ndarray, "k q p"]) -> Float[np.ndarray, "q p"]:
        """Probability that an execution of each draw hits.

        Of the noise across the way to the middle its mean square is taken, and along it all.
        """
        from scipy.special import ndtr  # as in `expectation_propagation`

        across = (len(drawn) - 1) * self.execution_sd**2
        distance = np.sqrt(np.square(drawn - self.aims.T[:, None]).sum(axis=0) + across)
        return np.asarray(ndtr((self.radii - distance) / self.execution_sd))


def p_hit_after(
    belief: Belief, missed: Targets, candidates: Targets, outlier: float, seed: int = 0
) -> Float[np.ndarray, " n"]:
    """Return each candidate's probability of a hit, given that the trials before it missed.

    Args:
        belief: Of displacements, before it is known that they missed.
        missed: What M trials missed.
        candidates: What n candidates are to hit.
        outlier: Probability that a miss says nothing.
        seed: Of the draws.
    """
    _, k, n = belief.mean.shape
    normal = _normal(k, len(missed.aims) + 1, seed)
    hits, total = np.zeros(n), 0.0
    for model in np.flatnonzero(belief.share > _LEAST_SHARE):
        draws = max(_FEWEST, math.ceil(_DRAWS * belief.share[model]))
        share, drawn = belief.share[model] / draws, normal[:, :draws]
        # Conditions that are the same have a singular covariance: a root by eigenvectors.
        values, vectors = np.linalg.eigh(belief.among_missed[model])
        root = np.sqrt(np.maximum(values, _SINGULAR * values[:, -1:]))[:, None]
        onto = np.swapaxes(belief.cross[model] @ (vectors / root), 1, 2)
        left = np.maximum(belief.variance[model] - np.square(onto).sum(axis=1), 0.0)
        of_missed = drawn[..., :-1] @ np.swapaxes(vectors * root, 1, 2)
        of_candidates = drawn[..., :-1] @ onto + np.sqrt(left)[:, None] * drawn[..., -1:]
        would_hit = missed.share_within(belief.at_missed[model][:, None] + of_missed)
        weight = np.prod(1.0 - (1.0 - outlier) * would_hit, axis=1)
        hits += share * (
            weight @ candidates.share_within(belief.mean[model][:, None] + of_candidates)
        )
        total += share * weight.sum()
    return np.asarray(hits / total)


def share_within(
    radius: float | Float[np.ndarray, " n"],
    mean: Float[np.ndarray, "m k n"],
    sd: Float[np.ndarray, "m k n"],
) -> Float[np.ndarray, "m n"]:
    """Probability that independent normal numbers lie in the ball around 0, or in one each.

    One component after another, each between what the ones before leave of the ball: exact for k =
    1, and smooth in everything. Source: Genz, Numerical computation of multivariate normal
    probabilities, 1992, for a box; the ball is ours.
    """
    from scipy.special import ndtr, ndtri

    k = mean.shape[1]
    points = evenly_spread(k - 1)
    square = np.square(radius)[..., None]
    left = np.broadcast_to(square, (*mean[:, 0].shape, len(points)))
    inside = np.ones_like(left)
    for j in range(k):
        reach, middle, spread = np.sqrt(left), mean[:, j, :, None], sd[:, j, :, None]
        low, high = ndtr((-reach - middle) / spread), ndtr((reach - middle) / spread)
        inside = inside * (high - low)
        if j < k - 1:
            at = middle + spread * ndtri(np.clip(low + (high - low) * points[:, j], 1e-300, 1.0))
            left = np.maximum(left - np.square(np.clip(at, -reach, reach)), 0.0)
    return np.asarray(inside.mean(axis=-1))


@functools.lru_cache
def evenly_spread(k: int) -> Float[np.ndarray, "q k"]:
    """Points that fill the unit cube evenly: additive recurrence by the root of x^(k+1) = x + 1.

    Source: Roberts, The unreasonable effectiveness of quasirandom sequences, 2018.
    """
    root = 2.0
    for _ in range(50):
        root = (1.0 + root) ** (1.0 / (k + 1))
    return np.asarray(
        (0.5 + np.arange(1, _POINTS + 1)[:, None] * root ** -np.arange(1.0, k + 1)) % 1
    )


@functools.lru_cache
def _normal(k: int, size: int, seed: int) -> Float[np.ndarray, "k q s"]:
    """The same draws for every call, so that a proposal depends on what was observed alone."""
    return np.random.default_rng(seed).standard_normal((k, _DRAWS, size))

"""What trials that missed tell of the next: the probability of a hit, given that those missed.

A miss says that an error lies outside of a ball, which no interval and no Gaussian says. So the
displacements at the conditions that missed are drawn, each draw is weighed by the probability that
all of them would have missed, and a candidate's displacement follows from each draw:

    P(hit at c | misses) = sum_q w_q P(|d_c - aim_c| < radius | draw q) / sum_q w_q,
    w_q = prod_i [(1 - e) P(|d_i - aim_i| > radius_i | draw q) + e]

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
from scipy.special import ndtr

from prior_reinforce.arrays import Points

_DRAWS = 512
"""Of all models together (ours): a probability then has a standard error of 0.02 at most."""
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


def p_hit_after(
    belief: Belief,
    missed: Float[np.ndarray, "M k"],
    radii: Float[np.ndarray, " M"],
    aims: Points,
    radius: float,
    execution_sd: float,
    outlier: float,
) -> Float[np.ndarray, " n"]:
    """Return each candidate's probability of a hit, given that the trials before it missed.

    Args:
        belief: Of displacements, before it is known that they missed.
        missed: Which displacements would have hit, of each of M trials: goal minus condition.
        radii: How far from those they missed at least.
        aims: The same of the candidates, shape (n, k).
        radius: Within which a candidate hits.
        execution_sd: Standard deviation of an execution, which blurs both radii.
        outlier: Probability that a miss says nothing.
    """
    _, k, n = belief.mean.shape
    normal = _normal(k, len(missed) + 1)
    hits, total = np.zeros(n), 0.0
    for model in np.flatnonzero(belief.share > _LEAST_SHARE):
        draws = max(_FEWEST, math.ceil(_DRAWS * belief.share[model]))
        share, drawn = belief.share[model] / draws, normal[:, :draws]
        # Conditions that are the same have a singular covariance: a root by eigenvectors.
        values, vectors = np.linalg.eigh(belief.among_missed[model])
        root = np.sqrt(np.maximum(values, _SINGULAR * values[:, -1:]))[:, None]
        factor = vectors * root
        onto = np.swapaxes(belief.cross[model] @ (vectors / root), 1, 2)
        left = np.maximum(belief.variance[model] - np.square(onto).sum(axis=1), 0.0)
        there = belief.at_missed[model][:, None] + drawn[..., :-1] @ np.swapaxes(factor, 1, 2)
        here = belief.mean[model][:, None] + drawn[..., :-1] @ onto
        here += np.sqrt(left)[:, None] * drawn[..., -1:]
        beside = (_distance(there, missed) - radii) / execution_sd
        weight = np.prod((1.0 - outlier) * ndtr(beside) + outlier, axis=1)
        inside = ndtr((radius - _distance(here, aims)) / execution_sd)
        hits += share * (weight @ inside)
        total += share * weight.sum()
    return np.asarray(hits / total)


def _distance(
    drawn: Float[np.ndarray, "k q p"], aims: Float[np.ndarray, "p k"]
) -> Float[np.ndarray, "q p"]:
    """How far each draw is from what would hit."""
    return np.asarray(np.sqrt(np.square(drawn - aims.T[:, None]).sum(axis=0)))


@functools.lru_cache
def _normal(k: int, size: int) -> Float[np.ndarray, "k q s"]:
    """The same draws for every call, so that a proposal depends on what was observed alone."""
    return np.random.default_rng(0).standard_normal((k, _DRAWS, size))

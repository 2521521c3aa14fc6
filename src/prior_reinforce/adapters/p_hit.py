"""The probability of a hit, and what trials that missed tell of it.

Under each history displacements are, in each component by itself, a mixture of normal
distributions; the probability of a hit is the share of their product that lies in a ball
(`share_within`).

A miss says that an error lies outside of a ball, which no interval and no Gaussian says. So the
displacements at the conditions that missed are drawn, each draw is weighed by the probability that
all of them would have missed, and a candidate's displacement follows from each draw:

    P(hit at c | misses) = sum_q w_q P(|d_c - aim_c| < 1 | draw q) / sum_q w_q,
    w_q = prod_i [1 - (1 - e) P(|d_i - aim_i| < 1 | draw q)],  lengths in tolerances

With a share e of trials whose result says nothing. Where only one condition is concerned this is
the search for a lost object: what was searched is unlikely, so search beside it.

Source: Koopman, The theory of search, Operations Research 4 and 5, 1956-57, for the idea; the
importance weights are standard (Robert and Casella, Monte Carlo Statistical Methods, 2004, 3.3).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.adapters.memory import Memory

_TRIALS_AFTER_A_MISS = 1.24
"""Fitted to 1623 trials of tuning material (ours; reproduction/docs/decisions-adapter.md)."""
_LEAST_P_HIT = 0.01
"""Below, nobody knows how many trials it takes (ours). Where "a miss" was all that was told,
1 / P(hit) are expected: such a trial teaches little. That is still too few: 8 to 13 where 14 were
needed (tuning fields)."""
_CELLS = 64
"""Into which a ball is cut along all components but the last, at most (ours)."""
_ALL_CELLS = 32768
"""of all those components together, and of all candidates where they are several (ours): right to
0.006 for k up to 4 of one candidate; of a hundred, for k = 3 and 4, to 0.005 and 0.07."""
_DRAWS = (1024, 8192)
"""Of all histories together, where many candidates are compared, and of one or two (ours). After
six misses the standard error of P(hit) is 0.02 with two components, 0.07 with one, at 1,024 (twelve
sets, twenty seeds)."""
_EVALUATED = 200_000
"""Draws times candidates, between those two (ours)."""
_FEWEST = 64
"""Draws of an improbable history, which may be the one that explains the misses (ours)."""
_EDGE = 0.1
"""Blur of a ball's edge, in radii (ours): so that few draws tell small differences."""
_SINGULAR = 1e-9
"""Eigenvalues of a covariance are this share of the greatest at least."""


_NO_SHARE = 1e-9
"""Probability of a model below which it is left out of P(hit) (ours)."""


@dataclass(frozen=True, eq=False)
class Belief:
    """Displacements at n candidates and M missed conditions, under each of m models."""

    probability: float
    """Of the history that it follows from."""
    share: Float[np.ndarray, "m k"]
    """Probability of each model, for each component."""
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
    radii: Float[np.ndarray, "p k"]
    """Tolerances of the components: half-axes."""

    def share_within(self, drawn: Float[np.ndarray, "k q p"]) -> Float[np.ndarray, "q p"]:
        """Probability that each draw hits: 0 or 1, but for a blurred edge."""
        from scipy.special import ndtr  # as in `expectation_propagation`

        off = (drawn - self.aims.T[:, None]) / self.radii.T[:, None]
        return np.asarray(ndtr((1.0 - np.sqrt(np.square(off).sum(axis=0))) / _EDGE))


def p_hit_after(
    beliefs: Sequence[Belief], missed: Targets, candidates: Targets, outlier: float, seed: int = 0
) -> Float[np.ndarray, " n"]:
    """Return each candidate's probability of a hit, given that the trials before it missed.

    Args:
        beliefs: Of displacements, before it is known that they missed.
        missed: What M trials missed.
        candidates: What n candidates are to hit.
        outlier: Probability that a miss says nothing.
        seed: Of the draws.
    """
    _, k, n = beliefs[0].mean.shape
    hits, total = np.zeros(n), 0.0
    most = int(np.clip(_EVALUATED // n, *_DRAWS))
    for belief in beliefs:
        draws = max(_FEWEST, math.ceil(most * belief.probability))
        normal = standard_normal((k, _DRAWS[1] + 1, len(missed.aims) + 1), seed)[:, :draws]
        of_missed = np.empty((k, draws, len(missed.aims)))
        of_candidates = np.empty((k, draws, n))
        for j in range(k):
            models = _shared_out(belief.share[:, j], draws, seed + j)
            for m in np.unique(models):
                at, drawn = models == m, normal[j, models == m]
                # Conditions that are the same have a singular covariance: a root by eigenvectors.
                values, vectors = np.linalg.eigh(belief.among_missed[m, j])
                root = np.sqrt(np.maximum(values, _SINGULAR * values[-1]))
                onto = (belief.cross[m, j] @ (vectors / root)).T
                left = np.maximum(belief.variance[m, j] - np.square(onto).sum(axis=0), 0.0)
                of_missed[j, at] = belief.at_missed[m, j] + drawn[:, :-1] @ (vectors * root).T
                of_candidates[j, at] = (
                    belief.mean[m, j] + drawn[:, :-1] @ onto + drawn[:, -1:] * np.sqrt(left)
                )
        hit, weight = weighed_hits(of_missed, missed, of_candidates, candidates, outlier)
        share = belief.probability / draws
        hits += share * hit
        total += share * weight
    return np.asarray(hits / total)


def weighed_hits(
    drawn_missed: Float[np.ndarray, "k q M"],
    missed: Targets,
    drawn: Float[np.ndarray, "k q n"],
    candidates: Targets,
    outlier: float,
) -> tuple[Float[np.ndarray, " n"], float]:
    """Return the sums over draws of w_q P(hit | draw q), for each candidate, and of w_q.

    Args:
        drawn_missed: What M trials that missed would do, in q draws.
        missed: What they missed.
        drawn: What n candidates would do, in the same draws.
        candidates: What these are to hit.
        outlier: e, probability that a miss says nothing.
    """
    weight = np.prod(1.0 - (1.0 - outlier) * missed.share_within(drawn_missed), axis=1)
    return weight @ candidates.share_within(drawn), float(weight.sum())


def share_within(
    mean: Float[np.ndarray, "m k n"],
    sd: Float[np.ndarray, "m k n"],
    share: Float[np.ndarray, "m k"],
) -> Float[np.ndarray, " n"]:
    """Probability that independent numbers lie in the unit ball around 0.

    Each number has a distribution that is a mixture of m normal ones. The ball is cut into cells
    along one component after another; the last is exact.
    """
    from scipy.special import ndtr

    _, k, n = mean.shape
    each = _ALL_CELLS / (max(n, 1) if k > 2 else 1)
    cells = max(4, min(_CELLS, round(each ** (1.0 / max(k - 1, 1)))))
    edges = np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, cells + 1))
    middles = np.sin(0.5 * np.pi * (np.arange(cells) + 0.5) / cells * 2.0 - 0.5 * np.pi)

    def below(values: Float[np.ndarray, "..."], j: int) -> Float[np.ndarray, "..."]:
        column, used = (-1, len(values), *(1,) * (values.ndim - 1)), share[:, j] > _NO_SHARE
        middle, spread = mean[used, j].reshape(column), sd[used, j].reshape(column)
        return np.asarray(np.tensordot(share[used, j], ndtr((values - middle) / spread), axes=1))

    def inside(left: Float[np.ndarray, "..."], j: int) -> Float[np.ndarray, "..."]:
        if j == k - 1:
            return below(left, j) - below(-left, j)
        in_cell = np.diff(below(left[..., None] * edges, j), axis=-1)
        rest = left[..., None] * np.sqrt(1.0 - middles**2)
        return np.asarray(np.sum(in_cell * inside(rest, j + 1), axis=-1))

    return np.clip(inside(np.ones(mean.shape[2:]), 0), 0.0, 1.0)


@functools.lru_cache
def standard_normal(shape: tuple[int, ...], seed: int) -> Float[np.ndarray, "..."]:
    """The same draws for every call, so that a proposal depends on what was observed alone."""
    return np.random.default_rng(seed).standard_normal(shape)


def _shared_out(share: Float[np.ndarray, " m"], draws: int, seed: int) -> Int[np.ndarray, " q"]:
    """A model for each draw, in proportion, and in an order of its own for each component."""
    evenly = (np.random.default_rng(seed).permutation(draws) + 0.5) / draws
    return np.minimum(np.searchsorted(np.cumsum(share), evenly), len(share) - 1)


def trials_to_go(p_hit: float, told: Memory) -> float | None:
    """Trials that are expected to the next hit, that one included, after those that were told.

    None where a hit is next to impossible.
    """
    if p_hit < _LEAST_P_HIT:
        return None
    of_goal = told.only(np.all(told.goals == told.goals[-1:], axis=1))
    bare = of_goal.missed & np.all(np.isinf(of_goal.high - of_goal.low), 1)
    if len(bare) and np.all(bare):
        return 1.0 / p_hit
    return 1.0 + _TRIALS_AFTER_A_MISS * (1.0 - p_hit)

"""The probability of a hit, and what earlier misses say about it.

Under each hypothesis every component of a displacement has a mixture of normal distributions,
independent of the other components. The probability of a hit is the probability of a ball under
their product (`ball_probability`).

A miss says that an error lies outside of a ball, which neither an interval nor a Gaussian can
express. So the displacements at the conditions that missed are sampled, each sample is weighted by
the probability that all of these trials miss, and the displacements of candidates are sampled given
them:

    P(hit at c | misses) = sum_q w_q P(|d_c - centre_c| < 1 | sample q) / sum_q w_q,
    w_q = prod_i [1 - (1 - e) P(|d_i - centre_i| < 1 | sample q)],  lengths in tolerances

A share e of misses says nothing. With a single condition this is the search for a lost object: what
was searched is unlikely, so search beside it.

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
"""Least P(hit) for which a number of trials is expected (ours). If "a miss" was all that was told,
1 / P(hit) are expected: such a trial teaches little. That is still too few: 8 to 13 where 14 were
needed (tuning fields)."""
_CELLS = 64
"""Most cells of a ball along each component but the last (ours)."""
_ALL_CELLS = 32768
"""Most cells along all those components together, shared by several candidates (ours): right to
0.006 for k up to 4 of one candidate; of a hundred, for k = 3 and 4, to 0.005 and 0.07."""
_SAMPLES = (1024, 8192)
"""Samples of all hypotheses together, for many candidates and for one or two (ours). After six
misses the standard error of P(hit) is 0.02 with two components, 0.07 with one, at 1,024 (twelve
sets, twenty seeds)."""
_EVALUATED = 200_000
"""Samples times candidates, between those two (ours)."""
_FEWEST = 64
"""Fewest samples of an improbable hypothesis, which may explain the misses (ours)."""
_EDGE = 0.1
"""Blur of a ball's edge, in radii (ours): small differences show in few samples."""
_SINGULAR = 1e-9
"""Least eigenvalue of a covariance, as a share of the greatest."""
_NEGLIGIBLE = 1e-9
"""Probability of a model below which it is left out of P(hit) (ours)."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Displacements at n candidates and M missed conditions, under each of m models."""

    probability: float
    """Of the hypothesis that it follows from."""
    model_weights: Float[np.ndarray, "m k"]
    """Probability of each model, for each component."""
    missed_mean: Float[np.ndarray, "m k M"]
    missed_covariance: Float[np.ndarray, "m k M M"]
    mean: Float[np.ndarray, "m k n"]
    """At the candidates."""
    variance: Float[np.ndarray, "m k n"]
    """At the candidates."""
    cross: Float[np.ndarray, "m k n M"]
    """Covariances of candidates with missed conditions."""


@dataclass(frozen=True, eq=False)
class Targets:
    """Ellipsoids of the displacements that hit, at p conditions."""

    centres: Float[np.ndarray, "p k"]
    """Goal minus condition."""
    radii: Float[np.ndarray, "p k"]
    """Half-axes: tolerances of the components."""

    def p_hit(self, samples: Float[np.ndarray, "k q p"]) -> Float[np.ndarray, "q p"]:
        """Return the probability that each sample hits: 0 or 1, but for a blurred edge."""
        from scipy.special import ndtr  # as in `expectation_propagation`

        off = (samples - self.centres.T[:, None]) / self.radii.T[:, None]
        return np.asarray(ndtr((1.0 - np.sqrt(np.square(off).sum(axis=0))) / _EDGE))


def p_hit_given_misses(
    predictions: Sequence[Prediction],
    missed: Targets,
    candidates: Targets,
    outlier: float,
    seed: int = 0,
) -> Float[np.ndarray, " n"]:
    """Return each candidate's probability of a hit, given that earlier trials missed.

    Args:
        predictions: One for each hypothesis, before the misses are known.
        missed: Targets of the M misses.
        candidates: Targets of the n candidates.
        outlier: Probability that a miss says nothing.
        seed: Of the samples.
    """
    (_, k, n), n_missed = predictions[0].mean.shape, len(missed.centres)
    hits, total = np.zeros(n), 0.0
    most = int(np.clip(_EVALUATED // n, *_SAMPLES))
    for prediction in predictions:
        n_samples = max(_FEWEST, math.ceil(most * prediction.probability))
        normal = standard_normal((k, _SAMPLES[1] + 1, n_missed + 1), seed)[:, :n_samples]
        at_missed, at_candidates = np.empty((k, n_samples, n_missed)), np.empty((k, n_samples, n))
        for j in range(k):
            models = _sample_models(prediction.model_weights[:, j], n_samples, seed + j)
            for m in np.unique(models):
                own, z = models == m, normal[j, models == m]
                # Equal conditions have a singular covariance: its root is found by eigenvectors.
                values, vectors = np.linalg.eigh(prediction.missed_covariance[m, j])
                root = np.sqrt(np.maximum(values, _SINGULAR * values[-1]))
                gain = (prediction.cross[m, j] @ (vectors / root)).T
                left = np.maximum(prediction.variance[m, j] - np.square(gain).sum(axis=0), 0.0)
                at_missed[j, own] = prediction.missed_mean[m, j] + z[:, :-1] @ (vectors * root).T
                at_candidates[j, own] = (
                    prediction.mean[m, j] + z[:, :-1] @ gain + z[:, -1:] * np.sqrt(left)
                )
        hit, weight = weighted_hits(at_missed, missed, at_candidates, candidates, outlier)
        share = prediction.probability / n_samples
        hits += share * hit
        total += share * weight
    return np.asarray(hits / total)


def weighted_hits(
    at_missed: Float[np.ndarray, "k q M"],
    missed: Targets,
    at_candidates: Float[np.ndarray, "k q n"],
    candidates: Targets,
    outlier: float,
) -> tuple[Float[np.ndarray, " n"], float]:
    """Return the sums over samples of w_q P(hit | sample q), for each candidate, and of w_q.

    Args:
        at_missed: q samples at the M conditions that missed.
        missed: Their targets.
        at_candidates: The same samples at n candidates.
        candidates: Their targets.
        outlier: e, probability that a miss says nothing.
    """
    weight = np.prod(1.0 - (1.0 - outlier) * missed.p_hit(at_missed), axis=1)
    return weight @ candidates.p_hit(at_candidates), float(weight.sum())


def ball_probability(
    mean: Float[np.ndarray, "m k n"],
    sd: Float[np.ndarray, "m k n"],
    model_weights: Float[np.ndarray, "m k"],
) -> Float[np.ndarray, " n"]:
    """Return the probability that k independent numbers lie in the unit ball around 0.

    Each number has a mixture of m normal distributions. The ball is cut into cells along one
    component after another; the last is exact.
    """
    from scipy.special import ndtr

    _, k, n = mean.shape
    budget = _ALL_CELLS / (max(n, 1) if k > 2 else 1)
    cells = max(4, min(_CELLS, round(budget ** (1.0 / max(k - 1, 1)))))
    edges = np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, cells + 1))
    middles = np.sin(0.5 * np.pi * (np.arange(cells) + 0.5) / cells * 2.0 - 0.5 * np.pi)

    def cdf(values: Float[np.ndarray, "..."], j: int) -> Float[np.ndarray, "..."]:
        used = model_weights[:, j] > _NEGLIGIBLE
        column = (-1, len(values), *(1,) * (values.ndim - 1))
        of_model = ndtr((values - mean[used, j].reshape(column)) / sd[used, j].reshape(column))
        return np.asarray(np.tensordot(model_weights[used, j], of_model, axes=1))

    def inside(radius: Float[np.ndarray, "..."], j: int) -> Float[np.ndarray, "..."]:
        if j == k - 1:
            return cdf(radius, j) - cdf(-radius, j)
        in_cell = np.diff(cdf(radius[..., None] * edges, j), axis=-1)
        rest = radius[..., None] * np.sqrt(1.0 - middles**2)
        return np.asarray(np.sum(in_cell * inside(rest, j + 1), axis=-1))

    return np.clip(inside(np.ones(mean.shape[2:]), 0), 0.0, 1.0)


@functools.lru_cache
def standard_normal(shape: tuple[int, ...], seed: int) -> Float[np.ndarray, "..."]:
    """Return the same samples in every call: a proposal depends on the observations alone."""
    return np.random.default_rng(seed).standard_normal(shape)


def _sample_models(
    model_weights: Float[np.ndarray, " m"], n_samples: int, seed: int
) -> Int[np.ndarray, " q"]:
    """Stratified samples of models, in random order."""
    quantiles = (np.random.default_rng(seed).permutation(n_samples) + 0.5) / n_samples
    models = np.searchsorted(np.cumsum(model_weights), quantiles)
    return np.minimum(models, len(model_weights) - 1)


def expected_trials(p_hit: float, memory: Memory) -> float | None:
    """Return the expected number of trials until the next hit, that one included.

    None if a hit is next to impossible.
    """
    if p_hit < _LEAST_P_HIT:
        return None
    of_goal = memory.select(np.all(memory.goals == memory.goals[-1:], axis=1))
    bare = of_goal.missed & np.all(np.isinf(of_goal.high - of_goal.low), 1)
    if len(bare) and np.all(bare):
        return 1.0 / p_hit
    return 1.0 + _TRIALS_AFTER_A_MISS * (1.0 - p_hit)

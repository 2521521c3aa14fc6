r"""Prior of the displacement between condition and outcome, before any trial.

A plan for c mixes the demonstrated plans by weights w(c) (`plans.outcome_weights`). Let F be the
error of the generator as a function of the outcome asked for. A mixture cancels the part of F that
its weights reproduce:

    d(c) = sum_i w_i(c) e_i + F(c) - sum_i w_i(c) F(r_i) + h(c) + noise,    F ~ GP(0, a^2 K)

e_i is the error of the outcome of demonstration i: its label is uncertain, and it was a single
execution. h is what has changed since the day of the demonstrations. The noise differs between
executions. F less its mixture is zero at demonstrations, grows away from them, and has no affine
part, which the weights reproduce.

The size a and the standard deviations of h and of the noise are unknown for a new arm. Each
combination is a model, for each component separately: range may be far off where direction is not.

Source: ours; K is Matern's kernel of order 5/2 (Rasmussen and Williams, Gaussian Processes for
Machine Learning, 2006, eq. 4.17). The figures are in reproduction/docs/decisions-adapter.md.
"""

from __future__ import annotations

import copy
import itertools
from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np
from jaxtyping import Float

from prior_reinforce.adapters.normalisation import Normalisation
from prior_reinforce.arrays import Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.outcome_weights import smooth_weights
from prior_reinforce.settings import Checked, Positive

Sizes = Annotated[tuple[Positive, ...], msgspec.Meta(min_length=1)]
Probability = Annotated[float, msgspec.Meta(gt=0, lt=1)]

_SIZE_ODDS = 2 / 3
"""Prior probability of a size relative to the next smaller one (ours): before there are readings,
P(hit) is too low with equal odds, and too high with 1 / 2."""
_LONGEST_WEIGHTS = 10.0
"""Length of the weights beyond which displacements do not grow (ours): two demonstrations a tenth
of a millimetre apart have weights of 500 beside them, which are rounding. Inside a hull it is about
1."""
_CACHED = 8
"""Sets of conditions whose terms are cached (ours): those in memory are queried again and again."""
_Terms = tuple[
    Float[np.ndarray, "p N"],
    Float[np.ndarray, "p N"],
    Float[np.ndarray, " p"],
    Float[np.ndarray, "k p"],
]


@dataclass(frozen=True)
class BayesianConfig(Checked):
    """Settings of `BayesianAdapter`, in units of S, the demonstrations' spread (`Normalisation`).

    Where there are several values, each combination is a model, weighed by its evidence; the prior
    probability of a size is two thirds of that of the one before it.
    """

    generator_sd: Sizes = (0.05, 0.2, 0.8)
    """a, sd of the generator's error between demonstrations."""
    generator_reach: Positive = 1.4
    """Length scale of that error."""
    hardware_sd: tuple[Positive, Positive] = (0.01, 0.3)
    """Sd of h, the difference from the day of the demonstrations: with unchanged hardware, and with
    changed hardware."""
    hardware_reach: Positive = 2.5
    """Length scale of h: shift and stretch."""
    p_changed: Probability = 0.2
    """Prior probability that hardware was changed since the demonstrations."""
    shift_sd: Positive = 0.8
    """Sd of the shift of all outcomes when table, object or camera move."""
    p_change: Probability = 0.02
    """Probability of an unannounced change between two trials: a shift of all outcomes, or changed
    hardware, with equal odds."""
    p_misplaced: Probability = 0.002
    """Probability that one goal is moved unannounced between two trials."""
    p_mistaken: Probability = 0.01
    """Probability that a trial is reported wrongly: a mistyped number, a lost ball."""
    execution_sd: Sizes = (0.005, 0.02, 0.05)
    """Sd of the outcomes of one plan, or of neighbouring plans: 3 to 4 mm where the spread is 12 to
    18 cm, on our tasks."""
    outlier: Probability = 0.002
    """Probability that one component of a reading says nothing."""


class DisplacementPrior:
    """Prior means and covariances of displacements under each of m models."""

    def __init__(self, config: BayesianConfig, demonstrations: Demonstrations) -> None:
        """Take the settings and the demonstrations."""
        self.config = config
        self.normalisation = Normalisation.of(demonstrations)
        same, changed = config.hardware_sd
        hardware = ((same, 1.0 - config.p_changed), (changed, config.p_changed))
        sizes = enumerate(config.generator_sd), hardware, enumerate(config.execution_sd)
        grid = [
            (a, b, noise, p * _SIZE_ODDS ** (i + j))
            for (i, a), (b, p), (j, noise) in itertools.product(*sizes)
        ]
        a, b, noise, share = np.array(grid).T
        self.generator_variance, self._hardware_variance = a**2, b**2
        self.noise_variance = noise**2
        self.log_prior: Float[np.ndarray, " m"] = np.log(share / share.sum())
        """Log probability of each model."""
        self._set_demonstrations(
            self.normalisation.apply(demonstrations.outcomes_seen),
            demonstrations.outcome_noise / self.normalisation.scale,
            demonstrations.outcome_correction / self.normalisation.scale,
        )

    def with_demonstration(self, outcome: Float[np.ndarray, "1 k"]) -> DisplacementPrior:
        """Return it with one more demonstration, whose noise is the mean of the others'."""
        other = copy.copy(self)
        other._set_demonstrations(
            np.vstack([self._outcomes, outcome]),
            np.vstack([self._noise, self._noise.mean(axis=0)]),
            np.vstack([self._correction, self.mean(outcome).T]),
        )
        return other

    def _set_demonstrations(self, outcomes: Points, noise: Points, correction: Points) -> None:
        """Take normalised outcomes, their standard deviations and their expected errors."""
        self._outcomes, self._noise, self._correction = outcomes, noise, correction
        scale = self.normalisation.scale
        self._weights = smooth_weights(self.normalisation.undo(outcomes), noise=noise * scale)
        self._label_variance = np.mean(noise**2, axis=1)
        self._cache: dict[bytes, _Terms] = {}

    def mean(self, at: Float[np.ndarray, "p k"]) -> Float[np.ndarray, "k p"]:
        """Return the prior mean of displacements, the same under each model."""
        return self._terms(at)[3]

    def covariance(
        self, a: Float[np.ndarray, "p k"], b: Points, *, hardware: bool = True
    ) -> Float[np.ndarray, "m p n"]:
        """Return prior covariances without noise, with or without h."""
        (w_a, mixed_a, s_a, _), (w_b, mixed_b, s_b, _) = self._terms(a), self._terms(b)
        generator = (
            matern(a, b, self.config.generator_reach) * np.outer(s_a, s_b)
            - mixed_a @ w_b.T
            - w_a @ mixed_b.T
        )
        covariance = self.generator_variance[:, None, None] * generator
        covariance = covariance + (w_a * self._label_variance) @ w_b.T
        covariance += self.noise_variance[:, None, None] * (w_a @ w_b.T)
        if hardware:
            h = rbf(a, b, self.config.hardware_reach)
            covariance += self._hardware_variance[:, None, None] * h
        return np.asarray(covariance)

    def variance(
        self, at: Float[np.ndarray, "p k"], *, hardware: bool = True
    ) -> Float[np.ndarray, "m p"]:
        """Return the prior variance of the displacement of one execution, noise included."""
        w, mixed, s, _ = self._terms(at)
        generator = np.maximum(s**2 - 2.0 * np.sum(w * mixed, axis=1), 0.0)
        variance = self.generator_variance[:, None] * generator
        variance = variance + np.square(w) @ self._label_variance
        variance += self.noise_variance[:, None] * (1.0 + np.square(w).sum(axis=1))
        return np.asarray(variance + (hardware * self._hardware_variance)[:, None])

    def hardware_change(self, a: Float[np.ndarray, "p k"], b: Points) -> Float[np.ndarray, "p n"]:
        """Return the covariance that one change of hardware adds."""
        return self.config.hardware_sd[1] ** 2 * rbf(a, b, self.config.hardware_reach)

    def _terms(self, at: Float[np.ndarray, "p k"]) -> _Terms:
        """Return s w, s (K(at, r) - w K(r, r) / 2), s, and the mean, r being demonstrated outcomes.

        The factor s is 1 unless weights are longer than `_LONGEST_WEIGHTS`.
        """
        key = at.tobytes()
        if key not in self._cache:
            if len(self._cache) >= _CACHED:
                self._cache.pop(next(iter(self._cache)))
            outcomes, w = self._outcomes, self._weights(self.normalisation.undo(at))
            reach = self.config.generator_reach
            mixed = matern(at, outcomes, reach) - 0.5 * w @ matern(outcomes, outcomes, reach)
            s = np.minimum(1.0, _LONGEST_WEIGHTS / np.linalg.norm(w, axis=1))
            self._cache[key] = s[:, None] * w, s[:, None] * mixed, s, (w @ self._correction).T
        return self._cache[key]


def matern(a: Float[np.ndarray, "p k"], b: Points, reach: float) -> Float[np.ndarray, "p n"]:
    """Return Matern's kernel of order 5/2 of the distances from a to b."""
    square = 5.0 * _squared(a, b) / reach**2
    root = np.sqrt(square)
    return np.asarray((1.0 + root + square / 3.0) * np.exp(-root))


def rbf(a: Float[np.ndarray, "p k"], b: Points, reach: float) -> Float[np.ndarray, "p n"]:
    """Return exp(-d^2 / (2 reach^2)), d the distance from a to b."""
    return np.asarray(np.exp(-0.5 * _squared(a, b) / reach**2))


def _squared(a: Float[np.ndarray, "p k"], b: Points) -> Float[np.ndarray, "p n"]:
    return np.asarray(np.square(a[:, None] - b[None]).sum(axis=-1))

r"""What is believed, before any trial, of the displacement between condition and outcome.

A plan for c mixes the demonstrated plans by weights w(c) (`plans.outcome_weights`). Where it lands
is some function F of the outcome that was asked for, F(r_i) for demonstration i, and a mixture is
off by what its weights do not carry over:

    d(c) = sum_i w_i(c) e_i + F(c) - sum_i w_i(c) F(r_i) + h(c) + noise,    F ~ GP(0, a^2 K)

e_i is by how much the outcome of demonstration i is off: what was seen of it is uncertain, and it
was one execution. h is what is different from their day, and the noise what differs from one
execution to the next. F less its mixture is zero at demonstrations,
grows away from them, and has no affine part, which the weights reproduce.

Of no arm are the size a, the size of h and that of the noise known beforehand. All combinations are
models, for each component by itself: range may be far off where direction is not.

Source: ours; K is Matern's kernel of order 5/2 (Rasmussen and Williams, Gaussian Processes for
Machine Learning, 2006, eq. 4.17). The figures are in reproduction/docs/decisions-adapter.md.
"""

from __future__ import annotations

import copy
import itertools
from dataclasses import dataclass
from typing import Annotated, Any

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

_LESS = 2 / 3
"""How probable a size is beforehand, relative to the next smaller one (ours): equal odds say too
little of a hit before there are readings, half as probable too much."""
_STEEPEST = 10.0
"""Length of the weights beyond which displacements are not believed to grow (ours): two
demonstrations a tenth of a millimetre apart have weights of 500 beside them, and rounding is all
that is left then. Inside a hull it is about 1."""
_REMEMBERED = 8
"""Sets of places whose weights are remembered (ours): trials in memory are asked about again and
again."""
_AtPlaces = tuple[
    Float[np.ndarray, "p N"],
    Float[np.ndarray, "p N"],
    Float[np.ndarray, " p"],
    Float[np.ndarray, "k p"],
]


@dataclass(frozen=True)
class BayesianConfig(Checked):
    """Settings of `BayesianAdapter`, in units of S, the demonstrations' spread (`Normalisation`).

    Where there are several values, all combinations are models, and their evidence weighs them; of
    sizes each is beforehand two thirds as probable as the one before.
    """

    generator_sd: Sizes = (0.05, 0.2, 0.8)
    """a, by how much landing bends between demonstrations."""
    generator_reach: Positive = 1.4
    """How far that reaches."""
    hardware_sd: tuple[Positive, Positive] = (0.01, 0.3)
    """What is different from the demonstrations' day: where nothing was changed, and where
    something was."""
    hardware_reach: Positive = 2.5
    """How far that reaches: shift and stretch."""
    p_changed: Probability = 0.2
    """Beforehand, the probability that something was changed."""
    shift_sd: Positive = 0.8
    """By how much everything may be shifted when table, object or camera move."""
    p_change: Probability = 0.02
    """Probability that something changes between two trials, unsaid: a shift of everything, or as
    `hardware_sd` says, with equal odds."""
    p_misplaced: Probability = 0.002
    """Probability that one goal's place changes between two trials, unsaid."""
    p_mistaken: Probability = 0.01
    """Probability that a trial is told wrongly: a mistyped number, a lost ball."""
    execution_sd: Sizes = (0.005, 0.02, 0.05)
    """How far apart outcomes of one plan, or of plans next to each other, lie: 3 to 4 mm where the
    spread is 12 to 18 cm, on our tasks."""
    outlier: Probability = 0.002
    """Probability that one component of a reading says nothing."""


class DisplacementPrior:
    """Means and covariances of displacements under each of m models; demonstrations fix them."""

    def __init__(self, config: BayesianConfig, demonstrations: Demonstrations) -> None:
        """Take the settings, and what was demonstrated."""
        self.config = config
        self.normalisation = Normalisation.of(demonstrations)
        same, changed = config.hardware_sd
        hardware = ((same, 1.0 - config.p_changed), (changed, config.p_changed))
        sizes = enumerate(config.generator_sd), hardware, enumerate(config.execution_sd)
        grid = [
            (a, b, noise, p * _LESS ** (i + j))
            for (i, a), (b, p), (j, noise) in itertools.product(*sizes)
        ]
        a, b, noise, share = np.array(grid).T
        self._square, self._hardware, self.noise = a**2, b**2, noise**2
        self.log_share: Float[np.ndarray, " m"] = np.log(share / share.sum())
        """Log probability of each model."""
        self._mix(
            self.normalisation.apply(demonstrations.outcomes_seen),
            demonstrations.outcome_noise / self.normalisation.scale,
            demonstrations.outcome_correction / self.normalisation.scale,
        )

    def with_demonstration(self, outcome: Float[np.ndarray, "1 k"]) -> DisplacementPrior:
        """The same with one demonstration more, seen as the others are on average and near it."""
        other = copy.copy(self)
        other._mix(
            np.vstack([self._demonstrated, outcome]),
            np.vstack([self._noise, self._noise.mean(axis=0)]),
            np.vstack([self._correction, self.mean(outcome).T]),
        )
        return other

    def _mix(self, demonstrated: Points, noise: Points, correction: Points) -> None:
        """Know by which weights demonstrations are mixed, and how far they are off."""
        self._demonstrated, self._noise, self._correction = demonstrated, noise, correction
        outcomes = self.normalisation.undo(demonstrated)
        self._weights = smooth_weights(outcomes, noise=noise * self.normalisation.scale)
        self._label = np.mean(noise**2, axis=1)
        self._asked: dict[bytes, Any] = {}

    def mean(self, at: Float[np.ndarray, "p k"]) -> Float[np.ndarray, "k p"]:
        """Displacements that are expected there, before any trial and under each model."""
        return self._at(at)[3]

    def covariance(
        self, a: Float[np.ndarray, "p k"], b: Points, *, hardware: bool = True
    ) -> Float[np.ndarray, "m p n"]:
        """Between displacements at a and b; with what is different from the demonstrations' day."""
        (w_a, of_a, s_a, _), (w_b, of_b, s_b, _) = self._at(a), self._at(b)
        bent = (
            matern(a, b, self.config.generator_reach) * np.outer(s_a, s_b)
            - of_a @ w_b.T
            - w_a @ of_b.T
        )
        covariance = self._square[:, None, None] * bent + (w_a * self._label) @ w_b.T
        covariance += self.noise[:, None, None] * (w_a @ w_b.T)
        if hardware:
            covariance += self._hardware[:, None, None] * rbf(a, b, self.config.hardware_reach)
        return np.asarray(covariance)

    def variance(
        self, at: Float[np.ndarray, "p k"], *, hardware: bool = True
    ) -> Float[np.ndarray, "m p"]:
        """Of the displacement of an execution at each place."""
        w, left, scaled, _ = self._at(at)
        bent = np.maximum(scaled**2 - 2.0 * np.sum(w * left, axis=1), 0.0)
        of_each = self._square[:, None] * bent + np.square(w) @ self._label
        of_each += self.noise[:, None] * (1.0 + np.square(w).sum(axis=1))
        return np.asarray(of_each + (hardware * self._hardware)[:, None])

    def of_change(self, a: Float[np.ndarray, "p k"], b: Points) -> Float[np.ndarray, "p n"]:
        """Covariance of what changed hardware adds: shift and stretch."""
        return self.config.hardware_sd[1] ** 2 * rbf(a, b, self.config.hardware_reach)

    def _at(self, at: Float[np.ndarray, "p k"]) -> _AtPlaces:
        """S w, how much each demonstration counts, s (K(at, r) - w K(r, r) / 2), s, and the mean.

        s is 1 but where weights are steep: all that is unknown there is scaled down by it.
        """
        key = at.tobytes()
        if key not in self._asked:
            if len(self._asked) >= _REMEMBERED:
                self._asked.pop(next(iter(self._asked)))
            known, w = self._demonstrated, self._weights(self.normalisation.undo(at))
            reach = self.config.generator_reach
            left = matern(at, known, reach) - 0.5 * w @ matern(known, known, reach)
            scaled = np.minimum(1.0, _STEEPEST / np.linalg.norm(w, axis=1))
            expected = (w @ self._correction).T
            self._asked[key] = scaled[:, None] * w, scaled[:, None] * left, scaled, expected
        return self._asked[key]


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

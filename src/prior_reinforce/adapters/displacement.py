"""What is believed, before any trial, of the displacement between condition and outcome.

The model is told in `bayesian.BayesianAdapter`. Displacements at a and b, in normalised units, have
under each of m models the prior covariance

    w(a)' S w(b) + rough^2 K(a, b; .32) + g^2 K(a, b; .5) + h^2 K(a, b; 2.5)

with w the weights of a spline over the demonstrated outcomes, S the variances of their labels, K
the squared-exponential kernel of a reach, and the last term between trials of one hardware alone.
Their prior mean is w(a)' m, with m what the labels say to be off: "10 cm" by eye is 11.25 on
average.

Source: ours; the figures are in docs/decisions-adapter.md.
"""

from __future__ import annotations

import copy
import itertools
import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.arrays import Point, Points
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.normalisation import Normalisation
from prior_reinforce.plans.outcome_weights import smooth_weights


@dataclass(frozen=True)
class BayesianConfig:
    """Settings of `BayesianAdapter`, in units of S, the demonstrations' spread (`Normalisation`).

    Where there are several values, all combinations are models, and their evidence weighs them.
    """

    label_sd: tuple[float, ...] = (0.03, 0.1)
    """How far demonstrated outcomes are off, beside the noise that they state."""
    generator_sd: float = 0.3
    """a, what the generator itself gets wrong, whatever the labels."""
    generator_reach: float = 0.5
    """How far that reaches."""
    p_generator: float = 0.1
    """Beforehand, the probability that it does."""
    rough_sd: float = 0.025
    """What lies between demonstrations."""
    rough_reach: float = 0.32
    """How far that reaches."""
    hardware_sd: tuple[float, float] = (0.03, 0.3)
    """b, what is different from the demonstrations' day: where nothing was changed, and where
    something was."""
    hardware_reach: float = 2.5
    """How far that reaches: shift and stretch."""
    p_changed: float = 0.2
    """Beforehand, the probability that something was changed."""
    execution_sd: float = 0.02
    """How far apart outcomes of one plan lie: 3 to 4 mm where the spread is 12 to 18 cm, as for
    repeated executions on our tasks."""
    outlier: float = 0.01
    """Probability that a reading says nothing: a lost ball, a wrong word."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: A setting is not positive, a probability is 1 or more, or
                `hardware_sd` has not two values.
        """
        for name in ("label_sd", "hardware_sd"):
            if not isinstance(getattr(self, name), tuple):
                raise ConfigurationError(f"{name} must be a tuple, got {getattr(self, name)}")
        for name, value in vars(self).items():
            values = value if isinstance(value, tuple) else (value,)
            if not (values and all(math.isfinite(v) and v > 0 for v in values)):
                raise ConfigurationError(f"{name} must be positive, got {value}")
        for name in ("outlier", "p_generator", "p_changed"):
            if (value := getattr(self, name)) >= 1.0:
                raise ConfigurationError(f"{name} must be below 1, got {value}")
        if len(self.hardware_sd) != 2:
            raise ConfigurationError(
                f"hardware_sd must have two values, unchanged and changed, got {self.hardware_sd}"
            )


class DisplacementPrior:
    """The prior covariance of displacements under each of m models; demonstrations fix it."""

    def __init__(self, config: BayesianConfig, demonstrations: Demonstrations) -> None:
        """Take the settings, and what was demonstrated."""
        self.config = config
        self.normalisation = Normalisation.of(demonstrations)
        generator = ((0.0, 1.0 - config.p_generator), (config.generator_sd, config.p_generator))
        same, changed = config.hardware_sd
        hardware = ((same, 1.0 - config.p_changed), (changed, config.p_changed))
        grid = itertools.product(config.label_sd, generator, hardware)
        models = [(e, a, b, p * q) for e, (a, p), (b, q) in grid]
        e, a, b, share = np.array(models).T
        self._label, self._generator, self._hardware = e**2, a**2, b**2
        self.log_share: Float[np.ndarray, " m"] = np.log(share)
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
        self._stated = np.mean(noise**2, axis=1)

    def mean(self, at: Float[np.ndarray, "p k"]) -> Float[np.ndarray, "k p"]:
        """Displacements that are expected there, before any trial and under each model."""
        return np.asarray((self._mixed_by(at) @ self._correction).T)

    def of_difference(
        self, conditions: Points, other: Point, changes: int
    ) -> Float[np.ndarray, "m n"]:
        """Variance of the difference between displacements here and there."""
        there = other[None]
        cross = self.covariance(conditions, changes, there, changes)[..., 0]
        variance = self.variance(conditions, changes) + self.variance(there, changes)
        return np.asarray(variance - 2.0 * cross)

    def covariance(
        self,
        a: Float[np.ndarray, "p k"],
        after_a: Int[np.ndarray, " p"] | int,
        b: Points,
        after_b: Int[np.ndarray, " n"] | int,
    ) -> Float[np.ndarray, "m p n"]:
        """Between displacements at a and b, each after so many changes of hardware."""
        config = self.config
        square = np.square(a[:, None] - b[None]).sum(axis=-1)
        w_a, w_b = self._mixed_by(a), self._mixed_by(b)
        stated = (w_a * self._stated) @ w_b.T
        rough = config.rough_sd**2 * np.exp(-0.5 * square / config.rough_reach**2)
        generator = np.exp(-0.5 * square / config.generator_reach**2)
        of_a, of_b = np.broadcast_to(after_a, len(a)), np.broadcast_to(after_b, len(b))
        shared = np.where(of_a[:, None] == of_b, self._hardware_of(of_b)[:, None], 0.0)
        return np.asarray(
            stated
            + rough
            + self._label[:, None, None] * (w_a @ w_b.T)
            + self._generator[:, None, None] * generator
            + shared * np.exp(-0.5 * square / config.hardware_reach**2)
        )

    def _hardware_of(self, changes: Int[np.ndarray, " n"]) -> Float[np.ndarray, "m n"]:
        """b^2: before anything is said to be changed it is one of two, afterwards the greater."""
        return np.where(changes == 0, self._hardware[:, None], self.config.hardware_sd[1] ** 2)

    def variance(
        self, at: Float[np.ndarray, "p k"], changes: Int[np.ndarray, " p"] | int
    ) -> Float[np.ndarray, "m p"]:
        """Of the displacement of a trial."""
        squares = np.square(self._mixed_by(at))
        of_all = self.config.rough_sd**2 + squares @ self._stated
        of_each = self._label[:, None] * squares.sum(axis=1)
        hardware = self._hardware_of(np.broadcast_to(changes, len(at)))
        return np.asarray(of_all + of_each + self._generator[:, None] + hardware)

    def _mixed_by(self, at: Float[np.ndarray, "p k"]) -> Float[np.ndarray, "p N"]:
        """w, how much each demonstration counts."""
        return self._weights(self.normalisation.undo(at))

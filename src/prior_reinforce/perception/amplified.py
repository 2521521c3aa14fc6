"""The exact error, distorted on purpose (paper, Section V-B, "Amplified Perception Noise")."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.base import Perception
from prior_reinforce.readings import Reading
from prior_reinforce.settings import Checked, NonNegative

_LEAST_SCALE = 0.1
"""Factors below it are taken for it when a reading is weighed (ours): 1/s has no variance at 0."""


@dataclass(frozen=True)
class Amplified(Checked, Perception):
    """The true error times one random factor, plus Gaussian noise on each component."""

    scale_low: NonNegative = 0.7
    """Least factor, uniformly drawn once a vector (paper: 0.7)."""
    scale_high: NonNegative = 1.4
    """Greatest factor (paper: 1.4)."""
    noise_sd: NonNegative = 0.01
    """Standard deviation of the noise of each component, in [m]. Ours, because the paper gives
    none: 1 cm is two thirds of the tolerance, and half of the finest step of an estimate by eye."""

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if self.scale_low > self.scale_high:
            raise ConfigurationError(
                "scale_low and scale_high must rise, got "
                f"{self.scale_low} and {self.scale_high}; the paper's are 0.7 and 1.4"
            )

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """Return s (r - g) + n, with one s and k components of n drawn.

        Seen e, the true error is e / s but for n / s: its mean is e E[1/s], its variance
        e^2 Var[1/s] + noise_sd^2 / E[s]^2, each component taken for itself.
        """
        error = rollout.outcome - goal
        scale = rng.uniform(self.scale_low, self.scale_high)
        seen = scale * error + rng.normal(0.0, self.noise_sd, size=error.shape)
        mean, sd = self._inverse_scale()
        noise = 2.0 * self.noise_sd / (self.scale_low + self.scale_high)
        return replace(Reading.measured(mean * seen, np.hypot(sd * seen, noise)), error_seen=seen)

    def _inverse_scale(self) -> tuple[float, float]:
        """Mean and standard deviation of 1/s, for s uniform between its bounds."""
        low, high = max(self.scale_low, _LEAST_SCALE), max(self.scale_high, _LEAST_SCALE)
        if low == high:
            return 1.0 / low, 0.0
        mean = math.log(high / low) / (high - low)
        return mean, math.sqrt(max(1.0 / (low * high) - mean * mean, 0.0))

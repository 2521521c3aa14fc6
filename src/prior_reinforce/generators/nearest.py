"""I.N.N., interpolation of nearest neighbours: the paper's simplest baseline for pi.

    A(c) = sum_i w_i(c) A_i,    w_i proportional to |c - r_i|^-p over the m nearest outcomes

It mixes plans frame by frame, so demonstrations that begin their motion at different times give a
blur of two motions rather than one in between (see `alignment`).

Notation:
    A_i  plans       (N, H, D)  in their units
    r_i  outcomes    (N, k)     in their units
    c    conditions  (n, k)     in the outcomes' units
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.outcome_weights import inverse_distance_weights
from prior_reinforce.generators.plan_mixture import PlanMixture


@dataclass(frozen=True)
class NearestNeighboursConfig:
    """How neighbours are weighted; docs/baselines.md tells what was tried."""

    neighbours: int = 3
    """m, how many of the nearest demonstrations take part; all where there are fewer."""
    power: float = 2.0
    """p, how fast a demonstration's weight falls with the distance of its outcome."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: One is outside its range.
        """
        if self.neighbours < 1:
            raise ConfigurationError(f"neighbours must be at least 1, got {self.neighbours}")
        if not (math.isfinite(self.power) and self.power > 0):
            raise ConfigurationError(f"power must be a positive number, got {self.power}")


class NearestNeighbours(PlanMixture):
    """Inverse-distance interpolation of the nearest plans (paper, "I.N.N.")."""

    name: ClassVar[str] = "nearest"
    config_type: ClassVar[type[NearestNeighboursConfig]] = NearestNeighboursConfig
    config: NearestNeighboursConfig

    def __init__(self, config: NearestNeighboursConfig | None = None) -> None:
        """Choose settings; the defaults when None."""
        super().__init__(config or NearestNeighboursConfig())

    def weights(self, conditions: np.ndarray, outcomes: np.ndarray) -> np.ndarray:
        """Weigh the nearest plans; at a demonstration's outcome, its own alone."""
        return inverse_distance_weights(
            conditions, outcomes, neighbours=self.config.neighbours, power=self.config.power
        )

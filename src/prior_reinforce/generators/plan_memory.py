"""Demonstrations kept as they are, for the generators that mix them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from typing_extensions import Self

from prior_reinforce.motions import Demonstrations


@dataclass(frozen=True, eq=False)
class PlanMemory:
    """The plans and outcomes that an interpolating generator has learned."""

    plans: np.ndarray
    """A_i, shape (N, H, D), in their units."""
    outcomes: np.ndarray
    """r_i, shape (N, k), in their units."""

    @classmethod
    def of(cls, demonstrations: Demonstrations) -> Self:
        """Keep copies of both arrays."""
        return cls(demonstrations.plans.copy(), demonstrations.outcomes_seen.copy())

    @classmethod
    def restore(cls, tensors: Mapping[str, np.ndarray]) -> Self:
        """Rebuild from `tensors`.

        Raises:
            KeyError: An array is missing.
            ValueError: The arrays do not fit each other.
        """
        plans, outcomes = tensors["plans"], tensors["outcomes"]
        if plans.ndim != 3 or outcomes.ndim != 2 or len(plans) != len(outcomes):
            raise ValueError(f"plans {plans.shape} and outcomes {outcomes.shape} do not fit")
        return cls(plans, outcomes)

    def tensors(self) -> dict[str, np.ndarray]:
        """Both arrays by name, to be saved."""
        return {"plans": self.plans, "outcomes": self.outcomes}

    def mix(self, weights: np.ndarray) -> np.ndarray:
        """Return the weighted sums of plans, shape (n, H, D), for weights (n, N)."""
        mixed: np.ndarray = np.tensordot(weights, self.plans, axes=1)
        return mixed

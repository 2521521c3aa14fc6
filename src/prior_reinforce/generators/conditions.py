"""Conditions: checked, then scaled so that every component of the outcomes counts alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from typing_extensions import Self

from prior_reinforce.errors import InvalidGoalError


def as_conditions(values: np.ndarray, outcome_dim: int) -> np.ndarray:
    """Return conditions as a fresh float64 array, shape (n, k).

    Args:
        values: Shape (n, k); any n, also 0.
        outcome_dim: k.

    Raises:
        InvalidGoalError: Wrong shape, or not finite.
    """
    try:
        conditions = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidGoalError(f"conditions must be an array (n, k) of numbers: {error}") from error
    if conditions.ndim != 2 or conditions.shape[1] != outcome_dim:
        raise InvalidGoalError(
            f"conditions must have shape (n, {outcome_dim}), one row for each plan, "
            f"got {conditions.shape}"
        )
    if not np.all(np.isfinite(conditions)):
        row = int(np.argwhere(~np.isfinite(conditions))[0][0])
        raise InvalidGoalError(
            f"conditions must be finite, but row {row} is {conditions[row].tolist()}"
        )
    return conditions


@dataclass(frozen=True, eq=False)
class ConditionScale:
    """Maps the demonstrated range of each outcome component to [-1, 1], whatever its unit."""

    low: np.ndarray
    """Least outcome seen, shape (k,)."""
    high: np.ndarray
    """Greatest outcome seen, shape (k,); above `low` in every component."""

    @classmethod
    def fit(cls, outcomes: np.ndarray) -> Self:
        """Take the range of outcomes (N, k); `Demonstrations` has none of zero width."""
        return cls(outcomes.min(axis=0), outcomes.max(axis=0))

    def scale(self, conditions: np.ndarray) -> np.ndarray:
        """Return scaled conditions (n, k) of conditions (n, k) in their own units."""
        scaled: np.ndarray = 2 * (conditions - self.low) / (self.high - self.low) - 1
        return scaled

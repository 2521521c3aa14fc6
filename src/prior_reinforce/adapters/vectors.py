"""Checks of the vectors an adapter is handed: one shape, finite, never aliased."""

from __future__ import annotations

import numpy as np

from prior_reinforce.arrays import as_vector
from prior_reinforce.errors import InvalidFeedbackError, InvalidGoalError, NotFittedError


def as_goal_seen(values: np.ndarray, outcome_dim: int) -> np.ndarray:
    """Return a perceived goal as a fresh float array, shape (k,).

    Raises:
        InvalidGoalError: Wrong shape, or not finite.
    """
    return _as_outcome_like(values, outcome_dim, "goal", InvalidGoalError)


def as_trial(
    condition: np.ndarray, outcome_seen: np.ndarray, outcome_dim: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return a trial's condition and perceived outcome as fresh float arrays, shape (k,) each.

    Raises:
        InvalidFeedbackError: Wrong shape, or not finite.
    """
    return (
        _as_outcome_like(condition, outcome_dim, "condition", InvalidFeedbackError),
        _as_outcome_like(outcome_seen, outcome_dim, "perceived outcome", InvalidFeedbackError),
    )


def not_started(adapter: object) -> NotFittedError:
    """Return the error of an adapter that was used before `start`."""
    return NotFittedError(
        f"{type(adapter).__name__} knows no demonstrations yet; call start(demonstrations) first"
    )


def _as_outcome_like(
    values: np.ndarray,
    outcome_dim: int,
    name: str,
    problem: type[InvalidGoalError] | type[InvalidFeedbackError],
) -> np.ndarray:
    return as_vector(
        values,
        outcome_dim,
        problem,
        name=name,
        size=f"the demonstrations' outcomes have {outcome_dim} components",
        remedy="void a trial nobody saw",
    )

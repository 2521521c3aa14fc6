"""Checks of the vectors an adapter is handed: one shape, finite, never aliased."""

from __future__ import annotations

import numpy as np

from prior_reinforce.errors import InvalidFeedbackError, InvalidGoalError, NotFittedError


def as_goal(values: np.ndarray, outcome_dim: int) -> np.ndarray:
    """Return a goal as a fresh float array, shape (k,).

    Raises:
        InvalidGoalError: Wrong shape, or not finite.
    """
    return _as_vector(values, outcome_dim, "goal", InvalidGoalError)


def as_trial(
    condition: np.ndarray, outcome_seen: np.ndarray, outcome_dim: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return a trial's condition and perceived outcome as fresh float arrays, shape (k,) each.

    Raises:
        InvalidFeedbackError: Wrong shape, or not finite.
    """
    return (
        _as_vector(condition, outcome_dim, "condition", InvalidFeedbackError),
        _as_vector(outcome_seen, outcome_dim, "perceived outcome", InvalidFeedbackError),
    )


def not_started(adapter: object) -> NotFittedError:
    """Return the error of an adapter that was used before `start`."""
    return NotFittedError(
        f"{type(adapter).__name__} knows no demonstrations yet; call start(demonstrations) first"
    )


def _as_vector(
    values: np.ndarray,
    outcome_dim: int,
    name: str,
    error: type[InvalidGoalError] | type[InvalidFeedbackError],
) -> np.ndarray:
    try:
        vector = np.array(values, dtype=float)
    except (TypeError, ValueError) as problem:
        raise error(f"{name} must be {outcome_dim} numbers, got {values!r}") from problem
    if vector.shape != (outcome_dim,):
        raise error(
            f"{name} has shape {vector.shape}, but the demonstrations' outcomes have "
            f"{outcome_dim} components; give that many numbers"
        )
    if not np.all(np.isfinite(vector)):
        raise error(f"{name} must be finite, got {vector.tolist()}; void a trial nobody saw")
    return vector

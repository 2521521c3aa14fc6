"""What a caller's numbers must be: plans, outcomes, goals and errors become checked arrays.

Each function returns a copy, so that nobody's later change reaches it, and says in one line what
is wrong and how to mend it. The shapes of the package's arrays have their names here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.errors import (
    InvalidDemonstrationsError,
    InvalidFeedbackError,
    InvalidGoalError,
    InvalidPlanError,
    PriorReinforceError,
)

LARGEST = 1e6
"""Of plans, outcomes, goals and errors, in any unit; ours: an encoder's counts stay below it, and
squares of it are still exact. What is larger is a damaged file or a slip, and overflows later."""
Plans = Float[np.ndarray, "n H D"]
"""Action plans A, one for each of n conditions, in the units of their `PlanFormat`."""
Frames = Float[np.ndarray, "H D"]
"""One action plan: H frames of D numbers."""
Points = Float[np.ndarray, "n k"]
"""Outcomes, conditions, goals or errors, one a row, in the outcomes' units, mostly [m]."""
Point = Float[np.ndarray, " k"]
"""One outcome, condition, goal or error."""

SAME_OUTCOME = 1e-6
"""Outcomes this part of their range apart are the same; ours: what rounding and units leave."""
_FLAT = 0.1
"""Outcomes that stand this part off a line are (almost) on it. Ours: below it, first throws missed
by more than the nearest demonstration's outcome in 5 of 8 drawn sets of three, above 0.15 in 1 of
86 (four numerical tasks that are not ours, a script that is not kept)."""


def is_positive(value: Any) -> bool:
    """Whether a value is a finite number above 0, whatever a caller gave."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    return is_number and math.isfinite(value) and bool(value > 0)


def as_plans(
    values: ArrayLike, action_dim: int, *, name: str = "plans", single: bool = False
) -> Float[np.ndarray, "*n H D"]:
    """Return plans as a fresh, read-only float64 array.

    Args:
        values: Shape (n, H, D), or (H, D) if `single`.
        action_dim: D that is expected.
        name: What to call the array in a message.
        single: Expect one plan instead of a batch.

    Raises:
        InvalidPlanError: Wrong shape, fewer than two frames, or values that are not finite.
    """
    expected = "(H, D)" if single else "(n, H, D)"
    array = _as_numbers(values, InvalidPlanError, f"{name} must be an array {expected} of numbers")
    if array.ndim != (2 if single else 3):
        raise InvalidPlanError(f"{name} must have shape {expected}, got {array.shape}")
    if array.shape[-1] != action_dim:
        raise InvalidPlanError(
            f"{name} have {array.shape[-1]} action dimensions, but the plan format names "
            f"{action_dim}; check the order of the axes {expected}"
        )
    if array.shape[-2] < 2:
        raise InvalidPlanError(f"{name} need at least two frames, got {array.shape[-2]}")
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        raise InvalidPlanError(
            f"{name} must be finite, but element {tuple(bad[0].tolist())} is "
            f"{array[tuple(bad[0])]}; mend or drop that recording"
        )
    array.setflags(write=False)
    return array


def as_outcomes(values: ArrayLike, n_plans: int) -> Points:
    """Return the outcomes of demonstrations as a fresh, read-only float64 array.

    Shape (n, k), or (n,) where an outcome is one number. InvalidDemonstrationsError for a wrong
    shape, none, or values that are not finite.
    """
    outcomes = _as_rows(values, InvalidDemonstrationsError, "outcomes", None, n=n_plans)
    if len(outcomes) != n_plans:
        raise InvalidDemonstrationsError(
            f"{n_plans} plans need as many outcomes, got {len(outcomes)}"
        )
    if n_plans < 1:
        raise InvalidDemonstrationsError("at least one demonstration is needed, got none")
    outcomes.setflags(write=False)
    return outcomes


def check_spread(outcomes: Points) -> None:
    """Do nothing if outcomes span all their k dimensions: any goal among them can be asked for.

    InvalidDemonstrationsError if a component is the same in all, or they lie in a subspace (on one
    line when k = 2).
    """
    n, k = outcomes.shape
    spread = np.ptp(outcomes, axis=0)
    if np.any(spread == 0):
        raise InvalidDemonstrationsError(
            f"all outcomes agree in component {int(np.argmin(spread))}; a goal cannot ask for "
            "another value: spread the demonstrations, or drop that component"
        )
    if n > k and _flatness(outcomes) < 1e-6:
        raise InvalidDemonstrationsError(
            f"the {n} outcomes span fewer than {k} dimensions (they lie on one line or plane); add "
            "a demonstration off it"
        )


def say_flat(outcomes: Points) -> str:
    """Say it if outcomes, (n, k), lie almost on one line or plane; else an empty string.

    Their motions then do not tell what moves an outcome off it.
    """
    n, k = outcomes.shape
    if min(n, k) < 2 or _flatness(outcomes) > _FLAT:
        return ""
    where = "line" if min(n, k) == 2 else "plane"
    return (
        f"the outcomes lie almost on one {where}, so plans for goals beside it are guessed: "
        "demonstrate one well beside it, or say how a motion may be moved (docs/symmetry.md)"
    )


def _flatness(outcomes: Points) -> float:
    """How far outcomes stand off one line (plane, ...), over how far along it: 0 to 1.

    Each component is divided by its range, none of which is zero.
    """
    scaled = (outcomes - outcomes.mean(axis=0)) / np.ptp(outcomes, axis=0)
    singular = np.linalg.svd(scaled.T, compute_uv=False)
    return float(singular[-1] / singular[0]) if len(singular) == outcomes.shape[1] else 0.0


def as_conditions(values: ArrayLike, outcome_dim: int) -> Points:
    """Return conditions, shape (n, k), any n, as a fresh float64 array.

    InvalidGoalError for a wrong shape, or what is not finite.
    """
    return _as_rows(values, InvalidGoalError, "conditions", outcome_dim)


def as_goal(values: ArrayLike, outcome_names: Sequence[str]) -> Point:
    """Return a goal as a fresh float array, of as many components as there are names.

    InvalidGoalError for a wrong shape, or what is not finite.
    """
    k = len(outcome_names)
    size = f"the demonstrations' outcomes have {k} components {tuple(outcome_names)}"
    return as_vector(values, k, InvalidGoalError, "goal", size, "give numbers")


def as_error(values: ArrayLike, outcome_dim: int) -> Point:
    """Return a perceived error, outcome minus goal, as a fresh float array.

    InvalidFeedbackError for a wrong shape, or what is not finite.
    """
    size = f"an error is {outcome_dim} numbers, outcome minus goal"
    remedy = "say 'lost' if nobody saw where it went, or void the trial"
    return as_vector(values, outcome_dim, InvalidFeedbackError, "error", size, remedy)


def as_vector(
    values: ArrayLike,
    length: int,
    problem: type[InvalidGoalError] | type[InvalidFeedbackError],
    name: str,
    size: str,
    remedy: str,
) -> Point:
    """Return a vector (length,) as a fresh float array, or raise `problem`.

    Its message calls the vector `name`; `size` is a clause that says why it has this length, and
    `remedy` what to do about numbers that are not finite.
    """
    vector = _as_numbers(values, problem, f"{name} must be {length} numbers")
    if vector.ndim == 0 and length == 1:
        vector = vector[None]
    if vector.shape != (length,):
        raise problem(f"{name} has shape {vector.shape}, but {size}; give that many numbers")
    if not np.isfinite(vector).all():
        raise problem(f"{name} must be finite, got {vector.tolist()}; {remedy}")
    return vector


def _as_rows(
    values: ArrayLike,
    problem: type[PriorReinforceError],
    name: str,
    k: int | None,
    n: int | None = None,
) -> Points:
    """Points, of k components if that is known; n numbers, where n is known, are n points."""
    shape = f"(n, {k or 'k'})"
    rows = _as_numbers(values, problem, f"{name} must be an array {shape} of numbers")
    if rows.shape == (n,):
        rows = rows[:, None]
    if rows.ndim != 2 or rows.shape[1] < 1 or rows.shape[1] != (k or rows.shape[1]):
        raise problem(f"{name} must have shape {shape}, one row for each plan, got {rows.shape}")
    bad = ~np.isfinite(rows).all(axis=1)
    if bad.any():
        row = int(bad.argmax())
        raise problem(
            f"{name} must be finite, but row {row} is {rows[row].tolist()}; measure it again, or "
            "leave it out"
        )
    return rows


def _as_numbers(
    values: ArrayLike, problem: type[PriorReinforceError], expected: str
) -> Float[np.ndarray, "..."]:
    if np.ma.isMaskedArray(values) and np.any(np.ma.getmaskarray(values)):
        raise problem(f"{expected}, got a masked array; leave out what is masked")
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError, RuntimeError) as error:
        raise problem(f"{expected}, got {values!r:.80}: {error}") from error
    if ((np.abs(array) > LARGEST) & np.isfinite(array)).any():
        largest = float(np.abs(array[np.isfinite(array)]).max())
        raise problem(f"{expected}, got {largest:.4g}, which is implausibly large; check the unit")
    return array

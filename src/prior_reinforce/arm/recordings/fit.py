"""Whether each outcome fits its motion: slips in a table of outcomes, found by the other rows.

Each outcome is predicted from the others, by the main directions in which plans differ. A slip of
the pen (rows exchanged, shifted or in another order, lost signs, a decimal point) is reported where
undoing it makes these predictions far better. Ours; linear, and so blind to small slips.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Points
from prior_reinforce.plans.motions import Demonstrations

Errors = Float[np.ndarray, "N k"]
"""Of predicting each outcome from the others, in the outcomes' units."""
_FEWEST, _MOST = 6, 60
"""Demonstrations among which slips are looked for."""
_FAR_BETTER, _TELLING, _DOUBTFUL = 2.8, 0.6, 0.5
"""By how much, below which error put right, above which error as they stand, in spreads. Ours."""
_SHIFT_BETTER, _SIGN_BETTER, _POINT_BETTER = 4.0, 5.0, 5.0
"""The first for the other slips, of which more are tried."""
_ORDER_BETTER, _SIGNS_BETTER, _FEWEST_BETTER = 2.5, 6.0, 6.0
"""For all rows in another order, all signs of a component, and exchanges among `_FEWEST`."""
_CERTAIN, _FAR = 0.0, 4.0
"""A number so many times as far out as the others reach widens the spread in which errors are
counted: there errors in the outcomes' unit are to be `_FAR_BETTER` times smaller. Ours."""
_CHANGES = (
    (-1.0, "have lost its sign", _SIGN_BETTER),
    (0.1, "be 10 times too large", _POINT_BETTER),
    (10.0, "be 10 times too small", _POINT_BETTER),
    (0.01, "be 100 times too large", _POINT_BETTER),
    (100.0, "be 100 times too small", _POINT_BETTER),
)
"""Factors by which a number is put right, what is wrong with it, and by how much better it must be:
a sign, a decimal point, or centimetres for metres."""
_TURNS = 24
"""Lines through the plane of two directions of plans that are tried to tell signs."""
_BEYOND = 1.3
"""Half ranges of the others beyond which a number with a wrong decimal point lies. Ours."""


@dataclass(frozen=True)
class Slip:
    """An outcome that looks wrong."""

    rows: tuple[int, ...]
    """Demonstrations whose rows are doubted, from 0; all where rows are shifted."""
    what: str
    """What it looks like: a clause."""
    better: float
    """How many times better the motions tell all outcomes with it put right."""


def slips(demonstrations: Demonstrations, episodes: tuple[str, ...]) -> list[Slip]:
    """Return the likeliest slip in N demonstrations, by name, if any is far likelier than none."""
    outcomes, n = demonstrations.outcomes_seen, demonstrations.n
    if not _FEWEST <= n <= _MOST:
        return []
    directions = _directions(demonstrations)
    hats = _hats(directions, outcomes.shape[1])
    if not hats:
        return []
    now = _error(hats, outcomes)
    found = []
    for rows, what, other, least in _candidates(demonstrations, episodes, directions):
        known = np.isfinite(other).all(axis=1)
        hats_of, was, other = hats, now, other[known]
        if not known.all():  # the row of another throw is no part of what is compared
            hats_of = _hats(directions[known], other.shape[1])
            was = _error(hats_of, outcomes[known]) if hats_of else now
        columns = np.any(other != outcomes[known], axis=0)
        if not hats_of or not columns.any():
            continue  # that order is this one
        before, after = float(np.max(was[columns])), float(np.max(_error(hats_of, other)[columns]))
        better = before / max(after, 1e-12)
        told = better > least and after < _TELLING and before > _DOUBTFUL
        if least == _CERTAIN:
            shrinks = np.max(outcomes.std(axis=0)[columns] / other.std(axis=0)[columns])
            told = told or better * float(shrinks) > _FAR_BETTER
        if told:
            found.append(Slip(rows, what, better))
    return sorted(found, key=lambda slip: -slip.better)[:1]


def _directions(demonstrations: Demonstrations) -> Float[np.ndarray, "N D"]:
    """Where each plan lies along the directions in which plans differ, the main one first."""
    plans = demonstrations.plans - demonstrations.plans.mean(axis=0)
    spread = demonstrations.plans.std(axis=(0, 1))
    flat = (plans / np.where(spread > 0, spread, 1.0)).reshape(demonstrations.n, -1)
    left, sizes, _ = np.linalg.svd(flat, full_matrices=False)
    return left * sizes


def _hats(directions: Float[np.ndarray, "N D"], k: int) -> list[np.ndarray]:
    """Matrices that predict k components of outcomes from the first directions of plans."""
    n, hats = len(directions), []
    for count in (k, k + 1):
        columns = np.column_stack([np.ones(n), directions[:, :count]])
        if n >= columns.shape[1] + 3:
            hats.append(columns @ np.linalg.pinv(columns))
    return hats


def _error(hats: list[np.ndarray], outcomes: Points) -> Float[np.ndarray, " k"]:
    """Error of predicting each from the others, in spreads, of the better hat."""
    spread = np.maximum(outcomes.std(axis=0), 1e-12)
    each = [
        # The hat matrix tells it without fitting again.
        (outcomes - hat @ outcomes) / (1.0 - np.diag(hat)[:, None] + 1e-12) / spread
        for hat in hats
    ]
    return np.min([np.sqrt(np.mean(error**2, axis=0)) for error in each], axis=0)


def _sides(directions: Float[np.ndarray, "N D"]) -> Iterator[Float[np.ndarray, " N"]]:
    """Signs of plans on both sides of a line in the plane of their two main directions."""
    for turn in np.linspace(0, np.pi, _TURNS, endpoint=False):
        along = directions[:, :2] @ np.array([np.cos(turn), np.sin(turn)])
        for at in np.sort(along)[1:]:
            yield np.where(along < at, -1.0, 1.0)


def _candidates(
    demonstrations: Demonstrations, episodes: tuple[str, ...], directions: Float[np.ndarray, "N D"]
) -> Iterator[tuple[tuple[int, ...], str, Points, float]]:
    """Yield rows, their slip, the outcomes without it (nan if not in the table), and `better`."""
    (n, k), outcomes = demonstrations.outcomes_seen.shape, demonstrations.outcomes_seen
    names = demonstrations.outcome_format.names
    every = tuple(range(n))
    for i, j in combinations(every, 2):
        other = outcomes.copy()
        other[[i, j]] = other[[j, i]]
        what = f"{episodes[i]} and {episodes[j]} may have each other's outcome"
        yield (i, j), what, other, _FAR_BETTER if n > _FEWEST else _FEWEST_BETTER
    as_text = sorted(every, key=lambda i: episodes[i])
    for order, where in (
        (as_text, "beside names in the order 1, 10, 11, 2"),
        (np.argsort(as_text), "in the order 1, 10, 11, 2"),
        (every[::-1], "in reverse"),
    ):
        yield every, f"all outcomes may stand {where}", outcomes[list(order)], _ORDER_BETTER
    for c, name in enumerate(names):
        sizes = np.abs(outcomes[:, c])
        if n == _FEWEST or np.ptp(np.sign(outcomes[:, c])) > 1 or 2 * min(sizes) > max(sizes):
            continue  # it has signs, or is a distance that is never near 0
        for signs in _sides(directions):
            other = outcomes.copy()
            other[:, c] *= signs
            yield every, f"all of {name} may have lost their signs", other, _SIGNS_BETTER
    for start, by in [(s, b) for s in range(n - 3) for b in (1, -1)]:
        other = np.full_like(outcomes, np.nan)  # where a row is missing
        other[:start] = outcomes[:start]
        there, here = (n - 1, start + 1) if by > 0 else (n, start)
        other[here : here + n - 1 - start] = outcomes[there - (n - 1 - start) : there]
        where = "high" if by > 0 else "low"
        what = f"outcomes from {episodes[start]} on may stand one row too {where}"
        yield every[start:], what, other, _SHIFT_BETTER
    for i in range(n):
        for c, name in enumerate(names):
            if not outcomes[i, c]:
                continue  # zero has neither sign nor decimal point
            for factor, says, least in _CHANGES:
                other = outcomes.copy()
                other[i, c] *= factor
                rest = np.delete(outcomes[:, c], i)
                low, high = rest.min(), rest.max()
                middle, half = (low + high) / 2, _BEYOND * (high - low) / 2
                off = abs(outcomes[i, c] - middle)
                least = _CERTAIN if off > _FAR * half else least
                room = max(half, off if factor < 0 else off / _FAR)
                if abs(other[i, c] - middle) > room or (factor > 0 and off <= half):
                    continue  # it does not stand out, or would not stand among the others
                value = f"{name} of {episodes[i]}, {outcomes[i, c]:.4g}, may {says}"
                also = "; look at the other numbers of its row as well" * (factor > 0 and k > 1)
                yield (i,), value + also, other, least
    for c, name in enumerate(names):
        for i, j in combinations(every if n > _FEWEST else (), 2):
            other = outcomes.copy()
            other[[i, j], c] *= -1.0
            if np.ptp(np.sign(outcomes[:, c])) > 1 and outcomes[i, c] * outcomes[j, c] > 0:
                what = f"{name} of {episodes[i]} and {episodes[j]} may have lost their signs"
                yield (i, j), what, other, _SIGNS_BETTER

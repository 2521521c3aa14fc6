"""Whether each outcome fits its motion: slips in a table of outcomes, found by the other rows.

Outcomes are predicted from the main directions in which plans differ, each from the others. A slip
of the pen (two rows exchanged, rows shifted by one, a lost sign, a decimal point) is doubted where
putting it right makes these predictions far better. Ours; linear, and so blind to small slips.
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
_CERTAIN, _FAR = 0.0, 4.0
"""A number so many times as far out as the others reach widens the spread in which errors are
counted: there errors in the outcomes' unit are to be `_FAR_BETTER` times smaller. Ours."""
_FACTORS = (0.1, 10.0, 0.01, 100.0)
"""By which a wrong decimal point, or centimetres for metres, is put right."""
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
    hats = _hats(demonstrations)
    if not hats:
        return []
    now = _error(hats, outcomes)
    found = []
    for rows, what, other, least in _candidates(demonstrations, episodes):
        columns = np.any(other != outcomes, axis=0)
        before, after = float(np.max(now[columns])), float(np.max(_error(hats, other)[columns]))
        better = before / max(after, 1e-12)
        told = better > least and after < _TELLING and before > _DOUBTFUL
        if least == _CERTAIN:
            shrinks = np.max(outcomes.std(axis=0)[columns] / other.std(axis=0)[columns])
            told = told or better * float(shrinks) > _FAR_BETTER
        if told:
            found.append(Slip(rows, what, better))
    return sorted(found, key=lambda slip: -slip.better)[:1]


def _hats(demonstrations: Demonstrations) -> list[np.ndarray]:
    """Matrices that predict outcomes from plans, of a few directions of them."""
    n, k = demonstrations.outcomes_seen.shape
    plans = demonstrations.plans - demonstrations.plans.mean(axis=0)
    spread = demonstrations.plans.std(axis=(0, 1))
    flat = (plans / np.where(spread > 0, spread, 1.0)).reshape(n, -1)
    left, sizes, _ = np.linalg.svd(flat, full_matrices=False)
    hats = []
    for directions in (k, k + 1):
        columns = np.column_stack([np.ones(n), (left * sizes)[:, :directions]])
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


def _candidates(
    demonstrations: Demonstrations, episodes: tuple[str, ...]
) -> Iterator[tuple[tuple[int, ...], str, Points, float]]:
    """Rows, what slip it is, the outcomes without it, and how much better they must be."""
    outcomes, n = demonstrations.outcomes_seen, demonstrations.n
    names = demonstrations.outcome_format.names
    if n > _FEWEST:
        for i, j in combinations(range(n), 2):
            other = outcomes.copy()
            other[[i, j]] = other[[j, i]]
            what = f"{episodes[i]} and {episodes[j]} may have each other's outcome"
            yield (i, j), what, other, _FAR_BETTER
    for start, by in [(s, b) for s in range(n - 3) for b in (1, -1)]:
        other = outcomes.copy()
        other[start:] = np.roll(outcomes[start:], by, axis=0)
        where = "high" if by > 0 else "low"
        what = f"outcomes from {episodes[start]} on may stand one row too {where}"
        yield tuple(range(start, n)), what, other, _SHIFT_BETTER
    for i in range(n):
        for c, name in enumerate(names):
            if not outcomes[i, c]:
                continue  # zero has neither sign nor decimal point
            points = ((f, f"be {1 / f:g} times too large", _POINT_BETTER) for f in _FACTORS)
            changes = ((-1.0, "have lost its sign", _SIGN_BETTER), *points)
            for factor, says, least in changes:
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
                yield (i,), value, other, least

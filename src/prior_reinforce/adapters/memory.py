"""The trials that were read, in normalised units.

Source: ours, so that a proposal stays below tens of milliseconds
(reproduction/docs/decisions-adapter.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from prior_reinforce.arrays import Points

_AGAIN = 0.5
"""A condition closer than this share of the tolerance to one that missed the same goal would be
tried again (ours)."""
LATEST = 8
"""The latest trials, which are never forgotten, and whose misses count for themselves (ours)."""
_KEPT = 64
"""Trials in memory before one is forgotten for each that comes (ours)."""


@dataclass(frozen=True, eq=False)
class Places:
    """Where and when p displacements are asked for."""

    conditions: Points
    numbers: Int[np.ndarray, " p"]
    """Of the trials, from 0; -1 on the demonstrations' day."""
    goals: Points
    """What they are thrown at."""


@dataclass(frozen=True, eq=False)
class Memory(Places):
    """What was read of the displacements of n trials."""

    low: Points
    high: Points
    variance: Points
    missed_by: Points
    """Half-axes of the ellipsoid around its goal that each missed; 0 where nothing is known."""

    @classmethod
    def empty(cls, k: int) -> Memory:
        """Nothing yet."""
        none = np.empty((0, k))
        return cls(none, np.empty(0, int), none, none, none, none, none)

    @property
    def aims(self) -> Points:
        """Displacements that would have hit: goal minus condition."""
        return self.goals - self.conditions

    def followed_by(self, others: Memory) -> Memory:
        """The same and others after them."""
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        return Memory(*(np.concatenate(pair) for pair in pairs))

    def only(self, which: Bool[np.ndarray, " n"] | Int[np.ndarray, " m"] | slice) -> Memory:
        """Some of them."""
        return Memory(*(of[which] for of in vars(self).values()))

    def worth_keeping(self) -> Bool[np.ndarray, " n"]:
        """All, or all but one where they are too many: the older of the two closest together."""
        keep = np.ones(len(self.numbers), dtype=bool)
        if len(keep) > _KEPT:
            old = self.conditions[:-LATEST]
            square = np.square(old[:, None] - old[None]).sum(axis=-1)
            square[np.tril_indices(len(old))] = np.inf
            keep[np.unravel_index(np.argmin(square), square.shape)[0]] = False
        return keep


def tried_again(
    conditions: Points, tried: Float[np.ndarray, "m k"], missed_by: Float[np.ndarray, "m k"]
) -> Bool[np.ndarray, " n"]:
    """Which conditions are next to one that missed by so much at least."""
    apart = (conditions[:, None] - tried) / missed_by
    return np.asarray(np.any(np.linalg.norm(apart, axis=2) < _AGAIN, axis=1))

"""The trials that were read, in normalised units.

Source: ours, so that a proposal stays below tens of milliseconds
(reproduction/docs/decisions-adapter.md).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from typing_extensions import Self

from prior_reinforce.arrays import Point, Points
from prior_reinforce.readings import NOISE_SDS

AGAIN = 0.5
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

    def only(self, which: Bool[np.ndarray, " n"] | Int[np.ndarray, " m"] | slice) -> Self:
        """Some of them."""
        return type(self)(*(of[which] for of in vars(self).values()))


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

    @property
    def missed(self) -> Bool[np.ndarray, " n"]:
        """Which trials missed, by how much at least is known."""
        return np.any(self.missed_by > 0.0, axis=1)

    def bare_misses(self, hits: Points) -> Memory:
        """The latest trials that missed and of which their readings do not say so.

        Args:
            hits: What would have been read of each trial, had it hit, shape (n, k).
        """
        which = np.flatnonzero(self.missed)
        which = which[which >= len(self.numbers) - LATEST]
        latest, hits = self.only(which), hits[which]
        beyond = np.maximum(latest.low - hits, hits - latest.high)
        beyond = np.maximum(beyond - NOISE_SDS * np.sqrt(latest.variance), 0.0)
        return latest.only(np.linalg.norm(beyond / latest.missed_by, axis=1) < 1.0)

    def followed_by(self, others: Memory) -> Memory:
        """The same and others after them."""
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        return Memory(*(np.concatenate(pair) for pair in pairs))

    def worth_keeping(self) -> Bool[np.ndarray, " n"]:
        """All, or all but one where they are too many: the older of the two closest together."""
        keep = np.ones(len(self.numbers), dtype=bool)
        if len(keep) > _KEPT:
            old = self.conditions[:-LATEST]
            square = np.square(old[:, None] - old[None]).sum(axis=-1)
            square[np.tril_indices(len(old))] = np.inf
            keep[np.unravel_index(np.argmin(square), square.shape)[0]] = False
        return keep


def untried_around(
    condition: Point,
    reach: Point | float,
    tried: Float[np.ndarray, "m k"],
    missed_by: Float[np.ndarray, "m k"],
) -> Points:
    """Conditions around one that no trial which missed was next to, as far off as it takes.

    Args:
        condition: Shape (k,).
        reach: How far around it is looked first; doubled until something is left.
        tried: Conditions of trials that missed, shape (m, k).
        missed_by: By how much at least, shape (m, k).
    """
    while True:
        around = condition + reach * _ball(len(condition))
        left = around[~tried_again(around, tried, missed_by)]
        if len(left):
            return left
        reach = 2.0 * reach


def tried_again(
    conditions: Points, tried: Float[np.ndarray, "m k"], missed_by: Float[np.ndarray, "m k"]
) -> Bool[np.ndarray, " n"]:
    """Which conditions are next to one that missed by so much at least."""
    apart = (conditions[:, None] - tried) / missed_by
    return np.asarray(np.any(np.linalg.norm(apart, axis=2) < AGAIN, axis=1))


@functools.lru_cache
def _ball(k: int) -> Float[np.ndarray, "q k"]:
    """Points that fill the unit ball evenly: additive recurrence by the root of x^(k+1) = x + 1.

    Source: Roberts, The unreasonable effectiveness of quasirandom sequences, 2018.
    """
    root = 2.0
    for _ in range(50):
        root = (1.0 + root) ** (1.0 / (k + 1))
    cube = (0.5 + np.arange(1, 193)[:, None] * root ** -np.arange(1.0, k + 1)) % 1
    ball = 2.0 * cube - 1.0
    return np.asarray(ball[np.linalg.norm(ball, axis=1) <= 1.0])

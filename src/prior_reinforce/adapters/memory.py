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

REPEAT_DISTANCE = 0.5
"""A condition repeats another if it is closer than this share of the tolerance (ours)."""
RECENT = 8
"""Number of latest trials, which are never forgotten, and whose misses count separately (ours)."""
_CAPACITY = 64
"""Most trials in memory (ours)."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """Where and when p displacements are predicted: the inputs of the Gaussian process."""

    conditions: Points
    numbers: Int[np.ndarray, " p"]
    """Of the trials, from 0; -1 on the day of the demonstrations."""
    goals: Points
    """Goal of each trial."""

    def select(self, which: Bool[np.ndarray, " n"] | Int[np.ndarray, " m"] | slice) -> Self:
        """Index all arrays."""
        return type(self)(*(array[which] for array in vars(self).values()))


@dataclass(frozen=True, eq=False)
class Memory(Inputs):
    """n trials, and the interval in which each displacement was read."""

    low: Points
    high: Points
    variance: Points
    """Of the interval's ends."""
    missed_by: Points
    """Half-axes of the ellipsoid around its goal that each trial missed; 0 if none is known."""

    @classmethod
    def empty(cls, k: int) -> Memory:
        """No trial yet."""
        none = np.empty((0, k))
        return cls(none, np.empty(0, int), none, none, none, none, none)

    @property
    def to_goal(self) -> Points:
        """Displacements that would have hit: goal minus condition."""
        return self.goals - self.conditions

    @property
    def missed(self) -> Bool[np.ndarray, " n"]:
        """Which trials missed a known ellipsoid."""
        return np.any(self.missed_by > 0.0, axis=1)

    def bare_misses(self, hits: Points) -> Memory:
        """Return the recent misses whose readings leave a hit possible.

        Args:
            hits: Reading of each trial if it had hit exactly, shape (n, k).
        """
        which = np.flatnonzero(self.missed)
        which = which[which >= len(self.numbers) - RECENT]
        recent, hits = self.select(which), hits[which]
        beyond = np.maximum(recent.low - hits, hits - recent.high)
        beyond = np.maximum(beyond - NOISE_SDS * np.sqrt(recent.variance), 0.0)
        return recent.select(np.linalg.norm(beyond / recent.missed_by, axis=1) < 1.0)

    def append(self, others: Memory) -> Memory:
        """Return these trials followed by others."""
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        return Memory(*(np.concatenate(pair) for pair in pairs))

    def kept(self) -> Bool[np.ndarray, " n"]:
        """Which trials to keep: beyond the capacity, not the older of the two closest together."""
        keep = np.ones(len(self.numbers), dtype=bool)
        if len(keep) > _CAPACITY:
            old = self.conditions[:-RECENT]
            square = np.square(old[:, None] - old[None]).sum(axis=-1)
            square[np.tril_indices(len(old))] = np.inf
            keep[np.unravel_index(np.argmin(square), square.shape)[0]] = False
        return keep


def untried_conditions(
    condition: Point,
    reach: Point | float,
    tried: Float[np.ndarray, "m k"],
    missed_by: Float[np.ndarray, "m k"],
) -> Points:
    """Return conditions around one that repeat no miss.

    Args:
        condition: Centre, shape (k,).
        reach: Half-axes of the first search; doubled until a condition is left.
        tried: Conditions of trials that missed, shape (m, k).
        missed_by: Half-axes of the ellipsoids that they missed, shape (m, k).
    """
    while True:
        around = condition + reach * _unit_ball(len(condition))
        untried = around[~repeats_miss(around, tried, missed_by)]
        if len(untried):
            return untried
        reach = 2.0 * reach


def repeats_miss(
    conditions: Points, tried: Float[np.ndarray, "m k"], missed_by: Float[np.ndarray, "m k"]
) -> Bool[np.ndarray, " n"]:
    """Return which conditions repeat one that missed; see `untried_conditions`."""
    apart = (conditions[:, None] - tried) / missed_by
    return np.asarray(np.any(np.linalg.norm(apart, axis=2) < REPEAT_DISTANCE, axis=1))


@functools.lru_cache
def _unit_ball(k: int) -> Float[np.ndarray, "q k"]:
    """Points that fill the unit ball evenly: additive recurrence by the root of x^(k+1) = x + 1.

    Source: Roberts, The unreasonable effectiveness of quasirandom sequences, 2018.
    """
    root = 2.0
    for _ in range(50):
        root = (1.0 + root) ** (1.0 / (k + 1))
    cube = (0.5 + np.arange(1, 193)[:, None] * root ** -np.arange(1.0, k + 1)) % 1
    ball = 2.0 * cube - 1.0
    return np.asarray(ball[np.linalg.norm(ball, axis=1) <= 1.0])

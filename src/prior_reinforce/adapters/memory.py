"""What trials told of displacements, and how many old ones are made fewer.

Source: ours, so that a proposal stays below 20 ms (docs/decisions-adapter.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from prior_reinforce.adapters.displacement import DisplacementPrior
from prior_reinforce.adapters.expectation_propagation import Posterior
from prior_reinforce.arrays import Point, Points

LATEST = 8
"""The latest trials, which are never merged, and whose misses count for themselves (ours)."""
_KEPT = 24
"""Trials in memory before old ones are merged (ours)."""
_MERGED_TO = 16
"""How many are left then."""
_TELLS_NOTHING = 1e-2
"""Precision below which a reading is dropped when trials are merged (ours): an sd of ten
spreads."""


@dataclass(frozen=True, eq=False)
class Memory:
    """What was read of the displacement at n conditions, in normalised units."""

    conditions: Points
    changes: Int[np.ndarray, " n"]
    """How often a change of hardware had been said."""
    low: Points
    high: Points
    variance: Points
    aims: Points
    """Displacements that would have hit: goal minus condition."""
    missed_by: Float[np.ndarray, " n"]
    """How far from those they missed at least; 0 where nothing is known of it."""

    @classmethod
    def empty(cls, k: int) -> Memory:
        """Nothing yet."""
        none, no_numbers = np.empty((0, k)), np.empty(0)
        return cls(none, np.empty(0, int), none, none, none, none, no_numbers)

    def with_one(
        self,
        condition: Point,
        changes: int,
        low: Point,
        high: Point,
        variance: Point,
        aim: Point | None = None,
        missed_by: float = 0.0,
    ) -> Memory:
        """The same and one more."""
        aim = np.zeros_like(condition) if aim is None else aim
        one = (condition[None], [changes], low[None], high[None], variance[None], aim[None])
        return self._beside((*one, [missed_by]))

    def and_then(self, other: Memory) -> Memory:
        """The same and all of another."""
        return self._beside(tuple(vars(other).values()))

    def only(self, which: Bool[np.ndarray, " n"] | Int[np.ndarray, " m"] | slice) -> Memory:
        """Some of them."""
        return Memory(*(of[which] for of in vars(self).values()))

    def _beside(self, more: tuple[Any, ...]) -> Memory:
        pairs = zip(vars(self).values(), more, strict=True)
        return Memory(*(np.concatenate(pair) for pair in pairs))

    @property
    def is_full(self) -> bool:
        """Whether old trials are to be merged."""
        return len(self.changes) > _KEPT

    def merged(self, known: Posterior, prior: DisplacementPrior) -> Memory:
        """Make fewer trials of those that are old, the closest together first.

        Each becomes a number: its site, which is what the interval told beside all others. Two at
        different conditions tell of the place between them a little less.
        """
        share = known.model_weights
        tau, nu = (np.einsum("m,mkn->nk", share, of) for of in (known.tau, known.nu))
        old = np.arange(len(self.changes) - LATEST)
        sites = self.only(old)
        number = nu[old] / tau[old] + prior.mean(self.conditions[old]).T
        sites = replace(sites, low=number, high=number, variance=1.0 / tau[old])
        sites = sites.only(np.any(tau[old] > _TELLS_NOTHING, axis=1))
        # Trials of different hardware are never merged, so there may be none left that can be.
        while len(sites.changes) > max(_MERGED_TO - LATEST, len(np.unique(sites.changes))):
            i, j = _closest(sites)
            changes, variance = sites.changes[i], sites.variance[[i, j]]
            both = sites.conditions[[i, j]]
            middle = np.average(both, axis=0, weights=np.sum(1.0 / variance, axis=1))
            moved = share @ prior.of_difference(both, middle, int(changes))
            precision = 1.0 / (variance + moved[:, None])
            expected, expected_there = prior.mean(both).T, prior.mean(middle[None])[:, 0]
            beyond = np.sum(precision * (sites.low[[i, j]] - expected), axis=0)
            number = expected_there + beyond / precision.sum(axis=0)
            rest = sites.only(np.setdiff1d(np.arange(len(sites.changes)), [i, j]))
            sites = rest.with_one(middle, changes, number, number, 1.0 / precision.sum(axis=0))
        return sites.and_then(self.only(slice(-LATEST, None)))


def _closest(memory: Memory) -> tuple[int, int]:
    """The two that are closest together, of one hardware."""
    square = np.square(memory.conditions[:, None] - memory.conditions[None]).sum(axis=-1)
    square[memory.changes[:, None] != memory.changes] = np.inf
    square[np.tril_indices(len(square))] = np.inf
    i, j = np.unravel_index(np.argmin(square), square.shape)
    return int(i), int(j)

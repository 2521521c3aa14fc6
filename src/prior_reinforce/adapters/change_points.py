"""What may have happened between trials: changes that nobody announced, and trials told wrongly.

A history says after which trials something changed, for all that come or for one goal alone, and
which trials were told wrongly. A reading that is far from what was believed splits a history: it
was told wrongly; something changed for good; this goal lies elsewhere; or it was chance after all.
Prior odds and densities weigh them, and later readings decide: they contradict what was told
wrongly, and agree with what changed.

Histories are kept as long as they are not a thousand times less probable than the best one.

Source: Adams and MacKay, Bayesian online changepoint detection, 2007, for the recursion; that
changes add to a field, and concern one goal or all, is ours.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.adapters.displacement import DisplacementPrior
from prior_reinforce.adapters.expectation_propagation import Posterior, Readings, infer, tilted
from prior_reinforce.adapters.memory import Memory, Places

_LEAST_ODDS = 1e-3
"""Histories less probable than this part of the most probable one are dropped (ours)."""
_MOST = 6
"""Histories that are kept at most (ours)."""
_NOTHING = 0.1
"""Probability that nothing has changed although it was said (ours)."""
_WIDTH = 8.0
"""W of `expectation_propagation`: a trial that was told wrongly may be told anywhere in that."""


@dataclass(frozen=True)
class Change:
    """Something is different from one trial on."""

    since: int
    """Number of the first trial that it concerns."""
    shift_sd: float
    """By how much all that it concerns may be shifted; 0 where hardware was changed, which does not
    shift all by the same."""
    goal: tuple[float, ...] | None = None
    """The only goal that it concerns, which was moved; None where it concerns all."""

    def concerns(self, places: Places) -> Bool[np.ndarray, " p"]:
        """Which of them it concerns."""
        after = places.numbers >= self.since
        return after if self.goal is None else after & np.all(places.goals == self.goal, axis=1)

    def covariance(
        self, prior: DisplacementPrior, a: Places, b: Places
    ) -> Float[np.ndarray, "p n"]:
        """Of what it adds to displacements."""
        both = np.outer(self.concerns(a), self.concerns(b))
        if self.shift_sd:
            return np.asarray(both * self.shift_sd**2)
        return np.asarray(both * prior.of_change(a.conditions, b.conditions))


def announced(since: int, shift_sd: float) -> list[tuple[tuple[Change, ...], float]]:
    """What may have changed where somebody says so, and the log probability of each."""
    something = math.log(0.5 * (1.0 - _NOTHING))
    changes = [((Change(since, sd),), something) for sd in (0.0, shift_sd)]
    return [((), math.log(_NOTHING)), *changes]


def changes_of(data: Any) -> tuple[Change, ...]:
    """Make changes of plain data: what `dataclasses.astuple` gives of each."""
    return tuple(Change(since, sd, goal and tuple(goal)) for since, sd, goal in data)


@dataclass(frozen=True, eq=False)
class History:
    """What is taken to have happened so far, and what follows for displacements."""

    changes: tuple[Change, ...]
    mistaken: frozenset[int]
    """Numbers of trials that were told wrongly."""
    log_prior: float
    posterior: Posterior

    def then(self, log_p: float, *changes: Change) -> History:
        """The same where more happened, of that log probability."""
        return replace(self, changes=(*self.changes, *changes), log_prior=self.log_prior + log_p)

    @property
    def log_weight(self) -> float:
        """Log probability of the readings and of this history, up to a constant."""
        evidence = np.logaddexp.reduce(self.posterior.log_evidence, axis=0)
        return self.log_prior + float(evidence.sum())

    def covariance(
        self, prior: DisplacementPrior, a: Places, b: Places
    ) -> Float[np.ndarray, "m p n"]:
        """Between displacements of trials."""
        hardware = bool(np.all(a.numbers >= 0) and np.all(b.numbers >= 0))
        base = prior.covariance(a.conditions, b.conditions, hardware=hardware)
        return base + self._changed(prior, a, b)

    def predict(
        self, prior: DisplacementPrior, at: Places, memory: Memory
    ) -> tuple[Float[np.ndarray, "m k p"], Float[np.ndarray, "m k p"]]:
        """Mean and variance of displacements under each model."""
        cross = self.covariance(prior, at, memory)[:, None]
        explained = np.sum((cross @ self.posterior.precision) * cross, axis=-1)
        variance = prior.variance(at.conditions, hardware=bool(np.all(at.numbers >= 0)))
        for change in self.changes:
            variance = variance + np.diag(change.covariance(prior, at, at))
        return self._mean(prior, at, cross), np.maximum(variance[:, None] - explained, 1e-10)

    def expected(
        self, prior: DisplacementPrior, at: Places, memory: Memory
    ) -> Float[np.ndarray, "m k p"]:
        """Mean of displacements under each model, which takes a fraction of `predict`."""
        return self._mean(prior, at, self.covariance(prior, at, memory)[:, None])

    def _mean(
        self, prior: DisplacementPrior, at: Places, cross: Float[np.ndarray, "m 1 p n"]
    ) -> Float[np.ndarray, "m k p"]:
        weighed = (cross @ self.posterior.weights[..., None])[..., 0]
        return np.asarray(prior.mean(at.conditions) + weighed)

    def _changed(self, prior: DisplacementPrior, a: Places, b: Places) -> Float[np.ndarray, "p n"]:
        nothing = np.zeros((len(a.numbers), len(b.numbers)))
        return sum((change.covariance(prior, a, b) for change in self.changes), nothing)


def told(
    histories: Sequence[History],
    prior: DisplacementPrior,
    memory: Memory,
    base: Float[np.ndarray, "m n n"],
    known: Bool[np.ndarray, " N"],
) -> list[History]:
    """The same histories after the readings in memory, inferred as one batch.

    Args:
        histories: At least one.
        prior: Of displacements.
        memory: What was read.
        base: Its covariance, had nothing changed.
        known: Which of the readings so far are still in it, all or all but one; its first ones.
    """
    m, many = len(base), len(histories)
    own = base + prior.noise[:, None, None] * np.eye(len(memory.numbers))
    covariance = np.concatenate([own + h._changed(prior, memory, memory) for h in histories])
    each = [_readings(prior, memory, h.mistaken) for h in histories]
    low, high = (
        np.repeat([getattr(readings, name) for readings in each], m, axis=0)
        for name in ("low", "high")
    )
    variance = np.broadcast_to(each[0].variance, low.shape)
    readings = replace(each[0], low=low, high=high, variance=variance)
    before = Posterior.joined([history.posterior for history in histories])
    log_prior = np.tile(prior.log_share, many)
    for i in np.flatnonzero(~known):
        left = covariance[:, None, :-1, :-1], readings.of(np.s_[..., :-1])
        before = before.without(int(i), *left, log_prior)
    after = infer(covariance, readings, log_prior, before, groups=many)
    return [
        replace(history, posterior=after.under(slice(h * m, h * m + m)))
        for h, history in enumerate(histories)
    ]


def _readings(prior: DisplacementPrior, memory: Memory, mistaken: Iterable[int] = ()) -> Readings:
    """What was read, beside what was expected before any trial."""
    mean = prior.mean(memory.conditions)
    wrong = np.isin(memory.numbers, list(mistaken))
    low = np.where(wrong, -np.inf, memory.low.T - mean)
    high = np.where(wrong, np.inf, memory.high.T - mean)
    return Readings(low, high, memory.variance.T, prior.config.outlier, _WIDTH)


def split(
    histories: Iterable[History], prior: DisplacementPrior, memory: Memory, new: Memory
) -> list[History]:
    """Return histories that may explain one more trial, before its reading is taken in.

    `memory` is without it, `new` is that trial alone.
    """
    config, number, goal = prior.config, int(new.numbers[0]), new.goals[0]
    size = new.high - new.low
    flat = np.log(np.where(size > 0, np.minimum(size, _WIDTH), 1.0) / _WIDTH).sum()
    happened = [
        (config.p_change / 2, Change(number, 0.0)),
        (config.p_change / 2, Change(number, config.shift_sd)),
        (config.p_misplaced, Change(number, config.shift_sd, tuple(goal.tolist()))),
    ]
    nothing = 1.0 - config.p_mistaken - sum(p for p, _ in happened)
    histories, before = list(histories), prior.mean(new.conditions)
    each = [history.predict(prior, new, memory) for history in histories]
    mean, variance = (np.stack(of)[:, None] for of in zip(*each, strict=True))
    more = [0.0, *(change.covariance(prior, new, new)[0, 0] for _, change in happened)]
    blurred = variance + np.reshape(more, (-1, 1, 1, 1))
    log_z, _, _ = tilted(mean - before, blurred, _readings(prior, new))
    with np.errstate(divide="ignore"):
        share = np.log([history.posterior.model_weights for history in histories])
    told = np.logaddexp.reduce(log_z[..., 0] + share[:, None], axis=2).sum(axis=-1)
    wrong = float(np.log(config.p_mistaken) + flat)
    ways: list[tuple[float, tuple[Change, ...]]] = [(nothing, ())]
    ways += [(p, (change,)) for p, change in happened]
    scored = []
    for history, under in zip(histories, told.tolist(), strict=True):
        for (p, changes), log_p in zip(ways, under, strict=True):
            after = history.then(float(np.log(p)), *changes)
            scored.append((history.log_weight + np.log(p) + log_p, after))
        mistaken = replace(history.then(wrong), mistaken=history.mistaken | {number})
        scored.append((history.log_weight + wrong, mistaken))
    scored.sort(key=lambda pair: -pair[0])
    least = scored[0][0] + np.log(_LEAST_ODDS)
    return [history for score, history in scored[:_MOST] if score > least]

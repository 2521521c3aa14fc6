"""Unannounced changes between trials, and trials that were reported wrongly.

A history says after which trials something changed, for all later trials or for one goal alone, and
which trials were reported wrongly. Each new reading branches every history: nothing happened; the
reading is wrong; something changed for good; this goal was moved. Prior odds and likelihoods weigh
the branches, and later readings decide: they contradict a wrong reading, and confirm a change.

Histories are kept unless they are a thousand times less probable than the best one.

Source: Adams and MacKay, Bayesian online changepoint detection, 2007, for the recursion; that
changes add to a field, and affect one goal or all, is ours.
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
from prior_reinforce.adapters.memory import Inputs, Memory

_LEAST_ODDS = 1e-3
"""Histories less probable than this share of the most probable one are dropped (ours)."""
_MOST_HISTORIES = 6
"""Most histories that are kept (ours)."""
_P_NO_CHANGE = 0.1
"""Probability that nothing has changed although a change was announced (ours)."""
_WIDTH = 8.0
"""W of `expectation_propagation`: a wrong reading is uniform over it."""


@dataclass(frozen=True)
class Change:
    """Something is different from one trial on."""

    since: int
    """Number of the first trial that it affects."""
    shift_sd: float
    """Standard deviation of the shift of all outcomes; 0 for changed hardware, whose effect varies
    with the condition."""
    goal: tuple[float, ...] | None = None
    """The goal that was moved, alone affected; None if all goals are affected."""

    def affects(self, inputs: Inputs) -> Bool[np.ndarray, " p"]:
        """Return which trials it affects."""
        after = inputs.numbers >= self.since
        return after if self.goal is None else after & np.all(inputs.goals == self.goal, axis=1)

    def covariance(
        self, prior: DisplacementPrior, a: Inputs, b: Inputs
    ) -> Float[np.ndarray, "p n"]:
        """Return the covariance that it adds to displacements."""
        both = np.outer(self.affects(a), self.affects(b))
        if self.shift_sd:
            return np.asarray(both * self.shift_sd**2)
        return np.asarray(both * prior.hardware_change(a.conditions, b.conditions))


def announced_changes(since: int, shift_sd: float) -> list[tuple[tuple[Change, ...], float]]:
    """Return the changes that an announcement may mean, and the log probability of each."""
    log_p = math.log(0.5 * (1.0 - _P_NO_CHANGE))
    changes = [((Change(since, sd),), log_p) for sd in (0.0, shift_sd)]
    return [((), math.log(_P_NO_CHANGE)), *changes]


def changes_from_data(data: Any) -> tuple[Change, ...]:
    """Make changes of plain data: what `dataclasses.astuple` gives of each."""
    return tuple(Change(since, sd, goal and tuple(goal)) for since, sd, goal in data)


@dataclass(frozen=True, eq=False)
class History:
    """One hypothesis of what happened, and the posterior of displacements under it."""

    changes: tuple[Change, ...]
    mistaken: frozenset[int]
    """Numbers of the trials that were reported wrongly."""
    log_prior: float
    posterior: Posterior

    def extend(self, log_p: float, *changes: Change) -> History:
        """Return it with further changes, of that log probability."""
        return replace(self, changes=(*self.changes, *changes), log_prior=self.log_prior + log_p)

    @property
    def log_weight(self) -> float:
        """Log probability of this history and the readings, up to a constant."""
        evidence = np.logaddexp.reduce(self.posterior.log_evidence, axis=0)
        return self.log_prior + float(evidence.sum())

    def covariance(
        self, prior: DisplacementPrior, a: Inputs, b: Inputs
    ) -> Float[np.ndarray, "m p n"]:
        """Return prior covariances of displacements under each model."""
        hardware = bool(np.all(a.numbers >= 0) and np.all(b.numbers >= 0))
        base = prior.covariance(a.conditions, b.conditions, hardware=hardware)
        return base + self.change_covariance(prior, a, b)

    def change_covariance(
        self, prior: DisplacementPrior, a: Inputs, b: Inputs
    ) -> Float[np.ndarray, "p n"]:
        """Return the covariance that all changes add."""
        zero = np.zeros((len(a.numbers), len(b.numbers)))
        return sum((change.covariance(prior, a, b) for change in self.changes), zero)

    def predict(
        self, prior: DisplacementPrior, inputs: Inputs, memory: Memory
    ) -> tuple[Float[np.ndarray, "m k p"], Float[np.ndarray, "m k p"]]:
        """Return mean and variance of displacements under each model."""
        cross = self.covariance(prior, inputs, memory)[:, None]
        explained = np.sum((cross @ self.posterior.precision) * cross, axis=-1)
        variance = prior.variance(inputs.conditions, hardware=bool(np.all(inputs.numbers >= 0)))
        for change in self.changes:
            variance = variance + np.diag(change.covariance(prior, inputs, inputs))
        return self._mean(prior, inputs, cross), np.maximum(variance[:, None] - explained, 1e-10)

    def predict_mean(
        self, prior: DisplacementPrior, inputs: Inputs, memory: Memory
    ) -> Float[np.ndarray, "m k p"]:
        """Return the mean alone, in a fraction of the time of `predict`."""
        return self._mean(prior, inputs, self.covariance(prior, inputs, memory)[:, None])

    def _mean(
        self, prior: DisplacementPrior, inputs: Inputs, cross: Float[np.ndarray, "m 1 p n"]
    ) -> Float[np.ndarray, "m k p"]:
        update = (cross @ self.posterior.weights[..., None])[..., 0]
        return np.asarray(prior.mean(inputs.conditions) + update)


def infer_posteriors(
    histories: Sequence[History],
    prior: DisplacementPrior,
    memory: Memory,
    base: Float[np.ndarray, "m n n"],
    kept: Bool[np.ndarray, " N"],
) -> list[History]:
    """Return the histories with posteriors given all readings in memory, inferred as one batch.

    Args:
        histories: At least one.
        prior: Of displacements.
        memory: The readings; the latest ones are not yet in the posteriors.
        base: Prior covariance of the displacements without changes.
        kept: Which readings in the posteriors are still in memory: all, or all but one.
    """
    m, n_histories = len(base), len(histories)
    base = base + prior.noise_variance[:, None, None] * np.eye(len(memory.numbers))
    of_changes = [history.change_covariance(prior, memory, memory) for history in histories]
    covariance = np.concatenate([base + added for added in of_changes])
    each = [_readings(prior, memory, h.mistaken) for h in histories]
    low = np.repeat([readings.low for readings in each], m, axis=0)
    high = np.repeat([readings.high for readings in each], m, axis=0)
    variance = np.broadcast_to(each[0].variance, low.shape)
    readings = replace(each[0], low=low, high=high, variance=variance)
    previous = Posterior.concatenate([history.posterior for history in histories])
    log_prior = np.tile(prior.log_prior, n_histories)
    for i in np.flatnonzero(~kept):
        remaining = covariance[:, None, :-1, :-1], readings.select(np.s_[..., :-1])
        previous = previous.without(int(i), *remaining, log_prior)
    posterior = infer(covariance, readings, log_prior, previous, groups=n_histories)
    return [
        replace(history, posterior=posterior.select(slice(h * m, h * m + m)))
        for h, history in enumerate(histories)
    ]


def _readings(prior: DisplacementPrior, memory: Memory, mistaken: Iterable[int] = ()) -> Readings:
    """Readings less the prior mean; wrong ones say nothing."""
    mean = prior.mean(memory.conditions)
    wrong = np.isin(memory.numbers, list(mistaken))
    low = np.where(wrong, -np.inf, memory.low.T - mean)
    high = np.where(wrong, np.inf, memory.high.T - mean)
    return Readings(low, high, memory.variance.T, prior.config.outlier, _WIDTH)


def branch(
    histories: Sequence[History], prior: DisplacementPrior, memory: Memory, new: Memory
) -> list[History]:
    """Return the branches of all histories that may explain a new trial, the most probable first.

    `new` is that trial alone and `memory` is without it; posteriors stay without its reading.
    """
    config, number, goal = prior.config, int(new.numbers[0]), new.goals[0]
    changes = [
        (config.p_change / 2, Change(number, 0.0)),
        (config.p_change / 2, Change(number, config.shift_sd)),
        (config.p_misplaced, Change(number, config.shift_sd, tuple(goal.tolist()))),
    ]
    branches: list[tuple[float, tuple[Change, ...]]] = [
        (1.0 - config.p_mistaken - sum(p for p, _ in changes), ()),
        *((p, (change,)) for p, change in changes),
    ]
    each = [history.predict(prior, new, memory) for history in histories]
    mean, variance = (np.stack(of)[:, None] for of in zip(*each, strict=True))
    added = [0.0, *(change.covariance(prior, new, new)[0, 0] for _, change in changes)]
    variance = variance + np.reshape(added, (-1, 1, 1, 1))
    log_z, _, _ = tilted(mean - prior.mean(new.conditions), variance, _readings(prior, new))
    with np.errstate(divide="ignore"):
        log_models = np.log([history.posterior.model_weights for history in histories])
    likelihoods = np.logaddexp.reduce(log_z[..., 0] + log_models[:, None], axis=2).sum(axis=-1)
    size = new.high - new.low
    uniform = np.log(np.where(size > 0, np.minimum(size, _WIDTH), 1.0) / _WIDTH).sum()
    log_mistaken = float(np.log(config.p_mistaken) + uniform)
    scored = []
    for history, of_history in zip(histories, likelihoods.tolist(), strict=True):
        weight = history.log_weight
        for (p, more), likelihood in zip(branches, of_history, strict=True):
            log_p = float(np.log(p))
            scored.append((weight + log_p + likelihood, history.extend(log_p, *more)))
        wrong = replace(history.extend(log_mistaken), mistaken=history.mistaken | {number})
        scored.append((weight + log_mistaken, wrong))
    scored.sort(key=lambda pair: -pair[0])
    least = scored[0][0] + np.log(_LEAST_ODDS)
    return [history for score, history in scored[:_MOST_HISTORIES] if score > least]

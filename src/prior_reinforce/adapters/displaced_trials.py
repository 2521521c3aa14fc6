"""Trials of plans as they were learned: the next condition, and what to expect of it.

The part of `BayesianAdapter` for demonstrations without a symmetry; the other is `moved_trials`.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from dataclasses import astuple, replace

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.adapters.base import Expectation, State
from prior_reinforce.adapters.change_points import (
    History,
    announced_changes,
    branch,
    changes_from_data,
    infer_posteriors,
)
from prior_reinforce.adapters.displacement import BayesianConfig, DisplacementPrior
from prior_reinforce.adapters.expectation_propagation import Posterior, Readings, infer
from prior_reinforce.adapters.memory import Inputs, Memory, repeats_miss, untried_conditions
from prior_reinforce.adapters.p_hit import (
    Prediction,
    Targets,
    ball_probability,
    expected_trials,
    p_hit_given_misses,
)
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading

_STEPS = 12
"""Most steps of the fixed-point iteration for the condition (ours). It need not converge: not where
outcomes hardly depend on the condition, as with demonstrations in a line."""
_RELAXATION = 0.7
_CONVERGED = 1e-5
"""A shorter step, in spreads, is the last (ours)."""
_LONGEST_CORRECTION = 6.0
"""Longest correction, in spreads (ours). Where weights are steep, an outcome may lie a hundred
spreads away. Three demonstrations nearly in a line need 2 to 4: bounded at 2 spreads, goals took
2.3 instead of 2.2 trials (24 draws; reproduction/docs/decisions-adapter.md)."""
_LEAST_P_HIT = 0.02
"""Below this probability of a hit, what was learned is no guide (ours)."""
_NOMINAL_TOLERANCE = 0.1
"""Tolerance if no trial stated one, in spreads (ours): theirs is 0.02 to 0.3."""
_TEACHING_SD = 0.1
"""Sd of the reading of a trial made in order to learn, in spreads (ours): "5 cm" by eye is an
interval of 4 cm, whose standard deviation is 1.2 cm of 12 to 18."""
_REPEATABLE = 0.3
"""Greatest sd of the executions of a plan that missed, in tolerances (ours): it would miss again.
On our own tasks it is 0.13 to 0.30."""
_LEAST_SD = 1e-3
"""Least sd of a reading, in spreads (ours)."""


class DisplacedTrials:
    """Posterior of the displacement between condition and outcome, and the best next condition.

    In normalised units, where S, the root mean square deviation of the demonstrated outcomes, is 1
    (one S for each unit), the outcome of a plan generated for c is r = c + d(c), in each component

        d(c) = sum_i w_i(c) e_i + F(c) - sum_i w_i(c) F(r_i) + h(c) + noise

    with independent Gaussian terms, all but e of prior mean 0:

        e   mean m_i, sd s_i    error of the outcome of demonstration i: m_i as its label says
                                (`Demonstrations.outcome_correction`); s_i from the label's stated
                                noise and that of one execution
        F   sd 0.05, 0.2 or 0.8, length scale 1.4    error of the generator between demonstrations;
                                a measured demonstration is a reading of it
        h   sd 0.01, or with probability 0.2 0.3, length scale 2.5    what has changed since the day
                                of the demonstrations
        noise  sd 0.005, 0.02 or 0.05    of one execution

    w are the weights of a spline over the demonstrated outcomes (`plans.outcome_weights`), by which
    generators mix plans. Each combination of sizes is a model, weighed by its evidence, for each
    component separately (`adapters.displacement`).

    Something may happen between two trials (`adapters.change_points`): with probability 0.02 a
    change for all later trials, a shift of sd 0.8 or an h of sd 0.3; with 0.002 one goal is moved;
    with 0.01 the trial is reported wrongly. The hypotheses are kept as histories, each with its
    probability, and later readings decide. An announced change has probability 0.9.

    A reading (`readings.Reading`) says that the blurred error r - g lies in an interval, or, with
    probability 0.002, nothing at all. Expectation propagation gives the posterior of each model and
    history.

    The next condition is the fixed point c = g - E d(c) of the most probable history. Before any
    trial, and where that hardly hits, it is the goal less the error that labels state, which is 0
    for measured ones. If the fixed point would repeat a miss of the same goal, because its reading
    did not say what to change (a word coarser than the tolerance, or "a miss" and nothing else),
    the untried condition beside it that most probably hits is next, given all misses
    (`adapters.p_hit`).
    """

    odds: dict[str, float] | None = None
    """None: no symmetry is stated."""
    doubted = False

    def __init__(self, config: BayesianConfig, demonstrations: Demonstrations) -> None:
        """Begin without trials."""
        self.config = config
        self._prior = DisplacementPrior(config, demonstrations)
        self._normalisation = self._prior.normalisation
        self._memory, self._next = Memory.empty(demonstrations.outcome_dim), 0
        none, log_prior = np.empty((demonstrations.outcome_dim, 0)), self._prior.log_prior
        prior = infer(np.empty((len(log_prior), 0, 0)), Readings(none, none, none), log_prior)
        self._histories = [History((), frozenset(), 0.0, prior)]

    def state(self) -> State:
        """Return what `resume` needs."""
        histories = self._histories
        posteriors = [vars(history.posterior) for history in histories]
        return State(
            {
                "histories": [
                    [list(map(astuple, h.changes)), sorted(h.mistaken), h.log_prior]
                    for h in histories
                ],
                "now": self._next,
            },
            {
                **vars(self._memory),
                **{name: np.stack([of[name] for of in posteriors]) for name in posteriors[0]},
            },
        )

    def resume(self, state: State) -> None:
        """Take up what `state` returned."""
        self._next, self._memory = state.facts["now"], state.build(Memory)
        posterior = state.build(Posterior)
        self._histories = [
            History(changes_from_data(changes), frozenset(mistaken), log_prior, posterior.select(h))
            for h, (changes, mistaken, log_prior) in enumerate(state.facts["histories"])
        ]

    def change_hardware(self) -> None:
        """Branch every history: hardware may be different from now on."""
        announced = announced_changes(self._next, self.config.shift_sd)
        after = [h.extend(log_p, *changes) for changes, log_p in announced for h in self._histories]
        self._histories = sorted(after, key=lambda h: -h.log_weight)

    def observe(self, condition: Point, goal: Point, reading: Reading) -> None:
        """Take in one trial; see `Adapter.observe`."""
        scale, to_goal = self._normalisation.scale, goal - condition
        radius = reading.missed_by_at_least
        new = Memory(
            self._normalisation.apply(condition[None]),
            np.array([self._next]),
            self._normalisation.apply(goal[None]),
            low=((reading.low + to_goal) / scale)[None],
            high=((reading.high + to_goal) / scale)[None],
            variance=((reading.sd / scale) ** 2 + _LEAST_SD**2)[None],
            missed_by=(np.zeros(len(scale)) if radius is None else radius / scale)[None],
        )
        branches = branch(self._histories, self._prior, self._memory, new)
        memory = self._memory.append(new)
        kept = memory.kept()
        memory = memory.select(kept)
        base = self._prior.covariance(memory.conditions, memory.conditions)
        after = infer_posteriors(branches, self._prior, memory, base, kept[:-1])
        self._histories = sorted(after, key=lambda history: -history.log_weight)
        self._memory, self._next = memory, self._next + 1

    def propose(self, goal_seen: Point) -> Point:
        """Return the condition to try next; see `Adapter.propose`."""
        goal = self._normalisation.apply(goal_seen)
        condition = self._best_condition(goal)
        missed = self._memory.select(self._memory.missed)
        same_goal = np.all(missed.goals == goal, axis=1)
        tried = missed.select(self._unchanged_since(missed, goal) & same_goal)
        if repeats_miss(condition[None], tried.conditions, tried.missed_by)[0]:
            condition = self._best_untried(condition, goal, tried)
        return self._normalisation.undo(condition)

    def _best_condition(self, goal: Point) -> Point:
        """The fixed point of the most probable history, unless it hardly hits.

        Then the condition before any trial, if it hits more probably: a motion that lost its object
        tells nothing of where to aim.
        """
        fixed_point = self._fixed_point(goal, self._histories[0])
        conditions = np.array([fixed_point, goal - self._prior.mean(goal[None])[:, 0]])
        radii = self._memory.missed_by[self._memory.missed]
        radius = radii[-1] if len(radii) else np.full(len(goal), _NOMINAL_TOLERANCE)
        p_hit = self._p_hit(self._inputs(conditions, goal), radius)
        return np.asarray(conditions[0 if p_hit[0] > _LEAST_P_HIT else np.argmax(p_hit)])

    def _fixed_point(self, goal: Point, history: History) -> Point:
        """Return the fixed point c = g - E d(c) of a history, in normalised units."""
        condition, weights = goal, history.posterior.model_weights
        for _ in range(_STEPS):
            inputs = self._inputs(condition[None], goal)
            mean = history.predict_mean(self._prior, inputs, self._memory)
            step = _RELAXATION * (goal - np.einsum("mk,mkp->k", weights, mean) - condition)
            condition = goal + _clipped(condition + step - goal, _LONGEST_CORRECTION)
            if np.linalg.norm(step) < _CONVERGED:
                break
        return condition

    def _unchanged_since(self, trials: Memory, goal: Point) -> Bool[np.ndarray, " n"]:
        """Which trials no later change separates from a trial for that goal now, most probably."""
        changes, now = self._histories[0].changes, self._inputs(goal[None], goal)
        after = [change.affects(trials) for change in changes if change.affects(now)[0]]
        return np.all(after, axis=0) if after else np.ones(len(trials.numbers), dtype=bool)

    def _best_untried(self, condition: Point, goal: Point, tried: Memory) -> Point:
        """Return the untried condition around another that most probably hits.

        It is sought within the last tolerance and two sds, at most those of changed hardware: where
        weights are steep, the sd means nothing.
        """
        best = self._histories[0]
        inputs = self._inputs(condition[None], goal)
        _, variance = best.predict(self._prior, inputs, self._memory)
        weights = best.posterior.model_weights
        sd = math.sqrt(float(np.einsum("mk,mkp->k", weights, variance).max()))
        radius = tried.missed_by[-1]
        reach = radius + 2.0 * min(sd, self.config.hardware_sd[1])
        candidates = untried_conditions(condition, reach, tried.conditions, tried.missed_by)
        p_hit = self._p_hit(self._inputs(candidates, goal), radius)
        return np.asarray(candidates[np.argmax(p_hit)])

    def expect(self, condition: Point, goal: Point, tolerance: Point) -> Expectation:
        """Return what is expected of a trial; see `Adapter.expect`."""
        p_hit = float(self.p_hit(condition[None], goal[None], tolerance)[0])
        trials = expected_trials(p_hit, self._memory)
        c, g = (self._normalisation.apply(point) for point in (condition, goal))
        mean, variance = (of[0] for of in self._moments(self._inputs(c[None], g)))
        scale = self._normalisation.scale
        return Expectation(p_hit, trials, (c + mean - g) * scale, np.sqrt(variance) * scale)

    def p_hit(self, conditions: Points, goals: Points, tolerance: Point) -> Float[np.ndarray, " n"]:
        """Return each condition's probability of a hit; see `BayesianAdapter.p_hit`."""
        radius = np.asarray(tolerance) / self._normalisation.scale
        c, g = (self._normalisation.apply(values) for values in (conditions, goals))
        return self._p_hit(self._inputs(c, g), radius, seed=1)

    def _inputs(
        self, conditions: Points, goal: Point | Points, number: int | None = None
    ) -> Inputs:
        """Inputs of the next trial, or of the numbered one."""
        numbers = np.full(len(conditions), self._next if number is None else number)
        return Inputs(conditions, numbers, np.broadcast_to(goal, conditions.shape))

    def _weighted_histories(self) -> Iterator[tuple[float, History]]:
        """Each history after its probability."""
        logs = np.array([history.log_weight for history in self._histories])
        shares = np.exp(logs - logs.max())
        return zip((shares / shares.sum()).tolist(), self._histories, strict=True)

    def _predict(
        self, inputs: Inputs
    ) -> Iterator[tuple[float, np.ndarray, np.ndarray, np.ndarray]]:
        """Probability, model weights, mean and variance of each history."""
        for probability, history in self._weighted_histories():
            weights = history.posterior.model_weights
            yield probability, weights, *history.predict(self._prior, inputs, self._memory)

    def _moments(self, inputs: Inputs) -> tuple[Points, Points]:
        """Mean and variance of displacements over all histories and models."""
        total, square = np.zeros((2, *inputs.conditions.shape))
        for probability, weights, mean, variance in self._predict(inputs):
            total += np.einsum("mk,mkp->pk", probability * weights, mean)
            square += np.einsum("mk,mkp->pk", probability * weights, variance + mean**2)
        return total, square - total**2

    def _p_hit(self, inputs: Inputs, radius: Point, *, seed: int = 0) -> Float[np.ndarray, " n"]:
        """Probability that each condition hits its goal; one seed chooses, another judges."""
        missed = self._memory.bare_misses(self._memory.to_goal)
        to_goal = inputs.goals - inputs.conditions
        if len(missed.numbers) > 0:
            predictions = [
                self._joint_prediction(probability, history, missed, inputs, radius)
                for probability, history in self._weighted_histories()
            ]
            targets = Targets(to_goal, np.broadcast_to(radius, to_goal.shape))
            misses = Targets(missed.to_goal, missed.missed_by)
            return p_hit_given_misses(predictions, misses, targets, self.config.outlier, seed)
        total, half_axes = np.zeros(len(inputs.numbers)), radius[:, None]
        for probability, weights, mean, variance in self._predict(inputs):
            off, sd = (mean - to_goal.T) / half_axes, np.sqrt(variance) / half_axes
            total += probability * ball_probability(off, sd, weights)
        return total

    def _joint_prediction(
        self, probability: float, history: History, missed: Memory, inputs: Inputs, radius: Point
    ) -> Prediction:
        """Displacements of misses and candidates together, with noise as small as `_REPEATABLE`."""
        prior, memory, posterior = self._prior, self._memory, history.posterior
        missed_cross = history.covariance(prior, missed, memory)[:, None]
        cross = history.covariance(prior, inputs, memory)[:, None]
        explained = posterior.precision @ np.swapaxes(missed_cross, 2, 3)
        mean, variance = history.predict(prior, inputs, memory)
        execution = prior.noise_variance[:, None]
        noise = np.minimum(execution, (_REPEATABLE * radius) ** 2)
        covariance = history.covariance(prior, missed, missed)[:, None]
        covariance = covariance + noise[..., None, None] * np.eye(len(missed.numbers))
        return Prediction(
            probability=probability,
            model_weights=posterior.model_weights,
            missed_mean=history.predict_mean(prior, missed, memory),
            missed_covariance=covariance - missed_cross @ explained,
            mean=mean,
            variance=variance - (execution - noise)[..., None],
            cross=history.covariance(prior, inputs, missed)[:, None] - cross @ explained,
        )

    def displacement(self, conditions: Points, *, hardware: bool = True) -> Points:
        """Return expected outcomes minus conditions; see `BayesianAdapter.displacement`."""
        c = self._normalisation.apply(conditions)
        mean, _ = self._moments(self._inputs(c, c, None if hardware else -1))
        return mean * self._normalisation.scale

    def gain(
        self, candidates: Points, over: Float[np.ndarray, "m k"], *, demonstrations: bool = False
    ) -> Float[np.ndarray, " n"]:
        """Share of the variance elsewhere that a reading removes; see `BayesianAdapter.gain`."""
        candidates, over = self._normalisation.apply(candidates), self._normalisation.apply(over)
        there, here = self._inputs(over, over), self._inputs(candidates, candidates)
        before = self._mean_variance(there)
        if demonstrations:
            after = [self._with_demonstration(r[None])._mean_variance(there) for r in candidates]
            return 1.0 - np.array(after) / before
        best, prior, memory = self._histories[0], self._prior, self._memory
        _, variance = best.predict(prior, here, memory)
        explained = best.covariance(prior, here, memory)[:, None] @ best.posterior.precision
        cross = best.covariance(prior, there, memory)[:, None]
        covariance = best.covariance(prior, here, there)[:, None]
        covariance = covariance - explained @ np.swapaxes(cross, 2, 3)
        removed = np.square(covariance).mean(axis=-1) / (variance + _TEACHING_SD**2)
        return np.asarray(np.einsum("mk,mkn->n", best.posterior.model_weights, removed) / before)

    def _mean_variance(self, inputs: Inputs) -> float:
        """Variance of a displacement, averaged over inputs and summed over components."""
        best = self._histories[0]
        _, variance = best.predict(self._prior, inputs, self._memory)
        return float(np.sum(best.posterior.model_weights * variance.mean(axis=-1)))

    def _with_demonstration(self, outcome: Float[np.ndarray, "1 k"]) -> DisplacedTrials:
        """Return a copy with one more demonstration, and the most probable history alone."""
        other = copy.copy(self)
        other._prior = self._prior.with_demonstration(outcome)
        conditions, best = self._memory.conditions, self._histories[0]
        base, kept = other._prior.covariance(conditions, conditions), np.ones(len(conditions), bool)
        best = replace(best, posterior=best.posterior.as_start())
        other._histories = infer_posteriors([best], other._prior, self._memory, base, kept)
        return other


def _clipped(vector: Point, longest: float) -> Point:
    """Shorten a vector to at most this length."""
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)

"""Trials of plans as they were learned: what to try next, and what is expected of it.

The part of `BayesianAdapter` for demonstrations without a symmetry; its sister is `moved_trials`.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from dataclasses import astuple, replace

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.adapters.base import Expectation, State
from prior_reinforce.adapters.change_points import History, announced, changes_of, split, told
from prior_reinforce.adapters.displacement import BayesianConfig, DisplacementPrior
from prior_reinforce.adapters.expectation_propagation import Posterior, Readings, infer
from prior_reinforce.adapters.memory import Memory, Places, tried_again, untried_around
from prior_reinforce.adapters.p_hit import Belief, Targets, p_hit_after, share_within, trials_to_go
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading

_STEPS = 12
"""Steps to the fixed point of the proposal, each 0.7 of the way (ours). They need not end there:
where landing hardly depends on the condition, as with demonstrations in a line, they go on."""
_RELAXATION = 0.7
_ARRIVED = 1e-5
"""A step that is shorter, in spreads, is the last (ours)."""
_FARTHEST = 6.0
"""A correction is so many spreads at most (ours). Where weights are
steep, an outcome may lie a hundred spreads away. Three demonstrations nearly in a line need 2 to 4:
bounded at 2 spreads, goals took 2.3 instead of 2.2 trials (24 draws;
reproduction/docs/decisions-adapter.md)."""
_HARDLY = 0.02
"""Where the probability of a hit is less, what was learned is no guide (ours)."""
_NOMINAL = 0.1
"""Tolerance where no trial told one, in spreads (ours): theirs is 0.02 to 0.3."""
_TEACHING_SD = 0.1
"""How finely a trial that is made to learn from is read, in spreads (ours): "5 cm" by eye is an
interval of 4 cm, whose standard deviation is 1.2 cm of 12 to 18."""
_REPEATABLE = 0.3
"""What missed would miss again: executions of one plan are then taken to lie no farther apart than
this share of the tolerance, as a standard deviation (ours). On our own tasks it is 0.13 to 0.30."""
_SHARPEST = 1e-3
"""Least sd of a reading, in spreads (ours)."""


class DisplacedTrials:
    """What is believed of the displacement between condition and outcome, and the best next try.

    In normalised units, where S, the root mean square deviation of the demonstrated outcomes, is 1
    (one S for each unit), a plan generated for c comes down at r = c + d(c), in each component

        d(c) = sum_i w_i(c) e_i + F(c) - sum_i w_i(c) F(r_i) + h(c) + noise

    with independent Gaussian terms, all but e of prior mean 0:

        e   mean m_i, sd s_i    by how much the outcome of demonstration i is off: m_i as its label
                                says (`Demonstrations.outcome_correction`), give or take the noise
                                that it states, and that of an execution
        F   sd 0.05, 0.2 or 0.8, reach 1.4    where landing bends between demonstrations; a
                                demonstration that was measured is a reading of it
        h   sd 0.01, or with probability 0.2 0.3, reach 2.5    what is different from their day
        noise  sd 0.005, 0.02 or 0.05    execution

    w are the weights of a spline over the demonstrated outcomes (`plans.outcome_weights`), by which
    generators mix plans. Each combination of sizes is a model, and the evidence weighs them, for
    each component by itself. The prior stands in `adapters.displacement`.

    Between two trials something may happen (`adapters.change_points`): with probability 0.02
    something changes for all trials from then on, by a shift of sd 0.8 or as h with 0.3; with 0.002
    one goal is moved; with 0.01 the trial is told wrongly. What may have happened is kept as
    histories, each with its probability, and later readings decide. Where a change is announced,
    its probability is 0.9.

    A reading (`readings.Reading`) says that the blurred error r - g lies in an interval, or, with
    probability 0.002, nothing at all. The posterior of each model and history is found by
    expectation propagation.

    The next condition is the fixed point c = g - E d(c) of the most probable history; where that
    hardly hits, and with nothing but demonstrations, it is the goal, less what their labels say to
    be off: nothing, where they were measured. Where the fixed point has just missed the same goal,
    since its reading did not say what to change (a word coarser than the tolerance, or "a miss" and
    nothing else), the condition beside it that most probably hits is next, given all that missed
    (`adapters.p_hit`).
    """

    odds: dict[str, float] | None = None
    """No symmetry is stated, so none is weighed."""
    doubted = False

    def __init__(self, config: BayesianConfig, demonstrations: Demonstrations) -> None:
        """Know nothing but the demonstrations."""
        self.config = config
        self._prior = DisplacementPrior(config, demonstrations)
        self._normalisation = self._prior.normalisation
        self._memory, self._now = Memory.empty(demonstrations.outcome_dim), 0
        self._histories = [self._from_the_beginning()]

    def _from_the_beginning(self) -> History:
        """What follows from demonstrations alone, where nothing happened."""
        k = len(self._normalisation.scale)
        none, m = np.empty((k, 0)), len(self._prior.log_share)
        nothing = infer(np.empty((m, 0, 0)), Readings(none, none, none), self._prior.log_share)
        return History((), frozenset(), 0.0, nothing)

    def state(self) -> State:
        """What `resume` needs."""
        histories = self._histories
        posteriors = [vars(history.posterior) for history in histories]
        return State(
            {
                "histories": [
                    [list(map(astuple, h.changes)), sorted(h.mistaken), h.log_prior]
                    for h in histories
                ],
                "now": self._now,
            },
            {
                **vars(self._memory),
                **{name: np.stack([of[name] for of in posteriors]) for name in posteriors[0]},
            },
        )

    def resume(self, state: State) -> None:
        """Go on from what `state` gave."""
        self._now, self._memory = state.facts["now"], state.made(Memory)
        posterior = state.made(Posterior)
        self._histories = [
            History(changes_of(changes), frozenset(mistaken), log_prior, posterior.under(h))
            for h, (changes, mistaken, log_prior) in enumerate(state.facts["histories"])
        ]

    def change_hardware(self) -> None:
        """Something may be different from now on; what is known of it stays as known."""
        may_be = announced(self._now, self.config.shift_sd)
        after = [h.then(log_p, *changes) for changes, log_p in may_be for h in self._histories]
        self._histories = sorted(after, key=lambda h: -h.log_weight)

    def observe(self, condition: Point, goal: Point, reading: Reading) -> None:
        """Take in one trial; see `Adapter.observe`."""
        scale, moved = self._normalisation.scale, goal - condition
        radius = reading.missed_by_at_least
        new = Memory(
            self._normalisation.apply(condition[None]),
            np.array([self._now]),
            self._normalisation.apply(goal[None]),
            low=((reading.low + moved) / scale)[None],
            high=((reading.high + moved) / scale)[None],
            variance=((reading.sd / scale) ** 2 + _SHARPEST**2)[None],
            missed_by=(np.zeros(len(scale)) if radius is None else radius / scale)[None],
        )
        may_be = split(self._histories, self._prior, self._memory, new)
        memory = self._memory.followed_by(new)
        keep = memory.worth_keeping()
        memory = memory.only(keep)
        base = self._prior.covariance(memory.conditions, memory.conditions)
        after = told(may_be, self._prior, memory, base, keep[:-1])
        self._histories = sorted(after, key=lambda history: -history.log_weight)
        self._memory, self._now = memory, self._now + 1

    def propose(self, goal_seen: Point) -> Point:
        """Return the condition to try next; see `Adapter.propose`."""
        goal = self._normalisation.apply(goal_seen)
        condition = self._most_probable(goal)
        missed = self._memory.only(self._memory.missed)
        tried = missed.only(self._as_now(missed, goal) & np.all(missed.goals == goal, axis=1))
        if tried_again(condition[None], tried.conditions, tried.missed_by)[0]:
            condition = self._likeliest_beside(condition, goal, tried)
        return self._normalisation.undo(condition)

    def _most_probable(self, goal: Point) -> Point:
        """The fixed point of the most probable history, unless it hardly hits.

        What demonstrations alone ask for is then asked for, if it hits more probably: a motion that
        lost its object points away from everywhere.
        """
        learned = self._expected_to_land_on(goal, self._histories[0])
        conditions = np.array([learned, goal - self._prior.mean(goal[None])[:, 0]])
        told = self._memory.missed_by[self._memory.missed]
        radius = told[-1] if len(told) else np.full(len(goal), _NOMINAL)
        p_hit = self._p_hit_now(self._places(conditions, goal), radius)
        return np.asarray(conditions[0 if p_hit[0] > _HARDLY else np.argmax(p_hit)])

    def _expected_to_land_on(self, goal: Point, history: History) -> Point:
        """Return the fixed point c = g - E d(c) of a history, in normalised units."""
        condition, share = goal, history.posterior.model_weights
        for _ in range(_STEPS):
            at = self._places(condition[None], goal)
            mean = history.expected(self._prior, at, self._memory)
            step = _RELAXATION * (goal - np.einsum("mk,mkp->k", share, mean) - condition)
            condition = goal + _clipped(condition + step - goal, _FARTHEST)
            if np.linalg.norm(step) < _ARRIVED:
                break
        return condition

    def _as_now(self, trials: Memory, goal: Point) -> Bool[np.ndarray, " n"]:
        """Which trials were made with all as it is now, for that goal, most probably."""
        changes, now = self._histories[0].changes, self._places(goal[None], goal)
        same = [change.concerns(trials) for change in changes if change.concerns(now)[0]]
        return np.all(same, axis=0) if same else np.ones(len(trials.numbers), dtype=bool)

    def _likeliest_beside(self, condition: Point, goal: Point, tried: Memory) -> Point:
        """Return the condition around another that most probably hits, within the last tolerance.

        No farther away than changed hardware takes it: where weights are steep, the sd means
        nothing.
        """
        best = self._histories[0]
        at = self._places(condition[None], goal)
        _, variance = best.predict(self._prior, at, self._memory)
        share = best.posterior.model_weights
        sd = math.sqrt(float(np.einsum("mk,mkp->k", share, variance).max()))
        radius = tried.missed_by[-1]
        reach = radius + 2.0 * min(sd, self.config.hardware_sd[1])
        candidates = untried_around(condition, reach, tried.conditions, tried.missed_by)
        p_hit = self._p_hit_now(self._places(candidates, goal), radius)
        return np.asarray(candidates[np.argmax(p_hit)])

    def expect(self, condition: Point, goal: Point, tolerance: Point) -> Expectation:
        """Return what is expected of a trial; see `Adapter.expect`."""
        p_hit = float(self.p_hit(condition[None], goal[None], tolerance)[0])
        trials = trials_to_go(p_hit, self._memory)
        at, aim = (self._normalisation.apply(point) for point in (condition, goal))
        mean, variance = (of[0] for of in self._expected(self._places(at[None], aim)))
        scale = self._normalisation.scale
        return Expectation(p_hit, trials, (at + mean - aim) * scale, np.sqrt(variance) * scale)

    def p_hit(self, conditions: Points, goals: Points, tolerance: Point) -> Float[np.ndarray, " n"]:
        """Return each condition's probability of a hit; see `BayesianAdapter.p_hit`."""
        radius = np.asarray(tolerance) / self._normalisation.scale
        at, targets = (self._normalisation.apply(values) for values in (conditions, goals))
        return self._p_hit_now(self._places(at, targets), radius, seed=1)

    def _places(
        self, conditions: Points, goal: Point | Points, number: int | None = None
    ) -> Places:
        """Of trials of now, if not said when."""
        numbers = np.full(len(conditions), self._now if number is None else number)
        return Places(conditions, numbers, np.broadcast_to(goal, conditions.shape))

    def _weighed(self) -> Iterator[tuple[float, History]]:
        """The probability of each history, and it."""
        logs = np.array([history.log_weight for history in self._histories])
        shares = np.exp(logs - logs.max())
        return zip((shares / shares.sum()).tolist(), self._histories, strict=True)

    def _predicted(self, at: Places) -> Iterator[tuple[float, np.ndarray, np.ndarray, np.ndarray]]:
        """Under each history: its probability, that of each model, mean and variance there."""
        for probability, history in self._weighed():
            share = history.posterior.model_weights
            yield probability, share, *history.predict(self._prior, at, self._memory)

    def _p_hit_now(self, at: Places, radius: Point, *, seed: int = 0) -> Float[np.ndarray, " n"]:
        """Probability that each condition hits its goal, given all that was told."""
        missed = self._memory.bare_misses(self._memory.aims)
        if len(missed.numbers) > 0:
            return self._p_hit_after(missed, at, radius, seed=seed)
        return self._p_hit(at, at.goals - at.conditions, radius)

    def _p_hit(self, at: Places, aims: Points, radius: Point) -> Float[np.ndarray, " n"]:
        """Probability that the displacement at each condition hits its aim."""
        total, half_axes = np.zeros(len(at.numbers)), radius[:, None]
        for probability, share, mean, variance in self._predicted(at):
            off, sd = (mean - aims.T) / half_axes, np.sqrt(variance) / half_axes
            total += probability * share_within(off, sd, share)
        return total

    def _expected(self, at: Places) -> tuple[Points, Points]:
        """Mean and variance of displacements over all that may be."""
        total, square = np.zeros((2, *at.conditions.shape))
        for probability, share, mean, variance in self._predicted(at):
            total += np.einsum("mk,mkp->pk", probability * share, mean)
            square += np.einsum("mk,mkp->pk", probability * share, variance + mean**2)
        return total, square - total**2

    def _p_hit_after(
        self, missed: Memory, at: Places, radius: Point, *, seed: int = 0
    ) -> Float[np.ndarray, " n"]:
        """`_p_hit`, given that those missed; what was chosen is judged by other draws."""
        prior, memory, beliefs = self._prior, self._memory, []
        for probability, history in self._weighed():
            known = history.posterior
            to_missed = history.covariance(prior, missed, memory)[:, None]
            to_here = history.covariance(prior, at, memory)[:, None]
            from_missed = known.precision @ np.swapaxes(to_missed, 2, 3)
            at_missed = history.expected(prior, missed, memory)
            mean, variance = history.predict(prior, at, memory)
            noise = np.minimum(prior.noise[:, None], (_REPEATABLE * radius) ** 2)
            among = history.covariance(prior, missed, missed)[:, None]
            among = among + noise[..., None, None] * np.eye(len(missed.numbers))
            beliefs.append(
                Belief(
                    probability=probability,
                    share=known.model_weights,
                    at_missed=at_missed,
                    among_missed=among - to_missed @ from_missed,
                    mean=mean,
                    variance=variance - (prior.noise[:, None] - noise)[..., None],
                    cross=history.covariance(prior, at, missed)[:, None] - to_here @ from_missed,
                )
            )
        size = np.broadcast_to(radius, at.goals.shape)
        return p_hit_after(
            beliefs,
            Targets(missed.aims, missed.missed_by),
            Targets(at.goals - at.conditions, size),
            self.config.outlier,
            seed,
        )

    def displacement(self, conditions: Points, *, hardware: bool = True) -> Points:
        """Where outcomes are expected to lie, seen from conditions; (n, k)."""
        at = self._normalisation.apply(conditions)
        mean, _ = self._expected(self._places(at, at, None if hardware else -1))
        return mean * self._normalisation.scale

    def gain(
        self, candidates: Points, over: Float[np.ndarray, "m k"], *, demonstrations: bool = False
    ) -> Float[np.ndarray, " n"]:
        """Share of the variance over places that a reading takes; see `BayesianAdapter.gain`."""
        candidates, over = self._normalisation.apply(candidates), self._normalisation.apply(over)
        places, at = self._places(over, over), self._places(candidates, candidates)
        left = self._unknown(places)
        if demonstrations:
            more = [self._with_demonstration(one[None])._unknown(places) for one in candidates]
            return 1.0 - np.array(more) / left
        best, prior, memory = self._histories[0], self._prior, self._memory
        _, variance = best.predict(prior, at, memory)
        explained = best.covariance(prior, at, memory)[:, None] @ best.posterior.precision
        to = best.covariance(prior, places, memory)[:, None]
        between = best.covariance(prior, at, places)[:, None]
        covariance = between - explained @ np.swapaxes(to, 2, 3)
        gone = np.square(covariance).mean(axis=-1) / (variance + _TEACHING_SD**2)
        return np.asarray(np.einsum("mk,mkn->n", best.posterior.model_weights, gone) / left)

    def _unknown(self, places: Places) -> float:
        """Mean variance of a trial's displacement there, summed over components."""
        best = self._histories[0]
        _, variance = best.predict(self._prior, places, self._memory)
        return float(np.sum(best.posterior.model_weights * variance.mean(axis=-1)))

    def _with_demonstration(self, outcome: Float[np.ndarray, "1 k"]) -> DisplacedTrials:
        """The same with one demonstration more, as far as is most probable."""
        other = copy.copy(self)
        other._prior = self._prior.with_demonstration(outcome)
        at = self._memory.conditions
        base, known = other._prior.covariance(at, at), np.ones(len(at), dtype=bool)
        best = self._histories[0]
        best = replace(best, posterior=best.posterior.under_others())
        other._histories = told([best], other._prior, self._memory, base, known)
        return other


def _clipped(vector: Point, longest: float) -> Point:
    """The same direction, no longer than that."""
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)

"""Trials of plans that a symmetry moves: the next condition, and what to expect of it.

The part of `BayesianAdapter` for demonstrations that carry a symmetry; see `moved` for the model.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from prior_reinforce.adapters.base import Expectation, State
from prior_reinforce.adapters.displacement import BayesianConfig
from prior_reinforce.adapters.memory import Inputs, Memory, repeats_miss, untried_conditions
from prior_reinforce.adapters.moved import EXECUTION, OF_TOLERANCE, UNIT, MovedPosterior
from prior_reinforce.adapters.moved_prior import AS_STATED, OTHER_WAY
from prior_reinforce.adapters.p_hit import expected_trials
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import LogDistance, Polar, Tempo
from prior_reinforce.readings import Reading

_AFTER_LOSS = 0.5
"""Share that is kept of the way from the demonstration to where an object was lost (ours)."""
_LEAST_TRIALS, _LEAST_ASKED, _GREATEST_SHARE = 3, 0.2, 0.2
"""Tempo has no effect if this many trials for a goal, whose aims differ by this much at least, as a
logarithm of the distance, had outcomes that differ by this share of it at most. Ours: on drawn laws
speed^p of p = 0.5 to 2.5 that was never found (175 trials)."""


class MovedTrials:
    """The trials so far, in the outcomes' units."""

    def __init__(self, config: BayesianConfig, demonstrations: Demonstrations) -> None:
        """Begin without trials."""
        self.posterior = MovedPosterior(demonstrations, config.p_change)
        self.chart = self.posterior.symmetry.chart
        self._next = 0  # number of the next trial that is read
        self._lost: list[tuple[Point, Point, int]] = []  # goal, aim, trials read before it

    def state(self) -> State:
        """Return what `resume` needs."""
        state = self.posterior.state()
        lost = [[goal.tolist(), aim.tolist(), before] for goal, aim, before in self._lost]
        return State({**state.facts, "now": self._next, "lost": lost}, state.arrays)

    def resume(self, state: State) -> None:
        """Take up what `state` returned."""
        self.posterior.resume(state)
        self._next, lost = state.facts["now"], state.facts["lost"]
        self._lost = [(np.array(goal), np.array(aim), before) for goal, aim, before in lost]

    def observe(self, condition: Point, goal: Point, reading: Reading) -> None:
        """Take in one trial; see `Adapter.observe`.

        After a loss the next plan for that goal is moved half as far. As many readings as losses
        lift this limit; until then plans are moved less far than those that lost the object.
        """
        if reading.lost:
            self._lost.append((goal, self.chart.to(condition), self._next))
            return
        radius = reading.missed_by_at_least
        noise = self._noise if radius is None else OF_TOLERANCE * radius
        self.posterior.observe(
            Memory(
                self.chart.to(condition)[None],
                np.array([self._next]),
                goal[None],
                reading.low[None],
                reading.high[None],
                (reading.sd**2 + noise**2)[None],
                (np.zeros_like(goal) if radius is None else radius)[None],
            )
        )
        self._next += 1

    def change_hardware(self) -> None:
        """Take note that hardware may be different from now on."""
        self.posterior.announce_change(self._next)
        self._lost.clear()

    def propose(self, goal: Point) -> Point:
        """Return the condition to try next; see `Adapter.propose`."""
        condition = self.chart.back(self._aim(goal, self._losses(goal)))
        missed = self._current_misses(goal)
        if repeats_miss(condition[None], self.chart.back(missed.conditions), missed.missed_by)[0]:
            return self._best_untried(condition, goal, missed)
        return condition

    def expect(self, condition: Point, goal: Point, tolerance: Point) -> Expectation:
        """Return what is expected of a trial; see `Adapter.expect`."""
        p_hit = float(self.p_hit(condition[None], goal[None], tolerance)[0])
        inputs = self._inputs(condition[None], goal[None])
        means, variances = [], []
        for h in range(len(self.posterior.hypotheses)):
            outcome = self.posterior.predict(h, inputs)
            means.append(outcome.mean[0] - goal)
            variances.append(np.diag(self.posterior.marginal_covariance(h, outcome)[0]))
        probabilities = self.posterior.probabilities
        error = probabilities @ np.array(means)
        variance = probabilities @ (np.array(variances) + np.square(means)) - error**2
        sd = np.sqrt(variance + np.square(OF_TOLERANCE * tolerance))
        losses = self._losses(goal)
        nearer = bool(losses) and not np.allclose(self._aim(goal, losses), self._aim(goal, []))
        beyond = bool(self._beyond(goal))
        trials = None if beyond else expected_trials(p_hit, self.posterior.memory)
        return Expectation(p_hit, trials, error, sd, self.remark(goal), nearer, beyond)

    def p_hit(
        self, conditions: Points, goals: Points, tolerance: Point, seed: int = 1
    ) -> Float[np.ndarray, " n"]:
        """Return each condition's probability of a hit; see `BayesianAdapter.p_hit`."""
        memory, radius = self.posterior.memory, np.broadcast_to(tolerance, goals.shape[1])
        misses = memory.bare_misses(np.zeros_like(memory.goals))
        return self.posterior.p_hit(self._inputs(conditions, goals), radius, misses, seed)

    def displacement(self, conditions: Points, *, hardware: bool = True) -> Points:
        """Return outcomes minus conditions, (n, k), under the most probable hypothesis.

        `hardware` has no effect: what differs from the demonstrations' day is not told apart.
        """
        return self.posterior.predict(0, self._inputs(conditions, conditions)).mean - conditions

    def gain(
        self, candidates: Points, over: Float[np.ndarray, "m k"], *, demonstrations: bool = False
    ) -> Float[np.ndarray, " n"]:
        """Share of the variance elsewhere that a reading removes; see `BayesianAdapter.gain`.

        The same for a demonstration: it would be moved as the others are, so that it teaches what a
        trial does.
        """
        posterior = self.posterior
        here = posterior.predict(0, self._inputs(candidates, candidates))
        there = posterior.predict(0, self._inputs(over, over))
        before = np.trace(posterior.marginal_covariance(0, there), axis1=1, axis2=2).sum()
        cross = posterior.covariance(0, here, there)
        read = posterior.marginal_covariance(0, here) + np.diag(np.square(self._noise))
        removed = np.einsum("pcnd,pce,pend->p", cross, np.linalg.inv(read), cross)
        return np.asarray(removed / before)

    @property
    def odds(self) -> dict[str, float]:
        """Probability of each kind of model of the symmetry."""
        odds = dict.fromkeys((model.name for model in self.posterior.prior.models), 0.0)
        for h, probability in enumerate(self.posterior.probabilities):
            odds[self.posterior.model(h).name] += float(probability)
        return odds

    @property
    def doubted(self) -> bool:
        """Whether evidence contradicts the symmetry; see `BayesianAdapter.symmetry_doubted`."""
        memory, best = self.posterior.memory, self.posterior.hypotheses[0]
        at_once = bool(best.changes) and len(np.unique(memory.goals, axis=0)) == 1
        return self.posterior.model(0).name != AS_STATED or at_once or len(self._lost) > 1

    def remark(self, goal: Point) -> str:
        """Return what a person should know before the next trial for a goal, in one line."""
        best, symmetry = self.posterior.hypotheses[0], self.posterior.symmetry
        if farther := self._asked_farther_in_vain(goal):
            return (
                f"plans that were aimed {farther:.0%} farther landed hardly farther; if speed has "
                'no effect here, declare distance = "amplitude"'
            )
        if beyond := self._beyond(goal):
            return f"the goal is {beyond}; demonstrate nearer to it"
        several = len(self.posterior.prior.anchors.z) > symmetry.k
        instead = "; or learn the demonstrations without it: generator auto,symmetry=none" * several
        if self.posterior.model(0).name == OTHER_WAY:
            return f"outcomes follow the symmetry ({symmetry.name}) the other way round{instead}"
        if self.doubted:
            return (
                f"outcomes do not follow the symmetry ({symmetry.name}): is it the right one?"
                f"{instead}"
            )
        shifts = [change.since for change in best.changes if change.shift_sd]
        if shifts:  # other changes were announced; lost trials have no number here
            n = self._next - shifts[-1]
            which = (
                f"the last {n} outcomes that were seen lie" if n > 1 else "the last outcome lies"
            )
            return f"{which} elsewhere: was something moved?"
        return ""

    def _asked_farther_in_vain(self, goal: Point) -> float:
        """How much farther plans were aimed than others whose outcomes are about as far; or 0.

        A share, of all trials for a goal: the posterior takes a tempo without effect for a change.
        """
        memory, polar = self.posterior.memory, isinstance(self.chart, (Polar, LogDistance))
        read = np.isfinite(memory.high - memory.low).all(axis=1)
        trials = memory.select(read & np.all(memory.goals == goal, axis=1))
        if not polar or not isinstance(self.posterior.symmetry.moves[0], Tempo):
            return 0.0
        if len(trials.numbers) < _LEAST_TRIALS:
            return 0.0
        outcomes = self.chart.to(trials.goals + 0.5 * (trials.low + trials.high))[:, 0]
        asked = float(np.ptp(trials.conditions[:, 0]))
        in_vain = asked > _LEAST_ASKED and np.ptp(outcomes) < _GREATEST_SHARE * asked
        return float(np.expm1(asked)) if in_vain else 0.0

    def _beyond(self, goal: Point) -> str:
        """Say whether a goal is farther or nearer than plans reach, or nothing.

        The symmetry limits moves; learned components are extrapolated by half of their range.
        """
        posterior, symmetry = self.posterior, self.posterior.symmetry
        z = posterior.prior.anchors.z
        aim = posterior.find_aim(goal, self._next, self._farthest(self._losses(goal)))
        w = posterior.prior.moves(aim[None])[0]
        inputs = self._inputs(self.chart.back(aim)[None], goal[None])
        mean = posterior.predict(0, inputs).mean[0]
        moved_to_end = np.abs(w) >= (1.0 - 1e-6) * symmetry.farthest
        beyond = (1.0 - 1e-6) * symmetry.farthest_from(z)
        at_end = (aim <= z.min(axis=0) - beyond) | (aim >= z.max(axis=0) + beyond)
        at_end = np.where(symmetry.learned, at_end, moved_to_end)
        tolerance = np.linalg.norm(self._noise) / OF_TOLERANCE
        if not np.any(at_end) or np.linalg.norm(mean - goal) <= tolerance:
            return ""
        polar = isinstance(self.chart, (Polar, LogDistance))
        short = self.chart.to(goal)[0] > self.chart.to(mean)[0]
        which = "nearer" if polar and at_end[0] and not short else "farther"
        if np.any(moved_to_end):
            return f"{which} than the demonstration can be moved ({symmetry.name})"
        return f"{which} than plans learned from these go (half their range beyond them)"

    @property
    def _noise(self) -> Point:
        """Standard deviation of an execution, in the outcomes' units."""
        radii = self.posterior.memory.missed_by[self.posterior.memory.missed]
        if len(radii):
            return np.asarray(OF_TOLERANCE * radii[-1])
        return np.asarray(EXECUTION * UNIT * self.posterior.prior.scale)

    def _aim(self, goal: Point, losses: list[tuple[Point, Points]]) -> Point:
        """Return the aim for a goal, in the chart, moved at most half-way to any that lost.

        Learned components (`Symmetry.learned`) are not moved: there the aim itself keeps nearer to
        a demonstration.
        """
        aim = self.posterior.find_aim(goal, self._next, self._farthest(losses))
        learned, z = self.posterior.symmetry.learned, self.posterior.prior.anchors.z
        for lost, read in losses:
            apart = (z - lost)[:, learned] / np.ptp(z, axis=0)[learned]
            nearest = z[np.argmin(np.square(apart).sum(axis=1))]
            most = _half_way(lost - nearest, read - nearest)
            aim = np.where(learned, nearest + np.clip(aim - nearest, -most, most), aim)
        return aim

    def _losses(self, goal: Point) -> list[tuple[Point, Points]]:
        """Aims for a goal that lost an object, each with the aims for that goal that were read.

        No losses once as many trials were read since the last one as were lost: objects are then
        lost by chance, and not because of the distance. Aims that were read count only after
        several losses.
        """
        losses = [(aim, before) for of, aim, before in self._lost if np.array_equal(of, goal)]
        memory = self.posterior.memory
        of_goal = np.all(memory.goals == goal, axis=1)
        since = of_goal & (memory.numbers >= max((before for _, before in losses), default=0))
        if np.sum(since) >= len(losses):
            return []
        return [(aim, memory.conditions[of_goal & (len(losses) > 1)]) for aim, _ in losses]

    def _farthest(self, losses: list[tuple[Point, Points]]) -> Point:
        """Longest move of a plan: as the symmetry allows, and half-way to aims that lost."""
        symmetry, prior = self.posterior.symmetry, self.posterior.prior
        farthest = np.where(symmetry.learned, 0.0, symmetry.farthest)
        limited = prior.inexact if len(prior.inexact) else np.arange(symmetry.k)
        for lost, read in losses:
            most = _half_way(prior.moves(lost[None])[0], prior.moves(read))
            farthest[limited] = np.minimum(farthest, most)[limited]
        return farthest

    def _inputs(self, conditions: Points, goals: Points) -> Inputs:
        """Inputs of the next trial."""
        return Inputs(self.chart.to(conditions), np.full(len(conditions), self._next), goals)

    def _current_misses(self, goal: Point) -> Memory:
        """Trials that missed a goal since the last change, most probably."""
        memory, changes = self.posterior.memory, self.posterior.hypotheses[0].changes
        since = changes[-1].since if changes else 0
        of_goal = np.all(memory.goals == goal, axis=1) & memory.missed
        return memory.select(of_goal & (memory.numbers >= since))

    def _best_untried(self, condition: Point, goal: Point, missed: Memory) -> Point:
        """Return the untried condition around another that most probably hits.

        The condition itself if plans for all of those would be moved too far.
        """
        posterior, radius = self.posterior, missed.missed_by[-1]
        outcome = posterior.predict(0, self._inputs(condition[None], goal[None]))
        sd = np.sqrt(np.diag(posterior.marginal_covariance(0, outcome)[0]))
        tried = self.chart.back(missed.conditions)
        candidates = untried_conditions(condition, radius + 2.0 * sd, tried, missed.missed_by)
        w = np.abs(posterior.prior.moves(self.chart.to(candidates)))
        farthest = self._farthest(self._losses(goal))
        farthest = np.where(posterior.symmetry.learned, np.inf, farthest)
        candidates = candidates[np.all(w <= (1.0 + 1e-6) * farthest, axis=1)]
        if not len(candidates):
            return condition
        goals = np.broadcast_to(goal, candidates.shape)
        return np.asarray(candidates[np.argmax(self.p_hit(candidates, goals, radius, seed=0))])


def _half_way(lost: Point, read: Points) -> Point:
    """Longest move after a loss: as far as was read, and half of the way from there."""
    within = np.abs(read).max(axis=0, initial=0.0)
    return np.asarray(within + _AFTER_LOSS * np.maximum(np.abs(lost) - within, 0.0))

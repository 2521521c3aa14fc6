"""Trials of plans that a symmetry moves: what to try next, and what is expected of it.

The part of `BayesianAdapter` for demonstrations that carry a symmetry; see `moved` for the model.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from prior_reinforce.adapters.base import Expectation, State
from prior_reinforce.adapters.displacement import BayesianConfig
from prior_reinforce.adapters.memory import Memory, Places, tried_again, untried_around
from prior_reinforce.adapters.moved import EXECUTION, OF_TOLERANCE, UNIT, MovedBelief
from prior_reinforce.adapters.moved_prior import AS_STATED, OTHER_WAY
from prior_reinforce.adapters.p_hit import trials_to_go
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import LogDistance, Polar, Tempo
from prior_reinforce.readings import Reading

_BACK = 0.5
"""What is left of the way from the demonstration where an object was lost (ours)."""
_TELL_IN_VAIN, _FARTHER, _AS_FAR = 3, 0.2, 0.2
"""Trials for a goal that tell at least that tempo has no effect, by how much they were aimed apart
at least, as a logarithm of the distance, and the part of that by which outcomes lie apart at most.
Ours: on drawn laws speed^p of p = 0.5 to 2.5 they never said so (175 trials)."""


class MovedTrials:
    """The trials so far, in the outcomes' units."""

    def __init__(self, config: BayesianConfig, demonstrations: Demonstrations) -> None:
        """Know nothing but the demonstrations."""
        self.belief = MovedBelief(demonstrations, config.p_change)
        self.chart = self.belief.symmetry.chart
        self.now = 0
        self._lost: list[tuple[Point, Point, int]] = []  # goal, aim, trials read before it

    def state(self) -> State:
        """What `resume` needs."""
        state = self.belief.state()
        lost = [[goal.tolist(), aim.tolist(), at] for goal, aim, at in self._lost]
        return State({**state.facts, "now": self.now, "lost": lost}, state.arrays)

    def resume(self, state: State) -> None:
        """Go on from what `state` gave."""
        self.belief.resume(state)
        self.now = state.facts["now"]
        self._lost = [(np.array(goal), np.array(aim), at) for goal, aim, at in state.facts["lost"]]

    def observe(self, condition: Point, goal: Point, reading: Reading) -> None:
        """Take in one trial; see `Adapter.observe`.

        Where the object was lost, the next plan for that goal is moved half as far. As many
        readings as losses take that back; until then plans stay nearer than those lost.
        """
        if reading.lost:
            self._lost.append((goal, self.chart.to(condition), self.now))
            return
        radius = reading.missed_by_at_least
        none = np.zeros_like(goal)
        noise = self._noise if radius is None else OF_TOLERANCE * radius
        self.belief.observe(
            Memory(
                self.chart.to(condition)[None],
                np.array([self.now]),
                goal[None],
                reading.low[None],
                reading.high[None],
                (reading.sd**2 + noise**2)[None],
                (none if radius is None else radius)[None],
            )
        )
        self.now += 1

    def change_hardware(self) -> None:
        """Something may be different from now on."""
        self.belief.change(self.now)
        self._lost.clear()

    def propose(self, goal: Point) -> Point:
        """Return the condition to try next; see `Adapter.propose`."""
        condition = self.chart.back(self._aim(goal, self._losses(goal)))
        missed = self._told_as_now(goal)
        if tried_again(condition[None], self.chart.back(missed.conditions), missed.missed_by)[0]:
            return self._likeliest_beside(condition, goal, missed)
        return condition

    def expect(self, condition: Point, goal: Point, tolerance: Point) -> Expectation:
        """Return what is expected of a trial; see `Adapter.expect`."""
        p_hit = float(self.p_hit(condition[None], goal[None], tolerance)[0])
        at = self._places(condition[None], goal[None])
        means, variances = [], []
        for h in range(len(self.belief.hypotheses)):
            there = self.belief.outcomes(h, at)
            means.append(there.mean[0] - goal)
            variances.append(np.diag(self.belief.spread(h, there)[0]))
        share = self.belief.probabilities
        error = share @ np.array(means)
        variance = share @ (np.array(variances) + np.square(means)) - error**2
        sd = np.sqrt(variance + np.square(OF_TOLERANCE * tolerance))
        losses = self._losses(goal)
        nearer = bool(losses) and not np.allclose(self._aim(goal, losses), self._aim(goal, []))
        beyond = bool(self._beyond(goal))
        trials = None if beyond else trials_to_go(p_hit, self.belief.memory)
        return Expectation(p_hit, trials, error, sd, self.remark(goal), nearer, beyond)

    def p_hit(
        self, conditions: Points, goals: Points, tolerance: Point, seed: int = 1
    ) -> Float[np.ndarray, " n"]:
        """Return each condition's probability of a hit; see `BayesianAdapter.p_hit`."""
        at, radius = self._places(conditions, goals), np.broadcast_to(tolerance, goals.shape[1])
        memory = self.belief.memory
        return self.belief.p_hit(at, radius, memory.bare_misses(np.zeros_like(memory.goals)), seed)

    def displacement(self, conditions: Points, *, hardware: bool = True) -> Points:
        """Where outcomes are expected to lie, seen from conditions, most probably; (n, k).

        Whatever `hardware` says: what differs from the demonstrations' day is not told apart.
        """
        return self.belief.outcomes(0, self._places(conditions, conditions)).mean - conditions

    def gain(
        self, candidates: Points, over: Float[np.ndarray, "m k"], *, demonstrations: bool = False
    ) -> Float[np.ndarray, " n"]:
        """Share of the variance over places that a reading would take; see `BayesianAdapter.gain`.

        Of demonstrations too: they would be moved as those are that are there, so that each
        tells what a trial does.
        """
        belief, noise = self.belief, np.square(self._noise)
        at = belief.outcomes(0, self._places(candidates, candidates))
        there = belief.outcomes(0, self._places(over, over))
        unknown = np.trace(belief.spread(0, there), axis1=1, axis2=2).sum()
        between = belief.covariance(0, at, there)
        read = belief.spread(0, at) + np.diag(noise)
        gone = np.einsum("pcnd,pce,pend->p", between, np.linalg.inv(read), between)
        return np.asarray(gone / unknown)

    @property
    def odds(self) -> dict[str, float]:
        """Probability of each kind of model of the symmetry."""
        shares = dict.fromkeys((model.name for model in self.belief.prior.models), 0.0)
        for h, share in enumerate(self.belief.probabilities):
            shares[self.belief.model(h).name] += float(share)
        return shares

    @property
    def doubted(self) -> bool:
        """Whether evidence has left the symmetry; see `BayesianAdapter.symmetry_doubted`."""
        memory, best = self.belief.memory, self.belief.hypotheses[0]
        at_once = bool(best.changes) and len(np.unique(memory.goals, axis=0)) == 1
        return self.belief.model(0).name != AS_STATED or at_once or len(self._lost) > 1

    def remark(self, goal: Point) -> str:
        """What a person should know before the next trial for a goal, in one line, or nothing."""
        belief, model, symmetry = self.belief, self.belief.model(0), self.belief.symmetry
        if farther := self._aimed_farther_in_vain(goal):
            return (
                f"plans that were aimed {farther:.0%} farther landed hardly farther; if speed has "
                'no effect here, declare distance = "amplitude"'
            )
        if beyond := self._beyond(goal):
            return f"the goal is {beyond}; demonstrate nearer to it"
        several = len(belief.prior.anchors.z) > symmetry.k
        instead = "; or learn the demonstrations without it: generator auto,symmetry=none" * several
        if model.name == OTHER_WAY:
            return f"outcomes follow the symmetry ({symmetry.name}) the other way round{instead}"
        if self.doubted:
            return (
                f"outcomes do not follow the symmetry ({symmetry.name}): is it the right one?"
                f"{instead}"
            )
        found = [change.since for change in belief.hypotheses[0].changes if change.shift_sd]
        if found:  # others were announced; those that were lost have no number here
            n = self.now - found[-1]
            which = (
                f"the last {n} outcomes that were seen lie" if n > 1 else "the last outcome lies"
            )
            return f"{which} elsewhere: was something moved?"
        return ""

    def _aimed_farther_in_vain(self, goal: Point) -> float:
        """How much farther plans were aimed than others that landed about as far, as a share; or 0.

        Of all trials for a goal: where tempo has no effect, the belief takes that for a change.
        """
        memory, polar = self.belief.memory, isinstance(self.chart, (Polar, LogDistance))
        read = np.isfinite(memory.high - memory.low).all(axis=1)
        trials = memory.only(read & np.all(memory.goals == goal, axis=1))
        if not polar or not isinstance(self.belief.symmetry.moves[0], Tempo):
            return 0.0
        if len(trials.numbers) < _TELL_IN_VAIN:
            return 0.0
        landed = self.chart.to(trials.goals + 0.5 * (trials.low + trials.high))[:, 0]
        asked = float(np.ptp(trials.conditions[:, 0]))
        in_vain = asked > _FARTHER and np.ptp(landed) < _AS_FAR * asked
        return float(np.expm1(asked)) if in_vain else 0.0

    def _beyond(self, goal: Point) -> str:
        """Say whether a goal is farther or nearer than plans can be made for, or nothing.

        They may be moved only so far; and what is learned is extrapolated by half its range.
        """
        belief, symmetry, shown = self.belief, self.belief.symmetry, self.belief.prior.anchors.z
        aim = belief.aim(goal, self.now, self._farthest(self._losses(goal)))
        w = belief.prior.moved(aim[None])[0]
        mean = belief.outcomes(0, self._places(self.chart.back(aim)[None], goal[None])).mean[0]
        moved_to_end = np.abs(w) >= (1.0 - 1e-6) * symmetry.farthest
        most = (1.0 - 1e-6) * symmetry.farthest_from(shown)
        ends = (aim <= shown.min(axis=0) - most) | (aim >= shown.max(axis=0) + most)
        ends = np.where(symmetry.learned, ends, moved_to_end)
        tolerance = np.linalg.norm(self._noise) / OF_TOLERANCE
        if not np.any(ends) or np.linalg.norm(mean - goal) <= tolerance:
            return ""
        distance = isinstance(self.chart, (Polar, LogDistance))
        short = self.chart.to(goal)[0] > self.chart.to(mean)[0]
        which = "nearer" if distance and ends[0] and not short else "farther"
        if np.any(moved_to_end):
            return f"{which} than the demonstration can be moved ({symmetry.name})"
        return f"{which} than plans learned from these go (half their range beyond them)"

    @property
    def _noise(self) -> Point:
        """Standard deviation of an execution, in the outcomes' units."""
        told = self.belief.memory.missed_by[self.belief.memory.missed]
        if len(told):
            return np.asarray(OF_TOLERANCE * told[-1])
        return np.asarray(EXECUTION * UNIT * self.belief.prior.size)

    def _aim(self, goal: Point, losses: list[tuple[Point, Points]]) -> Point:
        """Return the aim for a goal, in the chart, half-way back from what lost an object.

        By what no move changes (`Symmetry.learned`) plans are not moved: there the aim itself keeps
        nearer to a demonstration.
        """
        aim = self.belief.aim(goal, self.now, self._farthest(losses))
        learned, z = self.belief.symmetry.learned, self.belief.prior.anchors.z
        for lost, read in losses:
            apart = (z - lost)[:, learned] / np.ptp(z, axis=0)[learned]
            nearest = z[np.argmin(np.square(apart).sum(axis=1))]
            way = _half_way(lost - nearest, read - nearest)
            aim = np.where(learned, nearest + np.clip(aim - nearest, -way, way), aim)
        return aim

    def _losses(self, goal: Point) -> list[tuple[Point, Points]]:
        """Aims for a goal that lost an object, each with the aims for that goal that were read.

        None once as many trials were read since the last loss as were lost: objects are then lost
        by chance, and not by going so far. What was read counts only where several were lost.
        """
        losses = [(aim, at) for about, aim, at in self._lost if np.array_equal(about, goal)]
        memory, again = self.belief.memory, len(losses) > 1
        of_goal = np.all(memory.goals == goal, axis=1)
        since = of_goal & (memory.numbers >= max((at for _, at in losses), default=0))
        if np.sum(since) >= len(losses):
            return []
        return [(aim, memory.conditions[of_goal & again]) for aim, _ in losses]

    def _farthest(self, losses: list[tuple[Point, Points]]) -> Point:
        """By how much plans may be moved: by the symmetry, and half-way to what lost an object."""
        symmetry, prior = self.belief.symmetry, self.belief.prior
        farthest = np.where(symmetry.learned, 0.0, symmetry.farthest)
        which = prior.left if len(prior.left) else np.arange(symmetry.k)
        for lost, read in losses:
            way = _half_way(prior.moved(lost[None])[0], prior.moved(read))
            farthest[which] = np.minimum(farthest, way)[which]
        return farthest

    def _places(self, conditions: Points, goals: Points) -> Places:
        """Of trials of now."""
        return Places(self.chart.to(conditions), np.full(len(conditions), self.now), goals)

    def _told_as_now(self, goal: Point) -> Memory:
        """Trials for a goal that missed, with all as it is now, most probably."""
        memory, changes = self.belief.memory, self.belief.hypotheses[0].changes
        since = changes[-1].since if changes else 0
        of_goal = np.all(memory.goals == goal, axis=1) & memory.missed
        return memory.only(of_goal & (memory.numbers >= since))

    def _likeliest_beside(self, condition: Point, goal: Point, missed: Memory) -> Point:
        """Return the condition around another that most probably hits and was not tried.

        The condition itself where plans for all of those would be moved too far.
        """
        at, radius = self._places(condition[None], goal[None]), missed.missed_by[-1]
        there = self.belief.outcomes(0, at)
        sd = np.sqrt(np.diag(self.belief.spread(0, there)[0]))
        tried = self.chart.back(missed.conditions)
        candidates = untried_around(condition, radius + 2.0 * sd, tried, missed.missed_by)
        w = np.abs(self.belief.prior.moved(self.chart.to(candidates)))
        farthest = np.where(
            self.belief.symmetry.learned, np.inf, self._farthest(self._losses(goal))
        )
        candidates = candidates[np.all(w <= (1.0 + 1e-6) * farthest, axis=1)]
        if not len(candidates):
            return condition
        goals = np.broadcast_to(goal, candidates.shape)
        return np.asarray(candidates[np.argmax(self.p_hit(candidates, goals, radius, seed=0))])


def _half_way(lost: Point, read: Points) -> Point:
    """How far to go where an object was lost: as far as was read, and half of what is left."""
    within = np.abs(read).max(axis=0, initial=0.0)
    return np.asarray(within + _BACK * np.maximum(np.abs(lost) - within, 0.0))

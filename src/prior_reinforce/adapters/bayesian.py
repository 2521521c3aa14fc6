"""A Bayesian condition adapter: readings are intervals, and nothing of an afternoon is forgotten.

Ours; the paper's adapter is in `gaussian_process`. See `BayesianAdapter` for the model.
"""

from __future__ import annotations

import copy
import math
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.adapters.base import Adapter, Expectation
from prior_reinforce.adapters.displacement import BayesianConfig, DisplacementPrior
from prior_reinforce.adapters.expectation_propagation import Posterior, Readings, infer
from prior_reinforce.adapters.memory import LATEST, Memory
from prior_reinforce.adapters.p_hit import (
    Belief,
    Targets,
    evenly_spread,
    p_hit_after,
    share_within,
)
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading

_STEPS = 12
"""Steps to the fixed point of the proposal, each 0.7 of the way (ours). They need not end there:
where landing hardly depends on the condition, as with demonstrations in a line, they go on."""
_RELAXATION = 0.7
_FARTHEST = 20.0
"""A correction is this many sd of changed hardware at most, 6 spreads (ours). Where weights are
steep, an outcome may lie a hundred spreads away. Three demonstrations nearly in a line need 2 to 4:
bounded at 2 spreads, goals took 2.3 instead of 2.2 trials (24 draws; docs/decisions-adapter.md)."""
_TRIALS_AFTER_A_MISS = 1.24
"""Fitted to 1623 trials of tuning material (ours; docs/decisions-adapter.md)."""
_LEAST_P_HIT = 0.01
"""Where "a miss" was all that was told, 1 / P(hit) trials are expected, a hundred at most (ours):
such a trial teaches little. That is still too few: 8 to 13 where 14 were needed (tuning fields)."""
_TEACHING_SD = 0.1
"""How finely a trial that is made to learn from is read, in spreads (ours): "5 cm" by eye is an
interval of 4 cm, whose standard deviation is 1.2 cm of 12 to 18."""
_NOT_EXCLUDED = 0.05
"""A miss counts where its reading leaves a hit more than this share as probable as it would be on
target (ours): where words are coarse, or numbers noisy, or not believed."""
_REPEATABLE = 0.3
"""Executions of one plan are taken to lie no farther apart than this share of the tolerance, as a
standard deviation (ours): nobody asks for what a good plan would miss. On our own tasks it is 0.13
to 0.30 by `execution_sd` alone."""
_AGAIN = 0.5
"""A condition closer than this share of the tolerance to one that missed the same goal would be
tried again (ours)."""


class BayesianAdapter(Adapter):
    """What is believed of the displacement between condition and outcome, and the best next try.

    In normalised units, where S, the root mean square deviation of the demonstrated outcomes, is 1
    (one S for each unit), a plan generated for c comes down at

        r = c + d(c) + noise,    d_j(c) = sum_i w_i(c) e_ij + f_j(c) + u_j(c) + h_j(c)    j = 1..k

    with independent Gaussian terms, all but e of prior mean 0:

        e   mean m_i, sd s_i    by how much the outcome of demonstration i is off: m_i as its label
                                says (`Demonstrations.outcome_correction`), give or take the noise
                                that it states (mean over components), and 0.03 or 0.1 more
        f   sd a, reach 0.5     what the generator itself gets wrong: 0, or with probability 0.1 0.3
        u   sd 0.025, reach 0.32    what lies between the demonstrations
        h   sd b, reach 2.5     what is different from their day: 0.03, or with probability 0.2 0.3;
                                0.3, anew, whenever a change of hardware is said
        noise  sd 0.02          execution; for P(hit) 0.3 of the tolerance at most

    f, u and h are Gaussian processes with squared-exponential kernels. w are the weights of a
    spline over the demonstrated outcomes (`plans.outcome_weights`): as far as landing is linear in
    the plan, a mixture of plans comes down where the same mixture of the demonstrations' outcomes
    is, so labels that are off move it by their mixture. Of six labels by eye that is little more
    than its affine part, which few trials tell.

    A reading (`readings.Reading`) says that the blurred error r - g lies in an interval, or, with
    probability 0.01, nothing at all. The posterior is found by expectation propagation for each of
    eight models; their evidence weighs them.

    The next condition is the fixed point c = g - E d(c): the posterior mean, which is as good as
    the greatest probability of a hit on our tasks, and knows no tolerance
    (docs/decisions-adapter.md). With nothing but demonstrations it is the goal, less what their
    labels say to be off: nothing, where they were measured. Where the fixed
    point has just missed the same goal, since its reading did not say what to change (a word
    coarser than the tolerance, or "a miss" and nothing else), the condition beside it that most
    probably hits is next, given all that missed (`adapters.p_hit`).

    The prior stands in `adapters.displacement`. Old trials are merged where there are many
    (`adapters.memory`): those closest together become one number with the precision of both.
    Proposals depend on what was observed alone, never on what was proposed before.

    Source: ours, because words are intervals, and taken as numbers an adapter stands still.
    Constants: measured fields of all our tasks, and the figures of docs/decisions-adapter.md.
    """

    config_type: ClassVar[type[BayesianConfig]] = BayesianConfig
    carries_over: ClassVar[bool] = True
    _posterior: Posterior | None
    _missed: Memory | None

    def __init__(self, config: BayesianConfig | None = None) -> None:
        """Take the settings, or the defaults."""
        self.config = config or BayesianConfig()

    def _start(self, demonstrations: Demonstrations) -> None:
        self._prior = DisplacementPrior(self.config, demonstrations)
        self._normalisation = self._prior.normalisation
        self._memory, self._now = Memory.empty(demonstrations.outcome_dim), 0
        self._posterior = self._missed = None

    def change_hardware(self) -> None:
        """What has changed since the demonstrations is unknown anew; the rest stays known."""
        self._now += 1

    def _observe_reading(self, condition: Point, goal: Point, reading: Reading) -> None:
        scale, moved = self._normalisation.scale, goal - condition
        radius = reading.missed_by_at_least
        missed_by = 0.0 if radius is None else float((radius / scale).min())
        self._memory = self._memory.with_one(
            self._normalisation.apply(condition),
            self._now,
            (reading.low + moved) / scale,
            (reading.high + moved) / scale,
            (reading.sd / scale) ** 2 + self.config.execution_sd**2,
            moved / scale,
            missed_by,
        )
        self._posterior = self._missed = None
        if self._memory.is_full:
            self._memory = self._memory.merged(self._known(), self._prior)
            self._posterior = self._missed = None

    def _propose(self, goal_seen: Point) -> Point:
        goal = self._normalisation.apply(goal_seen)
        condition = self._expected_to_land_on(goal)
        missed = self._misses()
        off = np.linalg.norm(missed.conditions - condition, axis=1)
        off += np.linalg.norm(missed.aims - (goal - condition), axis=1)
        if np.any((missed.changes == self._now) & (off < _AGAIN * missed.missed_by)):
            condition = self._likeliest_beside(condition, goal, missed)
        return self._normalisation.undo(condition)

    def _expected_to_land_on(self, goal: Point) -> Point:
        """Return the fixed point c = g - E d(c), in normalised units."""
        condition, farthest = goal, _FARTHEST * self.config.hardware_sd[1]
        for _ in range(_STEPS):
            mean, _ = self._predict(condition[None])
            step = _RELAXATION * (goal - self._mixed(mean)[0] - condition)
            condition = goal + _clipped(condition + step - goal, farthest)
        return condition

    def _likeliest_beside(self, condition: Point, goal: Point, missed: Memory) -> Point:
        """Return the condition around another that most probably hits, within the last tolerance.

        No farther away than changed hardware takes it: where weights are steep, the sd means
        nothing.
        """
        _, variance = self._predict(condition[None])
        share = self._known().model_weights
        sd = math.sqrt(float(np.einsum("m,mkp->k", share, variance).max()))
        radius = float(missed.missed_by[-1])
        reach = radius + 2.0 * min(sd, self.config.hardware_sd[1])
        cube = 2.0 * evenly_spread(len(goal)) - 1.0
        ball = cube[np.linalg.norm(cube, axis=1) <= 1.0]
        candidates = condition + reach * ball
        p_hit = self._p_hit_after(missed, candidates, goal - candidates, radius)
        return np.asarray(candidates[np.argmax(p_hit)])

    def _expect(self, condition: Point, goal: Point, tolerance: float) -> Expectation:
        p_hit = float(self.p_hit(condition[None], goal[None], tolerance)[0])
        last = self._memory.only(slice(-1, None))
        if np.any(last.missed_by > 0.0) and np.all(np.isinf(last.high - last.low)):
            return Expectation(p_hit, 1.0 / max(p_hit, _LEAST_P_HIT))
        return Expectation(p_hit, 1.0 + _TRIALS_AFTER_A_MISS * (1.0 - p_hit))

    def p_hit(self, conditions: Points, goals: Points, tolerance: float) -> Float[np.ndarray, " n"]:
        """Return the probability that each condition's outcome is within the tolerance of its goal.

        Args:
            conditions: Shape (n, k), in the outcomes' units.
            goals: Shape (n, k).
            tolerance: In the first component's unit (`Normalisation.metric`).
        """
        scale = self._normalisation.scale
        at, aims, radius = (
            self._normalisation.apply(conditions),
            (goals - conditions) / scale,
            tolerance / scale[0],
        )
        missed = self._misses()
        if len(missed.changes) > 0:
            return self._p_hit_after(missed, at, aims, radius, seed=1)
        return self._p_hit(at, self._now, aims, radius)

    def _p_hit(
        self,
        at: Points,
        changes: Int[np.ndarray, " n"] | int,
        aims: Points,
        radius: float | Float[np.ndarray, " n"],
    ) -> Float[np.ndarray, " n"]:
        """Probability that the displacement at each condition is within a radius of its aim."""
        mean, variance = self._predict(at, changes)
        sd = np.sqrt(variance + self._execution_sd(radius) ** 2)
        inside = share_within(radius, mean - aims.T, sd)
        return np.asarray(np.clip(self._known().model_weights @ inside, 0.0, 1.0))

    def _misses(self) -> Memory:
        """The latest trials that missed and of which their readings do not say so."""
        if self._missed is None:
            missed = self._memory.only(slice(-LATEST, None))
            missed = missed.only(missed.missed_by > 0.0)
            if len(missed.changes) > 0:
                at, radius = (missed.conditions, missed.changes), missed.missed_by
                on_target = self._p_hit(*at, self._mixed(self._predict(*at)[0]), radius)
                p_hit = self._p_hit(*at, missed.aims, radius)
                missed = missed.only(p_hit > _NOT_EXCLUDED * on_target)
            self._missed = missed
        return self._missed

    def _p_hit_after(
        self, missed: Memory, at: Points, aims: Points, radius: float, *, seed: int = 0
    ) -> Float[np.ndarray, " n"]:
        """`_p_hit` of now, given that those missed; what was chosen is judged by other draws."""
        known, memory = self._known(), self._memory
        then, told = (missed.conditions, missed.changes), (memory.conditions, memory.changes)
        to_missed = self._prior.covariance(*then, *told)[:, None]
        to_here = self._prior.covariance(at, self._now, *told)[:, None]
        from_missed = known.precision @ np.swapaxes(to_missed, 2, 3)
        mean, variance = self._predict(at)
        belief = Belief(
            share=known.model_weights,
            at_missed=self._prior.mean(missed.conditions)
            + (to_missed @ known.weights[..., None])[..., 0],
            among_missed=self._prior.covariance(*then, *then)[:, None] - to_missed @ from_missed,
            mean=mean,
            variance=variance,
            cross=self._prior.covariance(at, self._now, *then)[:, None] - to_here @ from_missed,
        )
        size = np.full(len(at), radius)
        return p_hit_after(
            belief,
            Targets(missed.aims, missed.missed_by, self._execution_sd(missed.missed_by)),
            Targets(aims, size, self._execution_sd(size)),
            self.config.outlier,
            seed,
        )

    def _execution_sd(self, radius: float | Float[np.ndarray, " n"]) -> Float[np.ndarray, "*n"]:
        """How far apart outcomes of one plan lie, where so small a radius is asked for."""
        return np.asarray(np.minimum(self.config.execution_sd, _REPEATABLE * np.asarray(radius)))

    def displacement(self, conditions: Points, *, hardware: bool = True) -> Points:
        """Return where outcomes are expected to lie, seen from these conditions.

        Args:
            conditions: Shape (n, k), in the outcomes' units.
            hardware: With what differs from the demonstrations' day; otherwise what labels and
                generator get wrong alone.

        Returns:
            Outcome minus condition, shape (n, k), in the outcomes' units.
        """
        mean, _ = self._predict(self._normalisation.apply(conditions), None if hardware else -1)
        return self._mixed(mean) * self._normalisation.scale

    def gain(
        self, candidates: Points, over: Float[np.ndarray, "m k"], *, demonstrations: bool = False
    ) -> Float[np.ndarray, " n"]:
        """Return by how much a reading at each candidate would lower what is unknown elsewhere.

        Args:
            candidates: Conditions that a trial might be made with, shape (n, k), in the outcomes'
                units.
            over: Conditions whose displacements are to be known, shape (m, k).
            demonstrations: Demonstrations with these outcomes would be added instead of trials; the
                generator then mixes anew, which can also make less known.

        Returns:
            Share of the mean variance over those places that is gone afterwards; of a trial exact
            for a number read to 0.1 spreads, which is about a word by eye.
        """
        at, places = self._normalisation.apply(candidates), self._normalisation.apply(over)
        left = self._unknown(places)
        if demonstrations:
            told = [self._with_demonstration(at[[i]])._unknown(places) for i in range(len(at))]
            return 1.0 - np.array(told) / left
        known, share = self._known(), self._known().model_weights
        memory, noise = self._memory, self.config.execution_sd**2 + _TEACHING_SD**2
        cross = self._prior.covariance(at, self._now, memory.conditions, memory.changes)
        to = self._prior.covariance(places, self._now, memory.conditions, memory.changes)
        between = self._prior.covariance(at, self._now, places, self._now)
        gone = np.zeros(len(at))
        for precision in np.moveaxis(known.precision, 1, 0):  # for each component
            explained = cross @ precision
            covariance = between - explained @ np.swapaxes(to, 1, 2)
            variance = self._prior.variance(at, self._now) - np.sum(explained * cross, axis=-1)
            gone += share @ (np.square(covariance).mean(axis=-1) / (variance + noise))
        return np.asarray(gone / left)

    def _unknown(self, places: Float[np.ndarray, "p k"]) -> float:
        """Mean variance of a trial's displacement there, summed over components."""
        _, variance = self._predict(places)
        return float(self._known().model_weights @ variance.sum(axis=1).mean(axis=1))

    def _with_demonstration(self, outcome: Float[np.ndarray, "1 k"]) -> BayesianAdapter:
        """The same with one demonstration more."""
        other = copy.copy(self)
        other._prior = self._prior.with_demonstration(outcome)
        other._posterior = other._missed = None
        return other

    def _known(self) -> Posterior:
        """The posterior of now."""
        if self._posterior is None:
            memory, outlier = self._memory, self.config.outlier
            at = memory.conditions, memory.changes
            mean = self._prior.mean(memory.conditions)
            low, high = memory.low.T - mean, memory.high.T - mean
            readings = Readings(low, high, memory.variance.T, outlier)
            covariance = self._prior.covariance(*at, *at)
            self._posterior = infer(covariance, readings, self._prior.log_share)
        return self._posterior

    def _predict(
        self, at: Float[np.ndarray, "p k"], changes: Int[np.ndarray, " p"] | int | None = None
    ) -> tuple[Float[np.ndarray, "m k p"], Float[np.ndarray, "m k p"]]:
        """Mean and variance of a trial's displacement under each model; now, if not said when."""
        posterior, memory = self._known(), self._memory
        after = self._now if changes is None else changes
        cross = self._prior.covariance(at, after, memory.conditions, memory.changes)[:, None]
        mean = self._prior.mean(at) + (cross @ posterior.weights[..., None])[..., 0]
        explained = np.sum((cross @ posterior.precision) * cross, axis=-1)
        variance = self._prior.variance(at, after)[:, None] - explained
        return mean, np.maximum(variance, 1e-10)

    def _mixed(self, means: Float[np.ndarray, "m k p"]) -> Float[np.ndarray, "p k"]:
        """Mean over all models."""
        return np.asarray(np.einsum("m,mkp->pk", self._known().model_weights, means))


def _clipped(vector: Point, longest: float) -> Point:
    """The same direction, no longer than that."""
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)

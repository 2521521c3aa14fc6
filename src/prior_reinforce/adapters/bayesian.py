"""A Bayesian condition adapter: readings are intervals, and nothing of an afternoon is forgotten.

Ours; the paper's adapter is in `gaussian_process`. See `BayesianAdapter` for the model.
"""

from __future__ import annotations

import copy
import functools
import itertools
import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.special import ndtr, ndtri

from prior_reinforce.adapters.base import Adapter, Expectation
from prior_reinforce.adapters.expectation_propagation import Posterior, Readings, infer
from prior_reinforce.adapters.misses import Belief, Targets, p_hit_after
from prior_reinforce.arrays import Point, Points
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.normalisation import Normalisation
from prior_reinforce.plans.outcome_weights import smooth_weights
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
_POINTS = 192
"""Where the probability of a hit is evaluated (ours): right to 0.002, for k up to 3."""
_TRIALS_KEPT = 24
"""Trials in memory before old ones are merged (ours): a proposal stays below 20 ms."""
_MERGED_TO = 16
"""How many are left then."""
_LATEST = 8
"""The latest of them, which are never merged, and whose misses count for themselves."""
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
_TELLS_NOTHING = 1e-2
"""Precision below which a reading is dropped when trials are merged (ours): an sd of ten
spreads."""


@dataclass(frozen=True)
class BayesianConfig:
    """Settings of `BayesianAdapter`, in units of S, the demonstrations' spread (`Normalisation`).

    Where there are several values, all combinations are models, and their evidence weighs them.
    """

    label_sd: tuple[float, ...] = (0.03, 0.1)
    """How far demonstrated outcomes are off, beside the noise that they state."""
    generator_sd: float = 0.3
    """a, what the generator itself gets wrong, whatever the labels."""
    generator_reach: float = 0.5
    """How far that reaches."""
    p_generator: float = 0.1
    """Beforehand, the probability that it does."""
    rough_sd: float = 0.025
    """What lies between demonstrations."""
    rough_reach: float = 0.32
    """How far that reaches."""
    hardware_sd: tuple[float, float] = (0.03, 0.3)
    """b, what is different from the demonstrations' day: where nothing was changed, and where
    something was."""
    hardware_reach: float = 2.5
    """How far that reaches: shift and stretch."""
    p_changed: float = 0.2
    """Beforehand, the probability that something was changed."""
    execution_sd: float = 0.02
    """How far apart outcomes of one plan lie: 3 to 4 mm where the spread is 12 to 18 cm, as for
    repeated executions on our tasks."""
    outlier: float = 0.01
    """Probability that a reading says nothing: a lost ball, a wrong word."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: A setting is not positive, a probability is 1 or more, or
                `hardware_sd` has not two values.
        """
        for name in ("label_sd", "hardware_sd"):
            if not isinstance(getattr(self, name), tuple):
                raise ConfigurationError(f"{name} must be a tuple, got {getattr(self, name)}")
        for name, value in vars(self).items():
            values = value if isinstance(value, tuple) else (value,)
            if not (values and all(math.isfinite(v) and v > 0 for v in values)):
                raise ConfigurationError(f"{name} must be positive, got {value}")
        for name in ("outlier", "p_generator", "p_changed"):
            if (value := getattr(self, name)) >= 1.0:
                raise ConfigurationError(f"{name} must be below 1, got {value}")
        if len(self.hardware_sd) != 2:
            raise ConfigurationError(
                f"hardware_sd must have two values, unchanged and changed, got {self.hardware_sd}"
            )


@dataclass(frozen=True, eq=False)
class _Memory:
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
    def empty(cls, k: int) -> _Memory:
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
    ) -> _Memory:
        """The same and one more."""
        aim = np.zeros_like(condition) if aim is None else aim
        one = (condition[None], [changes], low[None], high[None], variance[None], aim[None])
        return self._beside((*one, [missed_by]))

    def and_then(self, other: _Memory) -> _Memory:
        """The same and all of another."""
        return self._beside(tuple(vars(other).values()))

    def only(self, which: Bool[np.ndarray, " n"] | Int[np.ndarray, " m"] | slice) -> _Memory:
        """Some of them."""
        return _Memory(*(of[which] for of in vars(self).values()))

    def _beside(self, more: tuple[Any, ...]) -> _Memory:
        pairs = zip(vars(self).values(), more, strict=True)
        return _Memory(*(np.concatenate(pair) for pair in pairs))


class BayesianAdapter(Adapter):
    """What is believed of the displacement between condition and outcome, and the best next try.

    In normalised units, where S, the root mean square deviation of the demonstrated outcomes, is 1
    (one S for each unit), a plan generated for c comes down at

        r = c + d(c) + noise,    d_j(c) = sum_i w_i(c) e_ij + f_j(c) + u_j(c) + h_j(c)    j = 1..k

    with independent Gaussian terms of prior mean 0:

        e   sd s_i              by how much the outcome of demonstration i is off: the noise that it
                                states (mean over components), and 0.03 or 0.1 more
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
    (docs/decisions-adapter.md). With nothing but demonstrations it is the goal. Where the fixed
    point has just missed the same goal, since its reading did not say what to change (a word
    coarser than the tolerance, or "a miss" and nothing else), the condition beside it that most
    probably hits is next, given all that missed (`adapters.misses`).

    Old trials are merged where there are many: those closest together become one number with the
    precision of both. Proposals depend on what was observed alone, never on what was proposed
    before.

    Source: ours, because words are intervals, and taken as numbers an adapter stands still.
    Constants: measured fields of all our tasks, and the figures of docs/decisions-adapter.md.
    """

    config_type: ClassVar[type[BayesianConfig]] = BayesianConfig
    carries_over: ClassVar[bool] = True
    _posterior: Posterior | None
    _missed: _Memory | None

    def __init__(self, config: BayesianConfig | None = None) -> None:
        """Take the settings, or the defaults."""
        self.config = config = config or BayesianConfig()
        generator = ((0.0, 1.0 - config.p_generator), (config.generator_sd, config.p_generator))
        same, changed = config.hardware_sd
        hardware = ((same, 1.0 - config.p_changed), (changed, config.p_changed))
        grid = itertools.product(config.label_sd, generator, hardware)
        models = [(e, a, b, p * q) for e, (a, p), (b, q) in grid]
        e, a, b, share = np.array(models).T
        self._label, self._generator, self._hardware, self._log_prior = (
            e**2,
            a**2,
            b**2,
            np.log(share),
        )

    def _start(self, demonstrations: Demonstrations) -> None:
        self._normalisation = Normalisation.of(demonstrations)
        self._demonstrated = self._normalisation.apply(demonstrations.outcomes_seen)
        self._noise = demonstrations.outcome_noise / self._normalisation.scale
        self._memory, self._now = _Memory.empty(demonstrations.outcome_dim), 0
        self._mix()

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
        if len(self._memory.changes) > _TRIALS_KEPT:
            self._merge()

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

    def _likeliest_beside(self, condition: Point, goal: Point, missed: _Memory) -> Point:
        """Return the condition around another that most probably hits, within the last tolerance.

        No farther away than changed hardware takes it: where weights are steep, the sd means
        nothing.
        """
        _, variance = self._predict(condition[None])
        share = self._known().model_weights
        sd = math.sqrt(float(np.einsum("m,mkp->k", share, variance).max()))
        radius = float(missed.missed_by[-1])
        reach = radius + 2.0 * min(sd, self.config.hardware_sd[1])
        cube = 2.0 * _evenly(len(goal)) - 1.0
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
        inside = _share_within(radius, mean - aims.T, sd)
        return np.asarray(np.clip(self._known().model_weights @ inside, 0.0, 1.0))

    def _misses(self) -> _Memory:
        """The latest trials that missed and of which their readings do not say so."""
        if self._missed is None:
            missed = self._memory.only(slice(-_LATEST, None))
            missed = missed.only(missed.missed_by > 0.0)
            if len(missed.changes) > 0:
                at, radius = (missed.conditions, missed.changes), missed.missed_by
                on_target = self._p_hit(*at, self._mixed(self._predict(*at)[0]), radius)
                p_hit = self._p_hit(*at, missed.aims, radius)
                missed = missed.only(p_hit > _NOT_EXCLUDED * on_target)
            self._missed = missed
        return self._missed

    def _p_hit_after(
        self, missed: _Memory, at: Points, aims: Points, radius: float, *, seed: int = 0
    ) -> Float[np.ndarray, " n"]:
        """`_p_hit` of now, given that those missed; what was chosen is judged by other draws."""
        known, memory = self._known(), self._memory
        then, told = (missed.conditions, missed.changes), (memory.conditions, memory.changes)
        to_missed = self._covariance(*then, *told)[:, None]
        to_here = self._covariance(at, self._now, *told)[:, None]
        from_missed = known.precision @ np.swapaxes(to_missed, 2, 3)
        mean, variance = self._predict(at)
        belief = Belief(
            share=known.model_weights,
            at_missed=(to_missed @ known.weights[..., None])[..., 0],
            among_missed=self._covariance(*then, *then)[:, None] - to_missed @ from_missed,
            mean=mean,
            variance=variance,
            cross=self._covariance(at, self._now, *then)[:, None] - to_here @ from_missed,
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
        cross = self._covariance(at, self._now, memory.conditions, memory.changes)
        to = self._covariance(places, self._now, memory.conditions, memory.changes)
        between = self._covariance(at, self._now, places, self._now)
        gone = np.zeros(len(at))
        for precision in np.moveaxis(known.precision, 1, 0):  # for each component
            explained = cross @ precision
            covariance = between - explained @ np.swapaxes(to, 1, 2)
            variance = self._variance(at, self._now) - np.sum(explained * cross, axis=-1)
            gone += share @ (np.square(covariance).mean(axis=-1) / (variance + noise))
        return np.asarray(gone / left)

    def _unknown(self, places: Float[np.ndarray, "p k"]) -> float:
        """Mean variance of a trial's displacement there, summed over components."""
        _, variance = self._predict(places)
        return float(self._known().model_weights @ variance.sum(axis=1).mean(axis=1))

    def _with_demonstration(self, outcome: Float[np.ndarray, "1 k"]) -> BayesianAdapter:
        """The same with one demonstration more, seen as the others are on average."""
        other = copy.copy(self)
        other._demonstrated = np.vstack([self._demonstrated, outcome])
        other._noise = np.vstack([self._noise, self._noise.mean(axis=0)])
        other._mix()
        return other

    def _mix(self) -> None:
        """Know by which weights demonstrations are mixed, and how far they are off."""
        outcomes, scale = self._normalisation.undo(self._demonstrated), self._normalisation.scale
        self._weights = smooth_weights(outcomes, noise=self._noise * scale)
        self._stated = np.mean(self._noise**2, axis=1)
        self._posterior = self._missed = None

    def _known(self) -> Posterior:
        """The posterior of now."""
        if self._posterior is None:
            memory, config = self._memory, self.config
            at = memory.conditions, memory.changes
            covariance = self._covariance(*at, *at)
            readings = Readings(memory.low.T, memory.high.T, memory.variance.T, config.outlier)
            self._posterior = infer(covariance, readings, self._log_prior)
        return self._posterior

    def _merge(self) -> None:
        """Make fewer trials of those that are old, the closest together first.

        Each becomes a number: its site, which is what the interval told beside all others. Two at
        different conditions tell of the place between them a little less.
        """
        known, memory = self._known(), self._memory
        share = known.model_weights
        tau, nu = (np.einsum("m,mkn->nk", share, of) for of in (known.tau, known.nu))
        old = np.arange(len(memory.changes) - _LATEST)
        sites = memory.only(old)
        number = nu[old] / tau[old]
        sites = replace(sites, low=number, high=number, variance=1.0 / tau[old])
        told = np.any(tau[old] > _TELLS_NOTHING, axis=1)
        sites = sites.only(told)
        # Trials of different hardware are never merged, so there may be none left that can be.
        while len(sites.changes) > max(_MERGED_TO - _LATEST, len(np.unique(sites.changes))):
            i, j = _closest(sites)
            weight = np.sum(1.0 / sites.variance[[i, j]], axis=1)
            both = sites.conditions[[i, j]]
            middle = np.average(both, axis=0, weights=weight)
            precision = 1.0 / (
                sites.variance[[i, j]] + self._apart(both, middle, int(sites.changes[i]))[:, None]
            )
            number = np.sum(precision * sites.low[[i, j]], axis=0) / precision.sum(axis=0)
            changes, variance = sites.changes[i], 1.0 / precision.sum(axis=0)
            rest = sites.only(np.setdiff1d(np.arange(len(sites.changes)), [i, j]))
            sites = rest.with_one(middle, changes, number, number, variance)
        latest = memory.only(slice(-_LATEST, None))
        self._memory = sites.and_then(latest)
        self._posterior = self._missed = None

    def _apart(self, conditions: Points, other: Point, change: int) -> Float[np.ndarray, " n"]:
        """Prior variance of the difference between displacements here and there."""
        there = other[None]
        cross = self._covariance(conditions, change, there, change)[..., 0]
        variance = self._variance(conditions, change) + self._variance(there, change)
        return np.asarray(self._known().model_weights @ (variance - 2.0 * cross))

    def _covariance(
        self,
        a: Float[np.ndarray, "p k"],
        after_a: Int[np.ndarray, " p"] | int,
        b: Points,
        after_b: Int[np.ndarray, " n"] | int,
    ) -> Float[np.ndarray, "m p n"]:
        """Prior covariance of displacements at a and b, each after so many changes of hardware."""
        config = self.config
        square = np.square(a[:, None] - b[None]).sum(axis=-1)
        w_a, w_b = self._mixed_by(a), self._mixed_by(b)
        stated = (w_a * self._stated) @ w_b.T
        rough = config.rough_sd**2 * np.exp(-0.5 * square / config.rough_reach**2)
        generator = np.exp(-0.5 * square / config.generator_reach**2)
        of_a, of_b = np.broadcast_to(after_a, len(a)), np.broadcast_to(after_b, len(b))
        shared = np.where(of_a[:, None] == of_b, self._hardware_of(of_b)[:, None], 0.0)
        return np.asarray(
            stated
            + rough
            + self._label[:, None, None] * (w_a @ w_b.T)
            + self._generator[:, None, None] * generator
            + shared * np.exp(-0.5 * square / config.hardware_reach**2)
        )

    def _hardware_of(self, changes: Int[np.ndarray, " n"]) -> Float[np.ndarray, "m n"]:
        """b^2: before anything is said to be changed it is one of two, afterwards the greater."""
        return np.where(changes == 0, self._hardware[:, None], self.config.hardware_sd[1] ** 2)

    def _variance(
        self, at: Float[np.ndarray, "p k"], changes: Int[np.ndarray, " p"] | int
    ) -> Float[np.ndarray, "m p"]:
        """Prior variance of the displacement of a trial."""
        squares = np.square(self._mixed_by(at))
        of_all = self.config.rough_sd**2 + squares @ self._stated
        of_each = self._label[:, None] * squares.sum(axis=1)
        hardware = self._hardware_of(np.broadcast_to(changes, len(at)))
        return np.asarray(of_all + of_each + self._generator[:, None] + hardware)

    def _mixed_by(self, at: Float[np.ndarray, "p k"]) -> Float[np.ndarray, "p N"]:
        """w, how much each demonstration counts."""
        return self._weights(self._normalisation.undo(at))

    def _predict(
        self, at: Float[np.ndarray, "p k"], changes: Int[np.ndarray, " p"] | int | None = None
    ) -> tuple[Float[np.ndarray, "m k p"], Float[np.ndarray, "m k p"]]:
        """Mean and variance of a trial's displacement under each model; now, if not said when."""
        posterior, memory = self._known(), self._memory
        after = self._now if changes is None else changes
        cross = self._covariance(at, after, memory.conditions, memory.changes)[:, None]
        mean = (cross @ posterior.weights[..., None])[..., 0]
        explained = np.sum((cross @ posterior.precision) * cross, axis=-1)
        variance = self._variance(at, after)[:, None] - explained
        return mean, np.maximum(variance, 1e-10)

    def _mixed(self, means: Float[np.ndarray, "m k p"]) -> Float[np.ndarray, "p k"]:
        """Mean over all models."""
        return np.asarray(np.einsum("m,mkp->pk", self._known().model_weights, means))


def _clipped(vector: Point, longest: float) -> Point:
    """The same direction, no longer than that."""
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)


def _closest(memory: _Memory) -> tuple[int, int]:
    """The two that are closest together, of one hardware."""
    square = np.square(memory.conditions[:, None] - memory.conditions[None]).sum(axis=-1)
    square[memory.changes[:, None] != memory.changes] = np.inf
    square[np.tril_indices(len(square))] = np.inf
    i, j = np.unravel_index(np.argmin(square), square.shape)
    return int(i), int(j)


def _share_within(
    radius: float | Float[np.ndarray, " n"],
    mean: Float[np.ndarray, "m k n"],
    sd: Float[np.ndarray, "m k n"],
) -> Float[np.ndarray, "m n"]:
    """Probability that independent normal numbers lie in the ball around 0, or in one each.

    One component after another, each between what the ones before leave of the ball: exact for k =
    1, and smooth in everything. Source: Genz, Numerical computation of multivariate normal
    probabilities, 1992, for a box; the ball is ours.
    """
    k = mean.shape[1]
    points = _evenly(k - 1)
    square = np.square(radius)[..., None]
    left = np.broadcast_to(square, (*mean[:, 0].shape, len(points)))
    inside = np.ones_like(left)
    for j in range(k):
        reach, middle, spread = np.sqrt(left), mean[:, j, :, None], sd[:, j, :, None]
        low, high = ndtr((-reach - middle) / spread), ndtr((reach - middle) / spread)
        inside = inside * (high - low)
        if j < k - 1:
            at = middle + spread * ndtri(np.clip(low + (high - low) * points[:, j], 1e-300, 1.0))
            left = np.maximum(left - np.square(np.clip(at, -reach, reach)), 0.0)
    return np.asarray(inside.mean(axis=-1))


@functools.lru_cache
def _evenly(k: int) -> Float[np.ndarray, "q k"]:
    """Points that fill the unit cube evenly: additive recurrence by the root of x^(k+1) = x + 1.

    Source: Roberts, The unreasonable effectiveness of quasirandom sequences, 2018.
    """
    root = 2.0
    for _ in range(50):
        root = (1.0 + root) ** (1.0 / (k + 1))
    return np.asarray(
        (0.5 + np.arange(1, _POINTS + 1)[:, None] * root ** -np.arange(1.0, k + 1)) % 1
    )

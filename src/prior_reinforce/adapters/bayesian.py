"""A Bayesian condition adapter: readings are intervals, and nothing of an afternoon is forgotten.

Ours; the paper's adapter is in `gaussian_process`. See `BayesianAdapter` for the model.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.special import ndtr, ndtri

from prior_reinforce.adapters.base import Adapter, Expectation
from prior_reinforce.adapters.expectation_propagation import Posterior, Readings, infer
from prior_reinforce.arrays import Point, Points
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.normalisation import Normalisation
from prior_reinforce.readings import Reading

_STEPS = 12
"""Steps to the fixed point of the proposal, each 0.7 of the way (ours)."""
_RELAXATION = 0.7
_TRIALS_AFTER_A_MISS = 1.3
"""Fitted to 1429 trials of tuning material (ours; docs/decisions-adapter.md)."""
_POINTS = 192
"""Where the probability of a hit is evaluated (ours): right to 0.002, for k up to 3."""
_TRIALS_KEPT = 24
"""Trials in memory before old ones are merged (ours): a proposal stays below 20 ms."""
_MERGED_TO = 16
"""How many are left then."""
_LATEST = 6
"""The latest of them, which are never merged."""
_TEACHING_SD = 0.1
"""How finely a trial that is made to learn from is read, in spreads (ours): "5 cm" by eye is an
interval of 4 cm, whose standard deviation is 1.2 cm of 12 to 18."""
_TELLS_NOTHING = 1e-2
"""Precision below which a reading is dropped when trials are merged (ours): an sd of ten
spreads."""


@dataclass(frozen=True)
class BayesianConfig:
    """Settings of `BayesianAdapter`, in units of S, the demonstrations' spread (`Normalisation`).

    Where there are several values, all combinations are models, and their evidence weighs them.
    The defaults cover what maximum likelihood finds on the fields of all our tasks.
    """

    field_sd: tuple[float, ...] = (0.12, 0.25, 0.45)
    """a, what the generator gets wrong: mostly the rounding of labels that were seen by eye."""
    field_reach: tuple[float, ...] = (0.7, 1.0)
    """l, how far that reaches."""
    rough_sd: float = 0.025
    """What lies between demonstrations."""
    rough_reach: float = 0.32
    """How far that reaches."""
    hardware_sd: tuple[float, ...] = (0.03, 0.3)
    """b, what changed since the demonstrations: shift and stretch."""
    hardware_reach: float = 2.5
    """How far that reaches."""
    execution_sd: float = 0.02
    """How far apart outcomes of one plan lie: 3 to 4 mm where the spread is 12 to 18 cm, as for
    repeated executions on our tasks."""
    demonstration_sd: float = 0.15
    """By how much the demonstrations' outcomes are misread."""
    outlier: float = 0.01
    """Probability that a reading says nothing: a lost ball, a wrong word."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: A setting is not positive, or a probability of 1 or more.
        """
        for name, value in vars(self).items():
            values = value if isinstance(value, tuple) else (value,)
            if not (values and all(math.isfinite(v) and v > 0 for v in values)):
                raise ConfigurationError(f"{name} must be positive, got {value}")
        if self.outlier >= 0.5:
            raise ConfigurationError(f"outlier must be below 0.5, got {self.outlier}; try 0.01")


@dataclass(frozen=True, eq=False)
class _Memory:
    """What was read of the displacement at n conditions, in normalised units."""

    conditions: Points
    hardware: Int[np.ndarray, " n"]
    """0 for demonstrations, then counting changes of hardware from 1."""
    low: Points
    high: Points
    variance: Points

    def with_one(
        self, condition: Point, hardware: int, low: Point, high: Point, variance: Point
    ) -> _Memory:
        """The same and one more."""
        return _Memory(
            np.vstack([self.conditions, condition]),
            np.append(self.hardware, hardware),
            np.vstack([self.low, low]),
            np.vstack([self.high, high]),
            np.vstack([self.variance, variance]),
        )

    def only(self, which: Bool[np.ndarray, " n"] | Int[np.ndarray, " m"]) -> _Memory:
        """Some of them."""
        return _Memory(
            self.conditions[which],
            self.hardware[which],
            self.low[which],
            self.high[which],
            self.variance[which],
        )


class BayesianAdapter(Adapter):
    """What is believed of the displacement between condition and outcome, and the best next try.

    In normalised units, where S, the root mean square deviation of the demonstrated outcomes, is 1
    (one S for each unit), a plan generated for c comes down at

        r = c + d(c) + noise,        d_j(c) = f_j(c) + u_j(c) + h_j(c)        j = 1..k

    with independent Gaussian processes of prior mean 0 and squared-exponential kernels:

        f   sd a, reach l            what the generator got wrong, mostly labels that were rounded
        u   sd 0.025, reach 0.32     what lies between the demonstrations
        h   sd b, reach 2.5          what has changed since: shift and stretch, anew for every
                                     change of hardware
        noise  sd 0.02               execution

    Trials and questions see f + u + h of their hardware; demonstrations were executed on the
    hardware of their day and see f + u. A reading (`readings.Reading`) says that the blurred error
    r - g lies in an interval, or, with probability 0.01, nothing at all; a demonstration says that
    d(c_i) = 0 give or take 0.15. The posterior is found by expectation propagation for each (a, l,
    b) of a grid of 12; its evidence weighs them.

    The next condition is the fixed point c = g - E d(c): the posterior mean, which is as good as
    the greatest probability of a hit on our tasks, and knows no tolerance
    (docs/decisions-adapter.md). With nothing but demonstrations it is the goal.

    Old trials are merged where there are many: those closest together become one number with the
    precision of both. Proposals depend on what was observed alone, never on what was proposed
    before.

    Source: ours, because words are intervals, and taken as numbers an adapter stands still.
    Constants: maximum likelihood of such kernels on fields of all our tasks, and the figures of
    docs/decisions-adapter.md.
    """

    config_type: ClassVar[type[BayesianConfig]] = BayesianConfig
    carries_over: ClassVar[bool] = True

    def __init__(self, config: BayesianConfig | None = None) -> None:
        """Take the settings, or the defaults."""
        self.config = config or BayesianConfig()
        grid = itertools.product(
            self.config.field_sd, self.config.field_reach, self.config.hardware_sd
        )
        a, reach, b = np.array(list(grid)).T
        self._field, self._reach, self._hardware_variance = a**2, reach, b**2
        self._prior_variance = a**2 + b**2 + self.config.rough_sd**2

    def _start(self, demonstrations: Demonstrations) -> None:
        self._normalisation = Normalisation.of(demonstrations)
        conditions = self._normalisation.apply(demonstrations.outcomes_seen)
        zero = np.zeros_like(conditions)
        variance = np.full_like(zero, self.config.demonstration_sd**2 + self.config.execution_sd**2)
        self._memory = _Memory(conditions, np.zeros(len(zero), int), zero, zero, variance)
        self._now = 1
        self._posterior: Posterior | None = None

    def change_hardware(self) -> None:
        """What has changed since the demonstrations is unknown anew; the rest stays known."""
        self._now += 1

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        self._observe_reading(condition, condition, Reading.estimated(outcome_seen - condition))

    def _observe_reading(self, condition: Point, goal: Point, reading: Reading) -> None:
        scale, moved = self._normalisation.scale, goal - condition
        self._memory = self._memory.with_one(
            self._normalisation.apply(condition),
            self._now,
            (reading.low + moved) / scale,
            (reading.high + moved) / scale,
            (reading.sd / scale) ** 2 + self.config.execution_sd**2,
        )
        self._posterior = None
        if np.count_nonzero(self._memory.hardware) > _TRIALS_KEPT:
            self._merge()

    def _propose(self, goal_seen: Point) -> Point:
        goal = self._normalisation.apply(goal_seen)
        condition = goal
        for _ in range(_STEPS):
            mean, _ = self._predict(condition[None])
            condition = condition + _RELAXATION * (goal - self._mixed(mean)[0] - condition)
        return self._normalisation.undo(condition)

    def _expect(self, condition: Point, goal: Point, tolerance: float) -> Expectation:
        p_hit = float(self.p_hit(condition[None], goal[None], tolerance)[0])
        return Expectation(p_hit, 1.0 + _TRIALS_AFTER_A_MISS * (1.0 - p_hit))

    def p_hit(self, conditions: Points, goals: Points, tolerance: float) -> Float[np.ndarray, " n"]:
        """Return the probability that each condition's outcome is within the tolerance of its goal.

        Args:
            conditions: Shape (n, k), in the outcomes' units.
            goals: Shape (n, k).
            tolerance: In the first component's unit (`Normalisation.metric`).
        """
        scale = self._normalisation.scale
        mean, variance = self._predict(self._normalisation.apply(conditions))
        error = mean + ((conditions - goals) / scale).T  # (models, k, n)
        sd = np.sqrt(variance + self.config.execution_sd**2)
        inside = _share_within(tolerance / scale[0], error, sd)
        return np.asarray(np.clip(self._known().model_weights @ inside, 0.0, 1.0))

    def gain(
        self, candidates: Points, over: Float[np.ndarray, "m k"], *, demonstrations: bool = False
    ) -> Float[np.ndarray, " n"]:
        """Return by how much a reading at each candidate would lower what is unknown elsewhere.

        Args:
            candidates: Conditions that a trial might be made with, shape (n, k), in the outcomes'
                units.
            over: Conditions whose displacements are to be known, shape (m, k).
            demonstrations: The readings are of new demonstrations, which say nothing of what has
                changed, instead of trials.

        Returns:
            Share of the mean variance over those places that is gone afterwards; exact for a
            number read to 0.1 spreads, which is about a word by eye.
        """
        known, share = self._known(), self._known().model_weights
        at, places = self._normalisation.apply(candidates), self._normalisation.apply(over)
        here = (self._memory.hardware == self._now)[None]
        cross = self._covariance(at, self._memory.conditions, here & (not demonstrations))
        to = self._covariance(places, self._memory.conditions, here)
        now = np.full((1, len(places)), not demonstrations)
        own = self._prior_variance - (self._hardware_variance if demonstrations else 0.0)
        gone, left = np.zeros(len(at)), 0.0
        for precision in np.moveaxis(known.precision, 1, 0):  # for each component
            explained = cross @ precision
            covariance = self._covariance(at, places, now) - explained @ np.swapaxes(to, 1, 2)
            variance = own[:, None] - np.sum(explained * cross, axis=-1)
            noise = self.config.execution_sd**2 + _TEACHING_SD**2
            gone += share @ (np.square(covariance).mean(axis=-1) / (variance + noise))
            unknown = self._prior_variance[:, None] - np.sum((to @ precision) * to, axis=-1)
            left += float(share @ unknown.mean(axis=-1))
        return np.asarray(gone / left)

    def _known(self) -> Posterior:
        """The posterior of now."""
        if self._posterior is None:
            memory, config = self._memory, self.config
            same = memory.hardware[:, None] == memory.hardware
            covariance = self._covariance(
                memory.conditions, memory.conditions, same & (memory.hardware > 0)
            )
            readings = Readings(memory.low.T, memory.high.T, memory.variance.T, config.outlier)
            self._posterior = infer(covariance, readings)
        return self._posterior

    def _merge(self) -> None:
        """Make fewer trials of those that are old, the closest together first.

        Each becomes a number: its site, which is what the interval told beside all others. Two at
        different conditions tell of the place between them a little less.
        """
        known, memory = self._known(), self._memory
        share = known.model_weights
        tau, nu = (np.einsum("m,mkn->nk", share, of) for of in (known.tau, known.nu))
        trials = np.flatnonzero(memory.hardware)
        old = trials[:-_LATEST]
        sites = memory.only(old)
        number = nu[old] / tau[old]
        sites = replace(sites, low=number, high=number, variance=1.0 / tau[old])
        told = np.any(tau[old] > _TELLS_NOTHING, axis=1)
        sites = sites.only(told)
        a2, reach = share @ self._field, share @ self._reach
        while len(sites.hardware) > _MERGED_TO - _LATEST:
            i, j = _closest(sites)
            weight = np.sum(1.0 / sites.variance[[i, j]], axis=1)
            middle = np.average(sites.conditions[[i, j]], axis=0, weights=weight)
            square = np.square(sites.conditions[[i, j]] - middle).sum(axis=1)[:, None]
            lost = 2 * a2 * -np.expm1(-0.5 * square / reach**2)
            lost = lost + 2 * self.config.rough_sd**2 * -np.expm1(
                -0.5 * square / self.config.rough_reach**2
            )
            precision = 1.0 / (sites.variance[[i, j]] + lost)
            number = np.sum(precision * sites.low[[i, j]], axis=0) / precision.sum(axis=0)
            hardware, variance = sites.hardware[i], 1.0 / precision.sum(axis=0)
            rest = sites.only(np.setdiff1d(np.arange(len(sites.hardware)), [i, j]))
            sites = rest.with_one(middle, hardware, number, number, variance)
        own, latest = memory.only(memory.hardware == 0), memory.only(trials[-_LATEST:])
        self._memory = _Memory(
            *(
                np.concatenate([getattr(part, name) for part in (own, sites, latest)])
                for name in ("conditions", "hardware", "low", "high", "variance")
            )
        )
        self._posterior = None

    def _covariance(
        self, a: Float[np.ndarray, "p k"], b: Points, share_hardware: Bool[np.ndarray, "_ n"]
    ) -> Float[np.ndarray, "m p n"]:
        """Prior covariance of displacements, the hardware's part where both share it."""
        square = np.square(a[:, None] - b[None]).sum(axis=-1)
        rough = self.config.rough_sd**2 * np.exp(-0.5 * square / self.config.rough_reach**2)
        hardware = np.exp(-0.5 * square / self.config.hardware_reach**2) * share_hardware
        by_reach = np.exp(-0.5 * square / self._reach[:, None, None] ** 2)
        return np.asarray(
            self._field[:, None, None] * by_reach
            + self._hardware_variance[:, None, None] * hardware
            + rough
        )

    def _predict(
        self, at: Float[np.ndarray, "p k"]
    ) -> tuple[Float[np.ndarray, "m k p"], Float[np.ndarray, "m k p"]]:
        """Mean and variance of the displacement of a trial now, under each model."""
        posterior = self._known()
        same = (self._memory.hardware == self._now)[None]
        cross = self._covariance(at, self._memory.conditions, same)[:, None]
        mean = (cross @ posterior.weights[..., None])[..., 0]
        explained = np.sum((cross @ posterior.precision) * cross, axis=-1)
        variance = self._prior_variance[:, None, None] - explained
        return mean, np.maximum(variance, 1e-10)

    def _mixed(self, means: Float[np.ndarray, "m k p"]) -> Float[np.ndarray, "p k"]:
        """Mean over all models."""
        return np.asarray(np.einsum("m,mkp->pk", self._known().model_weights, means))


def _closest(memory: _Memory) -> tuple[int, int]:
    """The two that are closest together, of one hardware."""
    square = np.square(memory.conditions[:, None] - memory.conditions[None]).sum(axis=-1)
    square[memory.hardware[:, None] != memory.hardware] = np.inf
    square[np.tril_indices(len(square))] = np.inf
    i, j = np.unravel_index(np.argmin(square), square.shape)
    return int(i), int(j)


def _share_within(
    radius: float, mean: Float[np.ndarray, "m k n"], sd: Float[np.ndarray, "m k n"]
) -> Float[np.ndarray, "m n"]:
    """Probability that independent normal numbers lie in the ball around 0.

    One component after another, each between what the ones before leave of the ball: exact for k =
    1, and smooth in everything. Source: Genz, Numerical computation of multivariate normal
    probabilities, 1992, for a box; the ball is ours.
    """
    k = mean.shape[1]
    points = _evenly(k - 1)
    left = np.full((*mean[:, 0].shape, len(points)), radius**2)
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

"""Adapters that answer "why not simply ...?": rivals in comparisons, not for users to pick.

Named by their class: `reproduction.rivals:NewtonAdapter,gain=0.8`. All work in normalised units
(`Normalisation`), know one goal at a time, and try the goal itself first. Defaults are what served
each best on tuning material (reproduction/docs/decisions-adapter.md).
"""

from __future__ import annotations

import math
import warnings
from abc import abstractmethod
from typing import ClassVar

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.adapters.normalisation import Normalisation
from prior_reinforce.arrays import Point
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from reproduction.adapters.broyden import bounded


class Rival(Adapter):
    """Keeps all trials as numbers; a member says what to try next (`_next`)."""

    _settings: ClassVar[tuple[str, ...]]
    """Names of the settings, positive numbers all."""

    def _check(self) -> None:
        for name in self._settings:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ConfigurationError(f"{name} must be a positive number, got {value}")

    def _start(self, demonstrations: Demonstrations) -> None:
        self._normalisation = Normalisation.of(demonstrations)
        self._demonstrated = self._normalisation.apply(demonstrations.outcomes_seen)
        self._conditions = np.zeros((0, demonstrations.outcome_dim))
        self._outcomes = self._conditions

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        self._conditions = np.vstack([self._conditions, self._normalisation.apply(condition)])
        self._outcomes = np.vstack([self._outcomes, self._normalisation.apply(outcome_seen)])

    def _propose(self, goal_seen: Point) -> Point:
        if not len(self._outcomes):
            return goal_seen
        return self._normalisation.undo(self._next(self._normalisation.apply(goal_seen)))

    @abstractmethod
    def _next(self, goal: Point) -> Point:
        """What to try after at least one trial, in normalised units."""


class NewtonAdapter(Rival):
    """c' = c - gain J^-1 (r - g), J the slope of outcomes that were interpolated.

    What outcomes are off by, r - c, is interpolated over demonstrations, where it is 0, and trials
    by Gaussian radial functions of one reach; `smoothing` is added to the diagonal. The singular
    values of J are kept within a factor of two of 1, as Broyden's are.
    """

    _settings = ("gain", "reach", "smoothing")

    def __init__(self, gain: float = 0.6, reach: float = 2.0, smoothing: float = 0.2) -> None:
        """Choose the share of each step, and the reach of the radial functions in spreads."""
        self.gain, self.reach, self.smoothing = gain, reach, smoothing
        self._check()

    def _next(self, goal: Point) -> Point:
        known = np.vstack([self._demonstrated, self._conditions])
        off = np.vstack([np.zeros_like(self._demonstrated), self._outcomes - self._conditions])
        square = np.square(known[:, None] - known[None]).sum(axis=-1)
        kernel = np.exp(-0.5 * square / self.reach**2)
        weights = np.linalg.solve(kernel + self.smoothing * np.eye(len(known)), off)
        # d/dc of the radial functions at the last condition, whose row of the kernel is the last.
        towards = (known - known[-1]) / self.reach**2 * kernel[-1][:, None]
        slope = np.eye(len(goal)) + weights.T @ towards
        step = np.linalg.solve(bounded(slope), self._outcomes[-1] - goal)
        return np.asarray(known[-1] - self.gain * step)


class NormOptimalAdapter(Rival):
    """c' = c - (A'A + effort I)^-1 A' (r - g): norm-optimal iterative learning control.

    Each step minimises |predicted error|^2 + effort |step|^2. A, the slope of outcomes, is fitted
    to this goal's trials with their mean taken off, and held to the identity by `stiffness`.

    Source: Amann, Owens and Rogers, Iterative learning control for discrete-time systems with
    exponential rate of convergence, 1996. Theirs moves the whole input signal under a known model;
    a condition in place of the signal, and the fitted model, are ours.
    """

    _settings = ("effort", "stiffness")

    def __init__(self, effort: float = 0.4, stiffness: float = 0.1) -> None:
        """Choose what a step costs [-], and how firmly A is held, in squared spreads."""
        self.effort, self.stiffness = effort, stiffness
        self._check()

    def _next(self, goal: Point) -> Point:
        eye = np.eye(len(goal))
        moved = self._conditions - self._conditions.mean(axis=0)
        off = self._outcomes - self._conditions
        off = off - off.mean(axis=0)
        # Ridge regression of r - c on c: A = I + B.
        extra = np.linalg.solve(moved.T @ moved + self.stiffness * eye, moved.T @ off)
        slope = eye + extra.T
        error = self._outcomes[-1] - goal
        step = np.linalg.solve(slope.T @ slope + self.effort * eye, slope.T @ error)
        return np.asarray(self._conditions[-1] - step)


class CmaEsAdapter(Rival):
    """CMA-ES on |r - g|, one candidate a trial; the goal is the first of the first generation.

    Source: the library `cma` (Hansen, The CMA evolution strategy: a tutorial, 2016), as it is. It
    is run anew from its seed for each proposal, so that proposing changes nothing.
    """

    _settings = ("sigma", "population")

    def __init__(self, sigma: float = 0.1, population: int = 3, seed: int = 0) -> None:
        """Choose the first step size in spreads, candidates a generation, and the seed."""
        self.sigma, self.population, self.seed = sigma, population, seed
        self._check()

    def _next(self, goal: Point) -> Point:
        import cma

        rng = np.random.default_rng(self.seed)
        options = {
            "popsize": self.population,
            "randn": lambda *shape: rng.standard_normal(shape),
            "seed": np.nan,  # leave the global generator alone
            "verbose": -9,
        }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of populations that are small, and of one component
            strategy = cma.CMAEvolutionStrategy(goal, self.sigma, options)
            missed = np.linalg.norm(self._outcomes - goal, axis=1)
            for first in range(0, len(missed) + 1, self.population):
                candidates = strategy.ask()
                tried = self._conditions[first : first + self.population]
                if len(tried) < self.population:
                    break
                strategy.tell(list(tried), missed[first : first + self.population])
        return np.asarray(candidates[len(tried)])


class BayesianOptimisationAdapter(Rival):
    """Bayesian optimisation of the scalar |r - g| over conditions, by expected improvement.

    Demonstrations count as evaluations that were made already. Searched is the box around the goal.

    Source: the library `botorch`: `SingleTaskGP`, fitted anew for each proposal, and
    `LogExpectedImprovement` over the best posterior mean among what was tried, as noise asks for.
    """

    _settings = ("width", "power")

    def __init__(self, width: float = 0.5, power: float = 1.0, seed: int = 0) -> None:
        """Choose half the box in spreads, to which power |r - g| is raised, and the seed."""
        self.width, self.power, self.seed = width, power, seed
        self._check()

    def _next(self, goal: Point) -> Point:
        with warnings.catch_warnings():
            # Of fits that were tried again, and while torch is loaded.
            warnings.simplefilter("ignore")
            return self._search(goal)

    def _search(self, goal: Point) -> Point:
        import torch
        from botorch.acquisition.analytic import LogExpectedImprovement
        from botorch.fit import fit_gpytorch_mll
        from botorch.models import SingleTaskGP
        from botorch.optim.optimize import optimize_acqf
        from botorch.utils.sampling import manual_seed
        from gpytorch.mlls import ExactMarginalLogLikelihood

        tried = np.vstack([self._demonstrated, self._conditions])
        landed = np.vstack([self._demonstrated, self._outcomes])
        inputs = torch.as_tensor((tried - goal) / self.width)
        missed = np.linalg.norm(landed - goal, axis=1) ** self.power
        with manual_seed(self.seed):
            model = SingleTaskGP(inputs, torch.as_tensor(-missed[:, None]))
            fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
            best = model.posterior(inputs).mean.max().item()
            bounds = torch.tensor([[-1.0], [1.0]], dtype=inputs.dtype).expand(2, len(goal))
            found, _ = optimize_acqf(
                LogExpectedImprovement(model, best), bounds, q=1, num_restarts=4, raw_samples=128
            )
        return np.asarray(goal + self.width * found[0].numpy())

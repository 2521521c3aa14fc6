"""Generators that keep the demonstrations and mix them, frame by frame.

    A(c) = sum_i w_i(c) A_i

- `NearestNeighbours`: the paper's simplest baseline, "I.N.N.", w_i proportional to |c - r_i|^-p
  over the m nearest outcomes.
- `SmoothInterpolation`: w the cardinal weights of a polyharmonic spline with an affine tail, the
  strongest way to mix demonstrations we know. Not in the paper; ours, to measure how much of a
  generator's success is due to the assumption that plans depend smoothly on outcomes.

Demonstrations that begin their motion at different times mix to a blur of two motions rather than
one in between; on aligned ones the second is hard to beat (reproduction/docs/baselines.md).

Notation:
    A_i  plans       in their units
    r_i  outcomes    in their units
    c    conditions  in the outcomes' units
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.generators.base import Generator, OnProgress, report_single_step
from prior_reinforce.generators.saving import Tensors
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.outcome_weights import Kernel, smooth_weights
from prior_reinforce.registry import build
from prior_reinforce.settings import Checked


@dataclass(frozen=True)
class SmoothInterpolationConfig(Checked):
    """Settings of interpolation; reproduction/docs/baselines.md lists what was tried."""

    kernel: Kernel = "auto"
    """Radial function: the cube of distance, of least bending (`thin-plate`), or distance itself
    (`linear`); `auto` is the first, or the last if outcomes lie too close together for it."""
    ways: tuple[tuple[int, ...], ...] = ()
    """Numbers of the demonstrations of each way of doing the task. Ways are not mixed: a plan is of
    the way with the nearest outcome. Empty: all are of one way."""


class Mixture(Generator):
    """Weighted sums of the demonstrated plans; a subclass defines the weights."""

    config_type: ClassVar[type[Any]]
    _plans: Plans
    _outcomes: Points
    _noise: Points

    def __init__(self, config: Any = None) -> None:
        """Choose settings; the defaults when None."""
        self.config = config or self.config_type()

    @abstractmethod
    def _weights(self, conditions: Points) -> Float[np.ndarray, "n N"]:
        """Return the weight of each demonstration in the plan for each condition."""

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        """Keep the demonstrations; nothing is random and nothing takes time."""
        self._keep(
            demonstrations.plans.copy(),
            demonstrations.outcomes_seen.copy(),
            demonstrations.outcome_noise.copy(),
        )
        report_single_step(progress, loss=0.0)

    def _generate(self, conditions: Points) -> Plans:
        return np.tensordot(self._weights(conditions), self._plans, axes=1)

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """The demonstrations; see `Generator.state`."""
        return {"config": asdict(self.config)}, {
            "plans": self._plans,
            "outcomes": self._outcomes,
            "noise": self._noise,
        }

    @classmethod
    def from_state(cls, settings: Mapping[str, Any], tensors: Tensors) -> Self:
        """Rebuild it; see `Generator.from_state`."""
        generator = cls(build(cls.config_type, settings["config"]))
        plans, outcomes = tensors["plans"], tensors["outcomes"]
        if plans.ndim != 3 or outcomes.ndim != 2 or len(plans) != len(outcomes):
            raise ValueError(f"plans {plans.shape} and outcomes {outcomes.shape} do not fit")
        if tensors["noise"].shape != outcomes.shape:
            raise ValueError(f"noise {tensors['noise'].shape} does not fit outcomes")
        generator._keep(plans, outcomes, tensors["noise"])
        return generator

    def _keep(self, plans: Plans, outcomes: Points, noise: Points) -> None:
        """Keep the demonstrations."""
        self._plans, self._outcomes, self._noise = plans, outcomes, noise


class SmoothInterpolation(Mixture):
    """Polyharmonic-spline interpolation of plans over outcomes (ours)."""

    name: ClassVar[str] = "interpolation"
    config_type: ClassVar[type[SmoothInterpolationConfig]] = SmoothInterpolationConfig
    config: SmoothInterpolationConfig

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        super()._fit(demonstrations, seed, progress)
        if self.config.kernel == "auto" and self._splines[0].kernel == "linear":
            self.remarks = (
                "kernel: linear, since outcomes lie too close together for a cubic spline",
            )

    def _weights(self, conditions: Points) -> Float[np.ndarray, "n N"]:
        """Weigh the plans of one way; at a measured outcome its own plan alone, to rounding."""
        if not self.config.ways:
            return self._splines[0](conditions)
        distances = (conditions[:, None] - self._outcomes) / np.ptp(self._outcomes, axis=0)
        nearest = np.argmin(np.sum(distances**2, axis=2), axis=1)
        weights = np.zeros((len(conditions), len(self._outcomes)))
        for members, spline in zip(self.config.ways, self._splines, strict=True):
            rows = np.isin(nearest, members)
            weights[np.ix_(rows, np.array(members))] = spline(conditions[rows])
        return weights

    def _keep(self, plans: Plans, outcomes: Points, noise: Points) -> None:
        """Keep the demonstrations, and fit the weights of each way to them once."""
        super()._keep(plans, outcomes, noise)
        ways = [list(members) for members in self.config.ways] or [list(range(len(outcomes)))]
        self._splines = [
            smooth_weights(outcomes[way], kernel=self.config.kernel, noise=noise[way])
            for way in ways
        ]

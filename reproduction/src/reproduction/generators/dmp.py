r"""Dynamic movement primitives, interpolated over outcomes: the paper's baseline "DMP".

Variant: one discrete DMP a demonstration, `movement_primitives.dmp.DMP` without smooth scaling,
whose transformation system (Ijspeert et al., Neural Computation 25(2), 2013, eq. 2.1, forcing not
scaled by g - y0) and canonical system are

    tau^2 yddot = alpha (beta (g - y) - tau ydot) + z sum_b psi_b(z) v_b / sum_b psi_b(z)
    tau zdot = -alpha_z z,    alpha = 25, beta = alpha / 4 (critically damped), z(tau) = 0.01

started at rest in y0. Weights v, start y0, goal g, onset and duration are then interpolated over
outcomes with the cardinal weights of a thin-plate spline (`outcome_weights`).

The system is linear in (y0, g, v), in phase even whatever tau is. So the library integrates it
once, for unit parameters, and that response gives both the fit (least squares on positions; the
library's own fit takes backward differences and lags by a frame) and every generated plan. It also
means that interpolating the weights of DMPs of one duration is interpolating their motions: what a
DMP adds to `interpolation` is that each motion carries its own onset and duration.

Notation:
    y0, g  start and goal                   (D,)        in the plan's units
    v      forcing weights                  (D, B)      in the plan's units
    theta  all of them, y0 first, then g    (2 + B, D)  in the plan's units
    Phi    response to unit parameters      (H, 2 + B)  [-], over phase t / tau in [0, 1]
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arrays import Frames, Plans, Points
from prior_reinforce.generators.base import Generator, OnProgress, report_single_step
from prior_reinforce.generators.saving import Tensors
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.outcome_weights import smooth_weights
from prior_reinforce.registry import build
from prior_reinforce.settings import Checked, Positive

_INTEGRATION_STEPS = 1000
"""Runge-Kutta steps over a motion. The library evaluates the forcing one step late, which at its
default of one step a frame delays a motion by a frame; here it is a thousandth of the motion."""

_Phases = Float[np.ndarray, " H"]
"""t / tau of each frame, in [0, 1]."""


@dataclass(frozen=True)
class DynamicMovementPrimitivesConfig(Checked):
    """Size of the primitives; reproduction/docs/baselines.md tells what was tried."""

    frames_per_weight: Annotated[float, msgspec.Meta(ge=1)] = 2.0
    """Frames for each forcing weight of a dimension."""
    ridge: Positive = 1e-10
    """Ridge penalty of the fit, relative to the squared response of each weight [-]."""
    segmented: bool = True
    """Fit each demonstration from where its motion begins to where it ends, and interpolate onset
    and duration too, as is usual for DMPs. If not, every plan is one motion over its whole horizon,
    rests and all (the paper does not say)."""


class DynamicMovementPrimitives(Generator):
    """Interpolated discrete DMPs (paper, "DMP"); the variant is in this module's head."""

    name: ClassVar[str] = "dmp"
    config_type: ClassVar[type[DynamicMovementPrimitivesConfig]] = DynamicMovementPrimitivesConfig

    def __init__(self, config: DynamicMovementPrimitivesConfig | None = None) -> None:
        """Choose settings; the defaults when None."""
        self.config = config or DynamicMovementPrimitivesConfig()

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        """Fit one DMP to each demonstration; nothing is random."""
        plans, horizon = demonstrations.plans, demonstrations.horizon
        spans = np.tile([0.0, horizon - 1.0], (demonstrations.n, 1))
        if self.config.segmented:
            spans = demonstrations.signals.spans
        n_weights = max(2, min(horizon, round(horizon / self.config.frames_per_weight)))
        response = _Response(n_weights)
        parameters = np.stack(
            [
                response.fit(plan, _phases(horizon, span), self.config.ridge)
                for plan, span in zip(plans, spans, strict=True)
            ]
        )
        outcomes = demonstrations.outcomes_seen.copy()
        self._keep(_Primitives(response, parameters, spans, outcomes, horizon))
        report_single_step(progress, loss=float(np.mean((self._generate(outcomes) - plans) ** 2)))

    def _generate(self, conditions: Points) -> Plans:
        """Interpolate the primitives and roll each out."""
        known, weights = self._primitives, self._weights(conditions)
        parameters = np.tensordot(weights, known.parameters, axes=1)
        # Far outside the demonstrations an extrapolated motion could end before it begins.
        least = known.spans[:, 1] - known.spans[:, 0]
        onsets, durations = weights @ known.spans[:, 0], weights @ least
        durations = np.maximum(durations, least.min() / 2)
        plans = np.empty((len(conditions), known.horizon, known.parameters.shape[2]))
        for i, theta in enumerate(parameters):
            span = np.array([onsets[i], onsets[i] + durations[i]])
            plans[i] = known.response(_phases(known.horizon, span)) @ theta
        return plans

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """The primitives; see `Generator.state`."""
        known = self._primitives
        return (
            {"config": asdict(self.config), "horizon": known.horizon},
            {"parameters": known.parameters, "spans": known.spans, "outcomes": known.outcomes},
        )

    @classmethod
    def from_state(cls, settings: Mapping[str, Any], tensors: Tensors) -> Self:
        """Rebuild it; see `Generator.from_state`."""
        generator = cls(build(cls.config_type, settings["config"]))
        parameters, spans, outcomes = (tensors[n] for n in ("parameters", "spans", "outcomes"))
        if not len(parameters) == len(spans) == len(outcomes):
            raise ValueError("parameters, spans and outcomes do not fit")
        response, horizon = _Response(parameters.shape[1] - 2), int(settings["horizon"])
        generator._keep(_Primitives(response, parameters, spans, outcomes, horizon))
        return generator

    def _keep(self, primitives: _Primitives) -> None:
        """Keep the primitives, and fit the weights to their outcomes once."""
        self._primitives = primitives
        self._weights = smooth_weights(primitives.outcomes, kernel="thin-plate")


def _phases(horizon: int, span: Float[np.ndarray, 2]) -> _Phases:
    """Phase of every frame, held at 0 before the motion and at 1 after it."""
    return np.asarray(np.clip((np.arange(horizon) - span[0]) / (span[1] - span[0]), 0.0, 1.0))


class _Response:
    """Phi: the motion that one unit of each parameter makes, as a function of phase."""

    def __init__(self, n_weights: int) -> None:
        from movement_primitives.dmp import DMP
        from scipy.interpolate import CubicSpline

        n = 2 + n_weights
        # One dimension of the library's DMP for each parameter, all integrated at once.
        dmp = DMP(n, execution_time=1.0, dt=1 / _INTEGRATION_STEPS, n_weights_per_dim=n_weights)
        unit = np.eye(n)
        dmp.set_weights(unit[:, 2:].ravel())
        dmp.configure(start_y=unit[0], goal_y=unit[1])
        _, motions = dmp.open_loop()
        phases = np.linspace(0.0, 1.0, _INTEGRATION_STEPS + 1)
        self._spline = CubicSpline(phases, motions[: _INTEGRATION_STEPS + 1])

    def __call__(self, phases: _Phases) -> Float[np.ndarray, "H P"]:
        """Phi at each phase."""
        return np.asarray(self._spline(phases))

    def fit(self, plan: Frames, phases: _Phases, ridge: float) -> Float[np.ndarray, "P D"]:
        """Fit theta to a plan: its end points, then ridge regression."""
        response = self(phases)
        ends, forced = response[:, :2], response[:, 2:]
        boundary = plan[[0, -1]]
        size = np.linalg.norm(forced, axis=0)
        size[size == 0] = 1.0
        n_weights = len(size)
        system = np.vstack([forced / size, math.sqrt(ridge) * np.eye(n_weights)])
        rest = np.vstack([plan - ends @ boundary, np.zeros((n_weights, plan.shape[1]))])
        weights = np.linalg.lstsq(system, rest, rcond=None)[0] / size[:, None]
        return np.vstack([boundary, weights])


@dataclass(frozen=True, eq=False)
class _Primitives:
    """What is learned."""

    response: _Response
    parameters: Float[np.ndarray, "N P D"]
    """theta_i, in the plan's units."""
    spans: Float[np.ndarray, "N 2"]
    """Begin and end of each motion, in frames."""
    outcomes: Float[np.ndarray, "N k"]
    horizon: int

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
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.interpolate import CubicSpline
from typing_extensions import Self

from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    MissingExtraError,
    NotFittedError,
)
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.conditions import as_conditions
from prior_reinforce.generators.outcome_weights import smooth_weights
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.timing import velocity_profiles

_INTEGRATION_STEPS = 1000
"""Runge-Kutta steps over a motion. The library evaluates the forcing one step late, which at its
default of one step a frame delays a motion by a frame; here it is a thousandth of the motion."""
_SMOOTHING = 0.03
"""Standard deviation of the Gaussian that smooths velocities, in [s]; as in `alignment`."""
_MOVING = 0.05
"""A motion begins and ends where its speed crosses this part of its peak; ours, the usual 5 %."""
_EDGE = 0.1
"""A fit includes the rest next to a motion for this part of its duration, so that nothing slower
than the threshold is lost."""


@dataclass(frozen=True)
class DynamicMovementPrimitivesConfig:
    """Size of the primitives; docs/baselines.md tells what was tried."""

    frames_per_weight: float = 2.0
    """Frames for each forcing weight of a dimension."""
    ridge: float = 1e-10
    """Ridge penalty of the fit, relative to the squared response of each weight [-]."""
    segmented: bool = True
    """Fit each demonstration from where its motion begins to where it ends, and interpolate onset
    and duration too, as is usual for DMPs. If not, every plan is one motion over its whole horizon,
    rests and all (the paper does not say)."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: One is outside its range.
        """
        if not (math.isfinite(self.frames_per_weight) and self.frames_per_weight >= 1):
            raise ConfigurationError(
                f"frames_per_weight must be at least 1, got {self.frames_per_weight}"
            )
        if not (math.isfinite(self.ridge) and self.ridge > 0):
            raise ConfigurationError(f"ridge must be a positive number, got {self.ridge}")


class DynamicMovementPrimitives(Generator):
    """Interpolated discrete DMPs (paper, "DMP"); the variant is in this module's head."""

    name: ClassVar[str] = "dmp"

    def __init__(self, config: DynamicMovementPrimitivesConfig | None = None) -> None:
        """Choose settings; the defaults when None.

        Raises:
            MissingExtraError: The library is not installed.
        """
        _library()
        self.config = config or DynamicMovementPrimitivesConfig()
        self._fitted: _Fitted | None = None

    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Fit one DMP to each demonstration; nothing is random. See `Generator.fit`."""
        plans, horizon = demonstrations.plans, demonstrations.horizon
        spans = np.tile([0.0, horizon - 1.0], (demonstrations.n, 1))
        if self.config.segmented:
            smoothing = _SMOOTHING / demonstrations.format.dt
            profiles = velocity_profiles(plans, demonstrations.format.units, smoothing)
            spans = np.stack([motion_span(np.linalg.norm(p, axis=1)) for p in profiles])
        n_weights = max(2, min(horizon, round(horizon / self.config.frames_per_weight)))
        response = _Response(n_weights)
        parameters = np.stack(
            [
                response.fit(plan, _phases(horizon, span), self.config.ridge)
                for plan, span in zip(plans, spans, strict=True)
            ]
        )
        outcomes = demonstrations.outcomes_seen.copy()
        self._fitted = _Fitted(response, parameters, spans, outcomes, horizon)
        if progress is not None:
            loss = float(np.mean((self.generate(outcomes) - plans) ** 2))
            progress(FitProgress(step=1, n_steps=1, loss=loss, seconds_left=0.0))
        return self

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """Interpolate the primitives and roll each out; see `Generator.generate`."""
        fitted = self._require()
        conditions = as_conditions(conditions, fitted.outcomes.shape[1])
        weights = smooth_weights(conditions, fitted.outcomes, kernel="thin-plate")
        parameters = np.tensordot(weights, fitted.parameters, axes=1)
        # Far outside the demonstrations an extrapolated motion could end before it begins.
        least = fitted.spans[:, 1] - fitted.spans[:, 0]
        onsets, durations = weights @ fitted.spans[:, 0], weights @ least
        durations = np.maximum(durations, least.min() / 2)
        plans = np.empty((len(conditions), fitted.horizon, fitted.parameters.shape[2]))
        for i, theta in enumerate(parameters):
            span = np.array([onsets[i], onsets[i] + durations[i]])
            plans[i] = fitted.response(_phases(fitted.horizon, span)) @ theta
        return plans

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        fitted = self._require()
        write_model(
            folder,
            self.name,
            {"config": asdict(self.config), "horizon": fitted.horizon},
            {
                "parameters": fitted.parameters,
                "spans": fitted.spans,
                "outcomes": fitted.outcomes,
            },
        )

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; see `Generator.load`."""
        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(DynamicMovementPrimitivesConfig(**saved.settings["config"]))
            parameters = saved.tensors["parameters"]
            generator._fitted = _Fitted(
                _Response(parameters.shape[1] - 2),
                parameters,
                saved.tensors["spans"],
                saved.tensors["outcomes"],
                int(saved.settings["horizon"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(
                f"{folder} holds no complete {cls.name} generator ({error!r}); learn it again"
            ) from error
        return generator

    def _require(self) -> _Fitted:
        if self._fitted is None:
            raise NotFittedError(
                "this DynamicMovementPrimitives has learned nothing yet; call fit first"
            )
        return self._fitted


def motion_span(speed: np.ndarray) -> np.ndarray:
    """Return where a motion begins and ends, shape (2,), in frames, from its speed (H,).

    Crossings of the threshold are interpolated between frames and widened by `_EDGE`; an end at
    which the plan does not rest is the plan's own. A plan that never moves is one motion.
    """
    last = len(speed) - 1
    threshold = _MOVING * speed.max()
    moving = np.flatnonzero(speed > threshold)
    if not moving.size:
        return np.array([0.0, float(last)])
    a, b = int(moving[0]), int(moving[-1])
    start, end = float(a), float(b)
    if a > 0:
        start -= (speed[a] - threshold) / (speed[a] - speed[a - 1])
    if b < last:
        end += (speed[b] - threshold) / (speed[b] - speed[b + 1])
    edge = _EDGE * (end - start)
    return np.array([start - edge * (a > 0), end + edge * (b < last)])


def _phases(horizon: int, span: np.ndarray) -> np.ndarray:
    """Phase t / tau of every frame, shape (H,), held at 0 before the motion and at 1 after it."""
    return np.asarray(np.clip((np.arange(horizon) - span[0]) / (span[1] - span[0]), 0.0, 1.0))


class _Response:
    """Phi: the motion that one unit of each parameter makes, as a function of phase."""

    def __init__(self, n_weights: int) -> None:
        n = 2 + n_weights
        # One dimension of the library's DMP for each parameter, all integrated at once.
        dmp = _library()(
            n, execution_time=1.0, dt=1 / _INTEGRATION_STEPS, n_weights_per_dim=n_weights
        )
        unit = np.eye(n)
        dmp.set_weights(unit[:, 2:].ravel())
        dmp.configure(start_y=unit[0], goal_y=unit[1])
        _, motions = dmp.open_loop()
        phases = np.linspace(0.0, 1.0, _INTEGRATION_STEPS + 1)
        self._spline = CubicSpline(phases, motions[: _INTEGRATION_STEPS + 1])

    def __call__(self, phases: np.ndarray) -> np.ndarray:
        """Phi at phases (H,), shape (H, 2 + B)."""
        return np.asarray(self._spline(phases))

    def fit(self, plan: np.ndarray, phases: np.ndarray, ridge: float) -> np.ndarray:
        """Fit theta (2 + B, D) to a plan (H, D): its end points, then ridge regression."""
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


class _Fitted:
    """What `fit` makes and `save` keeps."""

    def __init__(
        self,
        response: _Response,
        parameters: np.ndarray,
        spans: np.ndarray,
        outcomes: np.ndarray,
        horizon: int,
    ) -> None:
        if not len(parameters) == len(spans) == len(outcomes):
            raise ValueError("parameters, spans and outcomes do not fit")
        self.response = response
        self.parameters = parameters  # theta_i, (N, 2 + B, D), in the plan's units
        self.spans = spans  # begin and end of each motion, (N, 2), in frames
        self.outcomes = outcomes  # r_i, (N, k)
        self.horizon = horizon


def _library() -> Any:
    try:
        from movement_primitives.dmp import DMP
    except ImportError as error:
        raise MissingExtraError(
            f"DMPs need the library movement_primitives ({error}); "
            "install it with: pip install 'prior-reinforce[baselines]'"
        ) from error
    return DMP

"""Smooth interpolation of plans over outcomes: the strongest way to mix demonstrations we know.

    A(c) = sum_i w_i(c) A_i,    w_i the cardinal weights of a polyharmonic spline, affine tail

Not in the paper; ours, because it asks how much of a generator's work is done by the assumption
that plans depend smoothly on outcomes. On aligned demonstrations it is hard to beat
(docs/baselines.md); on misaligned ones it blurs motions, as every frame-by-frame mixture does.

Notation:
    A_i  plans       (N, H, D)  in their units
    r_i  outcomes    (N, k)     in their units
    c    conditions  (n, k)     in the outcomes' units
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, get_args

import numpy as np

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.outcome_weights import Kernel, smooth_weights
from prior_reinforce.generators.plan_mixture import PlanMixture


@dataclass(frozen=True)
class SmoothInterpolationConfig:
    """How plans are interpolated; docs/baselines.md tells what was tried."""

    kernel: Kernel = "thin-plate"
    """Radial function: of least bending (`thin-plate`), or of distance itself (`linear`)."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: There is no such kernel.
        """
        if self.kernel not in get_args(Kernel):
            raise ConfigurationError(f"no kernel {self.kernel!r}; use one of {get_args(Kernel)}")


class SmoothInterpolation(PlanMixture):
    """Polyharmonic-spline interpolation of plans over outcomes (ours)."""

    name: ClassVar[str] = "interpolation"
    config_type: ClassVar[type[SmoothInterpolationConfig]] = SmoothInterpolationConfig
    config: SmoothInterpolationConfig

    def __init__(self, config: SmoothInterpolationConfig | None = None) -> None:
        """Choose settings; the defaults when None."""
        super().__init__(config or SmoothInterpolationConfig())

    def weights(self, conditions: np.ndarray, outcomes: np.ndarray) -> np.ndarray:
        """Weigh all plans; at a demonstration's outcome its own alone, to rounding."""
        return smooth_weights(conditions, outcomes, kernel=self.config.kernel)

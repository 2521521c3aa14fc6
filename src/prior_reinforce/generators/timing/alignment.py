"""Timeline alignment: shift demonstrations in time so that their dynamic phases coincide.

The paper aligns by hand ("Timeline Aligned Variants", Fig. "Timeline Alignment"); here the shifts
are estimated from the motions. A demonstration is only shifted, never stretched: its speed decides
where the object goes. Uncovered frames are held if the demonstration rests there, else extrapolated
with its velocity (`extrapolation`).

Notation:
    A_i  plan of demonstration i               (H, D)  unit of its format
    s_i  delay of A_i                          scalar  [s]
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.timing.extrapolation import ExtrapolatedPlans
from prior_reinforce.generators.timing.registration import CONVERGED, correlation_lags
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.speeds import SMOOTHING, frames_at_rest, velocity_profiles


@dataclass(frozen=True, eq=False)
class Alignment:
    """Aligned demonstrations, and the shift of each."""

    demonstrations: Demonstrations
    """The same outcomes with plans on one timeline. The horizon is longer than before only if a
    motion would otherwise be cut off."""
    shifts: Float[np.ndarray, " N"]
    """s_i, in [s]; positive if a demonstration was delayed."""


def align(demonstrations: Demonstrations, *, smoothing: float = SMOOTHING) -> Alignment:
    """Shift every demonstration in time so that their velocity profiles agree best.

    Each velocity profile (all action dimensions; those of one unit divided by their pooled root
    mean square) is shifted to where it correlates best with the sum of the others, in turn, until
    convergence: a coordinate ascent on the sum of all pairwise correlations. Lags are continuous,
    not whole frames. The common offset, which no correlation determines, is the one with mean shift
    zero, or the nearest to it that cuts no motion off.

    Args:
        demonstrations: N plans.
        smoothing: Standard deviation of the Gaussian that smooths velocities before they are
            compared, in [s]; plans stay unsmoothed.

    Returns:
        Aligned demonstrations, and the shifts.

    Raises:
        ConfigurationError: `smoothing` is not 0 or more.

    Source: ours; the paper aligns by hand.
    """
    if not smoothing >= 0:
        raise ConfigurationError(f"smoothing must be 0 s or more, got {smoothing}")
    plans, dt = demonstrations.plans, demonstrations.format.dt
    units = demonstrations.format.units
    profiles = np.stack(velocity_profiles(plans, units, smoothing / dt))
    lags = correlation_lags(profiles)
    speeds = np.linalg.norm(profiles, axis=2)
    rest = np.array([frames_at_rest(speed) for speed in speeds])  # (N, 2) start, end
    # Moving earlier than the rest at the start, or later than that at the end, cuts motion off.
    lowest, highest = float(np.max(-rest[:, 0] - lags)), float(np.min(rest[:, 1] - lags))
    offset = min(max(0.0, lowest), highest) if lowest <= highest else (lowest + highest) / 2
    lags = lags + offset
    before = math.ceil(max(0.0, float(np.max(-rest[:, 0] - lags)) - CONVERGED))
    after = math.ceil(max(0.0, float(np.max(lags - rest[:, 1])) - CONVERGED))
    lags[np.abs(lags) < CONVERGED] = 0.0
    clock = np.arange(-before, demonstrations.horizon + after, dtype=float)
    extrapolated = ExtrapolatedPlans(plans, demonstrations.signals.jumps, speeds)
    aligned = np.stack([extrapolated(i, clock - lag) for i, lag in enumerate(lags)])
    return Alignment(demonstrations.with_plans(aligned), lags * dt)

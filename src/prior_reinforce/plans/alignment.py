"""Timeline alignment: move demonstrations in time so that their dynamic phases coincide.

The paper aligns by hand ("Timeline Aligned Variants", Fig. "Timeline Alignment"); here the shifts
come from the motions themselves. A demonstration is only moved, never stretched: its speed decides
where the object goes. What a shift uncovers is filled by holding the first or the last frame, so
both ends must rest.

Notation:
    A_i  plan of demonstration i               (H, D)  unit of its format
    s_i  time that A_i is moved later          scalar  [s]
    V_i  its velocity profile, unit energy     (L, D)  [-], zero before and after the plan
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.timing import velocity_profiles

# Ours: rounds of "re-estimate the template, move each demonstration to it". Synthetic shifts and
# the shipped prior sets settle in 3 to 8.
_MAX_ROUNDS = 50
_CONVERGED = 1e-4  # [frames]
# Ours: lags are scanned on a grid this fine, which lies in the basin of Newton's method.
_LAGS_PER_FRAME = 8
_NEWTON_STEPS = 4
# Ours: slower than this part of the peak speed is rest, of which frames may be cut away.
_REST = 0.005


class NotAtRestError(InvalidDemonstrationsError):
    """A demonstration moves at an end that would have to be held."""

    def __init__(self, where: str) -> None:
        """Say which.

        Args:
            where: Demonstration, end and speed, as a clause.
        """
        self.where = where
        super().__init__(
            f"{where}, so that frame cannot be held while the rest moves in time; record from "
            "rest to rest, raise largest_end_speed, or do not align"
        )


@dataclass(frozen=True)
class AlignmentConfig:
    """How demonstrations are aligned."""

    smoothing: float = 0.03
    """Standard deviation of the Gaussian that smooths velocities before they are compared, in [s]:
    well above a frame of jitter, well below the dynamic phase. The plans stay unsmoothed."""
    largest_end_speed: float = 0.1
    """A demonstration whose first or last frame moves faster than this part of its peak speed does
    not rest there and is refused, in [-]."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: One is outside its range.
        """
        if not (math.isfinite(self.smoothing) and self.smoothing >= 0):
            raise ConfigurationError(f"smoothing must be at least 0 s, got {self.smoothing}")
        if not 0 < self.largest_end_speed <= 1:
            raise ConfigurationError(
                f"largest_end_speed must lie in (0, 1], got {self.largest_end_speed}"
            )


@dataclass(frozen=True, eq=False)
class Alignment:
    """Aligned demonstrations, and how far each was moved."""

    demonstrations: Demonstrations
    """The same outcomes with plans on one timeline. The horizon is longer than before only where
    a motion would otherwise have been cut off."""
    shifts: np.ndarray
    """s_i, shape (N,), in [s]; positive where a demonstration was moved later."""


def align(demonstrations: Demonstrations, config: AlignmentConfig | None = None) -> Alignment:
    """Move every demonstration in time until their velocity profiles agree best.

    Each velocity profile (all action dimensions; those of one unit divided by their pooled root
    mean square) is moved to where it correlates best with the sum of the others, in turn, until
    nothing moves: a coordinate ascent on the sum of all pairwise correlations. Lags are continuous,
    not whole frames. The common offset, which no correlation can tell, is the one with mean shift
    zero, or the nearest to it that cuts no motion off.

    Args:
        demonstrations: N plans (N, H, D); each at rest at both ends.
        config: Settings; the defaults if None.

    Returns:
        Aligned demonstrations (N, H', D), H' >= H, and the shifts (N,) in [s].

    Raises:
        NotAtRestError: A demonstration that has to be moved does not rest at the end that would be
            held; an InvalidDemonstrationsError.

    Source: ours; the paper aligns by hand.
    """
    config = config or AlignmentConfig()
    plans, dt = demonstrations.plans, demonstrations.format.dt
    units = demonstrations.format.units
    profiles = _unit_energy(velocity_profiles(plans, units, config.smoothing / dt))
    lags = _common_lags(profiles)
    rest = np.array([_frames_at_rest(profile) for profile in profiles])  # (N, 2) start, end
    # Moving earlier than the rest at the start, or later than that at the end, cuts motion off.
    lowest, highest = float(np.max(-rest[:, 0] - lags)), float(np.min(rest[:, 1] - lags))
    offset = min(max(0.0, lowest), highest) if lowest <= highest else (lowest + highest) / 2
    lags = lags + offset
    before = math.ceil(max(0.0, float(np.max(-rest[:, 0] - lags)) - _CONVERGED))
    after = math.ceil(max(0.0, float(np.max(lags - rest[:, 1])) - _CONVERGED))
    lags[np.abs(lags) < _CONVERGED] = 0.0
    _check_rest(profiles, lags, before, after, config.largest_end_speed)
    aligned = Demonstrations(
        np.stack([_moved(p, s, before, after) for p, s in zip(plans, lags, strict=True)]),
        demonstrations.outcomes_seen,
        demonstrations.format,
        demonstrations.outcome_names,
        demonstrations.outcome_units,
    )
    return Alignment(aligned, lags * dt)


def _unit_energy(profiles: np.ndarray) -> np.ndarray:
    energy = np.sqrt(np.sum(profiles**2, axis=(1, 2), keepdims=True))
    return np.asarray(profiles / np.where(energy > 0, energy, 1.0))


def _common_lags(profiles: np.ndarray) -> np.ndarray:
    """Lags [frames], mean zero, that maximise the sum of all pairwise correlations."""
    n, horizon, _ = profiles.shape
    spectra = np.fft.rfft(profiles, n=2 * horizon, axis=1)  # padded: a lag never wraps around
    frequencies = 2 * np.pi * np.fft.rfftfreq(2 * horizon)  # [rad/frame]
    # Correlation of i, moved later by s frames, with j: the real part of sum(cross[i, j] e^{jws}).
    cross = np.einsum("ifd,jfd->ijf", spectra.conj(), spectra)
    # Start from the demonstration that resembles all others most.
    starts = [[_best_lag(cross[i, j], frequencies) for i in range(n)] for j in range(n)]
    reference = max(range(n), key=lambda j: sum(value for _, value in starts[j]))
    lags = np.array([lag for lag, _ in starts[reference]])
    lags -= lags.mean()
    for _ in range(_MAX_ROUNDS):
        previous = lags.copy()
        for i in range(n):
            delays = np.exp(-1j * np.outer(lags, frequencies))  # e^{-jws}: moved later by s
            delays[i] = 0.0
            template = np.einsum("jf,jf->f", delays, cross[i])
            lags[i] = _best_lag(template, frequencies)[0]
        lags -= lags.mean()
        if np.max(np.abs(lags - previous)) < _CONVERGED:
            break
    return lags


def _best_lag(cross_spectrum: np.ndarray, frequencies: np.ndarray) -> tuple[float, float]:
    """Lag [frames] of the highest correlation, and that correlation: a scan, then Newton steps."""
    length = 2 * (len(frequencies) - 1)
    curve = np.fft.irfft(cross_spectrum, n=length * _LAGS_PER_FRAME) * _LAGS_PER_FRAME
    best = int(np.argmax(curve))
    value = float(curve[best])
    if value <= 0:  # nothing moves
        return 0.0, 0.0
    lag = best / _LAGS_PER_FRAME
    lag -= length if lag > length / 2 else 0
    # The real signal's spectrum has two sides, but for its ends.
    sided = np.where((frequencies == 0) | (frequencies == np.pi), 1.0, 2.0) * cross_spectrum
    for _ in range(_NEWTON_STEPS):
        terms = sided * np.exp(1j * frequencies * lag)
        slope = -np.sum(frequencies * terms.imag)
        curvature = -np.sum(frequencies**2 * terms.real)
        if curvature >= 0:  # a plateau: the scan's answer stands
            break
        step = -slope / curvature
        lag += float(np.clip(step, -1 / _LAGS_PER_FRAME, 1 / _LAGS_PER_FRAME))
    return lag, value


def _frames_at_rest(profile: np.ndarray) -> tuple[int, int]:
    """Frames before the motion begins and after it has ended; all of them for a constant plan."""
    speed = np.linalg.norm(profile, axis=1)
    moving = np.flatnonzero(speed > _REST * speed.max())
    if not moving.size:
        return len(speed), len(speed)
    return int(moving[0]), len(speed) - 1 - int(moving[-1])


def _check_rest(
    profiles: np.ndarray, lags: np.ndarray, before: int, after: int, largest: float
) -> None:
    """Refuse to hold a frame at which a demonstration is still moving."""
    speeds = np.linalg.norm(profiles, axis=2)
    for i, (speed, lag) in enumerate(zip(speeds, lags, strict=True)):
        for frame, name, held in ((0, "first", lag + before > 0), (-1, "last", lag - after < 0)):
            if held and speed[frame] > largest * speed.max():
                raise NotAtRestError(
                    f"demonstration {i} still moves at its {name} frame, with "
                    f"{speed[frame] / speed.max():.0%} of its peak speed (at most {largest:.0%} "
                    "counts as rest)"
                )


def _moved(plan: np.ndarray, lag: float, before: int, after: int) -> np.ndarray:
    """The plan `lag` frames later, its ends held; shape (before + H + after, D).

    Monotone cubic interpolation: second-order accurate at extrema, fourth elsewhere, and a step
    (a gripper channel) does not overshoot.
    """
    horizon = plan.shape[0]
    frames = np.arange(-before, horizon + after) - lag
    held = np.clip(frames, 0, horizon - 1)
    return np.asarray(PchipInterpolator(np.arange(horizon), plan, axis=0)(held))

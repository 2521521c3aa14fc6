"""Timeline alignment: move demonstrations in time so that their dynamic phases coincide.

The paper aligns by hand ("Timeline Aligned Variants", Fig. "Timeline Alignment"); here the shifts
come from the motions themselves. A demonstration is only moved, never stretched: its speed decides
where the object goes. What a shift uncovers is held where the demonstration rests, and goes on with
its velocity where it does not (`timing.Continued`).

Notation:
    A_i  plan of demonstration i               (H, D)  unit of its format
    s_i  time that A_i is moved later          scalar  [s]
    V_i  its velocity profile, unit energy     (H, D)  [-], zero before and after the plan
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.timing import (
    SMOOTHING,
    Continued,
    frames_at_rest,
    velocity_profiles,
)
from prior_reinforce.settings import Checked, NonNegative

# Ours: rounds of "re-estimate the template, move each demonstration to it". Synthetic shifts and
# the shipped prior sets settle in 3 to 8.
_MAX_ROUNDS = 50
_CONVERGED = 1e-4  # [frames]
# Ours: lags are scanned on a grid this fine, which lies in the basin of Newton's method.
_LAGS_PER_FRAME = 8
_NEWTON_STEPS = 4


@dataclass(frozen=True)
class AlignmentConfig(Checked):
    """How demonstrations are aligned."""

    smoothing: NonNegative = SMOOTHING
    """Standard deviation of the Gaussian that smooths velocities before they are compared, in [s].
    The plans stay unsmoothed."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """Aligned demonstrations, and how far each was moved."""

    demonstrations: Demonstrations
    """The same outcomes with plans on one timeline. The horizon is longer than before only where
    a motion would otherwise have been cut off."""
    shifts: Float[np.ndarray, " N"]
    """s_i, in [s]; positive where a demonstration was moved later."""


def align(demonstrations: Demonstrations, config: AlignmentConfig | None = None) -> Alignment:
    """Move every demonstration in time until their velocity profiles agree best.

    Each velocity profile (all action dimensions; those of one unit divided by their pooled root
    mean square) is moved to where it correlates best with the sum of the others, in turn, until
    nothing moves: a coordinate ascent on the sum of all pairwise correlations. Lags are continuous,
    not whole frames. The common offset, which no correlation can tell, is the one with mean shift
    zero, or the nearest to it that cuts no motion off.

    Args:
        demonstrations: N plans.
        config: Settings; the defaults if None.

    Returns:
        Aligned demonstrations, and the shifts.

    Source: ours; the paper aligns by hand.
    """
    config = config or AlignmentConfig()
    plans, dt = demonstrations.plans, demonstrations.format.dt
    units = demonstrations.format.units
    profiles = velocity_profiles(plans, units, config.smoothing / dt)
    lags = correlation_lags(profiles)
    speeds = np.linalg.norm(profiles, axis=2)
    rest = np.array([frames_at_rest(speed) for speed in speeds])  # (N, 2) start, end
    # Moving earlier than the rest at the start, or later than that at the end, cuts motion off.
    lowest, highest = float(np.max(-rest[:, 0] - lags)), float(np.min(rest[:, 1] - lags))
    offset = min(max(0.0, lowest), highest) if lowest <= highest else (lowest + highest) / 2
    lags = lags + offset
    before = math.ceil(max(0.0, float(np.max(-rest[:, 0] - lags)) - _CONVERGED))
    after = math.ceil(max(0.0, float(np.max(lags - rest[:, 1])) - _CONVERGED))
    lags[np.abs(lags) < _CONVERGED] = 0.0
    clock = np.arange(-before, demonstrations.horizon + after, dtype=float)
    continued = Continued(plans, units, speeds)
    aligned = np.stack([continued(i, clock - lag) for i, lag in enumerate(lags)])
    return Alignment(demonstrations.with_plans(aligned), lags * dt)


def _unit_energy(profiles: Float[np.ndarray, "N H D"]) -> Float[np.ndarray, "N H D"]:
    energy = np.sqrt(np.sum(profiles**2, axis=(1, 2), keepdims=True))
    return np.asarray(profiles / np.where(energy > 0, energy, 1.0))


def correlation_lags(profiles: Float[np.ndarray, "N H D"]) -> Float[np.ndarray, " N"]:
    """Find the lags that maximise the sum of all pairwise correlations.

    Args:
        profiles: Smoothed velocities; each demonstration's count alike.

    Returns:
        How many frames later each is to be moved, mean zero.
    """
    profiles = _unit_energy(profiles)
    n, horizon, _ = profiles.shape
    spectra = np.fft.rfft(profiles, n=2 * horizon, axis=1)  # padded: a lag never wraps around
    frequencies = 2 * np.pi * np.fft.rfftfreq(2 * horizon)  # [rad/frame]
    # Correlation of i, moved later by s frames, with j: the real part of sum(cross[i, j] e^{jws}).
    cross = np.einsum("ifd,jfd->ijf", spectra.conj(), spectra)
    # Start from the demonstration that resembles all others most.
    resembles = [
        float(np.maximum(_correlations(cross[:, j]).max(axis=1), 0).sum()) for j in range(n)
    ]
    reference = int(np.argmax(resembles))
    lags = np.array([_best_lag(cross[i, reference], frequencies) for i in range(n)])
    lags -= lags.mean()
    for _ in range(_MAX_ROUNDS):
        previous = lags.copy()
        for i in range(n):
            delays = np.exp(-1j * np.outer(lags, frequencies))  # e^{-jws}: moved later by s
            delays[i] = 0.0
            template = np.einsum("jf,jf->f", delays, cross[i])
            lags[i] = _best_lag(template, frequencies)
        lags -= lags.mean()
        if np.max(np.abs(lags - previous)) < _CONVERGED:
            break
    return lags


def _correlations(cross_spectra: Complex[np.ndarray, "*n F"]) -> Float[np.ndarray, "*n lags"]:
    """Correlation at every lag of a scan, `_LAGS_PER_FRAME` a frame."""
    length = 2 * (cross_spectra.shape[-1] - 1)
    scan = np.fft.irfft(cross_spectra, n=length * _LAGS_PER_FRAME, axis=-1)
    return np.asarray(scan * _LAGS_PER_FRAME)


def _best_lag(
    cross_spectrum: Complex[np.ndarray, " F"], frequencies: Float[np.ndarray, " F"]
) -> float:
    """Lag [frames] of the highest correlation: a scan, then Newton steps."""
    length = 2 * (len(frequencies) - 1)
    curve = _correlations(cross_spectrum)
    best = int(np.argmax(curve))
    if curve[best] <= 0:  # nothing moves
        return 0.0
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
    return lag

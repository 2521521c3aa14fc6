"""Registration: estimate each demonstration's start and tempo from the motions alone.

    t(tau) = start + exp(rho) tau

Phase 0 is the middle of the motion, so that start and tempo hardly depend on each other. If only
starts are estimated, motions of uneven pace are aligned where they are fastest. If a channel that
jumps is synchronous with the motion, its last transition is phase 0: a hand that opens decides
where the object goes, so the arm's states at that moment have to be mixed.

Notation:
    V      velocity profiles, unit energy    (N, H, D)  [-], zero before and after the plan
    t      time of a plan                    [frames]
    tau    phase, common to all plans        [frames]
    theta  warp of a plan                    (P,)       start [frames], then rho [-]

Source: ours; starts maximise pairwise correlations, tempos compare square-root velocities
[Srivastava2011].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Complex, Float, Int

from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.speeds import mean_frame, motion_span

WarpKind = Literal["none", "start", "tempo"]
"""Parameters of a warp: none (P = 0), a start (1), or a start and a tempo (2)."""
Warps = Float[np.ndarray, "N P"]
"""theta of each demonstration."""
Profiles = Float[np.ndarray, "N H D"]
"""V, or velocity profiles before scaling."""
Subset = slice | list[int]
"""The demonstrations that are registered, of those that are scaled together."""

_MAX_ROUNDS = 50
"""Rounds of "re-estimate the template, move each demonstration to it". Ours: synthetic shifts and
the shipped prior sets converge in 3 to 8."""
CONVERGED = 1e-4
"""Lags that change by less have converged, in frames. Ours: half of it moves plans by 2e-6 of a
range."""
_LAGS_PER_FRAME = 8
"""Lags are scanned on a grid this fine, which lies in the basin of Newton's method. Ours."""
_BLOCK_SIZE = 2**14
"""Correlations that are scanned at once, 128 kB, which fit a processor's cache."""
_NEWTON_STEPS = 4
"""Ours: two give the same plans to 2e-6 of a range, eight to 1e-9."""
_UNCORRELATED = 1e-9
"""Motions that correlate by no more at any lag get the smallest such lag, which otherwise rounding
would choose. Ours."""
_LARGEST_TEMPO = 0.7
"""Bound of |rho|: tempos differ by a factor of two at most. Ours."""
_ROUNDS = 4
"""Rounds of "mean of all motions, then each to it". Ours: two more change starts by 0.12
frames at most, on six sets of the zoo's development tasks."""
_GOES_WITH = 0.15
"""A step is synchronous with the motion if its phase has at most this standard deviation, as a part
of the motion's length. Ours: 0.02 to 0.03 on five sets of zoo-gripper; a gripper that closes by the
clock, whenever the arm starts, is not synchronous."""
_WINDOW_SD = 0.2
"""Standard deviation of the window around the fastest moment in which motions are compared, as a
part of a motion's length. Ours: with 0.1 two styles of a motion are taken for one
(reproduction/docs/decisions-generator.md)."""
_LARGEST_SHIFT = 0.3
"""If one motion would be shifted by more than this part of the length to agree there, in a round or
in all, none is shifted. Ours: half and double change no plan of 113 sets of the zoo; without it a
mirrored motion would be carried off."""
_LEAST_SHARED = 0.7
"""Least share of the motions' energy there that is in their mean. Ours: 0.67 to 0.99 in the zoo;
0.45 and 0.64 where a push goes to either side, which moved exact starts by 9 frames and 2."""
_LEAST_SHIFT = 0.007
"""Starts that would shift by less than this part of the length stay where whole motions agree best.
Ours: without differences of pace, estimates differ by up to that (curling, set A)."""
_LEAST_ENERGY = 1e-6
"""Energy of rest; a whole motion's is `_FINE`."""
_COMPARED = 40.0
"""Phases over the motion at which velocities are compared. Ours: they are smooth, and a motion of
400 frames takes no longer than one of 40."""
_LEAST_GAIN = 0.1
"""Channels are rescaled if that raises the log likelihood of the motions by this much, a frame and
demonstration. Ours: 0.12 to 0.18 where metres and radians were taken for one unit, at most 0.01 on
our own tasks (reproduction/docs/decisions-generator.md)."""
_LEAST_RESIDUAL = 0.1
"""Smallest residual of a channel, as a share of its energy, that is distinguished: else one channel
in which motions agree to rounding would outweigh all others. Ours: without it, first throws on one
set of `zoo-pour` fell from 0.97 to 0.30."""
_REWEIGHTED = 3
"""Rounds of "lags, then scales by the residuals". Ours: two more raise the log likelihood by 0.01
at most, on three sets of pushes."""
_LARGEST_SUBSET = 24
"""Most demonstrations from which the scales of channels and the timing are chosen; all are then
learned with these. Ours: `auto` took half a minute with 200, most of it for these few numbers."""
_OTHERS_WEIGHT = 0.01
"""Weight of the other channels in a search that begins with one. Ours."""
_STILL = 1e-6
"""A channel that moves less, relative to the others, is not scaled by agreement. Ours."""
_FINE = 8
"""Points a frame at which motions are compared around their fastest moment. Ours: 4 and 16 change
first throws by 0.014 at most."""


@dataclass(frozen=True, eq=False)
class Motions:
    """Demonstrated motions, whose warps are estimated."""

    profiles: Profiles
    """Velocity profiles of the channels that share the warp."""
    decisive: Float[np.ndarray, " N"] | None
    """Last transition of a channel that jumps, in frames; None if no channel does."""

    def register(self, kind: WarpKind, subset: Subset = slice(None)) -> tuple[Warps, bool]:
        """Estimate the warp of each demonstration, or of a subset.

        Returns theta, and whether the transition of a channel that jumps is phase 0.
        InvalidDemonstrationsError if a demonstration does not move.
        """
        if kind == "none":
            return np.zeros((len(self.profiles[subset]), 0)), False
        profiles = self._scaled[subset]
        speeds = np.linalg.norm(profiles, axis=2)
        starts = np.mean([mean_frame(speed**2) for speed in speeds]) - correlation_lags(profiles)
        length = float(np.median([np.ptp(motion_span(speed)) for speed in speeds]))
        by_step = False
        if self.decisive is not None:
            decisive = self.decisive[subset]
            by_step = bool(np.std(decisive - starts) <= _GOES_WITH * length)
            starts = decisive if by_step else starts
        if kind == "tempo":
            return _tempos(profiles, starts, length), by_step
        if not by_step:
            starts = _aligned_when_fastest(profiles, starts, length)
        return starts[:, None], by_step

    @cached_property
    def _scaled(self) -> Profiles:
        """Profiles with their channels scaled by agreement."""
        if not np.all(np.linalg.norm(self.profiles, axis=2).max(axis=1) > 0):
            raise InvalidDemonstrationsError(
                "a demonstration does not move, so it cannot be timed; drop it"
            )
        return _scaled_by_agreement(self.profiles)


def _scaled_by_agreement(profiles: Profiles) -> Profiles:
    """Scale channels by the agreement of demonstrations, if that is clearly more likely.

    How much a channel tells of a motion's time follows from neither its unit nor its size: a hand
    may turn freely while it strikes. With a variance for each channel, the log likelihood of normal
    deviations is -sum_d log sd_d, whatever the units. Its maxima are found by iteratively
    reweighted least squares, started with the present scales, and with each channel nearly alone.
    """
    size = np.sqrt(np.mean(profiles**2, axis=(0, 1)))
    moving = size > _STILL * size.max()
    normalised = profiles[:, :, moving] / size[moving]
    subset = normalised[even_subset(len(profiles))]
    alone = _OTHERS_WEIGHT + (1.0 - _OTHERS_WEIGHT) * np.eye(subset.shape[2])

    def log_likelihood(weights: Float[np.ndarray, " D"]) -> float:
        residuals = _residuals(subset, correlation_lags(subset * weights))
        return -0.5 * float(np.log(np.maximum(residuals, _LEAST_RESIDUAL)).sum())

    best, highest = profiles, log_likelihood(size[moving]) + _LEAST_GAIN
    if highest >= -0.5 * subset.shape[2] * math.log(_LEAST_RESIDUAL):
        return profiles  # they agree in all channels already
    for weights in (size[moving], *alone):
        for _ in range(_REWEIGHTED):
            weighted = _unit_energy(subset * weights)
            residuals = _residuals(weighted, correlation_lags(weighted))
            weights = weights / np.sqrt(residuals * np.mean(weighted**2, axis=(0, 1)))
        if (found := log_likelihood(weights)) > highest:
            best, highest = normalised * weights, found
    return best


def even_subset(n: int) -> Int[np.ndarray, " m"]:
    """Return evenly spread numbers of demonstrations, to choose scales and timing from."""
    return np.linspace(0, n - 1, min(n, _LARGEST_SUBSET)).round().astype(int)


def _residuals(profiles: Profiles, lags: Float[np.ndarray, " N"]) -> Float[np.ndarray, " D"]:
    """Share of each channel's energy that is not in the mean of motions delayed by these lags."""
    size = 2 * profiles.shape[1]
    spectra = np.fft.fft(profiles, size, axis=1)
    delayed = np.exp(-2j * np.pi * np.outer(lags, np.fft.fftfreq(size)))[..., None] * spectra
    shared = np.sum(np.abs(delayed.mean(axis=0)) ** 2, axis=0)
    energy = np.sum(np.abs(spectra) ** 2, axis=(0, 1)) / len(profiles)
    return np.maximum(1.0 - shared / energy, _LEAST_ENERGY)  # rounding may make it negative


def times_at(warps: Warps, phases: Float[np.ndarray, "*N L"]) -> Float[np.ndarray, "N L"]:
    """t(tau) of each warp."""
    start, pace = _start_and_pace(warps)
    return np.asarray(start + pace * phases)


def phases_at(warps: Warps, times: Float[np.ndarray, " L"]) -> Float[np.ndarray, "N L"]:
    """tau(t) of each warp."""
    start, pace = _start_and_pace(warps)
    return np.asarray((times - start) / pace)


def _start_and_pace(warps: Warps) -> tuple[Float[np.ndarray, "N 1"], Float[np.ndarray, "N 1"]]:
    start, pace = np.zeros((len(warps), 1)), np.ones((len(warps), 1))
    if warps.shape[1] > 0:
        start = warps[:, :1]
    if warps.shape[1] > 1:
        pace = np.exp(warps[:, 1:])
    return start, pace


def correlation_lags(profiles: Profiles) -> Float[np.ndarray, " N"]:
    """Find the delays, in frames, that maximise the sum of all pairwise correlations.

    Their mean is zero; all motions count alike.
    """
    spectra = _spectra(profiles)
    turns = 2j * np.pi * np.fft.rfftfreq(2 * profiles.shape[1])  # [rad/frame]
    # Start from the demonstration that resembles all others most.
    reference = int(np.argmax(np.maximum(best_correlations(profiles, 1), 0).sum(axis=0)))
    conjugates = spectra.conj()
    lags = np.array([_best_lag(each) for each in _sum_channels(conjugates * spectra[reference])])
    lags -= lags.mean()
    for _ in range(_MAX_ROUNDS):
        previous = lags.copy()
        delayed = np.exp(-np.outer(lags, turns))[..., None] * spectra  # by s: e^{-jws}
        total = delayed.sum(axis=0)
        for i, spectrum in enumerate(spectra):
            others = total - delayed[i]
            lags[i] = _best_lag(_sum_channels(conjugates[i] * others))
            total = others + np.exp(-lags[i] * turns)[:, None] * spectrum
        lags -= lags.mean()
        if np.max(np.abs(lags - previous)) < CONVERGED:
            break
    return lags


def _sum_channels(spectra: Complex[np.ndarray, "*n D"]) -> Complex[np.ndarray, "*n"]:
    """Sum over channels, faster than `sum` over a short axis."""
    return np.asarray(spectra @ np.ones(spectra.shape[-1]))


def best_correlations(
    profiles: Profiles, per_frame: int = _LAGS_PER_FRAME
) -> Float[np.ndarray, "N N"]:
    """Return the largest correlation of each two motions at any lag, at most 1.

    Lags are scanned at `per_frame` points a frame.
    """
    from scipy import fft

    spectra, length = np.moveaxis(_spectra(profiles), 1, 0), 2 * profiles.shape[1] * per_frame
    n = len(profiles)
    best = np.empty((n, n))
    block = max(1, _BLOCK_SIZE // (n * length))  # all scans at once would be gigabytes
    for i in range(0, n, block):
        cross = spectra[:, i : i + block].conj() @ spectra[:, i:].swapaxes(1, 2)
        scans = fft.irfft(np.moveaxis(cross, 0, -1), length, axis=-1, overwrite_x=True)
        best[i : i + block, i:] = per_frame * scans.max(axis=-1)
        best[i:, i : i + block] = best[i : i + block, i:].T
    return best


def _spectra(profiles: Profiles) -> Complex[np.ndarray, "N F D"]:
    """Return the spectra of profiles scaled to unit energy.

    The correlation of i, delayed by s frames, with j is the real part of sum(conj(i) j e^{jws}).
    """
    # Padded, so that a lag never wraps around.
    return np.asarray(np.fft.rfft(_unit_energy(profiles), n=2 * profiles.shape[1], axis=1))


def _best_lag(cross_spectrum: Complex[np.ndarray, " F"]) -> float:
    """Return the lag [frames] of the highest correlation: a scan, then Newton steps."""
    length = 2 * (len(cross_spectrum) - 1)
    curve = np.fft.irfft(cross_spectrum, length * _LAGS_PER_FRAME) * _LAGS_PER_FRAME
    best = int(curve.argmax())
    correlated = curve[best] > _UNCORRELATED
    if not correlated:
        size = np.minimum(np.arange(len(curve)), len(curve) - np.arange(len(curve)))
        best = int(np.argmin(np.where(curve < curve[best] - _UNCORRELATED, np.inf, size)))
    lag = best / _LAGS_PER_FRAME
    lag -= length if lag > length / 2 else 0
    if not correlated:
        return lag
    turns, derivatives = _derivatives(length)
    for _ in range(_NEWTON_STEPS):
        slope, curvature = (derivatives @ (cross_spectrum * np.exp(turns * lag))).real.tolist()
        if curvature >= 0:  # a plateau: keep the scan's lag
            break
        previous = lag
        lag -= min(max(slope / curvature, -1 / _LAGS_PER_FRAME), 1 / _LAGS_PER_FRAME)
        if lag == previous:
            break
    return lag


@lru_cache(maxsize=2)
def _derivatives(
    length: int,
) -> tuple[Complex[np.ndarray, " F"], Complex[np.ndarray, "2 F"]]:
    """Return j times each frequency [rad/frame], and the factors of the first two derivatives."""
    turns = 2j * np.pi * np.fft.rfftfreq(length)
    # A real signal's spectrum is two-sided, except at its ends.
    sides = np.r_[1.0, np.full(len(turns) - 2, 2.0), 1.0]
    return turns, np.stack([sides * turns, sides * turns**2])


def _aligned_when_fastest(
    profiles: Profiles, starts: Float[np.ndarray, " N"], length: float
) -> Float[np.ndarray, " N"]:
    """Shift starts so that motions agree best around the moment at which they are fastest.

    An object is thrown about then, so positions and velocities have to match there; motions of
    different paces that agree best as a whole do not. Starts stay if motions differ too much: if
    the mean has too small a share of their energy, or one would be shifted too far. For increments
    it is the moment at which they change most.
    """
    horizon = profiles.shape[1]
    tau = np.arange(-horizon * _FINE, horizon * _FINE + 1) / _FINE
    unit = _unit_energy(profiles)
    largest = int(_LARGEST_SHIFT * length * _FINE)
    shifts = np.arange(-largest, largest + 1)
    size = 2 * len(tau)  # padded, so that a shift never wraps around
    shifted = starts
    for _ in range(_ROUNDS):
        motions = np.stack([_at(tau + s, each) for s, each in zip(shifted, unit, strict=True)])
        mean = motions.mean(axis=0)
        fastest = tau[np.argmax(np.linalg.norm(mean, axis=0))]
        window = np.exp(-0.5 * ((tau - fastest) / (_WINDOW_SD * length)) ** 2)
        template = np.fft.rfft(window * mean, size).conj()
        product = np.fft.irfft(np.sum(np.fft.rfft(motions, size) * template, axis=1), size)
        energy = np.fft.irfft(
            np.fft.rfft(np.sum(motions**2, axis=1), size) * np.fft.rfft(window, size).conj(), size
        )
        if product[:, 0].sum() < _LEAST_SHARED * energy[:, 0].sum():
            return starts
        score = product[:, shifts] / np.sqrt(np.maximum(energy[:, shifts], _LEAST_ENERGY))
        best = np.where(score.max(axis=1) > 0.0, shifts[np.argmax(score, axis=1)], 0)
        if not best.any():
            break
        shifted = shifted + best / _FINE
    change = shifted - starts
    change -= change.mean()
    if not _LEAST_SHIFT * length <= np.abs(change).max() <= _LARGEST_SHIFT * length:
        return starts
    return starts + change


def _tempos(profiles: Profiles, starts: Float[np.ndarray, " N"], length: float) -> Warps:
    """Shift and stretch each motion so that its square-root velocity fits the mean of all."""
    from scipy.optimize import least_squares

    n, horizon, _ = profiles.shape
    tau = np.arange(-horizon / 2, horizon / 2 + 1, max(1.0, length / _COMPARED))
    unit = _unit_energy(profiles)

    def root_velocity(i: int, theta: Float[np.ndarray, " 2"]) -> Float[np.ndarray, "L D"]:
        warped = _at(times_at(theta[None], tau)[0], unit[i])
        return np.asarray(warped.T * np.sqrt(np.exp(theta[1])))

    def misfit(theta: np.ndarray, i: int, mean: Float[np.ndarray, "L D"]) -> np.ndarray:
        return (root_velocity(i, theta) - mean).ravel()

    bound = np.array([horizon, _LARGEST_TEMPO])
    warps = np.clip(np.stack([starts, np.zeros(n)], axis=1), -bound, bound)
    for _ in range(_ROUNDS):
        mean = np.mean([root_velocity(i, theta) for i, theta in enumerate(warps)], axis=0)
        warps = np.array(
            [
                least_squares(
                    misfit, theta, args=(i, mean), bounds=(-bound, bound), x_scale="jac"
                ).x
                for i, theta in enumerate(warps)
            ]
        )
        warps[:, 1] -= warps[:, 1].mean()
        warps = np.clip(warps, -bound, bound)
    return warps


def _at(
    times: Float[np.ndarray, " L"], profile: Float[np.ndarray, "H D"]
) -> Float[np.ndarray, "D L"]:
    """Interpolate velocities at times in frames; they are 0 outside."""
    clock = np.arange(len(profile), dtype=float)
    return np.stack([np.interp(times, clock, v, left=0.0, right=0.0) for v in profile.T])


def _unit_energy(profiles: Profiles) -> Profiles:
    """Scale each motion to unit energy."""
    energy = np.sqrt(np.sum(profiles**2, axis=(1, 2), keepdims=True))
    return np.asarray(profiles / np.where(energy > 0, energy, 1.0))

"""What of a recording is noise: the floors below which nothing in it counts as motion.

Every question of the kind "does it rest, is it held, does it step" is decided here, from absolute
floors and from the noise that the recording itself shows, never from a channel's own range: the
range of a joint that is held is its noise.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.bench.robots.gate import GateSettings

Channels = Float[np.ndarray, " D"]
"""One number for each of D channels, in its unit."""
Motion = Float[np.ndarray, "T D"]
"""D channels at T times, in their units."""

HELD = {"rad": 1e-3, "m": 5e-4}
"""A channel that stays within this is held. Ours: several counts of an encoder, and what a servo
gives way; below what moves a throw by a millimetre."""
REST_SPEED = {"rad": GateSettings().rest_speed, "m": 0.02}
"""A channel that is slower rests, a second: the gate's own line for joints; ours for lengths."""
_RELATIVE = 0.05
"""Of units that have no floor, this share of the largest speed or range counts instead. Ours."""
_NOISE_PEAK = 5.0
"""Noise stays within so many standard deviations of its mean over thousands of frames."""
_WINDOW = 8
"""Frames in which noise is measured: at 20 Hz, the rest at either end of a throw."""
_QUIET = 0.25
"""Noise is that of the quietest quarter of the windows, since motion is in the others."""
_QUIET_SHARE = 0.69
"""What the quietest quarter shows of white noise: measured, 200 sequences of 1,000 frames."""
_WORST = 2.5
"""Standard deviations that the worst of a plan's frames is off by. Ours: measured, 30 plans of 88
frames, 2.3 to 2.9; what an end leaps by from rest is 1.3 to 2.4."""
_END = 0.04
"""Time over which the speed at an end is measured, in [s]: a slope through several frames."""


def noise_of(positions: Motion) -> Channels:
    """Return the standard deviation of each channel's noise, as it shows where nothing moves.

    From third differences, of which white noise has sqrt(20) times its own, and a smooth motion
    next to nothing. Of fast motions at few frames a second, with no rest, it is an upper bound.
    """
    third = np.diff(positions, n=min(3, len(positions) - 1), axis=0)
    count = max(1, len(third) // _WINDOW)
    windows = np.array_split(third, count)
    spread = np.array([np.sqrt(np.mean(window**2, axis=0)) for window in windows])
    return np.quantile(spread, _QUIET, axis=0, method="lower") / (_QUIET_SHARE * math.sqrt(20))


def acceleration_of(noise: Channels, dt: float) -> Channels:
    """Return the largest acceleration that noise alone makes in a plan, in units/s^2.

    White noise at the knots of a cubic spline makes 6 / dt^2 times as much acceleration there.

    Args:
        noise: Standard deviation of each channel's noise.
        dt: Time between two frames, in [s].
    """
    return _WORST * 6.0 * noise / dt**2


def held_channels(positions: Motion, units: tuple[str, ...]) -> Bool[np.ndarray, " D"]:
    """Return which channels stay where they are, noise aside."""
    floor = np.array([HELD.get(unit, 0.0) for unit in units])
    return np.ptp(positions, axis=0) <= np.maximum(floor, 2 * _NOISE_PEAK * noise_of(positions))


def moving_ends(
    times: Float[np.ndarray, " T"], positions: Motion, units: tuple[str, ...]
) -> tuple[Bool[np.ndarray, " D"], Bool[np.ndarray, " D"]]:
    """Return which channels move at the first frames, and which at the last.

    The speed is the slope of a line through the frames of 40 ms, at least two.
    """
    count = max(2, int(np.searchsorted(times, times[0] + _END, side="right")))
    first, at_first = _slope(times[:count], positions[:count])
    last, at_last = _slope(times[-count:], positions[-count:])
    fastest = np.abs(np.gradient(positions, times, axis=0)).max(axis=0)
    floor = np.array(
        [REST_SPEED.get(u, _RELATIVE * f) for u, f in zip(units, fastest, strict=True)]
    )
    sigma = noise_of(positions)
    still = held_channels(positions, units)
    start = (np.abs(first) > np.maximum(floor, _NOISE_PEAK * sigma * at_first)) & ~still
    end = (np.abs(last) > np.maximum(floor, _NOISE_PEAK * sigma * at_last)) & ~still
    return start, end


def is_step(positions: Motion, units: tuple[str, ...]) -> Bool[np.ndarray, " D"]:
    """Return which channels jump, as grippers and switches do: most of their range in one frame."""
    largest = np.abs(np.diff(positions, axis=0)).max(axis=0)
    jumps = (largest > np.ptp(positions, axis=0) / 2) & (len(positions) > _WINDOW)
    return jumps & ~held_channels(positions, units)


def _slope(
    times: Float[np.ndarray, " n"], values: Float[np.ndarray, "n D"]
) -> tuple[Channels, float]:
    """Slopes of lines through the values, and the slope's spread for noise of spread 1."""
    t = times - times.mean()
    total = float(np.sum(t**2))
    return t @ (values - values.mean(axis=0)) / total, 1 / math.sqrt(total)

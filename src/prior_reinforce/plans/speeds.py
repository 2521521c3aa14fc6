"""Speed profiles: how fast a motion is, frame by frame, and when it begins and ends.

Notation:
    A  motions  (T_i, D) each, in their units: plans (H, D), or recordings
    s  speed    (T,)           relative to the pooled rms of its unit [-]
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

Motion = Float[np.ndarray, "_ D"]
"""D channels at some times, in their units."""
Channels = Float[np.ndarray, " D"]
"""One number for each channel, in its unit."""
Speed = Float[np.ndarray, " T"]
"""s of one motion."""

SMOOTHING = 0.03
"""Standard deviation of the Gaussian that smooths velocities before they are compared, in [s].
Ours: well above a frame of jitter, well below the dynamic phase of a throw."""
AT_REST = 0.005
"""Frames slower than this part of the peak speed may be cut away. Ours, low: they are lost."""
MOVING = 0.05
"""A motion begins and ends where its speed crosses this part of its peak. Ours, the usual 5 %: the
tremor of the shipped tele-operated sets reaches 0.03, and their motions start within two frames of
this crossing."""
_EDGE = 0.1
"""A motion's span includes the rest next to it for this part of its duration, so that nothing
slower than `MOVING` is lost."""
END_SPEED = 0.1
"""If the first or last frame is faster than this part of the peak, the motion continues beyond it.
Ours: with 0.05 one of 66 sets changes (zoo-lob, cut off), and is timed otherwise."""
_NO_MOTION = 1e-12
"""Velocities below this part of the values are rounding, not motion."""


def largest_of_unit(ranges: Channels, units: Sequence[str]) -> Channels:
    """Return for each channel the largest range of all that share its unit."""
    unit_of = np.array(units)
    return np.array([ranges[unit_of == unit].max() for unit in unit_of])


def velocity_profiles(
    motions: Sequence[Motion] | np.ndarray, units: Sequence[str], smoothing: float
) -> list[Motion]:
    """Return smoothed velocities, scaled so that the channels of every unit count alike.

    Central differences, smoothed by a Gaussian of standard deviation `smoothing`, in frames.
    Channels of one unit share one scale, their pooled root mean square over all motions: a joint
    that only jitters stays small beside one that throws. A unit in which nothing moves gives zeros.
    """
    from scipy.ndimage import gaussian_filter1d

    velocities = [np.gradient(motion, axis=0) for motion in motions]
    if smoothing > 0:
        velocities = [gaussian_filter1d(v, smoothing, axis=0, mode="reflect") for v in velocities]
    scale = np.full(len(units), np.inf)
    all_velocities, positions = np.concatenate(velocities), np.concatenate(list(motions))
    for unit in dict.fromkeys(units):
        channels = [d for d, other in enumerate(units) if other == unit]
        rms = math.sqrt(float(np.mean(all_velocities[:, channels] ** 2)))
        if rms > _NO_MOTION * float(np.abs(positions[:, channels]).max()):
            scale[channels] = rms
    return [velocity / scale for velocity in velocities]


def onset(speed: Speed) -> float:
    """Return the first frame that counts as moving."""
    return float(np.argmax(speed > MOVING * speed.max()))


def mean_frame(energy: Speed, first: float = 0.0) -> float:
    """Return the middle of the dynamic phase: the mean frame, weighted by energy (squared speed).

    The middle frame where nothing moves. `first` is the frame of the first value: 0.5 where the
    energy is of the steps between frames.
    """
    if not energy.any():
        return first + (len(energy) - 1) / 2
    return float(np.average(first + np.arange(len(energy)), weights=energy))


def motion_span(speed: Speed) -> Float[np.ndarray, "2"]:
    """Return where a motion begins and ends, in fractional frames.

    Crossings of `MOVING` are interpolated between frames and widened by a tenth of the duration. A
    motion that does not rest at an end of its plan ends there. A plan that never moves is one span.
    """
    last = len(speed) - 1
    threshold = MOVING * speed.max()
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


def frames_at_rest(speed: Speed) -> tuple[int, int]:
    """Count the frames before a motion begins and after it ends; all frames of a constant plan."""
    moving = np.flatnonzero(speed > AT_REST * speed.max())
    if not moving.size:
        return len(speed), len(speed)
    return int(moving[0]), len(speed) - 1 - int(moving[-1])

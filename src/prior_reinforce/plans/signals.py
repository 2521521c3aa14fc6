"""Signal analysis: noise, the kind of each channel, rest and motion, by one set of thresholds.

A plan is rarely all smooth joint paths. A base is turned and then held, a gripper opens within six
frames, a valve is on or off. Each kind is timed, coded and interpolated in its own way:

- `held`: one number a plan; changes within a plan are noise.
- `switch`: takes a few values only, and jumps between them.
- `step`: rests except for short transitions: a gripper that opens.
- `smooth`: everything else.

"At rest" is measured in three ways, because mistakes cost differently:

- *Speed of all channels*, smoothed and relative to its peak, where motions are compared or aligned
  (`speeds`): an onset that is only compared may be late.
- *Distance from the end pose* (`moving_rows`), where frames are dropped (`trim_band`) or a motion
  is cut off (`pose_band`): a frame that is dropped is lost.
- *Speed of one channel* at an end, relative to its fastest step where a plan is coded (`END_STEP`),
  in its unit where an arm executes it (`REST_SPEED`).

Notation:
    A      motions             (T_i, D) each, in their units: plans (H, D), or recordings
    sigma  noise of a channel  (D,)     in its unit
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.plans.plan_format import summed
from prior_reinforce.plans.speeds import (
    SMOOTHING,
    Channels,
    Motion,
    largest_of_unit,
    motion_span,
    velocity_profiles,
)
from prior_reinforce.units import Kind, in_unit

ChannelKind = Literal["held", "switch", "step", "smooth"]

HELD = 1e-4
"""A channel is held if it leaves its mean by at most this, rms, in rad or m (in other units: this
part of the largest range of that unit). Ours: the error at which a plan still counts as reproduced.
Of increments their sum is tested."""
COUNTS: Mapping[Kind, float] = {"angle": 1e-3, "length": 5e-4}
"""Range of a few counts of an encoder, in [rad] and [m]; poses no farther apart are the same. Ours:
less than moves a throw by a millimetre."""
NOISE_RMS = 3.0
"""Pure noise stays within so many sigma, rms. Ours: sigma is estimated from few frames, and from a
signal that is rounded to counts."""
_NOISE_PEAK = 5.0
"""A single frame or slope that deviates by more than so many sigma is not noise. Ours: noise
exceeds it in one frame of 1.7 million."""
_MAX_LEVELS = 4
"""A channel with at most so many values is a switch. Ours: 2 and 8 change no plan of the zoo's,
whose triggers have two."""
_STEP_SHARE = 0.25
"""A step's transitions last at most this part of the longest motion of any channel. Ours: a gripper
opens within six frames of a throw of 40, and joints that move together last about as long as each
other."""
_ACTIVE = 0.03
"""A frame belongs to a transition if it changes by over this part of the channel's largest change.
Ours: a trembling hand is below; half and double move a gripper by 6e-4 of its range."""
_STANDS_OUT = 0.25
"""Noise bounds transitions only if it is less than this part of the largest change: a slow joint at
1 kHz changes by less than its noise from frame to frame. Ours."""
_FEWEST_FRAMES = 20
"""Noise is not estimated from fewer frames, which show motion. Ours: 20 give five differences."""
_QUANTILE, _NORMAL = 0.3, 0.385
"""Noise is estimated from the 30 % quantile of absolute third differences, which is 0.385 standard
deviations of a normal variable."""

END_STEP = 0.01
"""A channel rests at an end of a plan if its step there is at most this part of its largest step.
Ours: a plan is then generated at rest there too."""
REST_SPEED: Mapping[Kind, float] = {"angle": 0.05, "length": 0.02}
"""A slower channel rests, in recordings and for the gate, in [rad/s] and [m/s]. Ours: the makers
ask for exactly 0; a smooth start recorded at 30 frames/s shows 0.02 rad/s."""
_REST_SHARE = 0.05
"""The same in other units, as a part of the channel's largest speed. Ours."""
_END_TIME = 0.04
"""Time over which the speed at an end is measured, in [s]: a slope through several frames."""
_TRIM_SHARE = 0.005
"""Frames within this share of the largest range of their unit from an end pose are trimmed. Ours:
above encoder noise, and reached by a smooth start within its first tenth."""
_POSE_SHARE = 1e-4
"""A channel leaves a pose by this part of the largest range of its unit. Ours: a minimum-jerk
motion has 0.7 % of its largest speed there, and can stop."""


@dataclass(frozen=True, eq=False)
class Signals:
    """The signals of D channels in some motions; made by `analyse`."""

    kinds: tuple[ChannelKind, ...]
    """Kind of each channel, from all motions together."""
    noise: Channels
    """sigma: standard deviation of each channel's noise, in its unit."""
    trim_band: Channels
    """How far a frame that may be dropped may be from a recording's end pose, for each channel."""
    pose_band: Channels
    """How far each channel may be from a pose and still count as there."""
    rest_start: tuple[bool, ...]
    """Whether every motion starts at rest, for each channel."""
    rest_end: tuple[bool, ...]
    """Whether every motion ends at rest, for each channel."""
    spans: Float[np.ndarray, "N 2"]
    """Where each motion begins and ends (`motion_span`), in frames."""

    @property
    def held(self) -> Bool[np.ndarray, " D"]:
        """Which channels no motion moves, except for noise."""
        return np.array([kind == "held" for kind in self.kinds])

    @property
    def jumps(self) -> Bool[np.ndarray, " D"]:
        """Which channels are steps or switches."""
        return np.array([kind in ("step", "switch") for kind in self.kinds])


def analyse(
    motions: Sequence[Motion] | np.ndarray,
    units: Sequence[str],
    dt: float,
    increments: Sequence[int] = (),
) -> Signals:
    """Analyse motions of the same channels, all together: plans, or recordings of any length.

    `dt` is the time between two frames, in [s]; of recordings, their median period. `increments`
    are columns that are summed to poses (`PlanFormat.increments`).
    """
    sigma = noise(motions)
    ranges = np.ptp(np.concatenate(list(motions)), axis=0)
    largest = np.max([np.ptp(motion, axis=0) for motion in motions], axis=0)
    counts = np.array([in_unit(COUNTS, unit) or 0.0 for unit in units])
    steps = [np.abs(np.diff(motion, axis=0)) for motion in motions]
    slow = END_STEP * np.max([step.max(axis=0) for step in steps], axis=0)
    profiles = velocity_profiles(motions, units, SMOOTHING / dt)
    poses = [summed(motion, increments) for motion in motions] if len(increments) else motions
    return Signals(
        kinds=_kinds(motions, steps, held_channels(poses, units), sigma),
        noise=sigma,
        trim_band=np.maximum(_TRIM_SHARE * largest_of_unit(largest, units), counts),
        pose_band=np.maximum(_POSE_SHARE * largest_of_unit(ranges, units), _NOISE_PEAK * sigma),
        rest_start=tuple(np.all([step[0] <= slow for step in steps], axis=0).tolist()),
        rest_end=tuple(np.all([step[-1] <= slow for step in steps], axis=0).tolist()),
        spans=np.array([motion_span(np.linalg.norm(each, axis=1)) for each in profiles]),
    )


def noise(motions: Sequence[Motion] | np.ndarray) -> Channels:
    """Estimate each channel's measurement noise, as a standard deviation in its unit.

    Where a motion rests, for a third of its time, its third differences are noise; those of white
    noise have 20 times its variance. An upper estimate if nothing rests; zero of less than 20
    frames, which show motion rather than noise.

    Source: ours, after the difference-based estimators of Gasser, Sroka and Jennen-Steinmetz
    (Biometrika 1986).
    """
    long = [np.diff(each, n=3, axis=0) for each in motions if len(each) >= _FEWEST_FRAMES]
    if not long:
        return np.zeros(motions[0].shape[1])
    quiet = np.quantile(np.abs(np.concatenate(long)), _QUANTILE, axis=0)
    return np.asarray(quiet / (_NORMAL * math.sqrt(20.0)))


def without_noise(plans: Float[np.ndarray, "N H D"], held: Bool[np.ndarray, " D"]) -> np.ndarray:
    """Return the plans with each held channel at its mean, one number a plan."""
    noisy = held & np.any(np.ptp(plans, axis=1), axis=0)  # a constant keeps its last digit
    return np.where(noisy, plans.mean(axis=1, keepdims=True), plans)


def active_runs(
    steps: Sequence[Float[np.ndarray, " _"]], sigma: float
) -> list[list[tuple[int, int]]]:
    """Return the runs of frames in which one channel changes, for each motion: first frame and end.

    `steps` are the channel's absolute changes from frame to frame, in each motion.
    """
    peak = max(step.max() for step in steps)
    noisy = _NOISE_PEAK * sigma
    threshold = max(_ACTIVE * peak, noisy if noisy < _STANDS_OUT * peak else 0.0)
    return [_runs(step > threshold) for step in steps]


def _runs(active: Bool[np.ndarray, " _"]) -> list[tuple[int, int]]:
    """Return begin and end of each run of active frames; one quiet frame does not end a run."""
    frames = np.flatnonzero(active)
    if not frames.size:
        return []
    gaps = np.flatnonzero(np.diff(frames) > 2)
    begins = frames[np.r_[0, gaps + 1]]
    ends = frames[np.r_[gaps, len(frames) - 1]] + 1
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def held_channels(
    motions: Sequence[Motion] | np.ndarray, units: Sequence[str]
) -> Bool[np.ndarray, " D"]:
    """Return which channels stay at their mean in every motion, or leave it by noise only.

    Successive values of noise are independent: their mean squared difference is twice the variance
    (von Neumann, 1941); in a motion it is a hundredth or less. Only angles and lengths are measured
    by encoders; in other units, what looks like noise may be intended.
    """
    ranges = np.ptp(np.concatenate(list(motions)), axis=0)
    known = np.array([in_unit(COUNTS, unit) is not None for unit in units])
    floor = HELD * np.where(known, 1.0, largest_of_unit(ranges, units))
    counts = np.array([in_unit(COUNTS, unit) or 0.0 for unit in units])
    unpadded = [_without_padding(motion) for motion in motions]
    sigma = np.max([noise([motion]) for motion in unpadded], axis=0)
    held = np.ones(len(units), dtype=bool)
    for motion, recorded in zip(motions, unpadded, strict=True):
        rms = np.std(recorded, axis=0)
        rough = np.mean(np.diff(recorded, axis=0) ** 2, axis=0) >= rms**2
        small = (np.ptp(recorded, axis=0) <= counts) | (rms <= NOISE_RMS * sigma)
        held &= (np.std(motion, axis=0) <= floor) | (known & rough & small)
    return held


def _without_padding(motion: Motion) -> Motion:
    """Remove the frames that repeat the last pose, by which plans are padded."""
    changes = np.flatnonzero(np.any(np.diff(motion, axis=0) != 0.0, axis=1))
    return motion[: changes[-1] + 2] if changes.size else motion


def _kinds(
    motions: Sequence[Motion] | np.ndarray,
    steps: Sequence[Motion],
    held: Bool[np.ndarray, " D"],
    sigma: Channels,
) -> tuple[ChannelKind, ...]:
    """Classify each channel, from all motions together."""
    durations = {}
    for d in np.flatnonzero(~held):
        runs = chain.from_iterable(active_runs([step[:, d] for step in steps], sigma[d]))
        durations[d] = max((end - begin for begin, end in runs), default=0)
    longest = max(durations.values(), default=0)
    kinds: list[ChannelKind] = ["held"] * len(held)
    for d, duration in durations.items():
        if len(np.unique(np.concatenate([motion[:, d] for motion in motions]))) <= _MAX_LEVELS:
            kinds[d] = "switch"
        else:
            kinds[d] = "step" if duration <= _STEP_SHARE * longest else "smooth"
    return tuple(kinds)


def moving_rows(
    motion: Motion, band: Channels, rates: Sequence[int] = ()
) -> tuple[int, int] | None:
    """Return the first row away from the first pose, and the last one away from the last pose.

    A motion that returns to its first pose has both as well. None if nothing moves. `band` is how
    far each channel may be from a pose: `trim_band` or `pose_band`. Columns of `rates` are 0 at
    rest, so their distance from 0 counts.
    """
    first, last = np.array(motion[0]), np.array(motion[-1])
    first[list(rates)] = last[list(rates)] = 0.0
    departed = np.flatnonzero(np.any(np.abs(motion - first) > band, axis=1))
    unfinished = np.flatnonzero(np.any(np.abs(motion - last) > band, axis=1))
    if not departed.size:
        return None
    return int(departed[0]), int(unfinished[-1] if unfinished.size else departed[-1])


def moving_ends(
    times: Float[np.ndarray, " T"],
    motion: Motion,
    units: Sequence[str],
    signals: Signals,
    rates: Sequence[int],
) -> Bool[np.ndarray, "2 D"]:
    """Return which channels move at the first frames of a recording, and which at the last.

    The speed is the slope of a line through the frames of 40 ms, at least two; for columns that are
    `rates`, it is their mean.
    """
    is_rate = np.isin(np.arange(len(units)), rates)
    count = max(2, int(np.searchsorted(times, times[0] + _END_TIME, side="right")))
    fastest = np.abs(np.where(is_rate, motion, np.gradient(motion, times, axis=0))).max(axis=0)
    rest = [in_unit(REST_SPEED, u) or _REST_SHARE * f for u, f in zip(units, fastest, strict=True)]
    moving = []
    for end in (slice(count), slice(-count, None)):
        t = times[end] - times[end].mean()
        total = float(t @ t)
        mean = motion[end].mean(axis=0)
        speed = np.abs(np.where(is_rate, mean, t @ (motion[end] - mean) / total))
        sd = np.where(is_rate, 1 / math.sqrt(len(t)), 1 / math.sqrt(total)) * signals.noise
        moving.append(speed > np.maximum(rest, _NOISE_PEAK * sd))
    return np.array(moving) & (~signals.held | is_rate)

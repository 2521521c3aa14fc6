"""From recordings of any channels, rate and length to plans of one format and one horizon."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import pairwise
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float
from msgspec import Meta

from prior_reinforce.arm.recordings.artefacts import failed_reads, held_frames, refuse_leaps, stalls
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.time_finder import GAP, LONGEST
from prior_reinforce.arm.recordings.units import say_names
from prior_reinforce.arrays import Frames, Plans
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.channels import zero_at_rest
from prior_reinforce.plans.plan_format import PlanFormat, stepped, summed
from prior_reinforce.plans.signals import Signals, analyse, moving_ends, moving_rows
from prior_reinforce.plans.speeds import Channels, largest_of_unit
from prior_reinforce.settings import Checked, NonNegative, Positive

_ON_GRID = 0.02
"""Part of a time step by which a frame may be early or late and is kept as it is. Ours: at 2 rad/s
and 100 Hz that is 0.4 mrad, below the servo's own error."""
_OVERSHOOT = 0.01
"""A spline that leaves a channel's recorded range by more than this share of it is refused."""
_NOISE_OVERSHOOT = 5.0
"""And by more than so many standard deviations of its noise, which splines overshoot too. Ours."""
_BEGINS = 1e-3
"""Part of the fastest step of its unit above which a channel leaves its rest, noise aside. Ours: a
plan that begins a little faster leaps from rest, and breaks limits of jerk."""
_SMALL = 0.01
"""Part of the largest increment below which nothing moves. Ours: noise is less."""
_WHOLE_RATE = 0.005
"""A median period this share from a whole rate is that rate. Ours: clocks drift by less."""
_STANDSTILL = 8
"""Periods of a gap in which the arm may have stood still. Ours: lost frames are fewer."""
_LITTLE, _SPARSE = 0.5, 0.1
"""Share of a channel's largest step that is little across a gap, and share of steps that are late
where a recorder writes changes only. Ours."""
_FEWEST_FRAMES = 5
"""Frames of which it can be said whether a channel moves at the ends."""
_MANY_FRAMES, _ENOUGH_FRAMES = 400, 140
"""Frames of a plan that are remarked on, and those that suffice: the throws of our own tasks have
140 (ours). Learning takes time with every frame."""
_MOST_FRAMES = 100_000
"""Longest plan that is made; more is a wrong time step far more often than a motion."""


@dataclass(frozen=True)
class Preprocessing(Checked):
    """How recordings become plans. Time is never stretched: a retimed throw is another throw."""

    dt: Positive | None = None
    """Time between two frames of a plan, in [s]; None takes the recordings' median period."""
    horizon: Annotated[int, Meta(ge=2)] | None = None
    """Frames of every plan; None takes the longest recording's. Shorter ones hold their last pose;
    a longer one is an error, never cut."""
    trim: bool = True
    """Drop the still time before the first and after the last movement of each recording."""
    smooth: Positive | None = None
    """Frequency above which plans are smoothed, in [Hz]: a Butterworth filter of order 2, run
    forwards and backwards, so that nothing is delayed. Steps and switches, such as grippers, are
    left alone. None keeps every frame as recorded."""
    margin: NonNegative = 0.1
    """Still time that trimming keeps at either end, in [s]. Ours: enough for the plan to start
    and end at rest at 30 frames a second."""


@dataclass(frozen=True, eq=False)
class Preprocessed:
    """Plans, and how they were made."""

    plans: Plans
    dt: float
    """Time between two frames, in [s]."""
    starts: tuple[float, ...]
    """Where in its recording each plan starts, in [s]."""
    ends: tuple[float, ...]
    """Where in its recording each plan ends, in [s], before the last pose is held."""
    held: int
    """How many plans hold their last pose to reach the horizon."""
    held_channels: tuple[int, ...]
    """Channels that no recording moves, noise aside."""
    noise: Channels
    """Standard deviation of each channel's noise at rest, in its unit."""
    smoothed: Float[np.ndarray, "N 2 D"] | None
    """What smoothing changed in each plan: rms and largest change; None where nothing was."""
    remarks: tuple[str, ...]
    """Warnings, the most important first: `episodes: what`."""


def preprocess(
    recordings: Sequence[Recording], form: PlanFormat, settings: Preprocessing
) -> Preprocessed:
    """Trim and resample N recordings of the channels of `form` to one horizon.

    Increments are summed up before and taken anew after. Speeds rest at 0. The time step is that of
    `settings`. InvalidDemonstrationsError if an episode never moves, exceeds the horizon, or leaps.
    """
    increments = form.increments
    durations = [recording.duration for recording in recordings]
    if increments:
        recordings = [_with_poses(recording, increments) for recording in recordings]
    refuse_leaps(recordings, form.units)
    dt = settings.dt or _common_dt(recordings)
    recordings = [_held_while_unchanged(recording) for recording in recordings]
    every = [r.positions for r in recordings]
    speeds = [i for i in zero_at_rest(form.names, form.units) if i not in increments]
    signals = analyse(every, form.units, float(np.median([r.period for r in recordings])))
    channels = _Channels(form.units, speeds, signals)
    spans = [(0.0, r.duration) for r in recordings]
    if settings.trim:
        spans = [_moving_span(r, channels, settings.margin) for r in recordings]
    sampled = [_resample(r, *s, dt, signals) for r, s in zip(recordings, spans, strict=True)]
    pieces, changes = [piece for piece, _ in sampled], None
    if settings.smooth is not None:
        of_plans = channels._replace(signals=analyse(pieces, form.units, dt))
        smooth = [
            _smoothed(recording, piece, dt, settings.smooth, of_plans)
            for recording, piece in zip(recordings, pieces, strict=True)
        ]
        off = [after - before for before, after in zip(pieces, smooth, strict=True)]
        changes = np.array([[np.sqrt(np.mean(o**2, axis=0)), np.abs(o).max(axis=0)] for o in off])
        pieces = smooth
    more = 1 if increments else 0
    longest = max(map(len, pieces)) - more
    horizon = settings.horizon or longest
    remarks: dict[tuple[_Kind, str], list[str]] = {}
    for recording, (piece, jumping), span in zip(recordings, sampled, spans, strict=True):
        if (frames := len(piece) - more) > horizon:
            raise InvalidDemonstrationsError(
                f"episode {recording.episode} has {frames} frames, more than the horizon "
                f"{horizon}; give a horizon of {longest}, or a larger dt (motions are never cut)"
            )
        held = frames < horizon
        for remark in _remarks(recording, span, channels, jumping, held=held):
            remarks.setdefault(remark, []).append(recording.episode)
    longest_motion = max(end - start for start, end in spans)
    if longest_motion > LONGEST:
        what = (
            f"motions take up to {longest_motion:.3g} s, and throws take seconds: cut the "
            "recordings, or say in which unit their times are (--time-unit)"
        )
        remarks[_Kind.SLOW, what] = []
    elif horizon > _MANY_FRAMES:
        fewer = dt * horizon / _ENOUGH_FRAMES
        what = f"{horizon} frames are many; dt {fewer:.2g} s makes {_ENOUGH_FRAMES}"
        remarks[_Kind.LONG, what] = []
    rows = horizon + more
    plans = np.stack([np.pad(p, ((0, rows - len(p)), (0, 0)), mode="edge") for p in pieces])
    for plan, piece in zip(plans, pieces, strict=True):
        plan[len(piece) - more :, speeds] = 0.0
    return Preprocessed(
        stepped(plans, increments) if increments else plans,
        dt,
        tuple(start for start, _ in spans),
        tuple(min(end, d) for (_, end), d in zip(spans, durations, strict=True)),
        sum(len(piece) < rows for piece in pieces),
        tuple(np.flatnonzero(signals.held).tolist()),
        signals.noise,
        changes,
        tuple(
            f"{'all' if len(e) in (0, len(every)) and len(every) > 1 else ', '.join(e)}: {what}"
            for (_, what), e in sorted(remarks.items(), key=lambda item: item[0][0])
        ),
    )


class _Channels(NamedTuple):
    """What is known of the channels of all recordings."""

    units: tuple[str, ...]
    speeds: Sequence[int]
    """Columns of speeds, which are 0 at rest."""
    signals: Signals


def _with_poses(recording: Recording, increments: Sequence[int]) -> Recording:
    """Sum up increments to poses; the last pose is reached a period later."""
    t, q, period = recording.times, recording.positions, recording.period
    size = np.abs(q[:, list(increments)])
    moving = np.any(size > _SMALL * size.max(axis=0), axis=1)
    waits = np.diff(t)
    jitter = np.median(np.abs(waits - period))  # else late frames count as lost
    late = np.where(waits > 1.5 * period + jitter, np.rint(waits / period).astype(int) - 1, 0)
    lost = int(late[moving[1:] | moving[:-1]].sum())
    remark = (
        f"{lost} of {len(t) + lost} frames are missing in mid-motion, and with them how far it "
        "went, which increments say frame by frame: leave the recording out (--leave-out), or "
        "write the frames that are missing"
    )
    return replace(
        recording,
        times=np.append(t, recording.duration + period),
        positions=summed(q, increments),
        remarks=(*recording.remarks, remark) if lost else recording.remarks,
    )


def at_rests(recording: Recording, rest: float) -> list[Recording]:
    """Cut a recording wherever nothing moves for `rest` in [s], into `NAME-0`, `NAME-1`, ...

    Nothing moves in gaps: some recorders pause with the arm.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    times, size = recording.times, max(2, math.ceil(rest / recording.period))
    frames = np.rint(np.append(np.diff(times), 0.0) / recording.period)
    frame = np.repeat(np.arange(len(times)), np.clip(frames, 1, 2 * size).astype(int))
    q = recording.positions[frame]
    if len(q) <= size:
        return [recording]
    zero = zero_at_rest(recording.names, recording.units)
    units = ["" if i in zero else unit or "rad" for i, unit in enumerate(recording.units)]
    band = analyse([recording.positions], units, recording.period).trim_band
    spread = maximum_filter1d(q, size, axis=0) - minimum_filter1d(q, size, axis=0)
    spread[:, zero] = maximum_filter1d(np.abs(q[:, zero]), size, axis=0)
    still = np.all(spread[size // 2 : len(q) - (size - 1) // 2] <= band, axis=1)
    covered = np.cumsum(np.append(still, np.zeros(size)) - np.append(np.zeros(size), still))
    moves = (covered[: len(q)] == 0).astype(int)
    begins, ends = (np.flatnonzero(np.diff(moves, prepend=0, append=0) == sign) for sign in (1, -1))
    middles = (begins[1:] + ends[:-1]) // 2
    cuts = [0, *(frame[middles] + (frame[middles] == frame[middles - 1])).tolist(), len(times)]
    return [
        replace(
            recording,
            episode=f"{recording.episode}-{i}",
            times=recording.times[a:b],
            positions=recording.positions[a:b],
        )
        for i, (a, b) in enumerate(pairwise(cuts))
    ]


_Kind = IntEnum("_Kind", ["SLOW", "ENDS", "GAP", "FAILED", "READING", "STEP", "LONG"])
"""What a remark is about, the most important first."""


def _remarks(
    recording: Recording,
    span: tuple[float, float],
    channels: _Channels,
    jumping: Sequence[str],
    *,
    held: bool,
) -> Iterator[tuple[_Kind, str]]:
    """Warn about one episode: gaps, failed reads, jumps, and ends in mid-swing."""
    units, speeds, signals = channels
    t, steps = recording.times, np.diff(recording.times)
    within = (t[1:] > span[0]) & (t[:-1] < span[1])
    still = np.all(np.diff(recording.positions, axis=0) == 0, axis=1)
    worst = int(np.argmax(np.where(within & ~still, steps, 0.0)))
    if not still[worst] and steps[worst] > GAP * recording.period:
        yield _Kind.GAP, f"nothing recorded for {steps[worst]:.3f} s at {t[worst]:.2f} s"
    for start, wait in stalls(recording):
        what = "nothing recorded in mid-motion for"
        yield _Kind.GAP, f"{what} {wait:.3f} s at {start:.2f} s: one frame again and again"
    if frames := held_frames(recording):
        rate = 1 / recording.period
        yield (
            _Kind.GAP,
            f"the joints change {rate / frames:.3g} times a second in frames at {rate:.4g} Hz, "
            "held in between, so they move in steps: record them at that rate, or write the "
            "frames alone in which they change",
        )
    for remark in failed_reads(recording, units, signals.trim_band):
        yield _Kind.FAILED, remark
    if jumping:
        yield _Kind.STEP, f"{', '.join(jumping)} jumps; no spline goes through it"
    for remark in recording.remarks:
        yield _Kind.READING, remark
    kept = (t >= span[0]) & (t <= span[1])
    if np.count_nonzero(kept) < _FEWEST_FRAMES:
        return
    starts, ends = moving_ends(t[kept], recording.positions[kept], units, signals, speeds)
    then = ", then holds its last pose" if held else ""
    for moving, what in ((starts, "starts in motion"), (ends, f"ends in motion{then}")):
        if names := [recording.names[i] for i in np.flatnonzero(moving) if i not in speeds]:
            yield _Kind.ENDS, f"{what} ({say_names(names)})"
    then = "; its plan is 0 from there on, at once" if held else ""
    for moving, row, what in ((starts, 0, "starts at a speed of"), (ends, -1, "ends at")):
        for i in np.flatnonzero(moving):
            if i in speeds:
                speed = f"{recording.positions[kept][row, i]:.3g} {units[i]}"
                yield _Kind.ENDS, f"{what} {speed}{then if row else ''} ({recording.names[i]})"


def _smoothed(
    recording: Recording, frames: Frames, dt: float, frequency: float, channels: _Channels
) -> Frames:
    """Remove from frames what is faster than a frequency, but for steps and switches."""
    units, speeds, signals = channels
    from scipy.signal import butter, sosfiltfilt

    if frequency >= 0.5 / dt:
        raise ConfigurationError(
            f"--smooth {frequency:g} Hz is no less than half the plans' {1 / dt:g} Hz, where "
            "nothing is faster; give less, or leave it out"
        )
    if frequency * len(frames) * dt < 1:
        raise ConfigurationError(
            f"--smooth {frequency:g} Hz takes out all that is faster than {1 / frequency:.3g} s, "
            f"and episode {recording.episode} is {len(frames) * dt:.3g} s long; give more Hz"
        )
    sections = butter(2, frequency, fs=1 / dt, output="sos")
    pad = min(len(frames) - 1, math.ceil(1 / (frequency * dt)))
    # Mirrored at an end, a channel keeps its rest there; turned about it, its speed.
    at_rest, moving = (
        np.asarray(sosfiltfilt(sections, frames, axis=0, padtype=padding, padlen=pad))
        for padding in ("even", "odd")
    )
    starts, ends = moving_ends(np.arange(len(frames)) * dt, frames, units, signals, speeds)
    smooth = np.where(starts | ends, moving, at_rest)
    return np.where(signals.jumps, frames, smooth)


def _held_while_unchanged(recording: Recording) -> Recording:
    """Fill the gaps of a recording that was written at changes only with the pose held there.

    Across such a gap every channel changes by little, unlike where frames were lost in mid-swing.
    """
    t, q, period = recording.times, recording.positions, recording.period
    steps, waits = np.abs(np.diff(q, axis=0)), np.diff(t)
    long = waits > _STANDSTILL * period
    share = 1.5 if np.mean(waits > 1.5 * period) > _SPARSE else _LITTLE
    held = long & np.all(steps <= share * steps[~long].max(axis=0, initial=0.0), axis=1)
    if not np.any(held):
        return recording
    kept = [np.arange(t[i] + period, t[i + 1] - period / 2, period) for i in np.flatnonzero(held)]
    at = np.repeat(np.flatnonzero(held) + 1, [len(times) for times in kept])
    remark = f"written at changes only: held still in between, up to {waits[held].max():.2f} s"
    return replace(
        recording,
        times=np.insert(t, at, np.concatenate(kept)),
        positions=np.insert(q, at, q[at - 1], axis=0),
        remarks=(*recording.remarks, remark),
    )


def _common_dt(recordings: Sequence[Recording]) -> float:
    """Return the median period, or that of a whole rate which is nearly the same."""
    period = float(np.median([recording.period for recording in recordings]))
    rate = round(1 / period)
    return 1 / rate if rate > 0 and abs(rate * period - 1) < _WHOLE_RATE else period


def _moving_span(recording: Recording, channels: _Channels, margin: float) -> tuple[float, float]:
    """Return from when to when a recording is kept, in [s]: its motion and a margin."""
    (units, speeds, signals), t = channels, recording.times
    rows = moving_rows(recording.positions, signals.trim_band, speeds)
    if rows is None:
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} never moves by more than {signals.trim_band.max():.2g} "
            "from its first pose; leave it out, or import without trimming (--no-trim)"
        )
    # The last frame within the still band before the motion, and the first one after it.
    before, after = max(rows[0] - 1, 0), min(rows[1] + 1, len(t) - 1)
    first = max(int(np.searchsorted(t, t[before] - margin, side="right")) - 1, 0)
    last = min(int(np.searchsorted(t, t[after] + margin)), len(t) - 1)
    # A long soft start or end is within the band for longer than the margin, and yet no rest.
    steps = np.abs(np.diff(recording.positions, axis=0))
    steps[:, speeds] = np.abs(recording.positions[:-1, speeds])
    slow = _BEGINS * largest_of_unit(steps.max(axis=0), units)
    at_rest = steps <= np.maximum(slow, _NOISE_OVERSHOOT * signals.noise)
    at_rest |= signals.held & ~np.isin(np.arange(len(units)), speeds)
    rests = np.flatnonzero(np.all(at_rest, axis=1))
    first = min(first, int(np.max(rests[rests < before], initial=-1)) + 1)
    last = max(last, int(np.min(rests[rests >= after], initial=len(t) - 1)))
    return float(t[first]), float(t[last])


def _resample(
    recording: Recording, start: float, end: float, dt: float, signals: Signals
) -> tuple[Frames, list[str]]:
    """Return frames at start, start + dt, ... to the end, and names of stepwise channels."""
    t, q = recording.times, recording.positions
    count = max(2, math.ceil((end - start) / dt - _ON_GRID) + 1)
    if count > _MOST_FRAMES:
        steps = np.diff(t)
        k = int(np.argmax(steps))
        remedy = "give a larger dt, or cut the recording"
        if steps[k] > (end - start) / 2:
            remedy = f"its times leap by {steps[k]:.4g} s at frame {k + 1}: cut it there"
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} makes {count} frames at dt {dt:g} s; {remedy}"
        )
    grid = start + np.arange(count) * dt
    nearest = np.clip(np.searchsorted(t, grid - dt / 2), 0, len(t) - 1)
    if np.all(np.abs(t[nearest] - grid) <= _ON_GRID * dt):
        return q[nearest], []
    from scipy.interpolate import CubicSpline, PchipInterpolator

    at = np.clip(grid, t[0], t[-1])
    frames = CubicSpline(t, q)(at) if len(t) > 3 else PchipInterpolator(t, q)(at)
    low, high = q.min(axis=0), q.max(axis=0)
    beyond = np.maximum(low - frames.min(axis=0), frames.max(axis=0) - high)
    stepwise = (beyond > _OVERSHOOT * (high - low)) & (beyond > _NOISE_OVERSHOOT * signals.noise)
    stepwise &= ~signals.held
    if np.any(stepwise):
        # PCHIP never leaves the range of its neighbours: right for grippers and switches.
        frames[:, stepwise] = PchipInterpolator(t, q[:, stepwise])(at)
    return frames, [n for n, s in zip(recording.names, stepwise, strict=True) if s]

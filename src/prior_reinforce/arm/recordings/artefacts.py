"""Errors of recorders: counters and angles that leap, failed reads, repeated frames.

A gripper or a switch steps between rests; a joint that moves on after a leap as it did before has
not leapt, only its numbers have.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.time_finder import GAP, Times, is_set_on
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.channels import Kind, kinds
from prior_reinforce.plans.signals import noise
from prior_reinforce.plans.speeds import Channels
from prior_reinforce.plans.whole_turns import HALF, TURN

_SHARE = 0.5
"""A leap is at least this part of a channel's range. Ours: a motion of 0.3 s recorded at 10 Hz
steps by less, and a counter that starts again by nearly all."""
_TIMES = 10.0
"""And so many times what the channel moves in that time before and after. Ours."""
_FRAMES = (4, 8, 16, 32)
"""Frames before and after a leap that may show how the channel moves: few where it is fast."""
_STRAIGHT = 0.15
"""Share of what it moves in these frames by which it may be off a line, rms; noise is. Ours."""
_NOISE = 6.0
"""And it moves by so many standard deviations of its noise. Ours."""
_ALIKE = 3.0
"""Times by which it may be faster after than before. Ours."""
_COUNTS = (*(2.0**n for n in range(8, 25)), 360.0, 3600.0)
"""Counts at which counters and encoders start again."""
_NEAR = 0.05
"""Share of these that a counter may miss just before it starts again, as it is fast. Ours."""
_AROUND = 8
"""A failed read is `_TIMES` as far off the line between its neighbours as any of so many frames
before and after. Ours: the peak of a flick of 0.2 s is 7.5 times as far off at 15 Hz."""
_THERE_AND_BACK = 0.14
"""Time in which no arm goes anywhere and comes back, in [s]. Ours."""
_ACROSS = 2.0
"""Across a stall a channel moves by so many times its steps around, and about as fast. Ours."""
_FAST = 0.5
"""Part of its largest step by which a channel is in mid-motion there. Ours: a log of changes has
pauses, before which an arm slows down."""
_MOST, _FEWEST_VALUES = 0.9, 12
"""Values that are held for about one number of frames, of at least so many. Ours."""

Values = Float[np.ndarray, " T"]
"""One channel at these times."""


def refuse_leaps(recordings: Iterable[Recording], units: Sequence[str]) -> None:
    """Refuse channels and clocks that leap in mid-motion: InvalidDemonstrationsError."""
    for recording in recordings:
        _refuse_set_clock(recording)
        for channels, frame in _leaps(recording, units):
            q, names = recording.positions, [recording.names[i] for i in channels]
            said = " and ".join(
                f"{recording.names[i]} leaps from {q[frame, i]:.4g} to {q[frame + 1, i]:.4g} "
                f"{units[i]}"
                for i in channels
            )
            leap = q[frame + 1, channels[0]] - q[frame, channels[0]]
            count = _counter(q[:, channels[0]])
            if len(channels) > 1:
                why = "both by half a turn, as angles of an attitude do that are written otherwise"
            elif count is not None:
                turn = f"{'add' if leap < 0 else 'take off'} {count:.0f} from there on"
                why = f"as what counts to {count:.0f} and starts again ({turn})"
            else:
                why = "and moves on as before"
            raise InvalidDemonstrationsError(
                f"episode {recording.episode}: {said} at {recording.times[frame + 1]:.3f} s, "
                f"{why}; mend the recording, leave that episode out (--leave-out), or import the "
                f"channels without {' and '.join(names)} (--joints)"
            )


def _refuse_set_clock(recording: Recording) -> None:
    """Refuse times that leap while the joints go on by one frame's step: the clock was set."""
    t, period = recording.times, recording.period
    waits, steps = np.diff(t), np.diff(recording.positions, axis=0)
    shifts = waits - period
    for k in np.flatnonzero(is_set_on(shifts, period)).tolist():
        around = [i for i in (k - 2, k - 1, k + 1, k + 2) if 0 <= i < len(steps)]
        usual, largest = steps[around].mean(axis=0), np.abs(np.delete(steps, k, axis=0)).max(axis=0)
        fast = np.all(steps[around] * np.sign(usual) > _FAST * largest, axis=0)
        share = steps[k, fast] / usual[fast]
        goes_on = np.all((share > 1 / _ACROSS) & (share < _ACROSS))
        # A log of changes waits longer as the arm slows down, and what stalled catches up after.
        after = waits[k + 1 : k + 1 + round(waits[k] / period)]
        even = np.max(waits[around]) < 2 * period and np.median(after) > period / 2
        if len(around) == 4 and np.any(fast) and goes_on and even:
            shift, remedy = f"{shifts[k]:.3f} s", "--time-column none --rate HZ"
            if "stamps" in recording.clock:  # a bag's, which has two
                remedy = "write the positions as CSV, or try the bag's other clock: --time-column "
                remedy += "recorder" if "header" in recording.clock else "header"
            hour = " (an hour, as local time does in spring)" if round(shifts[k], 1) == 3600 else ""
            raise InvalidDemonstrationsError(
                f"episode {recording.episode}: time leaps by {shift}{hour} at frame {k + 1} "
                f"({t[k]:.3f} s, then {t[k + 1]:.3f} s), while the joints go on by one frame's "
                "step, so it is the times that are wrong, as where a clock was set: read the "
                f"frames at their known rate ({remedy}), correct the times from there on, or leave "
                "that episode out (--leave-out)"
            )


def _leaps(recording: Recording, units: Sequence[str]) -> Iterator[tuple[list[int], int]]:
    """Channels that leap, and the frame before."""
    t, q = recording.times, recording.positions
    steps, ranges, sigma = np.diff(q, axis=0), np.ptp(q, axis=0), noise([q])
    angles = [i for i, unit in enumerate(units) if unit in TURN]
    if len(angles) > 1 and len(steps) > 2:
        turns = np.array([TURN[units[i]] for i in angles])
        off = np.abs(np.abs(steps[:, angles]) % turns - turns / 2)
        half = off < HALF * turns
        for frame in np.flatnonzero(half.sum(axis=1) > 1).tolist():
            yield [angles[i] for i in np.flatnonzero(half[frame])], frame
    for i, kind in enumerate(kinds(recording.names)):
        if kind is Kind.TOOL or ranges[i] == 0:
            continue
        for frame in np.flatnonzero(np.abs(steps[:, i]) >= _SHARE * ranges[i]).tolist():
            if _starts_again(q[:, i], frame) or _moves_on(t, q[:, i], frame, sigma[i]):
                yield [i], frame


def _starts_again(values: Values, frame: int) -> bool:
    """Whether a counter starts again after a frame: whole numbers that use up all its counts."""
    steps, count = np.abs(np.diff(values)), _counter(values)
    if count is None:
        return False
    around = max(steps[max(frame - 1, 0)], steps[min(frame + 1, len(steps) - 1)])
    return bool(abs(steps[frame] - count) <= _ALIKE * around < count / _ALIKE)


def _counter(values: Values) -> float | None:
    """What whole numbers count to that use up all its counts; None of other numbers."""
    most = values.max()
    if values.min() < 0 or np.any(values % 1):
        return None
    return next((c for c in _COUNTS if most < c <= most * (1 + _NEAR)), None)


def _moves_on(times: Times, values: Values, frame: int, sigma: float) -> bool:
    """Whether a channel moves after a leap as it did before, and far more slowly than it leaps."""
    ends = frame + 1
    before = list(_slopes(times[:ends][::-1], values[:ends][::-1], sigma))
    after = list(_slopes(times[ends:], values[ends:], sigma))
    little = abs(values[ends] - values[frame]) / (_TIMES * (times[ends] - times[frame]))
    return any(
        1 / _ALIKE < one / other < _ALIKE and max(abs(one), abs(other)) < little
        for one, other in product(before, after)
    )


def _slopes(times: Times, values: Values, sigma: float) -> Iterator[float]:
    """How fast a channel moves in its first frames, where that is a motion and no noise."""
    for count in _FRAMES:
        if count > len(times):
            return
        t, q = times[:count] - times[:count].mean(), values[:count] - values[:count].mean()
        slope = float(t @ q / (t @ t))
        moves = abs(slope) * np.ptp(t)
        if moves > _NOISE * sigma and np.std(q - slope * t) < _STRAIGHT * moves:
            yield slope


def failed_reads(recording: Recording, units: Sequence[str], still: Channels) -> Iterator[str]:
    """Remark on channels that are off their course for one frame, grippers and switches aside.

    The frame is farther off than noise at rest (`still`), a few counts of an encoder, and the steps
    around it.
    """
    t, q, of = recording.times, recording.positions, np.array(units)
    if len(t) < 4 or 2 * recording.period > _THERE_AND_BACK:
        return
    steps, past = np.abs(np.diff(q, axis=0)), q[2:] - q[:-2]
    off = np.abs(q[1:-1] - q[:-2] - ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None] * past)
    counts = np.min(steps, axis=0, where=steps > 0, initial=np.inf)
    for i, kind in enumerate(kinds(recording.names)):
        least = max(still[i], _TIMES * counts[of == of[i]].min())
        alone = (off[:, i] > least) & (np.abs(past[:, i]) < off[:, i] / 2) & (kind != Kind.TOOL)
        for k in np.flatnonzero(alone).tolist():
            beside = [*off[max(k - _AROUND, 0) : max(k - 1, 0), i], *off[k + 2 : k + _AROUND, i]]
            most = max(beside, default=np.inf)
            fastest = max([*steps[max(k - _AROUND, 0) : k, i], *steps[k + 2 : k + _AROUND, i]])
            far = off[k, i] > max(_TIMES * most, fastest)
            if far and (most > 0 or kind is Kind.ANGLE):
                yield (
                    f"{recording.names[i]} is {q[k + 1, i]:.4g} {units[i]} in frame {k + 1} alone "
                    f"({t[k + 1]:.3f} s), between {q[k, i]:.4g} and {q[k + 2, i]:.4g}, as where a "
                    "read failed: write their middle there, or leave that episode out (--leave-out)"
                )


def held_frames(recording: Recording) -> float | None:
    """Return for how many frames each pose is held in mid-motion, None if for one.

    Rounded numbers are held too, but move by single counts.
    """
    arm = [kind is not Kind.TOOL for kind in kinds(recording.names)]
    steps = np.abs(np.diff(recording.positions[:, arm], axis=0))
    new = np.flatnonzero(np.any(steps > 0, axis=1))
    if len(new) < _FEWEST_VALUES:
        return None
    counts = np.min(steps, axis=0, where=steps > 0, initial=np.inf)
    held, leaps = np.diff(new), np.max(steps[new] / counts, axis=1)
    usual = float(np.median(held))
    alike = np.abs(held - usual) <= max(1.0, usual / 4)
    regular = usual > 1 and np.mean(alike) > _MOST and np.median(leaps) > _ACROSS
    return float(np.mean(held[alike])) if regular else None


def stalls(recording: Recording) -> Iterator[tuple[float, float]]:
    """Return when, and for how long, the recorder repeats a frame in mid-motion, in [s].

    An arm that rests slows down before, and does not leap after.
    """
    same = np.all(np.diff(recording.positions, axis=0) == 0, axis=1)
    new = np.flatnonzero(np.append(True, ~same))
    if len(new) < 4:
        return
    t, q = recording.times[new], recording.positions[new]
    waits, steps = np.diff(t), np.abs(np.diff(q, axis=0))
    speeds = steps / waits[:, None]
    slow, fast = (of(speeds[:-2], speeds[2:]) for of in (np.minimum, np.maximum))
    alike = (slow > 0) & (slow < _ALIKE * speeds[1:-1]) & (speeds[1:-1] < _ALIKE * fast)
    leaps = steps[1:-1] > _ACROSS * np.maximum(steps[:-2], steps[2:])
    long = (waits > GAP * np.median(waits)) & (np.diff(new) > 1)
    for i in (np.flatnonzero(long[1:-1] & np.any(alike & leaps, axis=1)) + 1).tolist():
        yield float(t[i]), float(waits[i])

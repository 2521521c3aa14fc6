"""Leaps of numbers that no arm makes: counters that start again, angles that flip by half a turn.

A gripper and a switch step between rests. What moves on after a leap as it moved before has not
leapt: its numbers have, and a plan with them would sweep the whole way back in one frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.recordings.channels import Kind, kinds
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.time_finder import Times
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.signals import noise
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

Values = Float[np.ndarray, " T"]
"""One channel at these times."""


def refuse_leaps(recordings: Iterable[Recording], units: Sequence[str]) -> None:
    """Refuse channels that leap in mid-motion: InvalidDemonstrationsError names both values."""
    for recording in recordings:
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

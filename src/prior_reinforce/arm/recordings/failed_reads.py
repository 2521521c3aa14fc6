"""What a recorder writes where it read nothing: a number of no meaning, or the last frame again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from prior_reinforce.arm.recordings.channels import Kind, kinds
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.plans.speeds import Channels

_TIMES, _AROUND = 10.0, 8
"""A failed read is so many times as far off the line between its neighbours as any of so many
frames before and after. Ours: the peak of a flick of 0.2 s is 7.5 times as far off at 15 Hz."""
_THERE_AND_BACK = 0.14
"""Time in which no arm goes anywhere and comes back, in [s]. Ours."""
_WAITS = 3.0
"""A stall takes more than so many times the usual wait for a new frame. Ours, as of a gap."""
_LEAP, _ALIKE = 2.0, 3.0
"""Across a stall a channel moves by so many times its steps around, and about as fast. Ours."""
_MOST, _FEWEST_VALUES = 0.9, 12
"""Values that are held for about one number of frames, of at least so many. Ours."""


def failed_reads(recording: Recording, units: Sequence[str], still: Channels) -> Iterator[str]:
    """Say which channels are elsewhere for one frame, and before and after it on their course.

    A frame counts if it is farther off than a channel strays at rest (`still`), than a few counts
    of an encoder, and than the channel moves from frame to frame around it. Grippers are left out,
    and switches, which rest before and after.
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
    """Return for how many frames each pose is held while the arm moves, None if for one.

    What is rounded is held too, but moves by its counts; grippers may move by themselves.
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
    regular = usual > 1 and np.mean(alike) > _MOST and np.median(leaps) > _LEAP
    return float(np.mean(held[alike])) if regular else None


def stalls(recording: Recording) -> Iterator[tuple[float, float]]:
    """Return when, and for how long, the recorder repeats a frame while the arm moves on, in [s].

    What dwells slows down before, and does not leap after; what is rounded moves by its counts.
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
    leaps = steps[1:-1] > _LEAP * np.maximum(steps[:-2], steps[2:])
    long = (waits > _WAITS * np.median(waits)) & (np.diff(new) > 1)
    for i in (np.flatnonzero(long[1:-1] & np.any(alike & leaps, axis=1)) + 1).tolist():
        yield float(t[i]), float(waits[i])

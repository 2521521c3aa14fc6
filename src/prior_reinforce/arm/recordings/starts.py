"""Takes that are no throw like the others: they start elsewhere, go another way, or go back."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.recordings.appending import so_far
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.units import listed
from prior_reinforce.arrays import Plans

_APART, _AGAINST = 2.0, 0.5
"""Ranges of its motion by which a channel's starts in two groups of takes may lie apart, and that
where the groups move in opposite directions. Ours: a zero that was moved, columns in another order,
a gripper that counts the other way."""
_LEAST = {"rad": 0.1, "m": 0.02, "percent": 5.0}
"""Range of a channel that moves, by its unit. Ours: what stands still may stand anywhere."""
_WITHIN = 0.2
"""Part of the gap between two groups by which starts within one may differ. Ours."""
_BACK = 0.1
"""Part of its range that a joint may be off where a motion goes back to a start. Ours."""


def odd_starts(
    before: Sequence[Float[np.ndarray, "_ D"]],
    motions: Sequence[Float[np.ndarray, "_ D"]],
    episodes: Sequence[str],
    names: Sequence[str],
    units: Sequence[str],
) -> Iterator[str]:
    """Say which takes start far from the others in a channel, as if they were of another arm.

    Demonstrations that were there `before` count as one group.
    """
    motions, n = [*before, *motions], len(before)
    episodes = [*so_far(n), *episodes]
    if len(motions) < 2:
        return
    starts = np.array([motion[0] for motion in motions])
    ways = np.array([motion[-1] for motion in motions]) - starts
    ranges = np.median([np.ptp(motion, axis=0) for motion in motions], axis=0)
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        order = np.argsort(starts[:, i])
        gaps = np.diff(starts[order, i])
        cut = int(np.argmax(gaps)) + 1
        below, above = order[:cut], order[cut:]
        spread = max(np.ptp(starts[group, i]) for group in (below, above))
        against = np.median(ways[below, i]) * np.median(ways[above, i]) < 0
        allowed = (_AGAINST if against else _APART) * ranges[i]
        moves = ranges[i] > _LEAST.get(unit, 0.0)
        if moves and gaps[cut - 1] > allowed and spread <= _WITHIN * gaps[cut - 1]:
            few, rest = sorted((below, above), key=lambda group: (len(group), max(group)))
            if {*few.tolist()} == {*range(n)}:
                few, rest = rest, few
            here, there = (f"{np.median(starts[group, i]):.3g} {unit}" for group in (few, rest))
            yield (
                f"{name} starts at {here} in {listed([episodes[k] for k in sorted(few)])}, and at "
                f"{there} in the others{', and goes the other way' * bool(against)}: if that is "
                "not meant, its zero, its sign or the order of columns is another"
            )


def ways_back(recordings: Sequence[Recording]) -> str:
    """Say what to do with motions that go back to where the one before began; empty if none do."""
    back = list[str]()
    for before, motion in pairwise(recordings):
        alike = before.positions.shape[1] == motion.positions.shape[1]
        if alike and before.episode not in back and _goes_back(before, motion):
            back.append(motion.episode)
    if not back:
        return ""
    said = f"{listed(back)} go back to where the motion before began: if those are no throws, "
    return f"{said}--leave-out {shlex.join(back)}"


def _goes_back(before: Recording, motion: Recording) -> bool:
    """Whether a motion goes from where the one before it ended to where that began."""
    ranges = np.ptp(np.vstack([before.positions, motion.positions]), axis=0)
    (began, ended), (begins, ends) = (each.positions[[0, -1]] for each in (before, motion))
    there = _is_at(ends, began, ranges) and _is_at(begins, ended, ranges)
    return there and not _is_at(ends, begins, ranges)


def all_return(plans: Plans) -> str:
    """Say it if every motion ends where it began: each may hold a way back; else empty."""
    if not _is_at(plans[:, -1], plans[:, 0], np.ptp(plans, axis=1)):
        return ""
    return (
        "every motion ends where it began: if it rests before it goes back, cut it there "
        "(--rests 0.3), and leave the way back out"
    )


def _is_at(pose: np.ndarray, other: np.ndarray, ranges: np.ndarray) -> bool:
    """Whether every joint is where it is in another pose, but for a part of its range."""
    return bool(np.all(np.abs(pose - other) <= np.maximum(_BACK * ranges, 1e-12)))

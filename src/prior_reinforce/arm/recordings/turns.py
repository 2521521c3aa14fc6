"""Bring recordings whose numbers are a turn, or a sign, apart together (`plans.whole_turns`).

Within an episode, an angle that passes the end of its recorder's range is continued. Across
episodes, starts are brought as near to each other as whole turns can, within the robot's limits.
What cannot be decided is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.arm.recordings.units import is_no_angle, listed
from prior_reinforce.arm.robots.limits import RobotLimits, is_joint, with_turns
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.whole_turns import (
    TURN,
    euler_angles,
    other_euler_angles,
    other_form,
    whole_circles,
)

Channel = Float[np.ndarray, " T"]
"""An angle at T frames."""
Spans = Float[np.ndarray, "N 3"]
"""First, lowest and highest value of an angle in each of N episodes."""
_NEXT = 0.3
"""Of a step across the end of a range, what is left without the turn, in [rad], beside what the
frames around it step. Ours: an encoder's noise, and one lost frame at 10 rad/s and 30 Hz."""
_NORM = 0.05
"""By which the four numbers of a quaternion may miss length 1."""
_SAME = 1e-3
"""The same where only that tells that they are one. Ours: recorders write four digits or more."""
_MOST_TURNS = 3


def aligned(selection: Selection, limits: RobotLimits | None) -> tuple[Selection, PlanFormat]:
    """Return the recordings brought together, and what their channels mean; `dt` is 1 s.

    The robot's joints keep to its limits, where they are known. InvalidDemonstrationsError where it
    cannot be told which way round a joint went, or which of two turns an episode is in.
    """
    form = with_turns(PlanFormat(selection.names, selection.units, 1.0), limits)
    motions = [np.array(recording.positions) for recording in selection.recordings]
    named = tuple(_unit_length(form, motions))
    form = replace(form, attitudes=(*named, *_unnamed_attitudes(form, named, motions)))
    said: list[str] = []
    taken = {name for group in form.attitudes for name in group}
    for group in form.attitudes:
        said += _align_forms(selection, motions, group)
    for angles in euler_angles(form.names, form.units):
        if taken.isdisjoint(angles):
            unit = form.units[form.names.index(angles[0])]
            said += _align_forms(selection, motions, angles, TURN[unit])
    for i, (name, unit) in enumerate(zip(form.names, form.units, strict=True)):
        if unit in TURN and name not in taken and not is_no_angle(name):
            said += _align_angle(selection, motions, i, limits)
    recordings = tuple(
        replace(recording, positions=motion)
        for recording, motion in zip(selection.recordings, motions, strict=True)
    )
    remarks = (*selection.remarks, *said)
    return replace(selection, recordings=recordings, remarks=remarks), form


def _unit_length(form: PlanFormat, motions: Sequence[np.ndarray]) -> Iterator[tuple[str, ...]]:
    """Attitudes, without those called like a quaternion whose numbers have not length 1."""
    for group in form.attitudes:
        columns = [form.names.index(name) for name in group]
        lengths = np.concatenate([np.linalg.norm(m[:, columns], axis=1) for m in motions])
        if len(group) == 3 or np.all(np.abs(lengths - 1) < _NORM):
            yield group


def _unnamed_attitudes(
    form: PlanFormat, named: Sequence[tuple[str, ...]], motions: Sequence[np.ndarray]
) -> Iterator[tuple[str, ...]]:
    """Attitudes whose names do not say so, such as `pose_3` to `pose_6`: their numbers do.

    Four numbers whose length is 1 throughout are a quaternion. Three are a rotation vector where
    some episodes start at one, and others at the same attitude's other form.
    """
    taken = {name for group in named for name in group} | set(form.periodic)
    for size in (4, 3):
        for first in range(len(form.names) - size + 1):
            group, columns = form.names[first : first + size], slice(first, first + size)
            if not taken.isdisjoint(group) or {*form.units[columns]} - {"rad", "1"}:
                continue
            own = [motion[:, columns] for motion in motions]
            if _are_unit_length(own) if size == 4 else _start_at_two_forms(own):
                taken |= set(group)
                yield group


def _are_unit_length(motions: Sequence[np.ndarray]) -> bool:
    """Whether four numbers that move have length 1 throughout, as quaternions do."""
    every = np.concatenate(motions)
    far = np.abs(np.linalg.norm(every, axis=1) - 1).max()
    return bool(np.ptp(every, axis=0).max() > _NEXT / 10 and far < _SAME)


def _start_at_two_forms(motions: Sequence[np.ndarray]) -> bool:
    """Whether some motions start at one rotation vector, and the others at its other form.

    Angles of their own, which lie apart though they are turned, are none.
    """
    starts = np.array([motion[0] for motion in motions])
    off, other = starts - starts[0], other_form(starts) - starts[0]
    turned = off - TURN["rad"] * np.round(off / TURN["rad"])
    near, far, turned = (np.linalg.norm(each, axis=1) for each in (off, other, turned))
    some = np.any((near > 1) & (far < np.minimum(_NEXT, turned / 2)))
    return bool(some and np.all(np.minimum(near, far) < 1))


def _align_forms(
    selection: Selection, motions: Sequence[np.ndarray], group: Sequence[str], turn: float = 0.0
) -> Iterator[str]:
    """Take the form of an attitude that is nearest to the frame, and to the episode, before.

    `turn` is a whole turn of Euler angles; 0 is of quaternions and rotation vectors.
    """
    columns, what = [selection.names.index(name) for name in group], ", ".join(group)
    first, passed, turned = motions[0][0, columns], list[str](), list[str]()
    margin = _NEXT * turn / TURN["rad"]

    def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        step = one - other
        return np.linalg.norm(step - turn * np.round(step / turn) if turn else step, axis=-1)

    for episode, motion in zip(selection.episodes, motions, strict=True):
        own = motion[:, columns]
        forms = np.stack([own, other_euler_angles(own, turn) if turn else other_form(own)])
        which = np.zeros(len(own), dtype=int)
        steps = apart(forms[:, None, 1:], forms[:, :-1])  # of each form now from each before
        for t in range(1, len(own)):
            k = which[t - 1]
            changes = steps[1 - k, k, t - 1] < steps[k, k, t - 1] - margin
            which[t] = 1 - k if changes else k
        if np.any(which):
            passed.append(episode)
        near, far = apart(forms[:, 0], first)
        if far < near - margin:
            which = 1 - which
            turned.append(episode)
        if not turn and abs(far - near) < _NEXT and max(far, near) > 1:
            raise InvalidDemonstrationsError(
                f"episode {episode} starts half a turn from {selection.episodes[0]} in {what}: "
                "which way lies between them cannot be told; leave one out (--leave-out)"
            )
        motion[:, columns] = forms[which, np.arange(len(own))]
    other = "sign" if len(group) == 4 else "numbers of the same turn"
    changed = "change their sign within the motion, which is one attitude"
    taken = f"have the other {other}, and are taken as the same attitude"
    if turn:
        other = "other angles of the same attitude"
        changed = f"change to the {other} within the motion, and are continued"
        taken = "are taken as the same attitude's other angles"
    for episodes, says in ((passed, changed), (turned, taken)):
        if episodes:
            yield f"{listed(episodes)}: {what} {says}"


def _align_angle(
    selection: Selection, motions: Sequence[np.ndarray], channel: int, limits: RobotLimits | None
) -> Iterator[str]:
    name, turn = selection.names[channel], TURN[selection.units[channel]]
    low, high = _range(name, limits)
    whole = whole_circles(selection.names, selection.units)
    passed = list[str]()
    for episode, motion in zip(selection.episodes, motions, strict=True):
        unwrapped = _continued(motion[:, channel], turn)
        if np.any(unwrapped != motion[:, channel]):
            passed.append(episode)
        motion[:, channel] = unwrapped
        step = np.abs(np.diff(unwrapped))
        if (np.isfinite(low) or name in whole) and step.max() > turn / 2:
            raise InvalidDemonstrationsError(
                f"episode {episode}: {name} steps by {step.max():.3g} {selection.units[channel]} "
                f"at frame {int(np.argmax(step)) + 1}, which no joint does in one frame; mend that "
                "frame, or drop that episode (--leave-out)"
            )
    if passed:
        yield f"{listed(passed)}: {name} passes the end of its range, and is continued"
    spans = np.array([[m[0, channel], m[:, channel].min(), m[:, channel].max()] for m in motions])
    shifts = _shifts(spans, turn, low, high)
    if shifts is None:
        raise InvalidDemonstrationsError(
            f"{name} starts all round the circle, from {spans[:, 0].min():.3g} to "
            f"{spans[:, 0].max():.3g} {selection.units[channel]}: which of two turns an episode is "
            "in cannot be told; import those apart that start elsewhere (--leave-out)"
        )
    for shift in sorted(set(shifts.tolist()) - {0}):
        moved = [e for e, k in zip(selection.episodes, shifts, strict=True) if k == shift]
        turns = f"{abs(shift)} turn{'s' * (abs(shift) > 1)} {'higher' if shift > 0 else 'lower'}"
        yield f"{listed(moved)}: {name} is taken {turns}, as the others have it: the same pose"
    for motion, shift in zip(motions, shifts, strict=True):
        motion[:, channel] += shift * turn


def _range(name: str, limits: RobotLimits | None) -> tuple[float, float]:
    """Where a channel may be; anywhere if it is no joint of the robot."""
    if limits is not None:
        for joint, low, high in zip(limits.joint_names, limits.lower, limits.upper, strict=True):
            if is_joint(name, joint):
                return float(low), float(high)
    return -np.inf, np.inf


def _continued(values: Channel, turn: float) -> Channel:
    """An angle without whole turns within one frame; a switch that steps further stays."""
    steps = np.diff(values)
    left = steps - turn * np.round(steps / turn)
    at = np.arange(len(left))
    before, after = at - 1, at + 1
    before[0], after[-1] = min(1, len(left) - 1), max(len(left) - 2, 0)
    # The smaller: one bad frame at the cut makes two large steps, which must not excuse each other.
    around = np.minimum(np.abs(left[before]), np.abs(left[after]))
    wraps = (np.abs(steps) > turn / 2) & (np.abs(left) <= 2 * around + _NEXT * turn / TURN["rad"])
    if not np.any(wraps):
        return values
    turns = np.round(steps / turn) * wraps
    return values - turn * np.concatenate([[0.0], np.cumsum(turns)])


def _shifts(spans: Spans, turn: float, low: float, high: float) -> Int[np.ndarray, " N"] | None:
    """Turns by which each episode is shifted; None where that cannot be told."""
    n, slack = len(spans), 1e-3 * turn
    turns = np.arange(-_MOST_TURNS, _MOST_TURNS + 1)
    fits = (spans[:, 1, None] + turns * turn >= low - slack) & (
        spans[:, 2, None] + turns * turn <= high + slack
    )
    starts = np.sort(np.mod(spans[:, 0], turn))
    gaps = np.diff(np.append(starts, starts[0] + turn))
    cut = starts[(int(np.argmax(gaps)) + 1) % n]  # the first after the widest gap
    base = np.mod(spans[:, 0] - cut, turn) + cut  # within one turn from there
    base = np.where(base - cut > turn - 1e-9, cut, base)
    found = []
    for k in turns:
        shift = np.round((base + k * turn - spans[:, 0]) / turn).astype(int)
        if np.all(np.abs(shift) <= _MOST_TURNS) and np.all(fits[np.arange(n), shift + _MOST_TURNS]):
            middle = abs(float(np.mean(spans[:, 0] + shift * turn)))
            found.append((int(np.count_nonzero(shift)), middle, shift))
    if found:
        best = min(found, key=lambda each: each[:2])[2]
        if not np.any(best) or turn - gaps.max() <= turn / 2:
            return np.asarray(best)
        if np.isinf(high):
            return None
    # Limits part them: each stays, or where it cannot be, is in the only turn in which it can.
    each = np.zeros(n, dtype=int)
    for i in range(n):
        if not fits[i, _MOST_TURNS] and fits[i].any():
            each[i] = min(turns[fits[i]].tolist(), key=abs)
    return each

"""Bring recordings whose numbers are a turn, or a sign, apart together (`plans.whole_turns`).

Within an episode, an angle that passes the end of its recorder's range is continued. Across
episodes, starts are brought as near to each other as whole turns can, within the robot's limits.
What cannot be decided is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.arm.recordings.channels import Kind, kinds
from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.arm.recordings.units import listed
from prior_reinforce.arm.robots.limits import RobotLimits, is_joint, with_turns
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.whole_turns import (
    HALF,
    TURN,
    euler_angles,
    other_euler_forms,
    other_form,
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
_NOISE = 0.02
"""The same of a channel that may be no angle: a magnet's current that is switched off steps by
about a turn too. Ours: an encoder's noise."""
_MOST_TURNS = 3


def aligned(selection: Selection, limits: RobotLimits | None) -> tuple[Selection, PlanFormat]:
    """Return the recordings brought together, and what their channels mean; `dt` is 1 s.

    The robot's joints keep to its limits, where they are known. InvalidDemonstrationsError where it
    cannot be told which way round a joint went, or which of two turns an episode is in.
    """
    form = with_turns(PlanFormat(selection.names, selection.units, 1.0), limits)
    recorded = zip(selection.names, selection.recorded_units, strict=True)
    degrees = {name for name, unit in recorded if unit == "deg"}
    # `rx`, `ry`, `rz` are a rotation vector where they are in radians, and else Euler angles.
    euler = [g for g in euler_angles(form.names, form.units) if degrees.issuperset(g)]
    told = [g for g in form.attitudes if {*g} in map(set, euler)]
    form = replace(form, attitudes=tuple(g for g in form.attitudes if g not in told))
    motions = [np.array(recording.positions) for recording in selection.recordings]
    form = replace(form, attitudes=tuple(_unit_length(form, motions)))
    form, said = align(form, selection.episodes, motions, limits, angles=degrees)
    periodic = dict.fromkeys((*form.periodic, *(name for group in told for name in group)))
    form = replace(form, periodic=tuple(periodic))
    recordings = tuple(
        replace(recording, positions=motion)
        for recording, motion in zip(selection.recordings, motions, strict=True)
    )
    remarks = (*selection.remarks, *said)
    return replace(selection, recordings=recordings, remarks=remarks), form


def align(
    form: PlanFormat,
    episodes: Sequence[str],
    motions: Sequence[np.ndarray],
    limits: RobotLimits | None,
    *,
    angles: Collection[str] = (),
    fixed: int = 0,
) -> tuple[PlanFormat, list[str]]:
    """Bring motions together in place; return their format with all attitudes, and what was done.

    Args:
        form: What their channels mean, with the attitudes that are known.
        episodes: What to call them.
        motions: N of them.
        limits: Of the robot whose joints they move.
        angles: Channels that are known to be angles, whatever their names.
        fixed: How many, the first ones, are in use, and stay as they are: 0 or more.

    Raises:
        InvalidDemonstrationsError: As in `aligned`.
    """
    named = form.attitudes
    form = replace(form, attitudes=(*named, *_unnamed_attitudes(form, named, motions)))
    said: list[str] = []
    taken = {name for group in form.attitudes for name in group}
    for group in form.attitudes:
        said += _align_forms(form, episodes, motions, group)
    joints = {name for name in form.names if np.isfinite(_range(name, limits)[0])}
    euler = [g for g in euler_angles(form.names, form.units) if (taken | joints).isdisjoint(g)]
    own = {name for group in euler for name in group}
    for each in (*euler, *_flipping(form, motions, taken | own | joints)):
        said += _align_forms(
            form, episodes, motions, each, TURN[form.units[form.names.index(each[0])]]
        )
    known = {*angles, *own, *joints}
    of_kind = zip(form.names, form.units, kinds(form.names), strict=True)
    for i, (name, unit, kind) in enumerate(of_kind):
        if unit in TURN and name not in taken and kind is not Kind.TOOL:
            sure = name in known or kind is Kind.ANGLE or not _is_word(name)
            said += _align_angle(form, episodes, motions, i, limits, known=sure, fixed=fixed)
    return form, said


def _is_word(name: str) -> bool:
    """Whether a name is a plain word, which without a unit may be anything: a magnet's current."""
    words = re.findall(r"[^\W\d_]+", name)
    return max(map(len, words), default=0) > 1 and re.search(r"\d", name) is None


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


def _flipping(
    form: PlanFormat, motions: Sequence[np.ndarray], taken: set[str]
) -> Iterator[tuple[str, ...]]:
    """Three angles whose first and last step by half a turn in the same frame, as no joints do."""
    for first in range(len(form.names) - 2):
        group, columns = form.names[first : first + 3], slice(first, first + 3)
        turn = TURN.get(form.units[first])
        if turn is None or {*form.units[columns]} != {form.units[first]}:
            continue
        if not taken.isdisjoint(group) or Kind.TOOL in kinds(group):
            continue
        steps = [np.abs(np.diff(motion[:, columns], axis=0)) % turn for motion in motions]
        half = [np.abs(s[:, [0, 2]] - turn / 2).max(axis=1) < HALF * turn for s in steps]
        if any(map(np.any, half)):
            taken = taken | {*group}
            yield group


@dataclass(frozen=True, eq=False)
class _InForms:
    """Motions in those forms of an attitude that continue each other."""

    frames: list[np.ndarray]
    passed: list[int]
    """Motions that change their form."""
    turned: list[int]
    """Motions that start in another form than the first."""
    near: Channel
    far: Channel
    """How far each starts from the first, as it is and in the other form."""
    leaps: float
    """What is left of steps from frame to frame, and from start to start: their sum."""


def _in_forms(
    motions: Sequence[np.ndarray],
    other: Callable[[np.ndarray], np.ndarray],
    apart: Callable[[np.ndarray, np.ndarray], np.ndarray],
    margin: float,
) -> _InForms:
    """Take the form that is nearest to the frame, and to the motion, before."""
    frames, passed, turned, leaps = [], list[int](), list[int](), 0.0
    starts = []
    for i, own in enumerate(motions):
        forms = np.stack([own, other(own)])
        which = np.zeros(len(own), dtype=int)
        steps = apart(forms[:, None, 1:], forms[:, :-1])  # of each form now from each before
        for t in np.flatnonzero(
            steps.min(axis=(0, 1)) < np.maximum(steps[0, 0], steps[1, 1]) - margin
        ).tolist():
            k = which[t]
            if steps[1 - k, k, t] < steps[k, k, t] - margin:
                which[t + 1 :] = 1 - k
        if np.any(which):
            passed.append(i)
        near, far = apart(forms[:, 0], motions[0][0])
        if far < near - margin:
            which = 1 - which
            turned.append(i)
        starts.append((near, far))
        frames.append(forms[which, np.arange(len(own))])
        leaps += float(apart(frames[-1][1:], frames[-1][:-1]).sum() + min(near, far))
    near, far = np.array(starts).T
    return _InForms(frames, passed, turned, near, far, leaps)


def _align_forms(
    form: PlanFormat,
    episodes: Sequence[str],
    motions: Sequence[np.ndarray],
    group: Sequence[str],
    turn: float = 0.0,
) -> Iterator[str]:
    """Take the form of an attitude that is nearest to the frame, and to the episode, before.

    `turn` is a whole turn of Euler angles; 0 is of quaternions and rotation vectors.
    """
    columns, what = [form.names.index(name) for name in group], ", ".join(group)
    others: Sequence[Callable[[np.ndarray], np.ndarray]] = [other_form]
    if turn:
        others = [partial(other, turn) for other in other_euler_forms(group)]
    margin = _NEXT * (turn or TURN["rad"]) / TURN["rad"]

    def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        step = one - other
        return np.linalg.norm(step - turn * np.round(step / turn) if turn else step, axis=-1)

    own = [motion[:, columns] for motion in motions]
    best = min((_in_forms(own, o, apart, margin) for o in others), key=lambda each: each.leaps)
    for i, episode in enumerate(episodes):
        near, far = best.near[i], best.far[i]
        halfway = not turn and abs(far - near) < _NEXT and max(far, near) > 1
        if halfway or (len(others) > 1 and i in best.turned and far > turn / TURN["rad"]):
            raise InvalidDemonstrationsError(
                f"episode {episode} starts half a turn from {episodes[0]} in {what}: "
                "which way lies between them cannot be told; leave one out (--leave-out)"
            )
    for motion, frames in zip(motions, best.frames, strict=True):
        motion[:, columns] = frames
    sign = "sign" if len(group) == 4 else "numbers of the same turn"
    changed = "change their sign within the motion, which is one attitude"
    taken = f"have the other {sign}, and are taken as the same attitude"
    if turn:
        changed = "change to the other angles of the same attitude within the motion, and are "
        changed += "continued"
        taken = "are taken as the same attitude's other angles"
    for those, says in ((best.passed, changed), (best.turned, taken)):
        if those:
            yield f"{listed([episodes[i] for i in those])}: {what} {says}"


def _align_angle(
    form: PlanFormat,
    episodes: Sequence[str],
    motions: Sequence[np.ndarray],
    channel: int,
    limits: RobotLimits | None,
    *,
    known: bool,
    fixed: int,
) -> Iterator[str]:
    """Continue an angle across the end of its range, and start all episodes in one turn.

    What is not `known` to be an angle is one where it passes the end of a range smoothly.
    """
    name, unit = form.names[channel], form.units[channel]
    turn, (low, high) = TURN[unit], _range(name, limits)
    left = (_NEXT if known else _NOISE) * turn / TURN["rad"]
    passed = list[str]()
    for episode, motion in zip(episodes, motions, strict=True):
        unwrapped = _continued(motion[:, channel], turn, left)
        if np.any(unwrapped != motion[:, channel]):
            passed.append(episode)
        motion[:, channel] = unwrapped
        step = np.abs(np.diff(unwrapped))
        if (np.isfinite(low) or name in form.periodic) and step.max() > turn / 2:
            raise InvalidDemonstrationsError(
                f"episode {episode}: {name} steps by {step.max():.3g} {unit} "
                f"at frame {int(np.argmax(step)) + 1}, which no joint does in one frame; mend that "
                "frame, or drop that episode (--leave-out)"
            )
    if passed:
        yield f"{listed(passed)}: {name} passes the end of its range, and is continued"
    elif not known:
        return
    spans = np.array([[m[0, channel], m[:, channel].min(), m[:, channel].max()] for m in motions])
    shifts = _shifts(spans, turn, low, high, fixed)
    if shifts is None:
        raise InvalidDemonstrationsError(
            f"{name} starts all round the circle, from {spans[:, 0].min():.3g} to "
            f"{spans[:, 0].max():.3g} {unit}: which of two turns an episode is "
            "in cannot be told; import those apart that start elsewhere (--leave-out)"
        )
    for shift in sorted(set(shifts.tolist()) - {0}):
        moved = [e for e, k in zip(episodes, shifts, strict=True) if k == shift]
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


def _continued(values: Channel, turn: float, beside: float) -> Channel:
    """An angle without whole turns within one frame; a switch that steps further stays.

    Without the turn, a step is at most `beside` more than what the frames around it step.
    """
    steps = np.diff(values)
    left = steps - turn * np.round(steps / turn)
    at = np.arange(len(left))
    before, after = at - 1, at + 1
    before[0], after[-1] = min(1, len(left) - 1), max(len(left) - 2, 0)
    # The smaller: one bad frame at the cut makes two large steps, which must not excuse each other.
    around = np.minimum(np.abs(left[before]), np.abs(left[after]))
    wraps = (np.abs(steps) > turn / 2) & (np.abs(left) <= 2 * around + beside)
    if not np.any(wraps):
        return values
    turns = np.round(steps / turn) * wraps
    return values - turn * np.concatenate([[0.0], np.cumsum(turns)])


def _shifts(
    spans: Spans, turn: float, low: float, high: float, fixed: int
) -> Int[np.ndarray, " N"] | None:
    """Turns by which each episode is shifted, the `fixed` first by none; None if undecided."""
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
        few = np.all(np.abs(shift) <= _MOST_TURNS) and not np.any(shift[:fixed])
        if few and np.all(fits[np.arange(n), shift + _MOST_TURNS]):
            middle = abs(float(np.mean(spans[:, 0] + shift * turn)))
            found.append((int(np.count_nonzero(shift)), middle, shift))
    if found:
        best = min(found, key=lambda each: each[:2])[2]
        if not np.any(best) or turn - gaps.max() <= turn / 2:
            return np.asarray(best)
    if (found or fixed) and np.isinf(high):
        return None
    # Limits part them: each stays, or where it cannot be, is in the only turn in which it can.
    each = np.zeros(n, dtype=int)
    for i in range(n):
        if not fits[i, _MOST_TURNS] and fits[i].any():
            each[i] = min(turns[fits[i]].tolist(), key=abs)
    return each

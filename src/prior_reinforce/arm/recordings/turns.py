"""Align recordings of one pose whose numbers differ by whole turns or signs (`plans.whole_turns`).

Within an episode, an angle that wraps at the end of its range is continued. Across episodes, whole
turns bring starts together, within the robot's limits; what cannot be decided is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.arm.recordings.takes import names_in_use
from prior_reinforce.arm.robots.limits import RobotLimits, joint_of, with_turns
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.channels import Kind, kinds, zero_at_rest
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.whole_turns import (
    HALF,
    TURN,
    euler_angles,
    is_of_a_limb,
    leap_alone,
    other_euler_forms,
    other_form,
)
from prior_reinforce.units import without_number
from prior_reinforce.wording import listed

Channel = Float[np.ndarray, " T"]
"""An angle at T frames."""
Spans = Float[np.ndarray, "N 3"]
"""First, lowest and highest value of an angle in each of N episodes."""
_NEXT = 0.3
"""Step across the end of a range, without the turn, beyond the steps around it, in [rad]. Ours: an
encoder's noise, and one lost frame at 10 rad/s and 30 Hz."""
_NORM = 0.05
"""By which the four numbers of a quaternion may miss length 1."""
_SAME = 1e-3
"""The same where only that tells that they are one. Ours: recorders write four digits or more."""
_OF_VECTORS = {"rad", "1"}
"""Units that the numbers of an attitude without names may be in."""
_STILL = 0.03
"""By less, no number of a quaternion moves. Ours."""
_NOISE = 0.02
"""The same of a channel that may be no angle: a magnet's current that is switched off steps by
about a turn too. Ours: an encoder's noise."""
_JOINTS = 4
"""Joints none of which goes below 0 by chance. Ours."""
_WIDEST = 2
"""Turns of a recorder's range at most. Ours: joints turn one turn either way."""
_MOST_TURNS = 12
"""By which an episode is shifted at most. Ours."""
_Form = Callable[[np.ndarray], np.ndarray]
"""From attitudes (..., 3) or (..., 4) to other numbers of the same."""
_Apart = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""How far two attitudes are apart, as they are written."""


def aligned(
    selection: Selection, limits: RobotLimits | None, before: Demonstrations | None = None
) -> tuple[Selection, PlanFormat]:
    """Return the aligned recordings, and the meaning of their channels; `dt` is 1 s.

    Joints keep to the robot's limits, and recordings to the turns and signs of demonstrations in
    use `before`. InvalidDemonstrationsError if it cannot be told which way round a joint went.
    """
    shown = () if before is None else before.plans
    episodes = [*names_in_use(len(shown)), *selection.episodes]
    motions = [*np.array(shown), *(np.array(each.positions) for each in selection.recordings)]
    form = with_turns(PlanFormat(selection.names, selection.units, 1.0), limits)
    recorded = zip(selection.names, selection.recorded_units, strict=True)
    degrees = {name for name, unit in recorded if without_number(unit)[0] == "deg"}
    # `rx`, `ry`, `rz` are a rotation vector where they are in radians, and else Euler angles.
    euler = [{*group} for group in euler_angles(form.names, form.units)]
    told, kept = [], []
    for group in form.attitudes:
        own = [motion[:, [form.names.index(name) for name in group]] for motion in motions]
        if {*group} in euler and (degrees.issuperset(group) or leap_alone(own)):
            told.append(group)
        if len(group) == 4:
            _check_length(group, own)
        if group not in told and (len(group) == 3 or _off_length_1(own) < _NORM):
            kept.append(group)
    form = replace(form, attitudes=tuple(kept))
    if before is not None:
        form = replace(before.format, dt=1.0)
    none = [n for n, kind in zip(form.names, kinds(form.names), strict=True) if kind is Kind.TOOL]
    none += [form.names[i] for i in zero_at_rest(form.names, form.units)]
    for size, are in ((4, _are_quaternions), (3, _take_two_forms)):
        taken = {*form.periodic, *chain(*form.attitudes), *none}
        unnamed = _consecutive(form, motions, size, taken, are)
        form = replace(form, attitudes=(*form.attitudes, *unnamed))
    said = list(_Together(form, episodes, motions, limits, len(shown)).align(degrees))
    new = motions[len(shown) :]
    if before is not None:
        _check_in_use(before, motions[: len(shown)], new, said)
    told = [group for group in told if group not in form.attitudes]  # of those before
    form = replace(form, periodic=tuple(dict.fromkeys((*form.periodic, *chain(*told)))))
    recordings = tuple(
        replace(recording, positions=motion)
        for recording, motion in zip(selection.recordings, new, strict=True)
    )
    remarks = (*selection.remarks, *said)
    return replace(selection, recordings=recordings, remarks=remarks), form


def _check_in_use(
    before: Demonstrations,
    theirs: Sequence[np.ndarray],
    new: Sequence[np.ndarray],
    said: Sequence[str],
) -> None:
    """Refuse new motions beside which those in use would be others, or that start a turn away."""
    if any(np.any(motion != plan) for motion, plan in zip(theirs, before.plans, strict=True)):
        raise InvalidDemonstrationsError(
            f"with the new demonstrations, those so far are other turns or signs of the same poses "
            f"({'; '.join(said)}); import all together"
        )
    form = before.format
    apart = np.median([m[0] for m in new], axis=0) - np.median(before.plans[:, 0], axis=0)
    for name, unit, by in zip(form.names, form.units, apart.tolist(), strict=True):
        if unit in TURN and abs(by) > 0.9 * TURN[unit]:
            raise InvalidDemonstrationsError(
                f"{name} of the new demonstrations starts {by:.3g} {unit} from where it did so "
                "far, about a turn; import all together"
            )


def _is_word(name: str) -> bool:
    """Whether a name is a plain word, which without a unit may be anything: a magnet's current."""
    words = re.findall(r"[^\W\d_]+", name)
    return max(map(len, words), default=0) > 1 and re.search(r"\d", name) is None


def _consecutive(
    form: PlanFormat,
    motions: Sequence[np.ndarray],
    size: int,
    taken: set[str],
    are: Callable[[Sequence[np.ndarray], set[str]], bool],
) -> list[tuple[str, ...]]:
    """Return adjacent channels, `pose_3` to `pose_6`, that `are` one attitude and not yet `taken`.

    The last first, as an attitude stands behind its place.
    """
    found, taken = [], {*taken}
    for first in reversed(range(len(form.names) - size + 1)):
        columns = slice(first, first + size)
        group, own = form.names[columns], [motion[:, columns] for motion in motions]
        if taken.isdisjoint(group) and are(own, {*form.units[columns]}):
            taken |= {*group}
            found.append(group)
    return found[::-1]


def _check_length(group: Sequence[str], motions: Sequence[np.ndarray]) -> None:
    """Refuse four numbers called like a quaternion whose length is one number, and not 1."""
    lengths = np.concatenate([np.linalg.norm(motion, axis=1) for motion in motions])
    length = float(np.median(lengths))
    if abs(length - 1) > _NORM and np.ptp(lengths) < _NORM * length:
        raise InvalidDemonstrationsError(
            f"{', '.join(group)} have length {length:.6g}, and a quaternion's is 1: divide them by "
            "it where they are recorded"
        )


def _off_length_1(motions: Sequence[np.ndarray]) -> float:
    return max(float(np.abs(np.linalg.norm(motion, axis=1) - 1).max()) for motion in motions)


def _are_quaternions(motions: Sequence[np.ndarray], units: set[str]) -> bool:
    """Whether four numbers that move have length 1 throughout."""
    moves = np.ptp(np.concatenate(motions), axis=0).max() > _STILL
    return bool(units <= _OF_VECTORS and moves and _off_length_1(motions) < _SAME)


def _take_two_forms(motions: Sequence[np.ndarray], units: set[str]) -> bool:
    """Whether rotation vectors go from one form to the other within a motion, or between starts."""
    starts = np.array([motion[0] for motion in motions])
    pairs = [(starts, starts[:1]), *((motion[1:], motion[:-1]) for motion in motions)]
    return units <= _OF_VECTORS and any(_are_two_forms(*pair) for pair in pairs)


def _are_two_forms(vectors: np.ndarray, others: np.ndarray) -> bool:
    """Whether some rotation vectors are near others only in their other form, the rest as is."""
    off, other = vectors - others, other_form(vectors) - others
    turned = off - TURN["rad"] * np.round(off / TURN["rad"])
    near, far, turned = (np.linalg.norm(each, axis=1) for each in (off, other, turned))
    some = np.any((near > 1) & (far < np.minimum(_NEXT, turned / 2)))
    return bool(some and np.all(np.minimum(near, far) < 1))


def _flip(motions: Sequence[np.ndarray], units: set[str]) -> bool:
    """Whether the first and last of three angles step by half a turn at once, as no joints do."""
    turn = TURN.get(next(iter(units)))
    if turn is None or len(units) > 1:
        return False
    steps = [np.abs(np.diff(motion[:, [0, 2]], axis=0)) % turn for motion in motions]
    return any(bool(np.any(np.abs(s - turn / 2).max(axis=1) < HALF * turn)) for s in steps)


class _InForms(NamedTuple):
    """A motion in those forms of an attitude that continue each other, from the first one's on."""

    frames: np.ndarray
    changes: bool
    """Whether it was in several forms."""
    turned: bool
    """Whether it starts in another form than the first motion."""
    near: float
    far: float
    """How far it starts from the first motion, as it is and in the other form."""
    leaps: float
    """Sum of its steps from frame to frame, and of that from the first motion's start."""


def _in_forms(
    own: np.ndarray, start: np.ndarray, other: _Form, apart: _Apart, margin: float
) -> _InForms:
    """Take the form that is nearer than the other, by a margin, to the frame before."""
    forms = np.stack([own, other(own)])
    which = np.zeros(len(own), dtype=int)
    steps = apart(forms[:, None, 1:], forms[:, :-1])  # of each form now from each before
    switches = steps.min(axis=(0, 1)) < np.maximum(steps[0, 0], steps[1, 1]) - margin
    for t in np.flatnonzero(switches).tolist():
        k = which[t]
        if steps[1 - k, k, t] < steps[k, k, t] - margin:
            which[t + 1 :] = 1 - k
    near, far = apart(forms[:, 0], start)
    turned = bool(far < near - margin)
    frames = forms[1 - which if turned else which, np.arange(len(own))]
    leaps = float(apart(frames[1:], frames[:-1]).sum() + min(near, far))
    return _InForms(frames, bool(np.any(which)), turned, near, far, leaps)


@dataclass(frozen=True, eq=False)
class _Together:
    """Motions that are brought together in place; each method says what it does to them."""

    form: PlanFormat
    episodes: Sequence[str]
    motions: Sequence[np.ndarray]
    limits: RobotLimits | None
    fixed: int
    """How many motions, the first ones, are in use, and stay as they are."""

    def align(self, angles: Collection[str]) -> Iterator[str]:
        """Bring attitudes and angles together; `angles` are known to be, whatever their names."""
        form = self.form
        attitudes = {*chain(*form.attitudes)}
        joints = {name for name in form.names if np.isfinite(_range(name, self.limits)[0])}
        every = euler_angles(form.names, form.units)
        named = [group for group in every if (attitudes | joints).isdisjoint(group)]
        euler, of_kind = {*chain(*named)}, dict(zip(form.names, kinds(form.names), strict=True))
        tools = {name for name, kind in of_kind.items() if kind is Kind.TOOL}
        taken = attitudes | joints | euler | tools
        for group in form.attitudes:
            yield from self.take_forms(group)
        for group in (*named, *_consecutive(form, self.motions, 3, taken, _flip)):
            yield from self.take_forms(group, TURN[form.units[form.names.index(group[0])]])
        turning = {
            i: name in {*angles, *euler, *joints}
            or of_kind[name] is Kind.ANGLE
            or not _is_word(name)
            for i, (name, unit) in enumerate(zip(form.names, form.units, strict=True))
            if unit in TURN and name not in attitudes | tools
        }
        is_arm = len(turning) >= _JOINTS
        upwards = is_arm and all(np.all(motion[:, [*turning]] >= 0) for motion in self.motions)
        for i, known in turning.items():
            yield from self.take_turns(
                i, known=known, circle=form.names[i] in joints or not is_of_a_limb(form.names[i])
            )
        starts = {i: min(motion[0, i] for motion in self.motions) for i in turning}
        high = [i for i, start in starts.items() if start > TURN[form.units[i]] / 2]
        if upwards and high:
            each = ", ".join(f"{form.names[i]} {starts[i]:.3g} {form.units[i]}" for i in high)
            what = f"{each} may be a turn too high for the arm's controller"
            yield f"no joint goes below 0, as where angles count from 0 to 360 deg: {what}"

    def take_forms(self, group: Sequence[str], turn: float = 0.0) -> Iterator[str]:
        """Write an attitude in the form nearest to the frame before, and to the first episode.

        `turn` is a whole turn of Euler angles; 0 of quaternions and rotation vectors.
        """
        columns, what = [self.form.names.index(name) for name in group], ", ".join(group)
        others: Sequence[_Form] = [other_form]
        if turn:
            others = [partial(other, turn) for other in other_euler_forms(group)]
        margin = _NEXT * (turn or TURN["rad"]) / TURN["rad"]

        def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
            step = one - other
            return np.linalg.norm(step - turn * np.round(step / turn) if turn else step, axis=-1)

        own = [motion[:, columns] for motion in self.motions]
        tried = [[_in_forms(o, own[0][0], other, apart, margin) for o in own] for other in others]
        best = min(tried, key=lambda each: sum(one.leaps for one in each))
        for episode, motion, one in zip(self.episodes, self.motions, best, strict=True):
            middle = abs(one.far - one.near) < _NEXT and max(one.far, one.near) > 1
            either = len(others) > 1 and one.turned and one.far > turn / TURN["rad"]
            if either or (middle and not turn):
                raise InvalidDemonstrationsError(
                    f"episode {episode} starts half a turn from {self.episodes[0]} in {what}: "
                    "which way lies between them cannot be told; leave one out (--leave-out)"
                )
            motion[:, columns] = one.frames
        changed = "change their sign within the motion, which is one attitude"
        sign = "sign" if len(group) == 4 else "numbers of the same turn"
        taken = f"have the other {sign}, and are taken as the same attitude"
        if turn:
            changed = "change to the other angles of the same attitude within the motion, and are "
            changed += "continued"
            taken = "are taken as the same attitude's other angles"
        changing = [e for e, one in zip(self.episodes, best, strict=True) if one.changes]
        turned = [e for e, one in zip(self.episodes, best, strict=True) if one.turned]
        for those, says in ((changing, changed), (turned, taken)):
            if those:
                yield f"{listed(those)}: {what} {says}"

    def take_turns(self, channel: int, *, known: bool, circle: bool) -> Iterator[str]:
        """Continue an angle across the end of its range, and start all episodes in one turn.

        A channel that is not `known` to be an angle is one if it wraps smoothly. One that is no
        `circle` may have stops, so its turn is kept, unless starts are over a turn apart.
        """
        name, unit = self.form.names[channel], self.form.units[channel]
        limits = _range(name, self.limits)
        turn, own = TURN[unit], [motion[:, channel] for motion in self.motions]
        left = (_NEXT if known else _NOISE) * turn / TURN["rad"]
        passed = list[str]()
        for episode, values in zip(self.episodes, own, strict=True):
            unwrapped = _continued(values, turn, left)
            if np.any(unwrapped != values):
                passed.append(episode)
            values[:] = unwrapped
            step = np.abs(np.diff(values))
            stopped = np.isfinite(limits[0]) or name in self.form.periodic
            if stopped and step.max() > turn / 2:
                raise InvalidDemonstrationsError(
                    f"episode {episode}: {name} steps by {step.max():.3g} {unit} at frame "
                    f"{int(np.argmax(step)) + 1}, which no joint does in one frame; mend that "
                    "frame, or drop that episode (--leave-out)"
                )
        if passed:
            yield f"{listed(passed)}: {name} passes the end of its range, and is continued"
        spans = np.array([[values[0], values.min(), values.max()] for values in own])
        if not passed and not (known and (circle or np.ptp(spans[:, 0]) > turn)):
            return
        shifts = _shifts(spans, turn, *limits, self.fixed)
        if shifts is None:
            raise InvalidDemonstrationsError(
                f"{name} starts all round the circle, from {spans[:, 0].min():.3g} to "
                f"{spans[:, 0].max():.3g} {unit}: which of two turns an episode is "
                "in cannot be told; import those apart that start elsewhere (--leave-out)"
            )
        for shift in sorted({*shifts.tolist()} - {0}):
            moved = [e for e, k in zip(self.episodes, shifts, strict=True) if k == shift]
            turns = f"{abs(shift)} turn{'s' * (abs(shift) > 1)}"
            turns += " higher" if shift > 0 else " lower"
            yield f"{listed(moved)}: {name} is taken {turns}, as the others have it: the same pose"
        for values, shift in zip(own, shifts, strict=True):
            values += shift * turn


def _range(name: str, limits: RobotLimits | None) -> tuple[float, float]:
    """Where a channel may be; anywhere if it is no joint of the robot."""
    joint = None if limits is None else joint_of(name, limits.joint_names)
    if limits is None or joint is None:
        return -np.inf, np.inf
    return float(limits.lower[joint]), float(limits.upper[joint])


def _continued(values: Channel, turn: float, beside: float) -> Channel:
    """Return an angle without whole turns from frame to frame; a switch that steps further stays.

    Without the turn, a step is at most `beside` more than the steps around it.
    """
    steps = np.diff(values)
    left = steps - turn * np.round(steps / turn)
    at = np.arange(len(left))
    before, after = at - 1, at + 1
    before[0], after[-1] = min(1, len(left) - 1), max(len(left) - 2, 0)
    # The smaller: one bad frame at the cut makes two large steps, which must not excuse each other.
    around = np.minimum(np.abs(left[before]), np.abs(left[after]))
    wraps = (np.abs(steps) > turn / 2) & (np.abs(left) <= 2 * around + beside)
    wraps &= np.abs(steps) < (_WIDEST + 0.5) * turn  # -999 is none
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

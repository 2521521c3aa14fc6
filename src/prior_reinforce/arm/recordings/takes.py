"""Find takes that differ from the others: in units, numbers, times, starts or ends.

A take that may be in another unit is asked about, never converted by what another take states.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.recordings.judging import Belief
from prior_reinforce.arm.recordings.preprocessing import at_rests
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.units import Ambiguity, judge_unit, known_unit, say_names
from prior_reinforce.arrays import Plans
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.channels import Kind, kinds, zero_at_rest
from prior_reinforce.plans.speeds import SMOOTHING, largest_of_unit, velocity_profiles
from prior_reinforce.plans.whole_turns import TURN
from prior_reinforce.units import base_of, factor, spelt, without_number
from prior_reinforce.wording import listed

APART: Mapping[str, Sequence[float]] = {"rad": (TURN["deg"] / TURN["rad"],), "m": (100.0, 1000.0)}
"""How many times larger numbers get by the next unit: rad to deg, m to cm and mm."""
_ALIKE = 1.5
"""How many times takes of one task may differ. Ours."""
_FAR_APART = 20.0
"""Times apart from which two plausible units are two. Ours."""
_STARTS_APART, _AGAINST = 2.0, 0.5
"""Ranges of motion by which starts in two groups of takes may differ, and the same if the groups
move in opposite directions. Ours: a shifted zero, columns in another order, a reversed gripper."""
_LEAST = {"rad": 0.1, "m": 0.02, "percent": 5.0}
"""Least range of a moving channel, by its unit. Ours."""
_WITHIN = 0.2
"""Part of the gap between two groups by which starts within one may differ. Ours."""
_BACK = 0.1
"""Part of its range that a joint may be off where a motion goes back to a start. Ours."""

_AT_ZERO = 0.02
"""Part of its largest number at which a column is 0. Ours."""
_OF_INCREMENTS = {
    n: ("dx", "dy", "dz", *("drx", "dry", "drz")[: 3 * (n > 5)], *("gripper",) * (n in (4, 7)))
    for n in (3, 4, 6, 7)
}
"""What increments of a tool's pose are called, by how many there are."""

_REST, _MOST_MOTIONS = 0.5, 3
"""Rest in [s] after which another throw may begin, and motions of one throw: there and back, with a
pause. Ours."""
_OWN = 0.2
"""Part of the recording's largest range that a motion of its own has; ours: bumps have less."""
_AS_FAST = 0.95
"""Part of the greatest speed from which two motions are equally fast. Ours."""


def in_one_unit(
    recordings: Sequence[Recording], names: Sequence[str], given: Sequence[str | None]
) -> tuple[list[Recording], list[str | None], list[str], list[Ambiguity]]:
    """Bring each channel into the given unit, else into that of the first file stating one.

    Returns the converted takes, the channels' units, remarks on channels in several units, and
    doubts about those of which only some files state a unit. ConfigurationError if a file states
    another unit than the given one; InvalidDemonstrationsError if two units cannot be converted.
    """
    scale, units = np.ones((len(recordings), len(names))), list[str | None]()
    remarks, doubts = list[str](), []
    renamed: dict[tuple[str, str, str], list[str]] = {}
    for i, (name, unit) in enumerate(zip(names, given, strict=True)):
        takes: dict[str, list[Recording]] = {}
        for recording in recordings:
            takes.setdefault(recording.units[i] or "", []).append(recording)
        silent = takes.pop("", [])
        where = {stated: _episodes(of_unit) for stated, of_unit in takes.items()}
        first = next(iter(takes), None)
        asked = unit and (known_unit(unit) or unit)
        units.append(asked or first)
        for stated, of_unit in takes.items():
            by = factor(stated, asked or str(first))
            of_one, number = without_number(asked or "")
            may_rename = number != 1 or not spelt(without_number(stated)[0])
            if asked is not None and by is None and may_rename and spelt(of_one):
                by = 1.0  # `Grad`, which is no listed unit; or m, of which one is 1250 percent
                renamed.setdefault((stated, where[stated], asked), []).append(name)
            elif asked not in (None, stated):
                raise ConfigurationError(
                    f"{of_unit[0].columns[i]} of episode {of_unit[0].episode} is in {stated}, but "
                    f"--units says {asked}; correct or drop it"
                )
            if by is None:
                raise InvalidDemonstrationsError(
                    f"{name} is in {first} in {where[str(first)]}, but in {stated} in "
                    f"{where[stated]}; correct what is wrong, or leave it out (--leave-out)"
                )
            scale[[r.units[i] == stated for r in recordings], i] = by
        each = ", ".join(f"in {stated} in {episodes}" for stated, episodes in where.items())
        if len(takes) > 1:
            remarks.append(f"{name} is {each}, as they state: each is converted")
        if takes and silent:
            stating = [*chain(*takes.values())]
            here, there = (
                max(np.abs(r.positions[:, i]).max() for r in of) for of in (silent, stating)
            )
            what = (
                f"{name} is {each} (up to {there:.4g}), and {_episodes(silent)} states no unit (up "
                f"to {here:.4g}): state it there, or leave out"
            )
            doubts.append(_without(what, [r.episode for r in min(silent, stating, key=len)]))
    converted = [
        replace(r, positions=r.positions * by) if np.any(by != 1) else r
        for r, by in zip(recordings, scale, strict=True)
    ]
    as_asked = [
        f"{say_names(channels)} recorded in {stated} in {episodes}, taken for {asked}, as said"
        for (stated, episodes, asked), channels in renamed.items()
    ]
    return converted, units, [*as_asked, *remarks], doubts


def _episodes(recordings: Sequence[Recording]) -> str:
    return say_names([recording.episode for recording in recordings])


def odd_takes(beliefs: Sequence[Belief]) -> tuple[set[str], list[Ambiguity]]:
    """Return takes whose numbers, angles or lengths or a gripper's, look like another unit; why."""
    groups: list[tuple[str, list[Belief]]] = [
        (unit, [b for b in beliefs if b.kind is not Kind.TOOL and base_of(b.unit)[0] == unit])
        for unit in APART
    ]
    groups += [("", [one]) for one in beliefs if one.kind is Kind.TOOL]
    found: dict[tuple[str, ...], list[str]] = {}
    for unit, group in groups:
        if not group:
            continue
        most = {take: max(one.reach[take] for one in group) for take in group[0].reach}
        odd = apart_from_most(most, unit)
        if odd:
            usual = max(number for take, number in most.items() if take not in odd)
            worst = max(odd, key=lambda take: most[take])
            name = next(one.name for one in group if one.reach[worst] == most[worst])
            apart = max(most[worst] / usual, usual / most[worst])
            found.setdefault(odd, []).append(
                f"{name} of {worst} reaches {most[worst]:.4g}, and of the others {usual:.4g} at "
                f"most, {apart:.3g} times apart"
            )
    doubts = [
        _without(
            f"{'; '.join(whats)}: {say_names(episodes)} may be in another unit; convert what is, "
            "or leave it out",
            episodes,
        )
        for episodes, whats in found.items()
    ]
    return {name for episodes in found for name in episodes}, doubts


def apart_from_most(reach: Mapping[str, float], unit: str) -> tuple[str, ...]:
    """Return the takes whose largest number is as far from most others' as two units are.

    Numbers are angles in `rad`, lengths in `m`, or a gripper's without a unit.
    """
    middle = sorted(reach.values())[(len(reach) - 1) // 2]
    odd = []
    for take, number in reach.items():
        if min(number, middle) <= 0:
            continue
        apart = max(number / middle, middle / number)
        looks, usual = (judge_unit(unit, n) if unit else str(n <= 1) for n in (number, middle))
        between = any(f / _ALIKE <= apart <= f * _ALIKE for f in APART.get(unit, ()))
        if between or (looks != usual and apart >= _FAR_APART):
            odd.append(take)
    return tuple(odd)


def ambiguities_of_times(recordings: Sequence[Recording]) -> list[Ambiguity]:
    """Return what is only guessed of the times, one doubt for each option.

    If only some takes are in another unit, no option holds for all: the fewer are to be left out.
    """
    found = {one.option: one for r in reversed(recordings) for one in r.ambiguities}
    for option, doubt in list(found.items()):
        asked = [r.episode for r in recordings if option in [one.option for one in r.ambiguities]]
        others = [r.episode for r in recordings if r.episode not in asked]
        if not option.startswith("--time-unit") or not others:
            continue
        what = (
            f"{say_names(asked)}: {doubt.what}, but {say_names(others)} would not be in that "
            "unit: convert what is in another one than the rest, or leave it out"
        )
        fewer = min(asked, others, key=len)
        if fewer is asked:
            del found[option]
        alone = _without(what, fewer)
        found[alone.option] = alone
    return list(found.values())


def _without(what: str, episodes: Sequence[str]) -> Ambiguity:
    """Return a doubt that is settled by leaving out some takes."""
    return Ambiguity(what, f"--leave-out {shlex.join(episodes)}", guessed=False)


def names_in_use(n: int) -> list[str]:
    """Return what to call the demonstrations in use."""
    return [f"demonstration {i} so far" for i in range(n)]


def odd_starts(
    before: Sequence[Float[np.ndarray, "_ D"]],
    motions: Sequence[Float[np.ndarray, "_ D"]],
    episodes: Sequence[str],
    names: Sequence[str],
    units: Sequence[str],
) -> Iterator[str]:
    """Remark on takes that start far from the others; `before` are demonstrations in use."""
    motions, n = [*before, *motions], len(before)
    episodes = [*names_in_use(n), *episodes]
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
        allowed = (_AGAINST if against else _STARTS_APART) * ranges[i]
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


def ways_back(recordings: Sequence[Recording], among: Collection[str] | None = None) -> str:
    """Advise to leave out motions, `among` some, that return to where the last one began."""
    back = list[str]()
    for before, motion in pairwise(recordings):
        alike = before.positions.shape[1] == motion.positions.shape[1]
        alike = alike and (among is None or motion.episode in among)
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
    """Remark if every motion ends where it began, as with a way back; else empty."""
    if not _is_at(plans[:, -1], plans[:, 0], np.ptp(plans, axis=1)):
        return ""
    return (
        "every motion ends where it began: if it rests before it goes back, cut it there "
        "(--rests 0.3), and leave the way back out; if its numbers are increments, from frame to "
        "frame, call them dx, dy, dyaw, delta_joint1, ... (new --action-names)"
    )


def ask_about_several_throws(recording: Recording) -> tuple[Ambiguity, ...]:
    """Ask whether a recording of many motions is several throws."""
    count = len(at_rests(recording, _REST))
    what = (
        f"{recording.episode} holds {count} motions with rests of {_REST:g} s or more between: it "
        "looks like several throws (if it is one: --rests 0)"
    )
    return (Ambiguity(what, f"--rests {_REST:g}"),) * (count > _MOST_MOTIONS)


def ask_about_increments(
    recordings: Sequence[Recording], keys: Sequence[str]
) -> tuple[Ambiguity, ...]:
    """Ask whether actions are increments of a tool's pose: all but a gripper rest at 0.

    robomimic, LIBERO, ManiSkill and Open-X call increments `actions` or `action`.
    """
    names = recordings[0].columns
    told = {*zero_at_rest(names, recordings[0].units)}
    each = np.array([np.abs(r.positions[[0, -1]]).max(axis=0) for r in recordings])
    largest = np.array([np.abs(r.positions).max(axis=0) for r in recordings]).max(axis=0)
    at_zero = np.all(each <= _AT_ZERO * largest, axis=0)
    moving = at_zero & (largest > 0)
    called = any(re.search(r"(^|[^a-z])actions?($|[^a-z])", key) for key in (*keys, *names))
    few = np.count_nonzero(moving) < 2 or np.count_nonzero(~at_zero) > 1
    are = {*kinds(names)}
    joints = bool(are & {Kind.ANGLE, Kind.SLIDE}) and Kind.PLACE not in are
    joints |= any(name.endswith(".pos") for name in names)  # as LeRobot calls them
    if told or few or joints or not called or len(names) not in _OF_INCREMENTS:
        return ()
    new = _OF_INCREMENTS[len(names)]
    units = shlex.join([kind.usual_unit(1.0) for kind in kinds(new)])
    what = (
        f"{say_names(names)} are 0 at both ends of every motion, as increments from frame to frame "
        "are: if these are some, make the workspace anew (prior-reinforce new WORKSPACE --robot "
        f"none --action-names {shlex.join(new)} --action-units {units}) and import with --joints "
        f"{shlex.join(names)} (where -1 to 1 is a controller's largest step, such as 5 cm, "
        "with --units '0.05 m' ...); if they are positions, import here"
    )
    return (Ambiguity(what, f"--joints {shlex.join(names)}", guessed=False),)


def pauses(recordings: Sequence[Recording]) -> Iterator[str]:
    """Remark if every recording rests between motions, of which the fastest is likely the throw."""
    throws, others = list[str](), list[str]()
    for recording in recordings:
        q, units = recording.positions, [unit or "rad" for unit in recording.units]
        least, parts = _OWN * largest_of_unit(np.ptp(q, axis=0), units), at_rests(recording, _REST)
        own = [part for part in parts if np.any(np.ptp(part.positions, axis=0) > least)]
        if len(own) < 2 or _is_at(q[-1], q[0], np.ptp(q, axis=0)):
            return
        motions = [part.positions for part in own]
        profiles = velocity_profiles(motions, units, SMOOTHING / recording.period)
        fastest = np.array([np.linalg.norm(speeds, axis=1).max() for speeds in profiles])
        # An approach as fast as the throw comes before it.
        as_fast = np.flatnonzero(fastest >= _AS_FAST * fastest.max())
        throws.append(own[as_fast[-1]].episode)
        others += [part.episode for part in parts if part.episode != throws[-1]]
    yield (
        f"every recording rests for {_REST:g} s or more between motions: if the fastest alone is "
        f"the throw ({listed(throws)}), --rests {_REST:g} --leave-out {shlex.join(others)} (if "
        "all are: --rests 0)"
    )


def _is_at(pose: np.ndarray, other: np.ndarray, ranges: np.ndarray) -> bool:
    """Whether every joint is where it is in another pose, but for a part of its range."""
    return bool(np.all(np.abs(pose - other) <= np.maximum(_BACK * ranges, 1e-12)))

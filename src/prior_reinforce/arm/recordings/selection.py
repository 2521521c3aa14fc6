"""Match recorded channels to the plan's, with their units."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from prior_reinforce.arm.recordings.beside import columns_beside, moving_beside
from prior_reinforce.arm.recordings.judging import UNIT, Given, Judge, beliefs_of
from prior_reinforce.arm.recordings.naming import (
    find_channels,
    joint_vectors,
    missing_channels,
    numbered_like,
)
from prior_reinforce.arm.recordings.recording import MOST_LOST, Recording, or_leave_out
from prior_reinforce.arm.recordings.takes import in_one_unit, odd_takes
from prior_reinforce.arm.recordings.units import Ambiguity, conversion, say_names, split_unit
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.channels import (
    RATES,
    Kind,
    is_increment,
    kinds,
    measured_of,
    one_for_all,
    says_no_position,
)
from prior_reinforce.plans.whole_turns import TURN
from prior_reinforce.units import UNITS
from prior_reinforce.wording import listed

_LIKE_RATES = "look like velocities, torques or the like"
_BEYOND = 5.0
"""A few frames so many times as large, or as far away, as all others were not read. Ours."""
_NOT_READ = (
    "as where a read failed: write nan there, so that they are left out as lost frames are, or "
    "leave that episode out (--leave-out)"
)


@dataclass(frozen=True, eq=False)
class Selection:
    """Recordings that hold the plan's channels, in the plan's units, and nothing else."""

    recordings: tuple[Recording, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    """Units of the plan's channels."""
    recorded_units: tuple[str, ...]
    """Units in which they were recorded."""
    ambiguities: tuple[Ambiguity, ...] = ()
    """Names and units, and of recordings that were read also times, that are only inferred."""
    remarks: tuple[str, ...] = ()
    """Warnings for a person."""
    other_unit: str = ""
    """The option for another unit that the numbers look like; empty if no one option gives it."""
    left_out: str = ""
    """Channels that move and are not part of the plan, with their ranges; else empty."""

    @property
    def episodes(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(recording.episode for recording in self.recordings)

    def without(self, episodes: Sequence[str]) -> Selection:
        """Return the same without some episodes."""
        left = tuple(r for r in self.recordings if r.episode not in episodes)
        return replace(self, recordings=left)


def select(
    recordings: Sequence[Recording],
    joints: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    plan_units: Sequence[str] | None = None,
    *,
    normalised: bool = False,
) -> Selection:
    """Pick, order, convert and rename the channels of every recording; drop frames of nan.

    `joints` and `units` are those of `ReadOptions`, `names` and `plan_units` (one may hold for all)
    those of `import_demonstrations`; with `normalised`, the recorder also writes shares of each
    joint's range. InvalidDemonstrationsError if a recording lacks a joint, or too many frames;
    ConfigurationError if names or units are not as many as joints, or units differ.
    """
    joints = tuple(joints) if joints is not None else recordings[0].names
    if _are_all_columns(joints, recordings, names):
        assert names is not None
        recordings = [replace(r, names=joints, columns=()) for r in recordings]
        if units is not None and len(units) == len(joints):
            units = [units[i] for i in find_channels(names, joints) or ()]
        joints = tuple(names)
    unnamed = names is not None and tuple(names) == joints  # the user names no recorded joints
    names = tuple(names) if names is not None else joints
    if plan_units is not None and len(plan_units) == 1:
        plan_units = tuple(plan_units) * len(names)
    if not joints or len(set(joints)) != len(joints):
        raise ConfigurationError(f"joints must be names that differ, got {list(joints)}")
    given: Given = "" if units is None else "each"
    stated: list[str | None] = [None] * len(joints) if units is None else [*units]
    if units is not None and len(units) == 1 < len(joints):
        given, stated = "one for all", one_for_all(units[0], names, plan_units)
    if len(names) != len(joints) or len(stated) != len(joints):
        raise ConfigurationError(
            f"{len(joints)} joints need as many names and units, got {len(names)} names and "
            f"{len(stated)} units: {list(joints)}"
        )
    joints, guessed = _guess_names(recordings[0], joints) if unnamed else (joints, ())
    _refuse_places(joints, names, plan_units)
    columns, others = [], any(r.named and _holds(r, joints) for r in recordings)
    for recording in recordings:
        with or_leave_out(recording.episode, lambda: others):
            columns.append(_columns(recording, joints, names, plan_units))
    if given == "each" and not recordings[0].named:
        stated = [stated[i] for i in find_channels(names, joints) or range(len(joints))]
    if UNIT in (units or ()):
        named = say_names([n for n, u in zip(names, stated, strict=True) if u in (UNIT, None)])
        raise ConfigurationError(
            f"--units {UNIT} stands for the unit of {named}, which only you know: put deg, mm, "
            "percent, ... in its place, or counts for a number without a unit"
        )
    picked = [_picked(*each, joints) for each in zip(recordings, columns, strict=True)]
    takes, stated, mixed, unsaid = in_one_unit(picked, names, stated)
    beliefs = beliefs_of(takes, names, stated, plan_units)
    states = [[r.units[i] is not None for r in picked] for i in range(len(names))]
    # A unit that only some files state is asked about anyway, unless the user gives it.
    enough = all if given else any
    unsettled = [b for b, own in zip(beliefs, states, strict=True) if not enough(own)]
    odd, differ = odd_takes(unsettled)
    silent, fixed = not any(map(any, states)), plan_units is not None
    judge = Judge([b.without(odd) for b in beliefs], given, silent, fixed, normalised)
    questions, (remarks, other) = judge.questions(), judge.remarks()
    if given:
        remarks = [*(doubt.what for doubt in differ), *remarks]
    else:
        questions = [] if _are_unsettled(recordings) else [*unsaid, *differ, *questions]
    recorded, wanted = judge.recorded(), tuple(belief.wanted for belief in beliefs)
    scale = [conversion(*each) for each in zip(recorded, wanted, names, strict=True)]
    moving = moving_beside(picked)
    left_out = [f"{n}, {low:.4g} to {high:.4g}" for n, (low, high) in moving.items()]
    if unnamed and not guessed and recordings[0].named:
        guessed = _doubt_first(
            picked[0].columns, [split_unit(name, any_word=True)[0] for name in moving]
        )
    return Selection(
        tuple(replace(r, positions=r.positions * scale, units=wanted) for r in takes),
        names,
        wanted,
        tuple(recorded),
        (*guessed, *questions),
        (*mixed, *remarks),
        other,
        listed(left_out, "; "),
    )


def _are_unsettled(recordings: Sequence[Recording]) -> bool:
    """Whether the user is still asked which columns the motion is, and so not yet for units."""
    asked = [one for r in recordings for one in r.ambiguities if not one.guessed]
    return any(one.option.startswith(("--joints", "--key")) for one in asked)


def _are_all_columns(
    joints: Sequence[str], recordings: Sequence[Recording], names: Sequence[str] | None
) -> bool:
    """Whether the joints name all columns of recordings without a header, more than the plan's."""
    few = names is not None and len(names) < len(joints) == len({*joints})
    return (
        few
        and find_channels(names or (), joints) is not None
        and all(not r.named and len(r.names) == len(joints) for r in recordings)
    )


def _refuse_places(
    joints: Sequence[str], names: Sequence[str], plan_units: Sequence[str] | None
) -> None:
    """ConfigurationError if places or velocities are to be a plan's joints: `--joints x y z`."""
    units, no_joint = plan_units or [""] * len(names), {n for n in names if says_no_position(n)}
    no_joint |= {n for n, kind in zip(names, kinds(names), strict=True) if kind.is_pose}
    each = zip(joints, names, kinds(joints), units, strict=True)
    turning = [(j, n, kind) for j, n, kind, unit in each if unit in TURN]
    places = [(j, n) for j, n, kind in turning if kind is Kind.PLACE]
    rates = [(j, n) for j, n, _ in turning if says_no_position(j) and n not in no_joint]
    for wrong, are in ((places, "are a place"), (rates, _LIKE_RATES)):
        if wrong:
            recorded, called = zip(*wrong, strict=True)
            raise ConfigurationError(
                f"{say_names(recorded)} {are}, and not the joints {say_names(called)}; name "
                "recorded joints with --joints, or what holds them with --key"
            )


def _guess_names(
    recording: Recording, joints: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[Ambiguity, ...]]:
    """Guess the recorded names of the joints: numbered channels, or all in their order."""
    if any(one.option.startswith("--joints") for one in recording.ambiguities):
        return joints, ()
    own = recording.columns != recording.names  # numbered columns of a log whose order is known
    if not (recording.named or own) and len(recording.names) == len(joints) > 1:
        what = f"{recording.episode} names no columns, and nothing in it says their order, which "
        what += f"has to be known from its recorder: are they {say_names(joints)}, in that order"
        return joints, (Ambiguity(what, f"--joints {shlex.join(joints)}"),)
    if not recording.named or find_channels(joints, recording.names) is not None:
        return joints, ()
    found = numbered_like(joints, recording.names)
    if found is None:
        return joints, ()
    what = f"no column is called {say_names(joints)}: it looks as if {say_names(found)} were these"
    return found, (Ambiguity(what, f"--joints {shlex.join(found)}"),)


def _doubt_first(columns: Sequence[str], moving: Sequence[str]) -> tuple[Ambiguity, ...]:
    """Ask of `joint1`, `joint2` whether they are the plan's where a `joint0` moves beside them."""
    first = re.fullmatch(r"(.*\D|)1(\D*)", columns[0])
    if first is None or len(columns) < 2:
        return ()
    zero, *others = (f"{first[1]}{i}{first[2]}" for i in range(len(columns) + 1))
    if others != [*columns] or zero not in moving:
        return ()
    what = (
        f"{zero} moves beside {say_names(columns)}: it looks as if the recorder counts from 0; if "
        f"the names are the plan's, from 1, give --joints {shlex.join(columns)}"
    )
    option = f"--joints {shlex.join([zero, *columns[:-1]])}"
    return (Ambiguity(what, option, guessed=False),)


def _holds(recording: Recording, joints: tuple[str, ...]) -> bool:
    """Whether the recording holds the joints, each once."""
    with suppress(InvalidDemonstrationsError):
        return find_channels(joints, recording.names) is not None
    return False


def _columns(
    recording: Recording,
    joints: tuple[str, ...],
    names: tuple[str, ...],
    plan_units: Sequence[str] | None,
) -> list[int]:
    found = find_channels(joints, recording.names)
    if found is not None:
        return found
    there = say_names(recording.names)
    if recording.named:
        missing = say_names(missing_channels(joints, recording.names))
        fitting = list(joint_vectors(recording.names, len(joints)))
        stem = measured_of(fitting) or next(iter(fitting), "")
        by_key = f", or numbered columns at once: --key {stem}" * bool(stem)
        of_kind = kinds(recording.names)
        others = [kind for kind in of_kind if not kind.is_pose]
        are_joints = all(unit in TURN for unit in plan_units or TURN)
        if Kind.PLACE in of_kind and len(others) < len(joints) and not fitting and are_joints:
            raise InvalidDemonstrationsError(
                f"episode {recording.episode} has no joint {missing}; it has {there}, a place and "
                "no joints: name what holds the joints with --key, or import the place into a "
                "workspace of --robot none"
            )
        tool = [name for name, kind in zip(recording.names, of_kind, strict=True) if kind.is_pose]
        rates = [n for n in recording.names if says_no_position(n) and n not in tool]
        if len(tool) == len(joints):
            there += f": {say_names(tool)} look like the pose of a tool"
            by_key = f" {shlex.join(tool)}{by_key}"
        elif rates and len(recording.names) - len(rates) < len(joints):
            there += f": {say_names(rates)} {_LIKE_RATES}, and positions are missing; record them, "
            there += "or if another column holds them"
        beside = list(recording.beside)
        for joint in missing_channels(joints, recording.names):
            for place in find_channels((joint,), beside) or ():
                by_key += f"; {beside[place]} stands beside the motion: take it by another --key"
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} has no joint {missing}; it has {there}: give the "
            f"recorded names in the plan's order with --joints{by_key}"
        )
    if len(recording.names) != len(joints):
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} has {len(recording.names)} columns without names, and "
            f"the plan {len(joints)} joints; with --joints name all its columns in their order, or "
            f"give those of {there} that are the plan's, in the plan's order"
        )
    # Columns without names are called by the joints, which may be the plan's in another order.
    return find_channels(names, joints) or list(range(len(joints)))


def _refuse_failed_reads(
    episode: str, called: Sequence[str], positions: np.ndarray, joints: Sequence[str]
) -> None:
    """Refuse a placeholder for failed reads, such as -999, in a few frames.

    It is far beyond all other frames, and all channels of its kind. Increments, speeds and tools
    may be large in a few frames. In the first and last frame, and where all others are 0, a motion
    may be as large, so only impossible angles are refused there.
    """
    size, of_kind = np.abs(positions), kinds(joints)
    most = size.max(axis=0, initial=0.0)
    rest = np.where(size <= most / 2, size, 0.0).max(axis=0, initial=0.0)
    usual = np.where(_BEYOND * rest < most, rest, most)
    for i, kind in enumerate(of_kind):
        far = np.flatnonzero(size[:, i] > most[i] / 2)
        opens = kind is Kind.TOOL and np.any(positions[far, i] > 0)
        if opens or kind in RATES or is_increment(joints[i]):
            continue
        no_angle = kind is Kind.ANGLE and most[i] > UNITS["deg"].largest
        moves = rest[i] > 0 and not {0, len(size) - 1} & {*far.tolist()}
        few = len(far) < MOST_LOST * len(size) and (no_angle or moves)
        alike = max(usual[j] for j, other in enumerate(of_kind) if other is kind)
        if few and most[i] > alike and _BEYOND * rest[i] < most[i]:
            raise InvalidDemonstrationsError(
                f"episode {episode}: {called[i]} is {positions[far[0], i]:.4g} in {len(far)} of "
                f"{len(size)} frames, first in {far[0]}, and {rest[i]:.4g} at most in all others, "
                f"{_NOT_READ}"
            )


def _refuse_empty_frames(episode: str, positions: np.ndarray, joints: Sequence[str]) -> None:
    """Refuse frames of 0 in mid-motion, as of lost packets: all channels leap there and back."""
    ranges = np.ptp(positions, axis=0)
    moves = [
        i
        for i, (name, kind) in enumerate(zip(joints, kinds(joints), strict=True))
        if ranges[i] > 0 and kind not in (*RATES, Kind.TOOL) and not is_increment(name)
    ]
    empty = np.all(positions[:, moves] == 0, axis=1)
    if len(moves) < 2 or not 0 < empty.sum() < len(empty) / 2 or empty[0] or empty[-1]:
        return
    steps = np.abs(np.diff(positions[:, moves], axis=0) / ranges[moves]).max(axis=1)
    leaps = empty[1:] != empty[:-1]
    usual = steps[~leaps].max(initial=0.0)  # 0 of key frames, and of commands that stand and leap
    if 0 < _BEYOND * usual < steps[leaps].min():
        raise InvalidDemonstrationsError(
            f"episode {episode}: {say_names([joints[i] for i in moves])} are 0 in {empty.sum()} of "
            f"{len(empty)} frames, first in {empty.argmax()}, and leap there and back, {_NOT_READ}"
        )


def _picked(recording: Recording, columns: list[int], joints: tuple[str, ...]) -> Recording:
    """Return some channels, without frames in which one of them is not finite."""
    positions, remarks = recording.positions[:, columns], recording.remarks
    called = tuple(recording.columns[i] for i in columns)
    bad = ~np.isfinite(positions)
    lost = np.any(bad, axis=1)
    if np.any(lost):
        frame, channel = np.argwhere(bad)[0].tolist()
        what = f"{called[channel]} is {positions[frame, channel]} at frame {frame}"
        if np.mean(lost) > MOST_LOST:
            raise InvalidDemonstrationsError(
                f"episode {recording.episode}: {what}, expected a finite number, and {lost.sum()} "
                f"of {len(lost)} frames are lost so; mend or drop that episode (--leave-out)"
            )
        count = "frame is" if lost.sum() == 1 else "frames are"
        remarks += (f"{what}; {lost.sum()} {count} left out, as lost packets are",)
    _refuse_failed_reads(recording.episode, called, positions[~lost], joints)
    _refuse_empty_frames(recording.episode, positions[~lost], joints)
    units = zip(recording.columns, recording.units, strict=True)
    names = [name + (f" [{unit}]" if unit else "") for name, unit in units]
    beside = columns_beside(names, recording.positions, columns, recording.times)
    return replace(
        recording,
        beside={**recording.beside, **beside},
        times=recording.times[~lost],
        positions=positions[~lost],
        names=joints,
        units=tuple(recording.units[i] for i in columns),
        columns=called,
        remarks=remarks,
    )

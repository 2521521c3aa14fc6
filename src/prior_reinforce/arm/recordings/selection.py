"""Match recorded channels to the plan's, with their units, and note what moves and is left out."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from prior_reinforce.arm.recordings.beside import columns_beside
from prior_reinforce.arm.recordings.naming import (
    find_channels,
    joint_vectors,
    missing_channels,
    numbered_like,
)
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.units import (
    Ambiguity,
    conversion,
    is_no_angle,
    is_possible,
    judge_unit,
    known_unit,
    listed,
    one_for_all,
    place_names,
    say_names,
)
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.whole_turns import TURN, attitudes
from prior_reinforce.units import base_of

_MOST_LOST = 0.1
"""Share of an episode's frames that may be lost. Ours: lost packets come in bursts of some frames;
where more is missing, the recorder failed."""


_NORMALISED = (
    ", unless LeRobot recorded shares of each joint's range (-100 to 100, where use_degrees is "
    "unset): those are no angles; record with use_degrees, or import them as percent into a "
    "workspace of --robot none"
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
    """Names and units that are only inferred."""
    remarks: tuple[str, ...] = ()
    """Warnings for a person."""
    other_unit: str = ""
    """The option for the unit that the numbers look like, where that is not the one used and one
    option can give it; else empty."""
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
    """Pick, order, convert and rename the channels of every recording.

    Frames with a value that is not finite are dropped, as lost packets are.

    Args:
        recordings: At least one.
        joints: Recorded names to keep, in order, or of all columns where these have none; None
            keeps those of the first recording.
        names: Their names in the plan; None keeps the recorded names. If they equal `joints` and
            no column has these names, as many numbered columns are a guess.
        units: Recorded units; a single one holds for all channels that can be in it: degrees for
            joints, not for a gripper in percent. None takes those that the recordings state, else
            the plan's; if no arm reaches such values, the unit is guessed.
        plan_units: Units of the plan; None takes rad for angles and what has none, m for lengths.
        normalised: Whether the recorder also writes shares of each joint's range, -100 to 100.

    Raises:
        InvalidDemonstrationsError: A joint that a recording lacks, or too many lost frames.
        ConfigurationError: Another number of names or units than of joints, or units that
            contradict each other.
    """
    joints = tuple(joints) if joints is not None else recordings[0].names
    unnamed = names is not None and tuple(names) == joints
    names = tuple(names) if names is not None else joints
    if not joints or len(set(joints)) != len(joints):
        raise ConfigurationError(f"joints must be names that differ, got {list(joints)}")
    given: Literal["no", "one for all", "each"] = "no" if units is None else "each"
    stated: list[str | None] = [None] * len(joints) if units is None else [*units]
    if units is not None and len(units) == 1 < len(joints):
        given, stated = "one for all", _spread(units[0], plan_units, names)
    if len(names) != len(joints) or len(stated) != len(joints):
        raise ConfigurationError(
            f"{len(joints)} joints need as many names and units, got {len(names)} names and "
            f"{len(stated)} units: {list(joints)}"
        )
    joints, guessed = _guess_names(recordings[0], joints) if unnamed else (joints, ())
    columns = [_columns(recording, joints, names) for recording in recordings]
    if given == "each" and not recordings[0].named:
        stated = [stated[i] for i in find_channels(names, joints) or range(len(joints))]
    said = [_said_unit(recordings, columns, i, unit) for i, unit in enumerate(stated)]
    picked = [_picked(*each, joints) for each in zip(recordings, columns, strict=True)]
    most = np.abs(np.concatenate([r.positions for r in picked])).max(axis=0)
    no_angles = {name for group in attitudes(names) if len(group) == 4 for name in group}
    no_angles |= {n for n, m in zip(names, most, strict=True) if is_no_angle(n) and m <= 1}
    lengths = place_names(names)
    usual = ["1" if n in no_angles else "m" if n in lengths else "rad" for n in names]
    wanted = [base_of(unit or own)[0] for unit, own in zip(said, usual, strict=True)]
    wanted = wanted if plan_units is None else list(plan_units)
    # No option may contradict a unit that the file states.
    open_ = all(r.units[i] is None for r, c in zip(recordings, columns, strict=True) for i in c)
    recorded, unclear, remarks, other = _judge_units(
        picked,
        names,
        said,
        wanted,
        given=given,
        open_=open_,
        normalised=normalised,
        fixed=plan_units is not None,
    )
    scale = [conversion(*one) for one in zip(recorded, wanted, names, strict=True)]
    return Selection(
        tuple(replace(r, positions=r.positions * scale, units=tuple(wanted)) for r in picked),
        names,
        tuple(wanted),
        tuple(recorded),
        (*guessed, *unclear),
        tuple(remarks),
        other,
        _left_out(recordings, columns),
    )


def _spread(unit: str, plan_units: Sequence[str] | None, names: Sequence[str]) -> list[str | None]:
    """One unit for all channels that can be in it, which no gripper or place is in degrees."""
    base = base_of(unit)[0]
    fits = [base_of(own)[0] == base for own in plan_units or (base,) * len(names)]
    each = zip(one_for_all(unit, names), fits, strict=True)
    return [own if fit or not any(fits) else None for own, fit in each]


def _guess_names(
    recording: Recording, joints: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[Ambiguity, ...]]:
    """The recorded names of the joints, if they can only be guessed: `q0`, `q1`, ..."""
    if any(one.option.startswith("--joints") for one in recording.ambiguities):
        return joints, ()
    own = recording.columns != recording.names  # numbered columns of a log whose order is known
    if not (recording.named or own) and len(recording.names) == len(joints) > 1:
        what = (
            f"{recording.episode} names no columns, and nothing in it says their order, which has"
        )
        what += f" to be known from its recorder: are they {say_names(joints)}, in that order"
        return joints, (Ambiguity(what, f"--joints {shlex.join(joints)}"),)
    if not recording.named or find_channels(joints, recording.names) is not None:
        return joints, ()
    found = numbered_like(joints, recording.names)
    if found is None:
        return joints, ()
    what = f"no column is called {say_names(joints)}: it looks as if {say_names(found)} were these"
    return found, (Ambiguity(what, f"--joints {shlex.join(found)}"),)


def _columns(recording: Recording, joints: tuple[str, ...], names: tuple[str, ...]) -> list[int]:
    found = find_channels(joints, recording.names)
    if found is not None:
        return found
    there = say_names(recording.names)
    if recording.named:
        missing = say_names(missing_channels(joints, recording.names))
        fitting = list(joint_vectors(recording.names, len(joints)))
        by_key = f", or numbered columns at once: --key {fitting[0]}" if fitting else ""
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} has no joint {missing}; it has {there}: give the "
            f"recorded names in the plan's order with --joints{by_key}"
        )
    if len(recording.names) != len(joints):
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} has {len(recording.names)} columns without names, but "
            f"{len(joints)} joints were given; name all its columns in order, or give some of "
            f"{there}"
        )
    # Columns without names are called by the joints, which may be the plan's in another order.
    return find_channels(names, joints) or list(range(len(joints)))


def _picked(recording: Recording, columns: list[int], joints: tuple[str, ...]) -> Recording:
    """Some channels, without the few frames in which one of them is not finite."""
    positions, remarks = recording.positions[:, columns], recording.remarks
    called = tuple(recording.columns[i] for i in columns)
    bad = ~np.isfinite(positions)
    lost = np.any(bad, axis=1)
    if np.any(lost):
        frame, channel = np.argwhere(bad)[0].tolist()
        what = f"{called[channel]} is {positions[frame, channel]} at frame {frame}"
        if np.mean(lost) > _MOST_LOST:
            raise InvalidDemonstrationsError(
                f"episode {recording.episode}: {what}, expected a finite number, and {lost.sum()} "
                f"of {len(lost)} frames are lost so; mend or drop that episode (--leave-out)"
            )
        count = "frame is" if lost.sum() == 1 else "frames are"
        remarks += (f"{what}; {lost.sum()} {count} left out, as lost packets are",)
    return replace(
        recording,
        times=recording.times[~lost],
        positions=positions[~lost],
        names=joints,
        units=tuple(recording.units[i] for i in columns),
        columns=called,
        remarks=remarks,
    )


def _left_out(recordings: Sequence[Recording], columns: Sequence[list[int]]) -> str:
    """Channels that move and are not selected, with their ranges over all recordings."""
    ranges: dict[str, list[tuple[float, float]]] = {}
    for recording, taken in zip(recordings, columns, strict=True):
        beside = columns_beside(recording.columns, recording.positions, taken, recording.times)
        for name, span in (*recording.left_out.items(), *beside.items()):
            ranges.setdefault(name, []).append(span)
    said = [
        f"{name}, {min(low for low, _ in spans):.4g} to {max(high for _, high in spans):.4g}"
        for name, spans in ranges.items()
    ]
    return listed(said, "; ")


def _said_unit(
    recordings: Sequence[Recording], columns: list[list[int]], index: int, given: str | None
) -> str | None:
    """Unit of a channel as given or as its file states it; None if neither does."""
    given = given if given is None else known_unit(given) or given
    for recording, column in zip(recordings, columns, strict=True):
        own = recording.units[column[index]]
        if own is not None and given not in (None, own):
            raise ConfigurationError(
                f"{recording.names[column[index]]} of episode {recording.episode} is in {own}, but "
                f"--units says {given}; correct or drop it"
            )
        given = given or own
    return given


def _judge_units(
    recordings: Sequence[Recording],
    names: Sequence[str],
    said: Sequence[str | None],
    wanted: Sequence[str],
    *,
    given: Literal["no", "one for all", "each"],
    open_: bool,
    normalised: bool,
    fixed: bool,
) -> tuple[list[str], list[Ambiguity], list[str], str]:
    """Infer the unit of each channel: as stated if possible, else as wanted, else as it looks.

    `said` are units given or from the file, and `given` how they were given: believed where they
    are possible. `open_`: the files state none. `fixed`: the plan says its units.

    Returns units, what is ambiguous of them, remarks, and `Selection.other_unit`.
    """
    reach = np.array([np.abs(r.positions).max(axis=0) for r in recordings])
    most = reach.max(axis=0)
    recorded = [unit or w for unit, w in zip(said, wanted, strict=True)]
    angles = [i for i, unit in enumerate(recorded) if unit in TURN and not is_no_angle(names[i])]
    small = given == "one for all" and open_ and {recorded[i] for i in angles} == {"deg"}
    small = small and most[angles].max() < TURN["rad"]
    # Joints of one recorder have one unit, unless few of them only are out of range.
    far = [i for i in angles if judge_unit(recorded[i], most[i]) not in (recorded[i], None)]
    near = max((most[i] for i in angles if i not in far), default=math.inf)
    if far and (2 * len(far) > len(angles) or near > TURN["rad"] or given != "no"):
        far = angles
    lengths = place_names(names)  # of one recorder, in one unit
    places = [i for i, unit in enumerate(recorded) if unit == "m" and names[i] in lengths]
    groups: dict[tuple[str, str | None, str], list[int]] = {}
    doubtful, other = dict[tuple[str, str], int](), ""
    single = len(set(recorded)) == 1
    for i, unit in enumerate(recorded):
        number = max(most[j] for j in places) if i in places else most[i]
        looks, why = judge_unit(unit, number, opening=is_no_angle(names[i])), "which no arm does"
        if unit == "percent":
            why = "which is hardly a motion" if looks else "which no share of a range does"
        alone = i in far and len(far) < len(angles) and not fixed
        if (alone or is_no_angle(names[i])) and said[i] is None and unit in TURN and looks != unit:
            why = "by its name" if not alone else f"beside joints in {unit}"
            looks, why = "percent", f"and {why} it is no angle"
        elif small and i in angles:
            looks, why = "rad", "which is hardly a motion"
        elif looks == unit and i in far:
            looks = "deg"
        elif looks == unit:
            continue
        alike = far if i in far else [i]
        impossible = open_ and single and not all(is_possible(unit, most[j]) for j in alike)
        if said[i] is None or (small and i in angles) or (given != "no" and impossible and looks):
            groups.setdefault((unit, looks, why), []).append(i)
        elif looks is not None:
            worst = doubtful.setdefault((unit, looks), i)
            doubtful[unit, looks] = i if most[i] > most[worst] else worst
    remarks = []
    for (unit, looks), i in doubtful.items():
        where = f"{names[i]} of {recordings[int(np.argmax(reach[:, i]))].episode}"
        other = f"--units {looks}" if open_ and single else other
        advice = f"if it was recorded in {looks}, say {other}" if other else "check its unit"
        remarks.append(f"{where} reaches {most[i]:.4g} {unit}, and arms do not: {advice}")
    unclear = []
    for (unit, looks, why), among in groups.items():
        worst = among[int(np.argmax(most[among]))]
        episode = recordings[int(np.argmax(reach[:, worst]))].episode
        by = ", as --units says," if given != "no" else ""
        seen = f"it looks like {looks}" if looks else "check that recording"
        if looks == "deg" and normalised and most[among].max() <= 100:
            seen += _NORMALISED
        called = say_names([names[i] for i in among])
        reaches = f"would reach {most[worst]:.4g} ({names[worst]} of {episode})"
        unclear.append(f"{called} in {unit}{by} {reaches}, {why}: {seen}")
        for i in among:
            recorded[i] = looks or unit
    in_degrees = bool(angles) and {recorded[i] for i in angles} == {"deg"}
    if given != "no" and normalised and in_degrees and not unclear and most[angles].max() <= 100:
        remarks.append(f"degrees, as --units says{_NORMALISED}")
    single = len(set(recorded)) == 1
    option = f"--units {recorded[0] if single else ' '.join(recorded)}"
    for i, unit in enumerate(wanted):
        if base_of(recorded[i])[0] != base_of(unit)[0] and said[i] is None:
            recorded[i] = unit  # asked about, and not converted
    return recorded, [Ambiguity(what, option) for what in unclear], remarks, other

"""Match recorded channels to the plan's, with their units, and note what moves and is left out."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from prior_reinforce.bench.importing.naming import (
    could_be_forgotten,
    find_channels,
    joint_vectors,
    missing_channels,
    numbered_like,
)
from prior_reinforce.bench.importing.recording import Recording
from prior_reinforce.bench.importing.tables import counts
from prior_reinforce.bench.importing.units import (
    Ambiguity,
    base_of,
    conversion,
    is_possible,
    judge_unit,
    known_unit,
    listed,
    say_names,
)
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.signals import held_channels

_MOST_LOST = 0.1
"""Share of an episode's frames that may be lost. Ours: lost packets come in bursts of some frames;
where more is missing, the recorder failed."""


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
) -> Selection:
    """Pick, order, convert and rename the channels of every recording.

    Frames with a value that is not finite are dropped, as lost packets are.

    Args:
        recordings: At least one.
        joints: Recorded names to keep, in order; None keeps those of the first recording. If the
            recordings name no columns, these name all columns in order.
        names: Their names in the plan; None keeps the recorded names. If they equal `joints` and
            no column has these names, as many numbered columns are a guess.
        units: Recorded units; a single one holds for all channels that can be in it: degrees for
            joints, not for a gripper in percent. None takes those that the recordings state, else
            the plan's; if no arm reaches such values, the unit is guessed.
        plan_units: Units of the plan; None takes radians for angles, metres for lengths, and
            radians for channels without a unit.

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
    if units is not None and len(units) == 1:
        units = _spread(units[0], plan_units or (units[0],) * len(joints))
    n_units = len(joints) if units is None else len(units)
    if len(names) != len(joints) or n_units != len(joints):
        raise ConfigurationError(
            f"{len(joints)} joints need as many names and units, got {len(names)} names and "
            f"{n_units} units: {list(joints)}"
        )
    joints, guessed = _guess_names(recordings[0], joints) if unnamed else (joints, ())
    columns = [_columns(recording, joints) for recording in recordings]
    said = [
        _said_unit(recordings, columns, i, None if units is None else units[i])
        for i in range(len(joints))
    ]
    wanted = [
        plan_units[i] if plan_units is not None else base_of(unit or "rad")[0]
        for i, unit in enumerate(said)
    ]
    picked = [_picked(*each, joints) for each in zip(recordings, columns, strict=True)]
    # No option may contradict a unit that the file states.
    open_ = all(r.units[i] is None for r, c in zip(recordings, columns, strict=True) for i in c)
    recorded, unclear, remarks, other = _judge_units(
        picked, names, said, wanted, given=units is not None, open_=open_
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


def _spread(unit: str, plan_units: Sequence[str]) -> tuple[str, ...]:
    """One unit for all channels that can be in it; the plan's for others, unless none can."""
    fits = [base_of(own)[0] == base_of(unit)[0] for own in plan_units]
    fits = fits if any(fits) else [True] * len(fits)
    return tuple(unit if fit else own for own, fit in zip(plan_units, fits, strict=True))


def _guess_names(
    recording: Recording, joints: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[Ambiguity, ...]]:
    """The recorded names of the joints, if they can only be guessed: `q0`, `q1`, ..."""
    if not recording.named or find_channels(joints, recording.names) is not None:
        return joints, ()
    found = numbered_like(joints, recording.names)
    if found is None:
        return joints, ()
    what = f"no column is called {say_names(joints)}: it looks as if {say_names(found)} were these"
    return found, (Ambiguity(what, f"--joints {shlex.join(found)}"),)


def _columns(recording: Recording, joints: tuple[str, ...]) -> list[int]:
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
    return list(range(len(joints)))


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
        for name, span in recording.left_out.items():
            ranges.setdefault(name, []).append(span)
        others = [i for i in range(len(recording.names)) if i not in taken]
        names = recording.names
        moving = could_be_forgotten([names[i] for i in others], [names[i] for i in taken])
        for i in others:
            values = recording.positions[:, i]
            values = values[np.isfinite(values)]
            if recording.names[i] not in moving or len(values) < 2 or counts(values):
                continue
            if not held_channels([values[:, None]], (recording.units[i] or "",))[0]:
                span = float(values.min()), float(values.max())
                ranges.setdefault(recording.columns[i], []).append(span)
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
    given: bool,
    open_: bool,
) -> tuple[list[str], list[Ambiguity], list[str], str]:
    """Infer the unit of every channel: as stated if possible, else as wanted, else as it looks.

    Args:
        recordings: With these channels alone.
        names: Of the channels in the plan.
        said: Their units, given or from the file; None where neither states one.
        wanted: Units of the plan.
        given: Whether units were given, then of all channels.
        open_: Whether the files state none of them.

    Returns:
        Units, what is ambiguous of them, remarks, and `Selection.other_unit`.
    """
    reach = np.array([np.abs(r.positions).max(axis=0) for r in recordings])
    recorded = [unit or w for unit, w in zip(said, wanted, strict=True)]

    def by_unit(channels: Iterable[int]) -> Iterator[tuple[list[int], float, str, str, str | None]]:
        """Channels of one unit, the largest number, where it stands, the unit, and its looks."""
        groups: dict[str, list[int]] = {}
        for i in channels:
            groups.setdefault(recorded[i], []).append(i)
        for unit, among in groups.items():
            episode, channel = divmod(int(np.argmax(reach[:, among])), len(among))
            most, where = reach[episode, among[channel]], names[among[channel]]
            where = f"{where} of {recordings[episode].episode}"
            yield among, most, where, unit, judge_unit(unit, most)

    unclear, remarks, other = [], [], ""
    may_doubt_given = open_ and len(set(recorded)) == 1
    unsure = [i for i, unit in enumerate(said) if given or unit is None]
    for among, most, where, unit, looks in by_unit(unsure):
        is_sure = is_possible(unit, most) or looks is None or not may_doubt_given
        if looks == unit or (given and is_sure):
            continue
        seen = f"it looks like {looks}" if looks else "check that recording"
        by = ", as --units says," if given else ""
        unclear.append(
            f"{say_names([names[i] for i in among])} in {unit}{by} would reach {most:.4g} "
            f"({where}), which no arm does: {seen}"
        )
        for i in among:
            recorded[i] = looks or unit
    single = len(set(recorded)) == 1
    option = f"--units {recorded[0] if single else ' '.join(recorded)}"
    for _, most, where, unit, looks in by_unit(range(len(names))):
        if looks not in (unit, None):
            advice = "check its unit"
            if open_ and single:
                other = f"--units {looks}"
                advice = f"if it was recorded in {looks}, say {other}"
            remarks.append(f"{where} reaches {most:.4g} {unit}, and arms do not: {advice}")
    return recorded, [Ambiguity(what, option) for what in unclear], remarks, other

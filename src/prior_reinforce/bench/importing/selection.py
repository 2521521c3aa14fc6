"""Which recorded channels are the plan's, in which units, and what moves and is left out."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
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
    judge_unit,
    known_unit,
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
    """Of the plan's channels."""
    recorded_units: tuple[str, ...]
    """In which they were recorded."""
    ambiguities: tuple[Ambiguity, ...] = ()
    """Which of names and units are only guessed."""
    remarks: tuple[str, ...] = ()
    """What a person should know of them."""
    other_unit: str = ""
    """The option that says the unit they look like instead; empty where that is the one taken, or
    one option cannot say it."""
    left_out: str = ""
    """Channels that move and are not the plan's, with their ranges; empty where there are none."""

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

    Frames in which one of them is not finite are left out, as lost packets are.

    Args:
        recordings: At least one.
        joints: Recorded names to keep, in order; None keeps those of the first recording. They
            name the columns, in order, of recordings that name nothing.
        names: What to call them; None keeps the recorded names. Where they are the joints, and no
            column is called like them, numbered columns of which there are as many are a guess.
        units: Recorded units; a single one holds for all. None takes those that the recordings
            say, and for others the plan's; where an arm could not be in that unit, it is guessed.
        plan_units: Units of the plan; None takes radians for angles and metres for lengths, and
            radians for what has no unit.

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
        units = (units[0],) * len(joints)
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
    picked = tuple(
        _without_lost_frames(_only(r, c, joints)) for r, c in zip(recordings, columns, strict=True)
    )
    # No option may contradict a unit that the file says.
    open_ = all(r.units[i] is None for r, c in zip(recordings, columns, strict=True) for i in c)
    units_found = _judge_units(picked, names, said, wanted, units is not None, open_)
    scale = [
        conversion(r, w, n) for r, w, n in zip(units_found.recorded, wanted, names, strict=True)
    ]
    return Selection(
        tuple(replace(r, positions=r.positions * scale, units=tuple(wanted)) for r in picked),
        names,
        tuple(wanted),
        tuple(units_found.recorded),
        (*guessed, *units_found.ambiguities),
        tuple(units_found.remarks),
        units_found.other,
        _left_out(recordings, columns),
    )


def _guess_names(
    recording: Recording, joints: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[Ambiguity, ...]]:
    """The joints by their recorded names, where these can only be guessed: `q0`, `q1`, ..."""
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


def _only(recording: Recording, columns: list[int], joints: tuple[str, ...]) -> Recording:
    """The recording with some of its channels."""
    return replace(
        recording,
        positions=recording.positions[:, columns],
        names=joints,
        units=tuple(recording.units[i] for i in columns),
        columns=tuple(recording.columns[i] for i in columns),
    )


def _without_lost_frames(recording: Recording) -> Recording:
    """The recording without frames in which a channel is not finite, where these are few."""
    bad = ~np.isfinite(recording.positions)
    lost = np.any(bad, axis=1)
    if not np.any(lost):
        return recording
    frame, channel = np.argwhere(bad)[0].tolist()
    what = f"{recording.columns[channel]} is {recording.positions[frame, channel]} at frame {frame}"
    if np.mean(lost) > _MOST_LOST:
        raise InvalidDemonstrationsError(
            f"episode {recording.episode}: {what}, expected a finite number, and {lost.sum()} of "
            f"{len(lost)} frames are lost so; mend or drop that episode (--leave-out)"
        )
    count = "frame is" if lost.sum() == 1 else "frames are"
    return replace(
        recording,
        times=recording.times[~lost],
        positions=recording.positions[~lost],
        remarks=(*recording.remarks, f"{what}; {lost.sum()} {count} left out, as lost packets are"),
    )


def _left_out(recordings: Sequence[Recording], columns: Sequence[list[int]]) -> str:
    """What moves and is not taken, with its range over all recordings."""
    ranges: dict[str, list[tuple[float, float]]] = {}
    for recording, taken in zip(recordings, columns, strict=True):
        for name, span in recording.left_out.items():
            ranges.setdefault(name, []).append(span)
        others = [i for i in range(len(recording.names)) if i not in taken]
        moving = could_be_forgotten([recording.names[i] for i in others], len(taken))
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
    more = f" and {len(said) - 12} more" if len(said) > 12 else ""
    return "; ".join(said[:12]) + more


def _said_unit(
    recordings: Sequence[Recording], columns: list[list[int]], index: int, given: str | None
) -> str | None:
    """Unit of a channel that was given or that its file says; None where neither does."""
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


@dataclass(frozen=True)
class _UnitsFound:
    recorded: list[str]
    ambiguities: list[Ambiguity]
    remarks: list[str]
    other: str


def _judge_units(
    recordings: Sequence[Recording],
    names: Sequence[str],
    said: Sequence[str | None],
    wanted: Sequence[str],
    given: bool,
    open_: bool,
) -> _UnitsFound:
    """Unit of every channel: as said if possible, as wanted if nobody says, else as it looks.

    Args:
        recordings: With these channels alone.
        names: Of the channels in the plan.
        said: Their units, given or from the file; None where nobody says.
        wanted: Units of the plan.
        given: Whether units were given.
        open_: Whether the files say none of them.
    """
    reach = np.array([np.abs(r.positions).max(axis=0) for r in recordings])

    def farthest(among: list[int]) -> tuple[float, str]:
        episode, channel = divmod(int(np.argmax(reach[:, among])), len(among))
        where = f"{names[among[channel]]} of {recordings[episode].episode}"
        return float(reach[episode, among[channel]]), where

    def channels(units: Sequence[str | None], unit: str) -> list[int]:
        return [i for i, own in enumerate(units) if own == unit]

    recorded = [unit or "" for unit in said]
    unclear = []
    unsaid = [w if unit is None else None for w, unit in zip(wanted, said, strict=True)]
    for unit in dict.fromkeys(filter(None, unsaid)):
        among = channels(unsaid, unit)
        most, where = farthest(among)
        judged = judge_unit(unit, most)
        if not judged.plausible:
            seen = f"it looks like {judged.looks}" if judged.looks else "and as degrees neither"
            unclear.append(
                f"{say_names([names[i] for i in among])} in {unit} would reach {most:.4g} "
                f"({where}), which no arm does: {seen}"
            )
        for i in among:
            recorded[i] = judged.looks or unit
    one = recorded[0] if len(set(recorded)) == 1 else None
    ambiguities = [Ambiguity(w, f"--units {one or ' '.join(recorded)}") for w in unclear]
    if one is not None and open_:
        most, where = farthest(list(range(len(names))))
        judged = judge_unit(one, most)
        if given and not judged.possible and judged.looks is not None:
            what = (
                f"{say_names(names)} in {one}, as --units says, would reach {most:.4g} ({where}), "
                f"which no arm does: it looks like {judged.looks}"
            )
            ambiguities.append(Ambiguity(what, f"--units {judged.looks}"))
            recorded = [judged.looks] * len(names)
    remarks, other = [], ""
    for unit in dict.fromkeys(recorded):
        most, where = farthest(channels(recorded, unit))
        judged = judge_unit(unit, most)
        if not judged.plausible and judged.looks is not None:
            advice = "check its unit"
            if open_ and len(set(recorded)) == 1:
                other = f"--units {judged.looks}"
                advice = f"if it was recorded in {judged.looks}, say {other}"
            remarks.append(f"{where} reaches {most:.4g} {unit}, and arms do not: {advice}")
    return _UnitsFound(recorded, ambiguities, remarks, other)

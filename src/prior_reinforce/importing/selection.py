"""Which recorded channels become the plan's columns, in which order, unit and name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.importing.recording import Recording


@dataclass(frozen=True)
class Selection:
    """Recordings that hold the plan's columns and nothing else."""

    recordings: tuple[Recording, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]


def select(
    recordings: Sequence[Recording],
    joints: Sequence[str] | None,
    names: Sequence[str] | None,
    units: Sequence[str] | None,
) -> Selection:
    """Pick, order, convert and rename the channels of every recording.

    Args:
        recordings: At least one.
        joints: Recorded names to keep, in order; None keeps those of the first recording. They
            name the columns, in order, of recordings that name nothing.
        names: What to call them; None keeps the recorded names.
        units: Recorded units; `deg` is converted to `rad`; None is radians.

    Raises:
        InvalidDemonstrationsError: A joint that a recording lacks.
        ConfigurationError: Another number of names or units than of joints.
    """
    first = recordings[0]
    joints = tuple(joints) if joints is not None else first.names
    names = tuple(names) if names is not None else joints
    units = tuple(units) if units is not None else ("rad",) * len(joints)
    if not joints or len(set(joints)) != len(joints):
        raise ConfigurationError(f"joints must be names that differ, got {list(joints)}")
    if len(names) != len(joints) or len(units) != len(joints):
        raise ConfigurationError(
            f"{len(joints)} joints need as many names and units, got {len(names)} names and "
            f"{len(units)} units: {list(joints)}"
        )
    scale = np.where([unit == "deg" for unit in units], np.pi / 180, 1.0)
    picked = [
        replace(r, positions=r.positions[:, _columns(r, joints)] * scale, names=joints)
        for r in recordings
    ]
    return Selection(
        tuple(picked), names, tuple("rad" if unit == "deg" else unit for unit in units)
    )


def _columns(recording: Recording, joints: tuple[str, ...]) -> list[int]:
    missing = [joint for joint in joints if joint not in recording.names]
    if not missing:
        return [recording.names.index(joint) for joint in joints]
    if not recording.named:
        if len(recording.names) == len(joints):
            return list(range(len(joints)))
        raise InvalidDemonstrationsError(
            f"episode {recording.episode} has {len(recording.names)} columns without names, but "
            f"{len(joints)} joints were given; name all its columns in order, or give some of "
            f"{', '.join(recording.names)}"
        )
    raise InvalidDemonstrationsError(
        f"episode {recording.episode} has no joint {', '.join(missing)}; it has "
        f"{', '.join(recording.names)}: give the recorded names"
    )

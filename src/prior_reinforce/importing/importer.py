"""The one way in: a recording on disk becomes `Demonstrations` and a preview."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidDemonstrationsError
from prior_reinforce.importing.detection import READERS, detect_format
from prior_reinforce.importing.outcomes import (
    find_outcomes,
    given_outcomes,
    in_order,
    outcomes_of,
    read_outcomes,
)
from prior_reinforce.importing.preprocessing import Preprocessing, preprocess
from prior_reinforce.importing.preview import Preview, make_preview
from prior_reinforce.importing.recording import Reading, Recording, RecordingFormat
from prior_reinforce.importing.selection import select
from prior_reinforce.plans.motions import Demonstrations, PlanFormat


@dataclass(frozen=True, eq=False)
class ImportResult:
    """What an import gives; nothing is on disk yet."""

    demonstrations: Demonstrations
    """Ready to be learned from: `demonstrations.save(path)`."""
    episodes: tuple[str, ...]
    """Name of each demonstration in its source, in order."""
    preview: Preview
    """`preview.text` to print, `preview.draw(path)` to look at."""


def read_recordings(
    source: str | os.PathLike[str],
    *,
    format: RecordingFormat | None = None,
    key: str | None = None,
    rate: float | None = None,
    episodes: Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
) -> list[Recording]:
    """Read every episode as it was recorded, for instance to ask for each one's outcome.

    Args:
        source: A file, or the folder that holds the recording.
        format: What it is; None detects it.
        key: Where the motion is: the array of an NPZ, the column of a LeRobot data set, the path
            of an HDF5 data set inside an episode, or the topic of a bag. None takes the only
            candidate.
        rate: Frames a second, for files that hold neither times nor a rate.
        episodes: Names of the episodes to keep, in order; None keeps all.
        joints: Recorded names that will be kept, so that the rest need not be there in every
            message of a bag, nor be numbers in a CSV; None reads everything.

    Raises:
        ConfigurationError: An unknown format, or a rate that is not positive.
        FileFormatError: Missing, truncated, of another format, or ambiguous without `key`.
        InvalidDemonstrationsError: An episode that cannot be used, or one asked for that is not
            there.
        MissingExtraError: The format's optional library is not installed.
    """
    source = Path(source)
    kind = format or detect_format(source)
    if kind not in READERS:
        raise ConfigurationError(f"unknown format {kind!r}; give one of {', '.join(READERS)}")
    if not source.exists():
        raise FileFormatError(f"no recording at {source}; give the path of a file or a folder")
    if rate is not None and not (math.isfinite(rate) and rate > 0):
        raise ConfigurationError(f"rate must be a positive number of frames a second, got {rate}")
    wanted = None if episodes is None else tuple(str(episode) for episode in episodes)
    reading = Reading(key, rate, wanted, None if joints is None else tuple(joints))
    found = READERS[kind](source, reading)
    twice = sorted(name for name, n in Counter(r.episode for r in found).items() if n > 1)
    if twice:
        raise InvalidDemonstrationsError(
            f"{source} holds more than one episode named {', '.join(twice)}; rename their files"
        )
    if wanted is None:
        if not found:
            raise FileFormatError(f"{source} holds no episode of format {kind}; say its format")
        return found
    by_name = {recording.episode: recording for recording in found}
    missing = [episode for episode in wanted if episode not in by_name]
    if missing or not wanted:
        there = READERS[kind](source, Reading(key, rate, None, reading.joints))
        raise InvalidDemonstrationsError(
            f"no episode {', '.join(missing) or 'named'} in {source}; it has "
            f"{', '.join(recording.episode for recording in there) or 'none'}"
        )
    return [by_name[episode] for episode in wanted]


def import_demonstrations(
    source: str | os.PathLike[str],
    *,
    format: RecordingFormat | None = None,
    key: str | None = None,
    rate: float | None = None,
    episodes: Sequence[str] | None = None,
    outcomes: str | os.PathLike[str] | Mapping[str, Sequence[float]] | None = None,
    outcome_names: Sequence[str] | None = None,
    outcome_units: Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    preprocessing: Preprocessing | None = None,
) -> ImportResult:
    """Read, select joints, trim, resample, join with the outcomes, and preview.

    Args:
        source: As in `read_recordings`, and so are the next four.
        format: What it is; None detects it.
        key: Where the motion is within the source.
        rate: Frames a second, for files that hold neither times nor a rate.
        episodes: Names of the episodes to keep, in order; None keeps all.
        outcomes: Where each demonstration's object landed: a CSV `episode,x,y[,z]`, or numbers by
            episode name. None takes `outcomes.csv` beside or inside the source.
        outcome_names: Names of the k components, in order, matched to the CSV's columns; None
            takes those as they stand.
        outcome_units: Unit of each component; None is metres.
        joints: Recorded names to keep, in the plan's order; None keeps all as recorded. Where the
            file names nothing, they name its columns in order.
        names: What to call them in the plan format; None keeps the recorded names.
        units: Recorded unit of each kept joint (`deg` is converted); None is radians.
        preprocessing: Time step, horizon and trimming; None takes the defaults.

    Raises:
        FileFormatError: As in `read_recordings`, or a damaged `outcomes.csv`.
        InvalidDemonstrationsError: Missing outcomes or joints (named), or demonstrations that
            cannot be learned from.
        ConfigurationError: Settings that contradict each other.
        MissingExtraError: The format's optional library is not installed.
    """
    source = Path(source)
    kind = format or detect_format(source)
    recordings = read_recordings(
        source, format=kind, key=key, rate=rate, episodes=episodes, joints=joints
    )
    if outcomes is None:
        known = find_outcomes(source, recordings)
    elif isinstance(outcomes, Mapping):
        known = given_outcomes(outcomes)
    else:
        known = read_outcomes(Path(outcomes))
    known = in_order(known, outcome_names)
    seen = outcomes_of(recordings, known, partial=episodes is not None)
    selection = select(recordings, joints, names, units)
    done = preprocess(selection.recordings, selection.units, preprocessing or Preprocessing())
    demonstrations = Demonstrations(
        done.plans,
        seen,
        PlanFormat(selection.names, selection.units, done.dt),
        tuple(outcome_names) if outcome_names is not None else known.names,
        tuple(outcome_units) if outcome_units is not None else (),
    )
    preview = make_preview(
        source.name, kind, selection.recordings, done, demonstrations, known.where
    )
    return ImportResult(
        demonstrations, tuple(recording.episode for recording in recordings), preview
    )

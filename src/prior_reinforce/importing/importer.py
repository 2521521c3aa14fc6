"""The way in: a recording on disk becomes `Demonstrations` and a preview.

A format is a file beside this one and a line of `FORMATS`.
"""

from __future__ import annotations

import importlib
import math
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    MissingExtraError,
)
from prior_reinforce.importing import csv, hdf5, lerobot, npz, ros, zarr
from prior_reinforce.importing.outcomes import find_outcomes, in_order, outcomes_of
from prior_reinforce.importing.preprocessing import Preprocessing, preprocess, select
from prior_reinforce.importing.preview import Preview
from prior_reinforce.importing.recording import ReadOptions, Recording, has_files
from prior_reinforce.plans.motions import Demonstrations, PlanFormat


@dataclass(frozen=True)
class Format:
    """How recordings of one format are recognised and read."""

    read: Callable[[Path, ReadOptions], list[Recording]]
    recognises: Callable[[Path], bool]
    """From names and layout alone; nothing large is opened."""
    library: str = ""
    """Optional library that reading needs, by the name of its module."""
    extra: str = ""
    """Extra of this package that installs it."""
    whole: bool = False
    """A folder laid out like this is this format, whatever else lies in it."""


FORMATS: Mapping[str, Format] = {
    "npz": Format(npz.read, lambda source: has_files(source, (".npz",))),
    "csv": Format(csv.read, lambda source: has_files(source, (".csv",))),
    "lerobot": Format(lerobot.read, lerobot.recognises, "pyarrow.parquet", "lerobot", whole=True),
    "robomimic": Format(hdf5.read_robomimic, hdf5.is_robomimic, "h5py", "hdf5"),
    "droid": Format(hdf5.read_droid, hdf5.is_droid, "h5py", "hdf5"),
    "ros": Format(ros.read, ros.recognises, "rosbags.highlevel", "ros"),
    "zarr": Format(zarr.read, zarr.recognises, "zarr", "zarr", whole=True),
}
"""What can be read. `ros` covers ROS 1 bags, ROS 2 sqlite bags and MCAP; `zarr` is the replay
buffer of Diffusion Policy."""


@dataclass(frozen=True, eq=False)
class ImportResult:
    """What an import gives; nothing is on disk yet."""

    demonstrations: Demonstrations
    """Ready to be learned from: `demonstrations.save(path)`."""
    episodes: tuple[str, ...]
    """Name of each demonstration in its source, in order."""
    preview: Preview
    """`preview.text` to print, `preview.draw(path)` to look at."""


def import_demonstrations(
    source: str | os.PathLike[str],
    *,
    format: str | None = None,
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
    """Read, join with the outcomes, select joints, trim, resample, and preview.

    Args:
        source: As in `read_recordings`, and so are the next four.
        format: See there.
        key: See there.
        rate: See there.
        episodes: See there.
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
    known = in_order(find_outcomes(source, recordings, outcomes), outcome_names)
    outcomes_seen = outcomes_of(recordings, known, partial=episodes is not None)
    kept = select(recordings, joints, names, units)
    done = preprocess(kept.recordings, kept.units, preprocessing or Preprocessing())
    demonstrations = Demonstrations(
        done.plans,
        outcomes_seen,
        PlanFormat(kept.names, kept.units, done.dt),
        tuple(outcome_names) if outcome_names is not None else known.names,
        tuple(outcome_units) if outcome_units is not None else (),
    )
    preview = Preview(f"{source.name} ({kind})", kept.recordings, done, demonstrations, known.where)
    return ImportResult(demonstrations, preview.episodes, preview)


def read_recordings(
    source: str | os.PathLike[str],
    *,
    format: str | None = None,
    key: str | None = None,
    rate: float | None = None,
    episodes: Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
) -> list[Recording]:
    """Read every episode as it was recorded, for instance to ask for each one's outcome.

    Args:
        source: A file, or the folder that holds the recording.
        format: What it is, a name of `FORMATS`; None detects it.
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
    if kind not in FORMATS:
        raise ConfigurationError(f"unknown format {kind!r}; give one of {', '.join(FORMATS)}")
    if not source.exists():
        raise FileFormatError(f"no recording at {source}; give the path of a file or a folder")
    if rate is not None and not (math.isfinite(rate) and rate > 0):
        raise ConfigurationError(f"rate must be a positive number of frames a second, got {rate}")
    _need(FORMATS[kind])
    read, kept = FORMATS[kind].read, None if joints is None else tuple(joints)
    wanted = None if episodes is None else tuple(map(str, episodes))
    found = read(source, ReadOptions(key, rate, wanted, kept))
    by_name = {recording.episode: recording for recording in found}
    twice = sorted(name for name, n in Counter(r.episode for r in found).items() if n > 1)
    if twice:
        raise InvalidDemonstrationsError(
            f"{source} holds more than one episode named {', '.join(twice)}; rename their files"
        )
    if wanted is None:
        if not found:
            raise FileFormatError(f"{source} holds no episode of format {kind}; say its format")
        return found
    missing = [episode for episode in wanted if episode not in by_name]
    if missing or not wanted:
        there = [
            recording.episode for recording in read(source, ReadOptions(key, rate, None, kept))
        ]
        raise InvalidDemonstrationsError(
            f"no episode {', '.join(missing) or 'named'} in {source}; it has "
            f"{', '.join(there) or 'none'}"
        )
    return [by_name[episode] for episode in wanted]


def detect_format(source: Path) -> str:
    """Return the format of a file or a folder, a name of `FORMATS`.

    Raises:
        FileFormatError: There is nothing there, or it is none or more than one of the formats.
    """
    if not source.exists():
        raise FileFormatError(f"no recording at {source}; give the path of a file or a folder")
    found = [name for name, format in FORMATS.items() if format.recognises(source)]
    found = [name for name in found if FORMATS[name].whole] or found
    if len(found) != 1:
        raise FileFormatError(
            f"{source} looks like {' and '.join(found) or 'no format that can be read'}; say its "
            f"format, one of {', '.join(FORMATS)}"
        )
    return found[0]


def _need(format: Format) -> None:
    """Raise MissingExtraError, with how to install it, where a library of the format is missing."""
    try:
        if format.library:
            importlib.import_module(format.library)
    except ImportError as error:
        raise MissingExtraError(
            f"{format.library.split('.')[0]} is not installed, which this format needs; run: "
            f'pip install "prior-reinforce[{format.extra}]"'
        ) from error

"""The way in: a recording on disk becomes `Demonstrations` and a preview.

A format is a file beside this one and a line of `FORMATS`.
"""

from __future__ import annotations

import importlib
import math
import os
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from typing_extensions import Unpack

from prior_reinforce.bench.importing import csv, hdf5, lerobot, npz, ros, zarr
from prior_reinforce.bench.importing.clock import TIME_UNITS
from prior_reinforce.bench.importing.inspection import (
    Inspection,
    hold_against,
    say_shaking,
    would_smoothing_help,
)
from prior_reinforce.bench.importing.outcomes import (
    find_outcomes,
    in_order,
    in_units,
    outcomes_of,
    uncertainty_of,
)
from prior_reinforce.bench.importing.preprocessing import (
    Preprocessed,
    Preprocessing,
    Selection,
    preprocess,
    refuse_copies,
    select,
)
from prior_reinforce.bench.importing.preview import Preview
from prior_reinforce.bench.importing.recording import HowToRead, ReadOptions, Recording, has_files
from prior_reinforce.bench.importing.tables import DELIMITERS, WORKBOOKS
from prior_reinforce.bench.importing.units import Doubt, refuse_doubts
from prior_reinforce.bench.robots import GateSettings, RobotLimits
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    MissingExtraError,
)
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
    options: frozenset[str] = frozenset({"key"})
    """Fields of `HowToRead` that say something of this format, beside those of every format."""
    whole: bool = False
    """A folder laid out like this is this format, whatever else lies in it."""


_TABLE = frozenset({"key", "time_column", "episode_column"})
_OPTIONAL = _TABLE | {"delimiter", "decimal"}
FORMATS: Mapping[str, Format] = {
    "npz": Format(
        npz.read,
        lambda source: has_files(source, npz.SUFFIXES),
        options=frozenset({"key", "time_column"}),
    ),
    "csv": Format(csv.read, lambda source: has_files(source, csv.SUFFIXES), options=_OPTIONAL),
    "excel": Format(
        csv.read_workbooks,
        lambda source: has_files(source, WORKBOOKS),
        "python_calamine",
        "excel",
        options=_TABLE,
    ),
    "lerobot": Format(lerobot.read, lerobot.recognises, "pyarrow.parquet", "lerobot", whole=True),
    "robomimic": Format(hdf5.read_robomimic, hdf5.is_robomimic, "h5py", "hdf5"),
    "droid": Format(hdf5.read_droid, hdf5.is_droid, "h5py", "hdf5"),
    "ros": Format(ros.read, ros.recognises, "rosbags.highlevel", "ros"),
    "zarr": Format(
        zarr.read,
        zarr.recognises,
        "zarr",
        "zarr",
        options=frozenset({"key", "time_column"}),
        whole=True,
    ),
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
    outcomes: str | os.PathLike[str] | Mapping[str, Sequence[float]] | None = None,
    outcome_names: Sequence[str] | None = None,
    outcome_units: Sequence[str] | None = None,
    outcome_unit: str | None = None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    plan_units: Sequence[str] | None = None,
    preprocessing: Preprocessing | None = None,
    robot: RobotLimits | None = None,
    gate: GateSettings | None = None,
    take_guesses: bool = False,
    **how: Unpack[HowToRead],
) -> ImportResult:
    """Read, join with the outcomes, select joints, trim, resample, and preview.

    Args:
        source: As in `read_recordings`.
        outcomes: Where each demonstration's object landed: a CSV `episode,x,y[,z][,sd]`, or numbers
            by episode name. None takes `outcomes.csv` beside or inside the source.
        outcome_names: Names of the k components, in order, matched to the CSV's columns; None
            takes those as they stand.
        outcome_units: Unit of each component; None is what the table's head says, or metres.
        outcome_unit: Unit in which a table holds those whose columns name none (`x_cm` does); None
            is the component's own, and an error where nothing could land there.
        names: What to call the joints in the plan format; None keeps the recorded names.
        units: Recorded unit of each kept joint, or one for all: `rad`, `deg`, `m`, `cm`, `mm`, or
            any other word. None takes what the recording says, and the plan's unit where it says
            nothing; where no arm could be in that unit, that is an error.
        plan_units: Unit of each joint in the plan; None is radians for angles, metres for lengths.
        preprocessing: Time step, horizon and trimming; None takes the defaults.
        robot: Limits that the preview holds every demonstration against; None checks none.
        gate: The gate's settings for that.
        take_guesses: Take units, times and names as they look, where that would be an error.
        how: As in `read_recordings`.

    Raises:
        FileFormatError: As in `read_recordings`, or a damaged `outcomes.csv`.
        InvalidDemonstrationsError: Missing outcomes or joints (named), or demonstrations that
            cannot be learned from.
        UnclearUnitsError: Units, times or names that nobody said, or that cannot be what somebody
            said; the message has the options that say what they look like.
        ConfigurationError: Settings that contradict each other.
        MissingExtraError: The format's optional library is not installed.
    """
    source = Path(source)
    recordings, kind = _read(source, how)
    kept = select(recordings, how.get("joints"), names, units, plan_units)
    doubts = [] if take_guesses else [*_doubts_of(recordings), *kept.doubts]
    try:
        known = in_order(
            find_outcomes(_places(source, kind), recordings, outcomes, outcome_names), outcome_names
        )
    except InvalidDemonstrationsError as missing:
        refuse_doubts(doubts, also=str(missing))
        raise
    if not isinstance(outcomes, Mapping):
        known, guessed = in_units(known, outcome_units, outcome_unit)
        doubts += [] if take_guesses else guessed
    refuse_doubts(doubts)
    partial = how.get("episodes") is not None or how.get("leave_out") is not None
    outcomes_seen = outcomes_of(recordings, known, partial=partial)
    settings = preprocessing or Preprocessing()
    done = preprocess(kept.recordings, kept.units, settings)
    refuse_copies(done.plans, [recording.episode for recording in recordings])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the preview's remarks say it, with the option to give
        demonstrations = Demonstrations(
            done.plans,
            outcomes_seen,
            PlanFormat(kept.names, kept.units, done.dt),
            tuple(outcome_names) if outcome_names is not None else known.names,
            tuple(outcome_units or [unit or "m" for unit in known.units]),
            uncertainty_of(recordings, known),
        )
    found = _inspection(kept, done, settings, robot, gate)
    preview = Preview(f"{source.name} ({kind})", found, demonstrations, known.where)
    return ImportResult(demonstrations, preview.episodes, preview)


def inspect_recordings(
    source: str | os.PathLike[str],
    *,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    plan_units: Sequence[str] | None = None,
    preprocessing: Preprocessing | None = None,
    robot: RobotLimits | None = None,
    gate: GateSettings | None = None,
    **how: Unpack[HowToRead],
) -> Inspection:
    """Say what recordings hold and what an import would make of them; nothing is needed but them.

    What nobody said of units, times and names, and what was said and cannot be, is taken as it
    looks, and named as a guess.

    Args:
        source: As in `read_recordings`.
        names: As in `import_demonstrations`, and so are the next four.
        units: See there.
        plan_units: See there.
        preprocessing: See there.
        robot: See there.
        gate: See there.
        how: As in `read_recordings`.

    Raises:
        FileFormatError: As in `read_recordings`.
        InvalidDemonstrationsError: Missing joints (named), or an episode that never moves.
        ConfigurationError: Settings that contradict each other.
        MissingExtraError: The format's optional library is not installed.
    """
    recordings, _ = _read(Path(source), how)
    kept = select(recordings, how.get("joints"), names, units, plan_units)
    settings = preprocessing or Preprocessing()
    done = preprocess(kept.recordings, kept.units, settings)
    found = _inspection(kept, done, settings, robot, gate)
    return replace(found, doubts=(*_doubts_of(recordings), *kept.doubts))


def _inspection(
    kept: Selection,
    done: Preprocessed,
    settings: Preprocessing,
    robot: RobotLimits | None,
    gate: GateSettings | None,
) -> Inspection:
    reports = hold_against(kept, done, robot, gate)
    name = None if robot is None else robot.robot
    shaking = say_shaking(kept, done, robot) if reports else ""
    helps = bool(shaking) and would_smoothing_help(kept, reports, settings, robot, gate)
    return Inspection(kept, done, name, reports, shaking, helps)


def appended(before: Demonstrations, more: Demonstrations) -> Demonstrations:
    """Return demonstrations with more of them; the shorter motions hold their last pose.

    Raises:
        InvalidDemonstrationsError: They mean other numbers, or have a motion twice.
    """
    for what, one, other in (
        ("plans of", before.format, more.format),
        ("outcomes", before.outcome_names, more.outcome_names),
        ("outcomes in", before.outcome_units, more.outcome_units),
    ):
        if one != other:
            raise InvalidDemonstrationsError(
                f"the demonstrations so far have {what} {one}, the new ones {other}; import all "
                "together"
            )
    horizon = max(before.horizon, more.horizon)
    plans = [
        np.pad(d.plans, ((0, 0), (0, horizon - d.horizon), (0, 0)), mode="edge")
        for d in (before, more)
    ]
    said = [f"demonstration {i} so far" for i in range(before.n)]
    refuse_copies(np.concatenate(plans), [*said, *(f"new one {i}" for i in range(more.n))])
    return replace(
        more,
        plans=np.concatenate(plans),
        outcomes_seen=np.concatenate([before.outcomes_seen, more.outcomes_seen]),
        outcome_noise=np.concatenate([before.outcome_noise, more.outcome_noise]),
        outcome_correction=np.concatenate([before.outcome_correction, more.outcome_correction]),
    )


def outcome_places(source: str | os.PathLike[str], format: str | None = None) -> list[Path]:
    """Return where a table of outcomes stands beside recordings: the first is where to write one.

    A folder of recordings holds its own. A file, and a data set that is a folder, has it beside.
    """
    source = Path(source)
    return _places(source, format or detect_format(source))


def _places(source: Path, kind: str) -> list[Path]:
    if source.is_file():
        return [source.parent]
    is_bag = (source / "metadata.yaml").is_file()
    return [source.parent, source] if FORMATS[kind].whole or is_bag else [source]


def read_recordings(
    source: str | os.PathLike[str], *, take_guesses: bool = False, **how: Unpack[HowToRead]
) -> list[Recording]:
    """Read every episode as it was recorded, for instance to ask for each one's outcome.

    Args:
        source: A file, or the folder that holds the recording.
        take_guesses: Take times as they look, where that would be an error.
        how: What is said of the recordings; each as in `HowToRead`.

    Raises:
        ConfigurationError: An unknown format, an option that the format has no use for, or one
            that contradicts the recording.
        UnclearUnitsError: The unit of the times is not said, and they cannot be seconds.
        FileFormatError: Missing, truncated, of another format, or ambiguous without `key`.
        InvalidDemonstrationsError: An episode that cannot be used, or one asked for that is not
            there.
        MissingExtraError: The format's optional library is not installed.
    """
    recordings, _ = _read(Path(source), how)
    if not take_guesses:
        refuse_doubts(_doubts_of(recordings))
    return recordings


def _read(source: Path, how: HowToRead) -> tuple[list[Recording], str]:
    """The recordings, their times perhaps guessed, and their format."""
    kind = how.get("format") or detect_format(source)
    if kind not in FORMATS:
        raise ConfigurationError(f"unknown format {kind!r}; give one of {', '.join(FORMATS)}")
    if not source.exists():
        raise FileFormatError(f"no recording at {source}; give the path of a file or a folder")
    rate, unit = how.get("rate"), how.get("time_unit")
    if rate is not None and not (math.isfinite(rate) and rate > 0):
        raise ConfigurationError(f"rate must be a positive number of frames a second, got {rate}")
    if unit is not None and unit not in TIME_UNITS:
        raise ConfigurationError(f"time-unit must be one of {', '.join(TIME_UNITS)}, got {unit!r}")
    said = {name: value for name, value in how.items() if value is not None}
    for name in sorted(_OPTIONAL & said.keys() - FORMATS[kind].options):
        option = name.replace("_", "-")
        raise ConfigurationError(f"--{option} {said[name]} has no use for {kind}; drop it")
    _need(FORMATS[kind])
    joints, wanted = how.get("joints"), how.get("episodes")
    options = ReadOptions(
        how.get("key"),
        rate,
        unit,
        how.get("time_column"),
        how.get("episode_column"),
        _delimiter(how.get("delimiter")),
        how.get("decimal"),
        None if wanted is None else tuple(map(str, wanted)),
        None if joints is None else tuple(joints),
    )
    return _chosen(source, kind, options, tuple(map(str, how.get("leave_out") or ()))), kind


def _delimiter(given: str | None) -> str | None:
    delimiter = given if given is None else DELIMITERS.get(given, given)
    if delimiter is not None and delimiter not in DELIMITERS.values() and len(delimiter) != 1:
        raise ConfigurationError(
            f"delimiter must be one of {', '.join(DELIMITERS)}, or one character, got {given!r}"
        )
    return delimiter


def _chosen(
    source: Path, kind: str, options: ReadOptions, leave_out: tuple[str, ...]
) -> list[Recording]:
    """The episodes that were asked for, in order."""
    read, wanted = FORMATS[kind].read, options.episodes
    found = read(source, options)
    by_name = {recording.episode: recording for recording in found}
    twice = sorted(name for name, n in Counter(r.episode for r in found).items() if n > 1)
    if twice:
        raise InvalidDemonstrationsError(
            f"{source} holds more than one episode named {', '.join(twice)}; rename their files"
        )
    if wanted is None and not found:
        raise FileFormatError(f"{source} holds no episode of format {kind}; say its format")
    there = tuple(by_name) if wanted is None else wanted
    missing = [e for e in (*there, *leave_out) if e not in by_name]
    kept = [episode for episode in there if episode not in leave_out]
    if missing or not kept:
        every = found if wanted is None else read(source, replace(options, episodes=None))
        names = ", ".join(recording.episode for recording in every) or "none"
        what = f"no episode {', '.join(missing)}" if missing else "no episode is left"
        raise InvalidDemonstrationsError(f"{what} in {source}; it has {names}: name those")
    return [by_name[episode] for episode in kept]


def _doubts_of(recordings: Sequence[Recording]) -> list[Doubt]:
    """One of each kind: the first episode's stands for all with the same remedy."""
    by_option = {d.option: d for r in reversed(recordings) for d in r.doubts}
    return list(by_option.values())


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

"""Which format a recording is in, from names and layout alone; nothing large is opened."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from prior_reinforce.errors import FileFormatError
from prior_reinforce.importing import hdf5, ros
from prior_reinforce.importing.files import files_in
from prior_reinforce.importing.hdf5 import read_droid, read_robomimic
from prior_reinforce.importing.lerobot import read_lerobot
from prior_reinforce.importing.npz_csv import read_csv, read_npz
from prior_reinforce.importing.recording import Reading, Recording, RecordingFormat
from prior_reinforce.importing.replay_buffer import (
    is_replay_buffer,
    read_replay_buffer,
)
from prior_reinforce.importing.ros import read_ros

READERS: dict[RecordingFormat, Callable[[Path, Reading], list[Recording]]] = {
    "npz": read_npz,
    "csv": read_csv,
    "lerobot": read_lerobot,
    "robomimic": read_robomimic,
    "droid": read_droid,
    "ros": read_ros,
    "zarr": read_replay_buffer,
}
"""One reader a format."""


def detect_format(source: Path) -> RecordingFormat:
    """The format of a file or a folder.

    Raises:
        FileFormatError: There is nothing there, or it is none or more than one of the formats.
    """
    if not source.exists():
        raise FileFormatError(f"no recording at {source}; give the path of a file or a folder")
    if is_replay_buffer(source):
        return "zarr"
    found: list[RecordingFormat] = []
    if source.is_dir():
        if (source / "meta" / "info.json").is_file():
            return "lerobot"
        if ros.bags_at(source):
            found.append("ros")
        if next(source.rglob("trajectory.h5"), None) is not None:
            found.append("droid")
        elif files_in(source, hdf5.SUFFIXES):
            found.append("robomimic")
        if files_in(source, (".npz",)):
            found.append("npz")
        if files_in(source, (".csv",)):
            found.append("csv")
    elif source.name == "trajectory.h5":
        return "droid"
    else:
        suffix = source.suffix.lower()
        by_suffix: dict[str, RecordingFormat] = {".npz": "npz", ".csv": "csv"}
        by_suffix |= dict.fromkeys(hdf5.SUFFIXES, "robomimic")
        by_suffix |= dict.fromkeys(ros.SUFFIXES, "ros")
        found = [by_suffix[suffix]] if suffix in by_suffix else []
    if len(found) != 1:
        raise FileFormatError(
            f"{source} looks like {' and '.join(found) or 'no format that can be read'}; say its "
            f"format, one of {', '.join(READERS)}"
        )
    return found[0]

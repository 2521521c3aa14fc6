"""Recordings in NPZ and CSV: what a lab writes when it writes its own log.

NPZ: a file an episode, or one file whose motion array has shape (N, T, D). CSV: a file an episode,
or one file with a column `episode`.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from prior_reinforce.errors import FileFormatError
from prior_reinforce.importing.files import files_in, named_damage, natural_order
from prior_reinforce.importing.recording import Reading, Recording, evenly, made_up_names

_MOTION_KEYS = ("q", "plans", "positions", "actions")
_TIME_COLUMNS = ("t", "time", "timestamp")


def read_npz(source: Path, reading: Reading) -> list[Recording]:
    """Read an NPZ file, or every NPZ file of a folder as an episode.

    Arrays: the motion (`key`, or `q`, `plans`, `positions`, `actions`), `t` or `dt` or `rate`, and
    where wanted `joint_names` or `names`, `outcome` or `outcomes` or `outcomes_seen`.
    """
    paths = files_in(source, (".npz",)) if source.is_dir() else [source]
    if len(paths) == 1:
        return _npz_episodes(paths[0], reading)
    return [
        recording
        for path in paths
        if reading.wants(path.stem)
        for recording in _npz_episodes(path, reading)
    ]


def _npz_episodes(path: Path, reading: Reading) -> list[Recording]:
    with (
        named_damage(path, "NPZ with plain number arrays"),
        path.open("rb") as file,
        np.load(file, allow_pickle=False) as archive,
    ):
        content = {name: np.array(archive[name]) for name in archive.files}
        if "metadata" in content:
            metadata = json.loads(str(content.pop("metadata")))
            form = metadata.get("format", metadata)
            content.setdefault("dt", np.array(float(form["dt"])))
            content.setdefault("names", np.array(form.get("names") or form.get("joint_names")))
    key = reading.key or next((name for name in _MOTION_KEYS if name in content), None)
    if key is None or key not in content:
        raise FileFormatError(
            f"{path} has no array {key or ' or '.join(_MOTION_KEYS)}; it holds "
            f"{sorted(content)}: say which with the key"
        )
    motion = content[key]
    if motion.ndim not in (2, 3) or motion.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{path}: {key} has shape {motion.shape} and type {motion.dtype}, expected numbers of "
            "shape (T, D) or (N, T, D)"
        )
    given = next((content[name] for name in ("joint_names", "names") if name in content), None)
    names = tuple(map(str, np.ravel(given))) if given is not None else None
    outcomes = next(
        (content[k] for k in ("outcome", "outcomes", "outcomes_seen") if k in content), None
    )
    single = motion.ndim == 2
    motions = motion[None] if single else motion
    if outcomes is not None:
        outcomes = np.reshape(outcomes, (1, -1)) if single else outcomes
        if outcomes.ndim != 2 or len(outcomes) != len(motions) or outcomes.dtype.kind not in "fiu":
            raise FileFormatError(
                f"{path}: outcomes have shape {outcomes.shape}, expected numbers of shape "
                f"({len(motions)}, k)"
            )
    recordings = []
    for index, positions in enumerate(motions):
        episode = path.stem if single else str(index)
        if not single and not reading.wants(episode):
            continue
        recordings.append(
            Recording(
                episode,
                _npz_times(content, positions.shape[0], index, reading.rate, episode, path),
                positions,
                names or made_up_names(positions.shape[1]),
                named=names is not None,
                outcome=None if outcomes is None else outcomes[index],
            )
        )
    return recordings


def _npz_times(
    content: Mapping[str, np.ndarray],
    count: int,
    index: int,
    rate: float | None,
    episode: str,
    path: Path,
) -> np.ndarray:
    with named_damage(path, "NPZ with times t, or dt, or rate"):
        if "t" in content:
            times = content["t"]
            return np.asarray(times[index] if times.ndim == 2 else times, dtype=np.float64)
        if "dt" in content:
            return np.arange(count) * float(content["dt"])
        if "rate" in content:
            rate = float(content["rate"])
    return evenly(count, rate, episode)


def read_csv(source: Path, reading: Reading) -> list[Recording]:
    """Read a CSV file, or every CSV file of a folder as an episode.

    The first line names the columns: `t` (or `time`, `timestamp`) in [s], `episode` if the file
    holds several, and the channels.
    """
    paths = files_in(source, (".csv",)) if source.is_dir() else [source]
    recordings: list[Recording] = []
    for path in paths:
        header, rows = _csv_rows(path)
        if "episode" not in header:
            if len(paths) > 1 and not reading.wants(path.stem):
                continue
            recordings.append(_csv_episode(path, path.stem, header, rows, reading))
            continue
        at = header.index("episode")
        for episode in sorted({row[at] for _, row in rows}, key=natural_order):
            if reading.wants(episode):
                own = [(line, row) for line, row in rows if row[at] == episode]
                recordings.append(_csv_episode(path, episode, header, own, reading))
    return recordings


def _csv_rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    with named_damage(path, "CSV in UTF-8"), path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file, strict=True)
        lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    if len(lines) < 3:
        raise FileFormatError(
            f"{path} has {len(lines)} lines; expected a line of column names and two frames or more"
        )
    header = [cell.strip() for cell in lines[0][1]]
    for line, row in lines[1:]:
        if len(row) != len(header):
            raise FileFormatError(
                f"{path}, line {line}: {len(row)} cells for {len(header)} columns; mend that line"
            )
    return header, [(line, [cell.strip() for cell in row]) for line, row in lines[1:]]


def _csv_episode(
    path: Path,
    episode: str,
    header: list[str],
    rows: list[tuple[int, list[str]]],
    reading: Reading,
) -> Recording:
    time = next((i for i, name in enumerate(header) if name.lower() in _TIME_COLUMNS), None)
    channels = [i for i, name in enumerate(header) if i != time and name != "episode"]
    if reading.joints and set(reading.joints) <= set(header):
        # Only these need to be numbers; a log may carry text beside them.
        channels = [header.index(name) for name in reading.joints]
    positions = np.array(
        [[_number(path, line, row[i], header[i]) for i in channels] for line, row in rows]
    )
    if time is None:
        times = evenly(len(rows), reading.rate, episode)
    else:
        times = np.array([_number(path, line, row[time], header[time]) for line, row in rows])
    return Recording(episode, times, positions, tuple(header[i] for i in channels))


def _number(path: Path, line: int, text: str, column: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise FileFormatError(
            f"{path}, line {line}: {column} is {text!r}, expected a number; mend that cell, or "
            "keep other columns"
        ) from None

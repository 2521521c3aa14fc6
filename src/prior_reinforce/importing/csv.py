"""Recordings in CSV: a file an episode, or one file with a column `episode`.

The first line names the columns: `t` (or `time`, `timestamp`, with a unit as in `t_ms`), `episode`
if the file holds several, and the channels.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from prior_reinforce.errors import FileFormatError
from prior_reinforce.importing.recording import (
    ReadOptions,
    Recording,
    files_at,
    named_damage,
    natural_order,
)
from prior_reinforce.importing.units import SECONDS, split_unit

_TIME_COLUMNS = ("t", "time", "timestamp")
Rows = list[tuple[int, list[str]]]
"""Cells of each row, with the number of its line."""


def read(source: Path, options: ReadOptions) -> list[Recording]:
    """Read a CSV file, or every CSV file of a folder."""
    paths = files_at(source, (".csv",))
    recordings: list[Recording] = []
    for path in paths:
        header, rows = read_table(path)
        if not header or len(rows) < 2:
            raise FileFormatError(
                f"{path} has {len(rows) + bool(header)} lines; expected a line of column names and "
                "two frames or more"
            )
        if "episode" not in header:
            if len(paths) == 1 or options.wants(path.stem):
                recordings.append(_episode(path, path.stem, header, rows, options))
            continue
        at = header.index("episode")
        for episode in sorted({row[at] for _, row in rows}, key=natural_order):
            if options.wants(episode):
                own = [(line, row) for line, row in rows if row[at] == episode]
                recordings.append(_episode(path, episode, header, own, options))
    return recordings


def read_table(path: Path) -> tuple[list[str], Rows]:
    """Read column names and rows; empty lines do not count.

    Raises:
        FileFormatError: No CSV, or a row of another length.
    """
    with named_damage(path, "CSV in UTF-8"), path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file, strict=True)
        stripped = ((reader.line_num, [cell.strip() for cell in row]) for row in reader)
        lines = [(line, row) for line, row in stripped if any(row)]
    header = lines[0][1] if lines else []
    for line, row in lines[1:]:
        if len(row) != len(header):
            raise FileFormatError(
                f"{path}, line {line}: {len(row)} cells for {len(header)} columns; mend that line"
            )
    return header, lines[1:]


def _episode(
    path: Path, episode: str, header: list[str], rows: Rows, options: ReadOptions
) -> Recording:
    bare = [split_unit(name, SECONDS)[0].lower() for name in header]
    time = next((i for i, name in enumerate(bare) if name in _TIME_COLUMNS), None)
    channels = [i for i, name in enumerate(header) if i != time and name != "episode"]
    if options.joints and set(options.joints) <= set(header):
        # Only these need to be numbers; a log may carry text beside them.
        channels = [header.index(name) for name in options.joints]

    def number(line: int, row: list[str], column: int) -> float:
        try:
            return float(row[column])
        except ValueError:
            raise FileFormatError(
                f"{path}, line {line}: {header[column]} is {row[column]!r}, expected a number; "
                "mend that cell, or keep other columns"
            ) from None

    positions = np.array([[number(*row, column) for column in channels] for row in rows])
    stamps = None if time is None else np.array([number(*row, time) for row in rows])
    name = "" if time is None else header[time]
    clock = options.clock(episode, len(rows), stamps=stamps, name=name)
    names = tuple(header[i] for i in channels)
    return Recording(
        episode, clock.times, positions, names, clock=clock.source, doubts=clock.doubts
    )

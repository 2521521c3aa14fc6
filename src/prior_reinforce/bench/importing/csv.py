"""Recordings in tables: CSV of any dialect, and workbooks (.xlsx, .xls, .ods).

A file an episode, or one with a column `episode`; of a workbook, a sheet an episode. One column may
hold the time; all others are channels. Logs of libfranka and of RTDE are known by their columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from prior_reinforce.bench.importing.clock import Clock
from prior_reinforce.bench.importing.naming import could_be_forgotten, find_channels, vectors
from prior_reinforce.bench.importing.options import ReadOptions
from prior_reinforce.bench.importing.recording import (
    NO_COLUMN,
    Episodes,
    Recording,
    files_at,
    natural_order,
    recorded,
    unread,
    without_units,
)
from prior_reinforce.bench.importing.rtde import mixed_rows
from prior_reinforce.bench.importing.tables import WORKBOOKS, Table, counts, read_tables
from prior_reinforce.bench.importing.units import (
    SECONDS,
    Ambiguity,
    say_names,
    split_unit,
)
from prior_reinforce.errors import ConfigurationError, FileFormatError

SUFFIXES = (".csv", ".tsv")
_WHEN_SAID = (*SUFFIXES, ".txt", ".dat", ".log")
"""Read where the format is said, because much else has such names."""
_TIMES = (
    "t", "time", "times", "timestamp", "timestamps", "stamp", "elapsed", "elapsed_time", "duration",
    "datetime", "date",
)  # fmt: skip
EPISODE_COLUMNS = tuple(
    name + ending
    for name in ("episode", "throw", "trial", "demo", "run")
    for ending in ("", "_id", "_index", "_number")
)
"""Names of a column that says of which episode a row is."""


class LogFormat(NamedTuple):
    """A log whose columns are documented."""

    name: str
    columns: tuple[str, ...]
    """Those that it is known by."""
    key: str
    """Which of its vectors is the measured motion."""
    time_unit: str
    mixed: bool = False
    """Whether a row may have its time from one cycle, and its positions from the next."""


LOG_FORMATS = (
    # libfranka, src/log.cpp: logToCSV writes time.toMSec(). First 0.9.2 and later, then of 2017.
    LogFormat("libfranka's log", ("time", "success_rate", "state.q[0]"), "state.q", "ms"),
    LogFormat("libfranka's log", ("duration", "success rate", "q[0]"), "q", "ms"),
    # UR's rtde/csv_writer.py and ur_rtde's recorder: seconds since the controller started.
    LogFormat("an RTDE log", ("timestamp", "actual_q_0"), "actual_q", "s", mixed=True),
)


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read a CSV file, or every CSV file of a folder."""
    return _of_files(files_at(source, SUFFIXES) or files_at(source, _WHEN_SAID), options)


def read_workbooks(source: Path, options: ReadOptions) -> Episodes:
    """Read a workbook, or every workbook of a folder."""
    return _of_files(files_at(source, WORKBOOKS), options)


def _of_files(paths: Sequence[Path], options: ReadOptions) -> Episodes:
    for path in paths:
        if len(paths) > 1 and path.stem in (options.leave_out or ()):
            yield path.stem, unread
            continue
        tables = read_tables(path, options.delimiter, options.decimal)
        for table in tables:
            if not table.names or len(table) < 2:
                raise FileFormatError(
                    f"{table.where} has {len(table)} frames; expected a line of column names and "
                    "two frames or more"
                )
            column = _episode_column(table, options)
            if column is None:
                sheet = table.where.removeprefix(f"{path} [").removesuffix("]")
                episode = path.stem if len(tables) == 1 else sheet
                yield episode, partial(_episode, table, episode, options)
                continue
            names = table.cells[column]
            for episode in sorted(set(names), key=natural_order):
                own = table.rows([i for i, name in enumerate(names) if name == episode])
                yield episode, partial(_episode, own, episode, options, column)


def _episode_column(table: Table, options: ReadOptions) -> int | None:
    if options.episode_column is not None:
        return _named_column(table, options.episode_column, "--episode-column")
    if not table.named:
        return None
    return next((i for i, n in enumerate(table.names) if n.lower() in EPISODE_COLUMNS), None)


def _named_column(table: Table, name: str, option: str) -> int:
    """A column by its name, with or without the unit in it, or by its number from 1."""
    bare = [split_unit(n, SECONDS)[0] for n in table.names]
    for names in (table.names, bare):
        if name in names:
            return names.index(name)
    if name.isdigit() and 1 <= int(name) <= len(table.names):
        return int(name) - 1
    raise ConfigurationError(
        f"{table.where} has no column {name!r} for {option}; it has {say_names(table.names)}"
    )


def _episode(
    table: Table, episode: str, options: ReadOptions, episode_column: int | None = None
) -> Recording:
    log = next((g for g in LOG_FORMATS if set(g.columns) <= set(table.names)), None)
    time, guessed = _time_column(table, options)
    index = 0 if time is None and _no_name_first(table) and _could_be_time(table) else None
    others = [i for i in range(len(table.names)) if i not in (time, episode_column, index)]
    channels, named = _channels(table, others, options, log)
    remarks = []
    if log is not None:
        remarks.append(f"{log.name}: time in {log.time_unit}, motion is {log.key} (measured)")
    if log is not None and log.mixed and time is not None:
        mixed = mixed_rows(table.numbers(time), table.columns(channels))
        if np.any(mixed):
            table = table.rows(np.flatnonzero(~mixed).tolist())
            why = "rows left out whose positions are of another cycle than their time"
            remarks.append(f"{why}: {mixed.sum()}")
    clock = _clock(table, episode, time, options, log and log.time_unit)
    if index is not None and channels == others and not options.joints:
        remarks.append(f"column {index + 1} left out, an index without a name")
    texts = [i for i in channels if table.is_text(i)] if channels == others else []
    if texts:
        channels = [i for i in channels if i not in texts]
        left_out = say_names([table.names[i] for i in texts])
        remarks.append(f"{left_out} left out, which holds no number")
    names, units = without_units([table.names[i] or f"column {i + 1}" for i in channels])
    return recorded(
        episode,
        clock,
        table.columns(channels),
        names if named else (),
        remarks=tuple(remarks),
        units=tuple(table.units[i] or u for i, u in zip(channels, units, strict=True)),
        ambiguities=(*guessed, *clock.ambiguities),
        columns=names if table.named else (),
        left_out=_unread_motion(table, others, channels),
    )


def _unread_motion(
    table: Table, others: Sequence[int], channels: Sequence[int]
) -> dict[str, tuple[float, float]]:
    """Range of each column of numbers that moves and is not read, such as a gripper's."""
    rest = [i for i in others if i not in channels]
    moving = could_be_forgotten([table.names[i] for i in rest], [table.names[i] for i in channels])
    ranges = {}
    for i in rest:
        name, values = table.names[i], table.values[:, i]
        if name in moving and table.is_number(i) and not counts(values) and np.ptp(values) > 0:
            ranges[name] = float(values.min()), float(values.max())
    return ranges


def _time_column(table: Table, options: ReadOptions) -> tuple[int | None, tuple[Ambiguity, ...]]:
    """The column of times, None where there is none, and what is only guessed of it."""
    if options.time_column == NO_COLUMN:
        return None, ()
    if options.time_column is not None:
        return _named_column(table, options.time_column, "--time-column"), ()
    if table.named:
        bare = [split_unit(name, SECONDS)[0].lower() for name in table.names]
        found = next((i for i, name in enumerate(bare) if name in _TIMES), None)
        if found is not None or not _no_name_first(table):
            return found, ()
        if table.nanoseconds(0) is not None:
            return 0, ()
        if options.rate is not None:
            return None, ()
    if len(table.names) > 1 and _could_be_time(table):
        what = f"{table.where} names no column of times, and column 1 looks like the time"
        return 0, (Ambiguity(what, "--time-column 1"),)
    return None, ()


def _no_name_first(table: Table) -> bool:
    """Whether the first column has no name, as pandas writes an index."""
    return table.named and (not table.names[0] or table.names[0].startswith("Unnamed:"))


def _could_be_time(table: Table) -> bool:
    """Whether the first column increases steadily."""
    stamps = table.nanoseconds(0)
    if stamps is None and table.is_text(0):
        return False
    steps = np.diff(table.numbers(0) if stamps is None else stamps)
    return bool(np.all(steps > 0) and steps.max() < 10 * np.median(steps))


def _clock(
    table: Table, episode: str, time: int | None, options: ReadOptions, unit: str | None
) -> Clock:
    if time is None:
        return options.clock(episode, len(table))
    dates, name = table.nanoseconds(time), table.names[time] or f"column {time + 1}"
    stamps, unit = (dates, "ns") if dates is not None else (table.numbers(time), unit)
    unit = unit or table.units[time]
    return options.clock(episode, len(table), stamps=stamps, name=name, unit=unit)


def _channels(
    table: Table, others: Sequence[int], options: ReadOptions, log: LogFormat | None
) -> tuple[list[int], bool]:
    """Columns of the motion, and whether their names are those of joints.

    Only these need to be numbers in every row; a log may carry others beside them.
    """
    names, joints = [table.names[i] for i in others], options.joints or ()
    if not table.named:
        return list(others), False
    if options.key is None and joints:
        found = find_channels(joints, names)
        if found is not None:
            return [others[i] for i in found], True
    key, groups = options.key or (log and log.key), vectors(names)
    if key is None:
        return list(others), True
    if key not in groups:
        raise FileFormatError(
            f"{table.where} has no columns {key}_0, {key}_1, ...; numbered columns are "
            f"{', '.join(groups) or 'none'}: say which with the key"
        )
    columns = [others[i] for i in groups[key]]
    by_name = {j: others[i] for j in joints for i in find_channels((j,), names) or ()}
    if len(columns) + len(by_name) == len(joints):  # a gripper beside a log's joints
        rest = iter(columns)
        columns = [by_name[j] if j in by_name else next(rest) for j in joints]
    return columns, False

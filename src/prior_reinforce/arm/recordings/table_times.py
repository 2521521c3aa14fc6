"""The times of a table's rows: a column of time stamps, two that are one time, or a frame rate."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from prior_reinforce.arm.recordings.clock import clock_from_columns, clock_of
from prior_reinforce.arm.recordings.options import NO_COLUMN, ReadOptions
from prior_reinforce.arm.recordings.tables import Column, Table
from prior_reinforce.arm.recordings.time_finder import (
    COLUMN_TIMES,
    FEWEST_COUNTS,
    Clock,
    DeclaredRate,
    FoundTimes,
    Times,
    declared_rate,
    find_times,
    guess_times,
    is_clock,
    is_periods,
    rises,
    says_time,
)
from prior_reinforce.arm.recordings.units import FRAME, SECONDS, known_unit, say_names, split_unit
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.units import NS_PER_S

_DATES = ("date", "datum", "day", "fecha", "data")
_SAYS = re.compile(
    r"([A-Za-z][A-Za-z_ ]*?)\s*[:=]\s*(\d+\.?\d*(?:[eE][-+]?\d+)?)(?![\d.:-]|,\d)\s*([A-Za-zµ]*)"
)
"""`fps: 40`, `sample rate = 1 kHz`."""
_OF_ANYTHING = re.compile(r"rate|period|freq(uency)?([ _]?hz)?", re.IGNORECASE)
"""Names of rates that may be of a swing, or a flow, as well as of frames."""
_SECONDS = re.compile(r"(?P<stem>.*?)(secs?|seconds|s)")
_THOUSAND = re.compile(r"\d{1,3}([.,]\d{3})+")
"""`1.000` beside a decimal comma."""


def _declared(table: Table, options: ReadOptions) -> DeclaredRate | None:
    """The frame rate that comments or a column of one number declare."""
    stated = {
        name: float(numbers[0])
        for name, numbers in zip(table.names, table.values.T, strict=True)
        if len(numbers) > 1 and np.ptp(numbers) == 0 and not _OF_ANYTHING.fullmatch(name)
    }
    for line in table.comments:
        for name, number, unit in _SAYS.findall(line):
            of_time = known_unit(unit) in SECONDS
            if of_time or unit.lower() in ("", "hz", "khz", "fps"):
                scale = 1000 if unit.lower() == "khz" else 1
                stated[f"{name}_{unit}" if of_time else name] = float(number) * scale
    return declared_rate(table.where, stated, options.rate)


def with_whole_dates(table: Table) -> Table:
    """Join a column of dates and one of times of day: `09.03.2024 23:58:00`."""
    found = {name.lower(): i for i, name in enumerate(table.names) if table.named}
    called = _DATES, COLUMN_TIMES
    date, time = (next((found[n] for n in own if n in found), None) for own in called)
    if date is None or time in (None, date) or not (table.is_text(date) and table.is_text(time)):
        return table
    both = [" ".join(each) for each in zip(table.cells[date], table.cells[time], strict=True)]
    cells = [both if i == time else own for i, own in enumerate(table.cells) if i != date]
    kept = [i for i in range(len(table.names)) if i != date]
    names, units = tuple(table.names[i] for i in kept), tuple(table.units[i] for i in kept)
    whole = replace(table, names=names, units=units, cells=tuple(cells))
    return table if whole.nanoseconds(names.index(table.names[time])) is None else whole


def columns_named_time(table: Table, options: ReadOptions) -> list[int]:
    """Return the column that the user names as the time; else those named like one."""
    if options.time_column is not None:
        none = options.time_column == NO_COLUMN
        return [] if none else [find_column(table, options.time_column, "--time-column")]
    bare = (split_unit(name, SECONDS)[0].lower() for name in table.names)
    found = [i for i, name in enumerate(bare) if name in COLUMN_TIMES]
    return [i for i in found if len({*table.cells[i]}) > 1] or found  # a date alone stands still


def find_column(table: Table, name: str, option: str) -> int:
    """Return a column by its name, with or without a unit, or by its number from 1."""
    bare = [split_unit(n, SECONDS)[0] for n in table.names]
    for one, names in product((name, f"column {name}"), (table.names, bare)):
        if one in names:
            return names.index(one)
    if name.isdigit() and 1 <= int(name) <= len(table.names):
        return int(name) - 1
    raise ConfigurationError(
        f"{table.where} has no column {name!r} for {option}; it has {say_names(table.names)}"
    )


def time_columns(table: Table, options: ReadOptions, others: Sequence[int | None]) -> FoundTimes:
    """Return the columns of time stamps; what rises steadily, and is no joint, may be one."""
    called = columns_named_time(table, options)
    if options.time_column is not None:
        summed = any(is_periods(table.names[i], table.values[:, i]) for i in called)
        return FoundTimes(tuple(called), summed=summed)
    if (pair := _seconds_and_parts(table)) is not None:
        return pair
    free = _columns(table, [i for i in range(len(table.names)) if i not in others])
    dated = [i for i in free if table.is_unnamed(i) and table.nanoseconds(i) is not None]
    called = [i for i in (*called, *(i for i in dated if rises(free[i][1]))) if i in free]
    # Beside the column of episodes, the others are joints, if these are known.
    found = find_times(table.where, free, called, no_motion=len(others) > 1)
    if found.columns:
        return found
    declared = _declared(table, options)
    rate = options.rate or (declared.hertz if declared else None)
    found = guess_times(table.where, free, rate, in_arrays=False)
    return found if len(table.names) > 1 else FoundTimes()


def _columns(table: Table, chosen: Iterable[int]) -> dict[int, tuple[str, Column]]:
    """Some columns with their names, as times."""
    return {i: (table.names[i] or f"column {i + 1}", table.stamps(i)) for i in chosen}


def _seconds_and_parts(table: Table) -> FoundTimes | None:
    """Two columns that are one time: `stamp.sec` and `stamp.nanosec`, or `tv_sec` and `tv_usec`."""
    ends = {name.lower(): i for i, name in enumerate(table.names) if table.named}
    for name, i in ends.items():
        if (match := _SECONDS.fullmatch(name)) is None:
            continue
        for ending, j in ends.items():
            unit = known_unit(ending.removeprefix(match["stem"])) or ""
            if ending.startswith(match["stem"]) and SECONDS.get(unit, 1.0) < 1:
                whole, part = table.values[:, i], table.values[:, j] * SECONDS[unit]
                if np.all(whole % 1 == 0) and np.all((part >= 0) & (part < 1)):
                    return FoundTimes((i, j), unit=unit)
    return None


def is_coarse_time(table: Table, column: int) -> bool:
    """Whether a column holds whole seconds of the time."""
    if (pair := _seconds_and_parts(table)) is not None and column in pair.columns:
        return True
    dates = table.nanoseconds(column)
    return dates is not None and bool(np.diff(dates).max(initial=0) <= NS_PER_S)


def is_long_format(table: Table, column: int) -> bool:
    """Whether a table in long format has a row for each joint, which this column names."""
    texts = {*table.cells[column]}
    if len(texts) < 2 or not table.is_text(column):
        return False
    for i in (i for i, name in enumerate(table.names) if says_time(name)):
        stamps = table.stamps(i).tolist()
        times, pairs = {*stamps}, {*zip(stamps, table.cells[column], strict=True)}
        if len(times) > 1 and len(pairs) == len(table) > (len(times) - 1) * len(texts):
            return True
    return False


def counts_rows(table: Table, column: int, times: Times) -> bool:
    """Whether a column counts rows or is a clock, which no joint is."""
    if table.is_unnamed(column):
        return rises(table.stamps(column))
    long = len(table) >= FEWEST_COUNTS
    return long and is_clock(table.names[column], table.values[:, column], times)


def clock_of_table(
    table: Table, episode: str, times: FoundTimes, options: ReadOptions, unit: str | None
) -> Clock:
    """Return the times of an episode's rows; `unit` is that of a known log, or None.

    FileFormatError where a column of times holds something else.
    """
    if not times.columns:
        declared = _declared(table, options)
        if not (declared or options.rate):  # a line of means is no want of times
            _check_times(table, [i for i, n in enumerate(table.names) if says_time(n)])
        return clock_of(episode, len(table), options, declared=declared)
    time = times.columns[0]
    columns = _columns(table, range(len(table.names)))
    if table.nanoseconds(time) is not None:
        unit = "ns"
    else:
        _check_times(table, [time])
        columns[time] = (columns[time][0], table.numbers(time))
        of_head = table.units[time]
        unit = times.unit or unit or (of_head if of_head in SECONDS else None)
    if times.unit and len(times.columns) == 2:
        (name, whole), (part_name, part) = (columns[i] for i in times.columns)
        stamps = (whole - whole[0]) / SECONDS[times.unit] + part
        columns[time] = (f"{name} and {part_name}", stamps)
    # Where there are times, a comment may be of another rate, as that of control.
    frames = FRAME in (unit, options.time_unit)
    declared = _declared(table, options) if frames else None
    times = times._replace(held=tuple(i for i in times.held if table.is_number(i)), unit=unit)
    return clock_from_columns(table.where, episode, len(table), times, columns, options, declared)


def _check_times(table: Table, columns: Sequence[int]) -> None:
    """Refuse a line in which a column of times holds something else: `Mittelwert`."""
    for i in columns:
        bad = np.isnan(table.values[:, i])
        if table.named and 0 < bad.sum() < len(bad) / 2:
            row = int(np.argmax(bad))
            remedy = "take that line out"
            if _THOUSAND.fullmatch(table.cells[i][row]):
                remedy = "if that is a thousand, write the column without such marks"
            raise table.unlike(row, i, f", expected a time; {remedy}")

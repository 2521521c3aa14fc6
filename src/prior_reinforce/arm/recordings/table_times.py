"""The times of a table's rows: a column, two that are one time, or a rate in its comments."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, islice, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.beside import is_clock
from prior_reinforce.arm.recordings.clock import (
    FEWEST_COUNTS,
    FRAME,
    NO_COLUMN,
    SAME_RATE,
    Clock,
    Times,
    counts_down,
    declared_rate,
    hold_together,
    is_periods,
    rises,
    says_time,
    skips_frames,
    tells_time,
)
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.tables import Table, is_unnamed
from prior_reinforce.arm.recordings.units import (
    SECONDS,
    Ambiguity,
    known_unit,
    say_names,
    split_unit,
)
from prior_reinforce.errors import ConfigurationError, FileFormatError

_TIMES = (
    "t", "time", "times", "timestamp", "timestamps", "stamp", "elapsed", "elapsed_time", "duration",
    "datetime", "date", "zeit", "uhrzeit", "hora", "heure", "ora",
)  # fmt: skip
_DATES = ("date", "datum", "day", "fecha", "data")
_MOST_COMMENTS = 200
"""Lines above a table that are looked through. Ours."""
_SAYS = re.compile(
    r"([A-Za-z][A-Za-z_ ]*?)\s*[:=]\s*(\d+\.?\d*(?:[eE][-+]?\d+)?)(?![\d.:-]|,\d)\s*([A-Za-zµ]*)"
)
"""`fps: 40`, `sample rate = 1 kHz`."""
_SECONDS = re.compile(r"(?P<stem>.*?)(secs?|seconds|s)")


def said_above(path: Path) -> dict[str, float]:
    """Numbers by name in the comments above a table, `# fps: 40`; `dt_ms` of `dt: 25 ms`."""
    said: dict[str, float] = {}
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in islice(file, _MOST_COMMENTS):
            if line.strip() and not line.lstrip("\ufeff ").startswith(("#", "%", "//")):
                break
            for name, number, unit in _SAYS.findall(line):
                of_time = known_unit(unit) in SECONDS
                if of_time or unit.lower() in ("", "hz", "khz", "fps"):
                    scale = 1000 if unit.lower() == "khz" else 1
                    said[f"{name}_{unit}" if of_time else name] = float(number) * scale
    return said


def _declared(table: Table, said: dict[str, float], options: ReadOptions) -> dict[str, Any]:
    """The rate that comments declare, as `clock_of` takes it.

    ConfigurationError if another rate is given.
    """
    found = declared_rate(table.where, said, options.rate)
    own, rate = found.get("own_rate"), options.rate
    if own and rate and abs(own - rate) > SAME_RATE * own:
        raise ConfigurationError(
            f"{table.where} says {own:g} frames a second in its comment {found['rate_name']}, but "
            f"--rate {rate:g}; drop --rate, or correct that comment"
        )
    return found


def with_whole_dates(table: Table) -> Table:
    """Return a table whose columns of dates and of times of day are one: `09.03.2024 23:58:00`."""
    found = {name.lower(): i for i, name in enumerate(table.names) if table.named}
    date, time = (next((found[n] for n in own if n in found), None) for own in (_DATES, _TIMES))
    if date is None or time in (None, date) or not (table.is_text(date) and table.is_text(time)):
        return table
    both = [" ".join(each) for each in zip(table.cells[date], table.cells[time], strict=True)]
    cells = [both if i == time else own for i, own in enumerate(table.cells) if i != date]
    kept = [i for i in range(len(table.names)) if i != date]
    names, units = tuple(table.names[i] for i in kept), tuple(table.units[i] for i in kept)
    whole = replace(table, names=names, units=units, cells=tuple(cells))
    return table if whole.nanoseconds(names.index(table.names[time])) is None else whole


def called_times(table: Table, options: ReadOptions) -> list[int]:
    """The column that is given as the time; else those that are called like one."""
    if options.time_column is not None:
        none = options.time_column == NO_COLUMN
        return [] if none else [named_column(table, options.time_column, "--time-column")]
    bare = (split_unit(name, SECONDS)[0].lower() for name in table.names)
    found = [i for i, name in enumerate(bare) if name in _TIMES]
    return [i for i in found if len({*table.cells[i]}) > 1] or found  # a date alone stands still


def named_column(table: Table, name: str, option: str) -> int:
    """A column by its name, with or without the unit in it, or by its number from 1."""
    bare = [split_unit(n, SECONDS)[0] for n in table.names]
    for one, names in product((name, f"column {name}"), (table.names, bare)):
        if one in names:
            return names.index(one)
    if name.isdigit() and 1 <= int(name) <= len(table.names):
        return int(name) - 1
    raise ConfigurationError(
        f"{table.where} has no column {name!r} for {option}; it has {say_names(table.names)}"
    )


_THOUSAND = re.compile(r"\d{1,3}([.,]\d{3})+")
"""`1.000` beside a decimal comma."""


class TimeColumns(NamedTuple):
    """Which columns are the time."""

    columns: tuple[int, ...] = ()
    """None, one, or whole seconds and a part of a second."""
    guessed: tuple[Ambiguity, ...] = ()
    held: tuple[int, ...] = ()
    """Columns that must agree with it."""
    unit: str | None = None
    """Unit of the last column, where it is known by other columns or by its numbers."""
    summed: bool = False
    """Whether the column holds the time since the row before."""


def time_columns(
    table: Table, options: ReadOptions, above: dict[str, float], others: Sequence[int | None]
) -> TimeColumns:
    """The columns of times; whatever rises steadily, and is no joint, may be one."""
    called = called_times(table, options)
    if options.time_column is not None:
        summed = any(is_periods(table.names[i], table.values[:, i]) for i in called)
        return TimeColumns(tuple(called), summed=summed)
    if (pair := _seconds_and_parts(table)) is not None:
        return pair
    free = [i for i in range(len(table.names)) if i not in others]
    rising = [i for i in free if rises(table.stamps(i))]
    skipping = [i for i in free if skips_frames(table.values[:, i])]
    called = [i for i in called if i in free]
    called += [i for i in free if tells_time(table.names[i], table.stamps(i))]
    called += [i for i in free if i not in called and _are_dates(table, i)]
    called = called or [i for i in free if counts_down(table.names[i], table.stamps(i))]
    _refuse_several(table, called)
    if called:
        held = [i for i in free if says_time(table.names[i])]
        held = [i for i in held if np.all(np.diff(table.values[:, i]) > 0)]
        return TimeColumns((called[0],), (), tuple({*held, *skipping} - {called[0]}))
    for i in free:
        if table.named and is_periods(table.names[i], table.values[:, i]):
            return TimeColumns((i,), summed=True)
    nameless = [i for i in rising if is_unnamed(table.names[i])]
    if nameless and table.nanoseconds(nameless[0]) is not None:
        return TimeColumns((nameless[0],))
    if options.rate is not None or _declared(table, above, options):
        # Whatever else rises is held against the rate; what counts rows says nothing of it.
        long = len(table) >= FEWEST_COUNTS
        rising = [i for i in rising if long and np.any(np.diff(table.stamps(i)) != 1)]
        return TimeColumns((*skipping, *rising)[:1], unit=FRAME if skipping else None)
    if rising and len(table.names) > 1:
        first = rising[0]
        shown = (table.names[first] or f"{first + 1}").removeprefix("column ")
        column = f"column {shown}" if shown.isdigit() else shown
        what = f"{table.where} names no column of times, and {column} looks like the time"
        return TimeColumns((first,), (Ambiguity(what, f"--time-column {shlex.quote(shown)}"),))
    return TimeColumns()


def _are_dates(table: Table, column: int) -> bool:
    """Whether a column called a time holds dates that rise, though unevenly: a log of changes."""
    dates = table.nanoseconds(column) if says_time(table.names[column]) else None
    return dates is not None and bool(np.all(np.diff(dates) > 0))


def _refuse_several(table: Table, times: Sequence[int]) -> None:
    """FileFormatError if columns of one name are times that differ: of each channel its own.

    pandas numbers columns that come again, `Time.1`. Half a frame is no difference.
    """
    bare = [re.sub(r"\.\d+$", "", name) for name in table.names]
    for i, j in combinations(times, 2):
        one, other = table.stamps(i), table.stamps(j)
        apart = np.abs(one - other).max() > np.median(np.abs(np.diff(one))) / 2
        if bare[i] == bare[j] and apart:
            raise FileFormatError(
                f"{table.where} has two columns {bare[i]} that differ, {one[0]:g} and "
                f"{other[0]:g} first: each channel has its own times; write all at the times of "
                "one: numpy.interp(its times, their own times, their values)"
            )


def _seconds_and_parts(table: Table) -> TimeColumns | None:
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
                    return TimeColumns((i, j), unit=unit)
    return None


def counts_rows(table: Table, column: int, times: Times) -> bool:
    """Whether a column counts rows or tells the time, which no joint does."""
    if is_unnamed(table.names[column]):
        return rises(table.stamps(column))
    long = len(table) >= FEWEST_COUNTS
    return long and is_clock(table.names[column], table.values[:, column], times)


def clock_of_table(
    table: Table,
    episode: str,
    times: TimeColumns,
    options: ReadOptions,
    above: dict[str, float],
    unit: str | None,
) -> Clock:
    """Return the times of an episode's rows; `unit` is that of a known log, or None.

    FileFormatError where a column of times holds something else.
    """
    if not times.columns:
        declared = _declared(table, above, options)
        if not (declared or options.rate):  # a line of means is no want of times
            _check_times(table, [i for i, n in enumerate(table.names) if says_time(n)])
        return options.clock(episode, len(table), **declared)
    time = times.columns[0]
    dates, name = table.nanoseconds(time), table.names[time] or f"column {time + 1}"
    unit = times.unit or unit
    if dates is None:
        _check_times(table, [time])
    stamps, unit = (dates, "ns") if dates is not None else (table.numbers(time), unit)
    if unit and len(times.columns) == 2:
        whole, part = (table.values[:, i] for i in times.columns)
        stamps = (whole - whole[0]) / SECONDS[unit] + part
        name = f"{name} and {table.names[times.columns[1]]}"
    if times.summed:
        stamps = np.concatenate([[0.0], np.cumsum(stamps[1:])])
    unit = unit or table.units[time]
    # Where there are times, a comment may be of another rate, as that of control.
    frames = FRAME in (unit, options.time_unit)
    declared = _declared(table, above, options) if frames else {}
    clock = options.clock(episode, len(table), stamps=stamps, name=name, unit=unit, **declared)
    held = {table.names[i]: table.values[:, i] for i in times.held if table.is_number(i)}
    hold_together(table.where, {name: clock.times, **held})
    return clock


def _check_times(table: Table, columns: Sequence[int]) -> None:
    """Refuse a line in which a column of times holds something else: `Mittelwert`."""
    for i in columns:
        bad = np.isnan(table.values[:, i])
        if table.named and 0 < bad.sum() < len(bad) / 2:
            row = int(np.argmax(bad))
            remedy = "take that line out"
            if _THOUSAND.fullmatch(table.cells[i][row]):
                remedy = "if that is a thousand, write the column without such marks"
            raise FileFormatError(
                f"{table.where}, line {table.lines[row]}: {table.names[i]} is "
                f"{table.cells[i][row][:40]!r}, expected a time; {remedy}"
            )

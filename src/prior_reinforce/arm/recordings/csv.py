"""Recordings in CSV of any dialect.

A file an episode, or one with a column `episode`. One column may hold the time; all others are
channels. Logs of libfranka and of RTDE are known by their columns.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.beside import columns_beside, headed, is_clock, names_said
from prior_reinforce.arm.recordings.clock import (
    FRAME,
    NO_COLUMN,
    SAME_RATE,
    Clock,
    Times,
    declared_rate,
    hold_together,
    is_periods,
    rises,
    says_time,
    skips_frames,
    tells_time,
)
from prior_reinforce.arm.recordings.naming import find_channels, numbered_like, vectors, words
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import (
    EPISODE_COLUMNS,
    Episodes,
    Recording,
    files_at,
    natural_order,
    recorded,
    unread,
    without_units,
)
from prior_reinforce.arm.recordings.tables import Table, is_unnamed, read_table
from prior_reinforce.arm.recordings.units import (
    SECONDS,
    Ambiguity,
    known_unit,
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
_FEWEST_COUNTS = 20
"""Rows of which it can be said that a column counts them. Ours."""
_MOST_WORDS = 8
"""Texts between which a column switches. Ours."""
_MOST_COMMENTS = 200
"""Lines above a table that are looked through. Ours."""
_SAYS = re.compile(
    r"([A-Za-z][A-Za-z_ ]*?)\s*[:=]\s*(\d+\.?\d*(?:[eE][-+]?\d+)?)(?![\d.:-])\s*([A-Za-zµ]*)"
)
"""`fps: 40`, `sample rate = 1 kHz`."""
_SECONDS = re.compile(r"(?P<stem>.*?)(secs?|seconds|s)")


class LogFormat(NamedTuple):
    """A log whose columns are documented."""

    name: str
    columns: tuple[str, ...]
    """Those that it is known by."""
    key: str
    """Which of its vectors is the measured motion."""
    time_unit: str


LOG_FORMATS = (
    # libfranka, src/log.cpp: logToCSV writes time.toMSec(). First 0.9.2 and later, then of 2017.
    LogFormat("libfranka's log", ("time", "success_rate", "state.q[0]"), "state.q", "ms"),
    LogFormat("libfranka's log", ("duration", "success rate", "q[0]"), "q", "ms"),
    # UR's rtde/csv_writer.py and ur_rtde's recorder: seconds since the controller started.
    LogFormat("an RTDE log", ("timestamp", "actual_q_0"), "actual_q", "s"),
)


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read a CSV file, or every CSV file of a folder."""
    paths = files_at(source, SUFFIXES) or files_at(source, _WHEN_SAID)
    for path in paths:
        if len(paths) > 1 and path.stem in (options.leave_out or ()):
            yield path.stem, unread
            continue
        table = headed(read_table(path, options.delimiter, options.decimal), options.joints)
        said = _said_above(path)
        if not table.names or len(table) < 2:
            raise FileFormatError(
                f"{path} has {len(table)} frames; expected a line of column names and two frames "
                "or more"
            )
        column, names, guessed = _throws(table, path.stem, options, alone=len(paths) == 1)
        for episode in sorted(set(names), key=natural_order):
            own = table.rows([i for i, name in enumerate(names) if name == episode])
            yield episode, partial(_episode, own, episode, options, column, guessed, said)


def _said_above(path: Path) -> dict[str, float]:
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


def _throws(
    table: Table, stem: str, options: ReadOptions, *, alone: bool
) -> tuple[int | None, Sequence[str], tuple[Ambiguity, ...]]:
    """The column that says of which episode each row is, what it says, and what is only guessed.

    In a single file without such a column, times that begin anew part the episodes; else a column
    that numbers long stretches of rows may.
    """
    whole = [stem] * len(table)
    if options.episode_column == NO_COLUMN:
        return None, whole, ()
    names = [name.lower() for name in table.names if table.named]
    column = next((i for i, name in enumerate(names) if name in EPISODE_COLUMNS), None)
    if options.episode_column is not None:
        column = _named_column(table, options.episode_column, "--episode-column")
    if column is not None:
        return column, table.cells[column], ()
    if not (alone and names):
        return None, whole, ()
    starts = _starts(table, options)
    for i, cells in enumerate(table.cells):
        changes = [k for k in range(len(cells)) if k == 0 or cells[k] != cells[k - 1]]
        says = [cells[k] for k in changes]
        if len(set(says)) < len(says) or len(says) < 2:
            continue
        if changes == starts:
            return i, cells, ()
        first = int(says[0]) if says[0].isdigit() else 0
        names_them = table.is_text(i) or says == [str(first + k) for k in range(len(says))]
        long = len(says) > 2 and min(np.diff([*changes, len(cells)])) >= _FEWEST_COUNTS
        if names_them and long and len(starts) == 1:
            name = table.names[i]
            what = f"{table.where} is one file, and {name} numbers {len(says)} stretches of rows"
            option = f"--episode-column {shlex.quote(name)}"
            what += f": it looks as if these were the episodes (if it is one: {NO_COLUMN})"
            return i, cells, (Ambiguity(what, option),)
    if len(starts) == 1:
        return None, whole, ()
    numbers = np.searchsorted(starts, np.arange(len(table)), side="right") - 1
    return None, [f"{stem}-{number}" for number in numbers], ()


def _starts(table: Table, options: ReadOptions) -> list[int]:
    """Rows in which the time begins anew, with the first."""
    time = next(iter(_called_times(table, options)), None)
    if time is None or not table.is_number(time):
        return [0]
    times = table.values[:, time]
    steps = np.diff(times)
    falls = (np.flatnonzero(steps < 0) + 1).tolist()
    anew = np.all(np.abs(times[falls] - times[0]) <= 2 * np.median(np.abs(steps)))
    long = np.min(np.diff([0, *falls, len(times)])) >= _FEWEST_COUNTS
    return [0, *falls] if anew and long else [0]


def _called_times(table: Table, options: ReadOptions) -> list[int]:
    """The column that is given as the time; else those that are called like one."""
    if options.time_column is not None:
        none = options.time_column == NO_COLUMN
        return [] if none else [_named_column(table, options.time_column, "--time-column")]
    bare = (split_unit(name, SECONDS)[0].lower() for name in table.names if table.named)
    return [i for i, name in enumerate(bare) if name in _TIMES]


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
    table: Table,
    episode: str,
    options: ReadOptions,
    episode_column: int | None,
    guessed: tuple[Ambiguity, ...],
    above: dict[str, float],
) -> Recording:
    log = next((g for g in LOG_FORMATS if set(g.columns) <= set(table.names)), None)
    said, told = _names_in_cells(table, options)
    called = [name or f"column {i + 1}" for i, name in enumerate(table.names)]
    names = [said.get(i, name) for i, name in enumerate(table.names)]
    joints = options.joints if table.named else None
    found = None if joints is None else find_channels(joints, names)
    times = _time_columns(table, options, above, [episode_column, *(found or ())])
    aside = {*times.columns, *times.held, episode_column, *told}
    others = [i for i in range(len(names)) if i not in aside]
    channels, named = list(others), table.named
    if found and not options.key and {*found} <= {*others}:
        channels = found
    elif table.named and (keys := options.key or ((log.key,) if log else ())):
        channels, named = _by_key(table, keys, others, options.joints or ()), False
    remarks = []
    if log is not None:
        remarks.append(f"{log.name}: time in {log.time_unit}, motion is {log.key} (measured)")
    clock = _clock(table, episode, times, options, above, log and log.time_unit)
    counts = [i for i in others if table.is_number(i) and _counts(table, i, clock.times)]
    rising = [i for i in counts if channels == others and table.named and not options.joints]
    all_read = not options.key and found is None
    texts = [i for i in others if table.is_text(i)]
    if not all_read:  # else only those that change between a few: `on` and `off`
        texts = [i for i in texts if 1 < len({*table.cells[i]} - {""}) <= _MOST_WORDS]
    for left, why in (
        (rising, "rises with every row, as times and counters do"),
        (texts, "holds no number"),
    ):
        channels = [i for i in channels if i not in left]
        remarks += [f"{say_names([called[i] for i in left])} left out, which {why}"] * bool(left)
    own, units = without_units([called[i] for i in channels])
    rest = [i for i in others if i not in (*channels, *counts) and not table.is_text(i)]
    return recorded(
        episode,
        clock,
        table.columns(channels),
        tuple(said.get(i, name) for i, name in zip(channels, own, strict=True))
        if named or said.keys() >= {*channels}
        else (),
        remarks=tuple(remarks),
        units=tuple(table.units[i] or u for i, u in zip(channels, units, strict=True)),
        ambiguities=(*guessed, *times.guessed, *clock.ambiguities),
        columns=own if table.named else (),
        left_out=columns_beside(
            [called[i] for i in (*channels, *rest)],
            table.values[:, [*channels, *rest]],
            range(len(channels)),
            clock.times,
        ),
        beside={
            called[i]: (float(np.nanmin(table.values[:, i])), float(np.nanmax(table.values[:, i])))
            for i in others
            if i not in channels and np.any(np.isfinite(table.values[:, i]))
        },
    )


def _names_in_cells(table: Table, options: ReadOptions) -> tuple[dict[int, str], set[int]]:
    """Names of numbered columns that stand in the cells of others, and which others these are.

    ROS writes `name0`, `name1`, ... beside `position0`, ..., or a cell of names beside one of
    positions. FileFormatError where they change, as they do if two publishers are in one table.
    """
    texts = [i for i in range(len(table.names)) if table.named and table.is_text(i)]
    groups = {s: [texts[i] for i in g] for s, g in vectors([table.names[i] for i in texts]).items()}
    groups |= {table.names[i]: [i] for i in texts}
    cells = {stem: _cells(table, group, 0) for stem, group in groups.items()}
    numbers = [i for i in range(len(table.names)) if i not in texts]
    called = [table.names[i] for i in numbers]
    for count in sorted({len(own) for own in cells.values() if len(own) > 1}):
        said = names_said(table.where, cells, count, options.joints)
        named = [i for key in options.key for i in vectors(called).get(key, ())]
        if said and not options.key:
            named = [called.index(name) for name in numbered_like(said, called) or ()]
        if not said or len(named) != count:
            continue
        stem = next(stem for stem, own in cells.items() if own == said)
        for row, line in enumerate(table.lines):
            if (own := _cells(table, groups[stem], row)) != said and any(own):
                raise FileFormatError(
                    f"{table.where}, line {line}: {stem} says {say_names(own)}, before "
                    f"{say_names(said)}; write rows of one publisher, in one order"
                )
        return dict(zip((numbers[i] for i in named), said, strict=True)), {*groups[stem]}
    return {}, set()


def _cells(table: Table, columns: Sequence[int], row: int) -> tuple[str, ...]:
    """The texts of some cells of a row, or of the list in an only one."""
    own = [table.cells[i][row] for i in columns]
    return words(own[0] if len(own) == 1 else own)


class _Times(NamedTuple):
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


def _time_columns(
    table: Table, options: ReadOptions, above: dict[str, float], others: Sequence[int | None]
) -> _Times:
    """The columns of times; whatever rises steadily, and is no joint, may be one."""
    called = _called_times(table, options)
    if options.time_column is not None:
        summed = any(is_periods(table.names[i], table.values[:, i]) for i in called)
        return _Times(tuple(called), summed=summed)
    if (pair := _seconds_and_parts(table)) is not None:
        return pair
    free = [i for i in range(len(table.names)) if i not in others]
    rising = [i for i in free if rises(table.stamps(i))]
    skipping = [i for i in free if skips_frames(table.values[:, i])]
    called = [i for i in called if i in free]
    called += [i for i in free if table.named and tells_time(table.names[i], table.stamps(i))]
    if called:
        held = [i for i in free if says_time(table.names[i])]
        held = [i for i in held if np.all(np.diff(table.values[:, i]) > 0)]
        return _Times((called[0],), (), tuple({*held, *skipping} - {called[0]}))
    for i in free:
        if table.named and is_periods(table.names[i], table.values[:, i]):
            return _Times((i,), summed=True)
    nameless = [i for i in rising if table.named and is_unnamed(table.names[i])]
    if nameless and table.nanoseconds(nameless[0]) is not None:
        return _Times((nameless[0],))
    if options.rate is not None or _declared(table, above, options):
        # Whatever else rises is held against the rate; what counts rows says nothing of it.
        long = len(table) >= _FEWEST_COUNTS
        rising = [i for i in rising if long and np.any(np.diff(table.stamps(i)) != 1)]
        return _Times((*skipping, *rising)[:1], unit=FRAME if skipping else None)
    if rising and len(table.names) > 1:
        first = rising[0]
        shown = table.names[first] if table.named and table.names[first] else f"{first + 1}"
        column = f"column {first + 1}" if shown.isdigit() else shown
        what = f"{table.where} names no column of times, and {column} looks like the time"
        return _Times((first,), (Ambiguity(what, f"--time-column {shlex.quote(shown)}"),))
    return _Times()


def _seconds_and_parts(table: Table) -> _Times | None:
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
                    return _Times((i, j), unit=unit)
    return None


def _counts(table: Table, column: int, times: Times) -> bool:
    """Whether a column counts rows or tells the time, which no joint does."""
    if is_unnamed(table.names[column]):
        return rises(table.stamps(column))
    long = len(table) >= _FEWEST_COUNTS
    return long and is_clock(table.names[column], table.values[:, column], times)


def _clock(
    table: Table,
    episode: str,
    times: _Times,
    options: ReadOptions,
    above: dict[str, float],
    unit: str | None,
) -> Clock:
    if not times.columns:
        declared = _declared(table, above, options)
        for i, name in enumerate(table.names):  # else it would be said to hold no times
            if not (table.named and says_time(name)) or declared or options.rate:
                continue
            bad = np.isnan(table.values[:, i])
            if 0 < bad.sum() < len(bad) / 2:
                row = int(np.argmax(bad))
                raise FileFormatError(
                    f"{table.where}, line {table.lines[row]}: {name} is "
                    f"{table.cells[i][row][:40]!r}, expected a time; take that line out"
                )
        return options.clock(episode, len(table), **declared)
    time = times.columns[0]
    dates, name = table.nanoseconds(time), table.names[time] or f"column {time + 1}"
    unit = times.unit or unit
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


def _by_key(
    table: Table, keys: Sequence[str], others: Sequence[int], joints: Sequence[str]
) -> list[int]:
    """Columns of the motion by the name before their numbers; by their own, those beside them."""
    names = [table.names[i] for i in others]
    groups = vectors(names)
    columns = []
    for key in keys:
        if key not in groups and key not in names:
            raise FileFormatError(
                f"{table.where} has no columns {key}_0, {key}_1, ...; numbered columns are "
                f"{', '.join(groups) or 'none'}: say which with --key"
            )
        columns += [others[i] for i in groups.get(key, ())] or [others[names.index(key)]]
    by_name = {j: others[i] for j in joints for i in find_channels((j,), names) or ()}
    if len(columns) + len(by_name) == len(joints):  # a gripper beside a log's joints
        rest = iter(columns)
        columns = [by_name[j] if j in by_name else next(rest) for j in joints]
    return columns

"""Recordings in CSV of any dialect: a file an episode, or one file with a column `episode`.

Logs of libfranka and of RTDE are known by their columns.
"""

from __future__ import annotations

import contextlib
import re
import shlex
from collections.abc import Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.beside import columns_beside, twin_vectors
from prior_reinforce.arm.recordings.naming import find_channels, numbered_like, vectors, words
from prior_reinforce.arm.recordings.options import NO_COLUMN, ReadOptions
from prior_reinforce.arm.recordings.outcome_names import names_in
from prior_reinforce.arm.recordings.outcomes import key_column
from prior_reinforce.arm.recordings.recording import (
    EPISODE_COLUMNS,
    ROW_COLUMNS,
    Episodes,
    Recording,
    files_at,
    natural_order,
    or_leave_out,
    recorded,
    unread,
    without_units,
)
from prior_reinforce.arm.recordings.stated import (
    failures,
    refuse_rates,
    says_success,
    says_valid,
    stated_names,
    without_invalid,
)
from prior_reinforce.arm.recordings.table_heads import (
    failed,
    read_sidecar,
    with_one_header,
    with_stated_header,
)
from prior_reinforce.arm.recordings.table_times import (
    clock_of_table,
    columns_named_time,
    counts_rows,
    find_column,
    is_coarse_time,
    is_long_format,
    time_columns,
    with_whole_dates,
)
from prior_reinforce.arm.recordings.tables import PLAIN, Table, read_table
from prior_reinforce.arm.recordings.time_finder import FEWEST_COUNTS, Times
from prior_reinforce.arm.recordings.units import Ambiguity, say_names
from prior_reinforce.errors import FileFormatError
from prior_reinforce.plans.channels import Kind, kinds, says_no_channel

SUFFIXES = (".csv", ".tsv")
IN_TEXT = (".txt", ".dat", ".log")
"""Read where nothing else is there, because much else has such names."""
_ABSENT = 9e9
"""What ABB writes for the position of an axis that is not there."""
_SEVERAL = re.compile(r"[-+.\deE]+(\s*[,;\s]\s*[-+.\deE]+)+")
"""Several numbers in a cell: `0.1,0.2`."""
_MOST_WORDS = 8
"""Texts between which a column switches. Ours."""
_FEW_FILES = 4
"""Files of a folder that are read again to tell whether one is unlike. Ours."""


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
    paths = files_at(source, SUFFIXES) or files_at(source, (*SUFFIXES, *IN_TEXT))
    stems = [path.stem for path in paths]
    for path in paths:
        if len(paths) > 1 and path.stem in (options.leave_out or ()):
            yield path.stem, unread
            continue
        with or_leave_out(path.stem, lambda: len(paths) > 1):
            table = read_table(path, options.delimiter, options.decimal)
            if len(paths) > 1 and _has_a_row_each(table, stems):
                continue
            sidecar = read_sidecar(table, options.joints)
            table = with_stated_header(table, sidecar, options.joints)
            table = with_whole_dates(with_one_header(table))
            if not table.names or len(table) < 2:
                raise FileFormatError(
                    f"{path} has {len(table)} frames; expected a line of column names and two "
                    "frames or more"
                )
            column, names, guessed = _episodes_of_rows(
                table, path.stem, options, alone=len(paths) == 1
            )
        rows = names.count("")
        left = (f"{rows} rows left out, which are of no episode",) * (0 < rows < len(names))
        for episode in sorted({*names} - {""} or {""}, key=natural_order):
            own = table.rows([i for i, name in enumerate(names) if name == episode])
            others = {*stems, *names} - {path.stem, episode}
            notes = (*left, *failed(table, sidecar, others))
            how = episode, options, column, guessed, notes
            guarded = or_leave_out(path.stem, partial(_has_other_columns, path, paths, options))
            yield episode, guarded(partial(_episode, own, *how))


def _has_other_columns(path: Path, paths: Sequence[Path], options: ReadOptions) -> bool:
    """Whether a file has other columns than the first files beside it."""

    def columns(of: Path) -> tuple[str, ...]:
        with contextlib.suppress(FileFormatError):
            return read_table(of, options.delimiter, options.decimal).names
        return ()

    return any(columns(path) != columns(other) for other in paths[:_FEW_FILES])


def tables_of_outcomes(source: Path, there: Sequence[str]) -> list[Path]:
    """Return the files among recordings that look like a table of outcomes."""
    found = []
    for path in files_at(source, SUFFIXES) if source.is_dir() else ():
        with contextlib.suppress(FileFormatError):  # beside recordings of another format
            found += [path] * (path.stem not in there and _has_a_row_each(read_table(path), there))
    return found


def _has_a_row_each(table: Table, episodes: Sequence[str]) -> bool:
    """Whether a table has one row an episode, as a table of outcomes has."""
    if not 1 < len(table) <= len(episodes):  # a recording's cells are not looked through for it
        return False
    key = key_column(table)
    rows = () if key is None else names_in(table, key)
    named = key is not None and table.names[key].lower() in ROW_COLUMNS
    return len({*rows}) == len(table) and (named or not {*rows}.isdisjoint(episodes))


def _episodes_of_rows(
    table: Table, stem: str, options: ReadOptions, *, alone: bool
) -> tuple[int | None, Sequence[str], tuple[Ambiguity, ...]]:
    """Return the column of episodes, if there is one, each row's episode, and what is guessed.

    In a single file without that column, a new episode begins where the time begins anew; or where
    a column that numbers long stretches of rows changes.
    """
    whole = [stem] * len(table)
    if options.episode_column == NO_COLUMN:
        return None, whole, ()
    said = (i for i, name in enumerate(table.names) if name.lower() in EPISODE_COLUMNS)
    column = next(said, None)
    if options.episode_column is not None:
        column = find_column(table, options.episode_column, "--episode-column")
    if column is not None:
        _refuse_labels_again(table, column)
        return column, table.cells[column], ()
    if not (alone and table.named):
        return None, whole, ()
    starts = _starts(table, options)
    for i, cells in enumerate(table.cells):
        changes = _changes(cells)
        says = [cells[k] for k in changes]
        if len(set(says)) < len(says) or len(says) < 2 or is_coarse_time(table, i):
            continue
        if changes == starts:
            return i, cells, ()
        first = int(says[0]) if says[0].isdigit() else 0
        names_them = table.is_text(i) or says == [str(first + k) for k in range(len(says))]
        long = len(says) > 2 and min(np.diff([*changes, len(cells)])) >= FEWEST_COUNTS
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


def _changes(cells: Sequence[str]) -> list[int]:
    """Return the rows in which a column changes, and the first."""
    return [k for k in range(len(cells)) if k == 0 or cells[k] != cells[k - 1]]


def _refuse_labels_again(table: Table, column: int) -> None:
    """Refuse labels of episodes that begin anew with another column, such as a session."""
    said = [label for label in table.cells[column] if label]
    if len({*said}) == len(_changes(said)):
        return
    table = table.rows([row for row, label in enumerate(table.cells[column]) if label])
    own, changes = table.cells[column], _changes(table.cells[column])
    for name, cells in zip(table.names, table.cells, strict=True):
        labels = {*zip(cells, own, strict=True)}
        if {*_changes(cells)} < {*changes} and len(labels) == len(changes):
            raise FileFormatError(
                f"{table.where}: {table.names[column]} counts anew with {name}, so that several "
                f"throws have one label: write both in one column, such as {name}_"
                f"{table.names[column]}, and name it, --episode-column"
            )


def _starts(table: Table, options: ReadOptions) -> list[int]:
    """Return the rows in which the time begins anew, and the first."""
    time = next(iter(columns_named_time(table, options)), None)
    if time is None or not table.is_number(time):
        return [0]
    times = table.values[:, time]
    steps = np.diff(times)
    falls = (np.flatnonzero(steps < 0) + 1).tolist()
    anew = np.all(np.abs(times[falls] - times[0]) <= 2 * np.median(np.abs(steps)))
    long = np.min(np.diff([0, *falls, len(times)])) >= FEWEST_COUNTS
    return [0, *falls] if anew and long else [0]


def _refuse_second_log(table: Table, times: Times) -> None:
    """Refuse a header that comes again among the rows, unless the time goes on there."""
    for line in table.heads:
        row = int(np.searchsorted(table.lines, line))
        if 0 < row < len(table) and times[row] <= times[row - 1]:
            raise FileFormatError(
                f"{table.where}, line {line}: the head comes again: two logs in one file; keep the "
                "part that is this motion, or leave that line out if the motion goes on"
            )


def _episode(
    table: Table,
    episode: str,
    options: ReadOptions,
    episode_column: int | None,
    guessed: tuple[Ambiguity, ...],
    notes: Sequence[str],
) -> Recording:
    """Return the recording in an episode's rows; `notes` are remarks on it."""
    log = next((each for each in LOG_FORMATS if {*each.columns} <= {*table.names}), None)
    in_cells, name_columns = _names_in_cells(table, options)
    heads = [name or f"column {i + 1}" for i, name in enumerate(table.names)]
    names = [in_cells.get(i, name) for i, name in enumerate(table.names)]
    joints = options.joints if table.named else None
    found = None if joints is None else find_channels(joints, names)
    table, merged = _without_other_logs(table, found or ())
    times = time_columns(table, options, [episode_column, *(found or ())])
    aside = {*times.columns, *times.held, episode_column, *name_columns}
    others = [i for i in range(len(names)) if i not in aside]
    channels, named = list(others), table.named
    _refuse_text(table, joints or (), names, found or ())
    if found and not options.key and {*found} <= {*others}:
        channels = found
    elif table.named and (keys := options.key or ((log.key,) if log else ())):
        channels = _by_key(table, keys, others, options.joints or ())
        named = not options.joints and Kind.PLACE in kinds([names[i] for i in channels])
    remarks = [*notes, *merged]
    if log is not None:
        remarks.append(f"{log.name}: time in {log.time_unit}, motion is {log.key} (measured)")
    clock = clock_of_table(table, episode, times, options, log and log.time_unit)
    _refuse_second_log(table, clock.times if times.columns else np.zeros(len(table)))
    counts = [i for i in others if table.is_number(i) and counts_rows(table, i, clock.times)]
    unasked = channels == others and table.named and not options.joints
    rising = [i for i in counts if unasked or (i in channels and table.is_unnamed(i))]
    all_read = not options.key and found is None
    no_channel = [i for i in channels if unasked and says_no_channel(heads[i])]
    no_channel *= len(no_channel) < len(channels)
    absent = [i for i in channels if found is None and np.all(table.values[:, i] == _ABSENT)]
    is_flag = [table.named and (says_valid(name) or says_success(name)) for name in heads]
    flags = {i: _flag(table, i) for i in others if is_flag[i]}
    for left, why in (
        ([*flags, *no_channel], "is no joint by its name"),
        (absent, "is 9E+09 all along, as ABB writes of an axis that is not there"),
        (rising, "rises with every row, as times and counters do"),
        *_texts(table, others, flags, all_read=all_read),
    ):
        channels = [i for i in channels if i not in left]
        remarks += [f"{say_names([heads[i] for i in left])} left out, which {why}"] * bool(left)
    measured = {heads[i]: flag for i, flag in flags.items()}
    positions, unmeasured = without_invalid(episode, table.columns(channels), measured)
    twins = all_read and twin_vectors([heads[i] for i in channels], table.values[:, channels])
    bare, units = without_units([heads[i] for i in channels])
    is_named = named or in_cells.keys() >= {*channels}
    joint_names = [in_cells.get(i, name) for i, name in zip(channels, bare, strict=True)]
    if not is_named:  # by their places in the file
        joint_names = [] if table.named else [heads[i].replace(" ", "") for i in channels]
    beside_motion = [
        i for i in others if i not in channels and not (i in counts and table.is_unnamed(i))
    ]
    return recorded(
        episode,
        clock,
        positions,
        tuple(joint_names),
        named=is_named,
        remarks=(*remarks, *unmeasured, *failures(measured)),
        units=tuple(table.units[i] or u for i, u in zip(channels, units, strict=True)),
        ambiguities=(*guessed, *clock.ambiguities, *(twins or ())),
        columns=bare if table.named else (),
        beside=columns_beside(
            [heads[i] for i in (*channels, *beside_motion)],
            table.values[:, [*channels, *beside_motion]],
            range(len(channels)),
            clock.times,
        ),
    )


def _texts(
    table: Table, others: Sequence[int], flags: Collection[int], *, all_read: bool
) -> Iterator[tuple[list[int], str]]:
    """Yield columns of text that are no channels, and why; unless `all_read`, switches alone."""
    texts = [i for i in others if table.is_text(i)]
    if not all_read:  # `on` and `off`
        texts = [i for i in texts if 1 < len({*table.cells[i]} - {""}) <= _MOST_WORDS]
    filled = {i: [*filter(None, table.cells[i])] for i in texts}
    lists = [i for i, cells in filled.items() if cells and all(map(_SEVERAL.fullmatch, cells))]
    yield lists, "holds several numbers in a cell; write a column a number, or lists in brackets"
    yield [i for i in texts if i not in {*flags, *lists}], "holds no number"


def _without_other_logs(table: Table, found: Sequence[int]) -> tuple[Table, tuple[str, ...]]:
    """Leave out rows of another log that was merged with that of the joints, and say so.

    They hold no joint, and values in columns that are mostly empty in rows of the joints.
    """
    empty = np.array([[not cell for cell in cells] for cells in table.cells])
    blank = empty[list(found)].all(axis=0) if found else np.zeros(len(table), dtype=bool)
    if not blank.any() or blank.all():
        return table, ()
    of_others = ~empty[empty[:, ~blank].mean(axis=1) > 0.5]
    if not of_others[:, blank].any(axis=0).all():
        return table, ()
    remark = f"{blank.sum()} rows left out, in which no joint has a value, as of a merged log"
    return table.rows(np.flatnonzero(~blank).tolist()), (remark,)


def _refuse_text(
    table: Table, joints: Sequence[str], names: Sequence[str], found: Sequence[int]
) -> None:
    """Refuse joints that are texts: names in a column of their own, or `True`."""
    opens = Kind.TOOL in kinds(joints)
    for i, cells in enumerate(table.cells):
        if (len(joints) > 1 and {*joints} <= {*cells}) or is_long_format(table, i):
            raise FileFormatError(
                f"{table.where}: each row is of one joint, which {names[i]} names; write a row a "
                "frame and a column a joint: pandas' DataFrame.pivot(index=TIME, columns="
                f"{names[i]!r}, values=POSITION)"
            )
        is_tool = opens and not found and kinds([names[i]])[0] is Kind.TOOL
        if (i in found or is_tool) and table.is_text(i) and any(cells):
            text = next(filter(None, cells))
            remedy = PLAIN if re.search(r"\d", text) else "write 1 and 0, or what was measured"
            raise FileFormatError(
                f"{table.where}: {names[i]} holds {text[:20]!r} and no numbers; {remedy}"
            )


def _names_in_cells(table: Table, options: ReadOptions) -> tuple[dict[int, str], set[int]]:
    """Return names of numbered columns that stand in cells, and the columns of these cells.

    ROS writes `name0`, `name1`, ... beside `position0`, ..., or lists of names and of positions.
    FileFormatError where names change, as of two publishers.
    """
    texts = [i for i in range(len(table.names)) if table.named and table.is_text(i)]
    texts = [i for i in texts if not re.match(r"[-+.]?\d", table.cells[i][0])]  # `0.3 rad`
    groups = {s: [texts[i] for i in g] for s, g in vectors([table.names[i] for i in texts]).items()}
    groups |= {table.names[i]: [i] for i in texts}
    cells = {stem: _cells(table, group, 0) for stem, group in groups.items()}
    numbers = [i for i in range(len(table.names)) if i not in texts]
    heads = [table.names[i] for i in numbers]
    for count in sorted({len(labels) for labels in cells.values() if len(labels) > 1}):
        names = stated_names(table.where, cells, count, options.joints)
        named = [i for key in options.key for i in vectors(heads).get(key, ())]
        if names and not options.key:
            named = [heads.index(name) for name in numbered_like(names, heads) or ()]
        if not names or len(named) != count:
            continue
        stem = next(stem for stem, labels in cells.items() if labels == names)
        for row, line in enumerate(table.lines):
            if (labels := _cells(table, groups[stem], row)) != names and any(labels):
                raise FileFormatError(
                    f"{table.where}, line {line}: {stem} says {say_names(labels)}, before "
                    f"{say_names(names)}; write rows of one publisher, in one order"
                )
        return dict(zip((numbers[i] for i in named), names, strict=True)), {*groups[stem]}
    return {}, set()


def _cells(table: Table, columns: Sequence[int], row: int) -> tuple[str, ...]:
    """Return the texts in some cells of a row, or in the list in a single cell."""
    texts = [table.cells[i][row] for i in columns]
    return words(texts[0] if len(texts) == 1 else texts)


def _flag(table: Table, column: int) -> np.ndarray:
    """Return a column's numbers, with 1 for `True`, as pandas writes it, and 0 for `False`."""
    flags = {"true": 1.0, "false": 0.0}
    cells = zip(table.cells[column], table.values[:, column], strict=True)
    return np.array([flags.get(cell.lower(), number) for cell, number in cells])


def _by_key(
    table: Table, keys: Sequence[str], others: Sequence[int], joints: Sequence[str]
) -> list[int]:
    """Return the columns that keys name: numbered ones by their common name, or a single one."""
    refuse_rates(table.where, keys, joints)
    names = [table.names[i] for i in others]
    groups = vectors(without_units(names)[0]) | vectors(names)
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

"""Read tables as people export them: CSV of any dialect.

Delimiter and decimal sign are the pair that makes most cells numbers, in rows of one width.
(`csv.Sniffer` knows no decimal comma.) A comment (`#`, `%`, `//`) right above the first row may be
the header, as `numpy.savetxt` writes it.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.arm.recordings.bounds import check_bytes, check_names, check_rows, check_table
from prior_reinforce.arm.recordings.options import DELIMITERS
from prior_reinforce.arm.recordings.recording import named_damage
from prior_reinforce.arm.recordings.units import known_unit, split_unit
from prior_reinforce.errors import FileFormatError
from prior_reinforce.units import NS_PER_S

_Column = tuple[str, str | None, list[str]]
"""Name, unit and cells of a column."""
Column = Float[np.ndarray, " T"]
"""Numbers of T rows."""
_COMMENTS = ("#", "%", "//")
_SAMPLE = 40
"""Lines from which a dialect is inferred."""
_WESTERN = set("°µ²³äöüÄÖÜßàâçéèêëîïôùûñÀÉÈáíóúãõåæøÅÆØ")
"""Non-ASCII characters in tables in the code page of a Western Excel."""
_LIST = re.compile(r"\s*[\[({]\s*[-+.\deE]+([,\s]+[-+.\deE]+)+\s*[\])}]\s*")
PLAIN = "write plain numbers, -0.6 for (0.6), 1000 for 1.000,0, 0.5 for '0.5 sec', [1, 2] for two"
"""Remedy for a column of numbers in other forms."""
_DATE = re.compile(r"\d{4}-\d\d-\d\d|\d{1,2}:\d\d|\d{1,2}[/.]\d{1,2}[/.]\d{4}")
_THOUSANDS = re.compile(
    r"[+-]?\d{1,3}(?:(['’\u00a0\u202f])\d{3}(\1\d{3})*([.,]\d*)?|( \d{3})+[.,]\d+)"
)
"""Numbers whose thousands are apart by a mark that no decimal sign is: `1'012.5`, `1 012,5`."""
_FORTRAN = re.compile(r"^([+-]?[\d.]+)[dD]([+-]?\d+)$")
"""`1.2D-01`."""
_MOMENT = re.compile(
    r"(\d{4})-?(\d\d)-?(\d\d)(?:[T ](\d\d):?(\d\d)(?::?(\d\d)(?:[.,](\d{1,9})\d*)?)?)?"
    r" ?(?:Z|UTC|([+-]\d\d):?(\d\d)?)?"
)
"""ISO 8601."""
_OF_AN_OFFICE = re.compile(
    r"(?:(\d{1,2})[/.](\d{1,2})[/.](\d{4}),? +)?(\d{1,2}):(\d\d):(\d\d)([.,]\d+)? ?([AP]M)?", re.I
)
"""`11/26/2026 1:05:09.3 PM`, `26.11.2026 13:05:09`: as office programs write them."""
_MINUTES = re.compile(r"[0-5]\d:[0-5]\d[.,]\d+")
"""`00:57.010`, minutes and seconds."""
_SPAN = re.compile(
    r"([+-]?)(?:(\d+) days? \+?)?(\d+):([0-5]\d):([0-5]\d)(?:(?:[.,]|:(?=\d{3}$))(\d{1,9})\d*)?"
)
_NAN = ("nan", "+nan", "-nan")
_NONE = ("none", "null", "na", "n/a", "-", "inf", "-inf")
_DAY = 86_400 * NS_PER_S
"""In [ns]."""
_NO_NAME = re.compile(r"(Unnamed:.*)?")
_SECOND_ROW_OF_UNITS = re.compile(r"[\[(]?[A-Za-zµμ°/^*·0-9.%-]{0,12}[\])]?")


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of cells under names."""

    where: str
    """File, and sheet where it has several, for messages."""
    names: tuple[str, ...]
    """Names of the columns; `column 1`, ... where the file has no line of names."""
    named: bool
    """Whether the file names them."""
    units: tuple[str | None, ...]
    """From a row of units under the names; None where it says none."""
    cells: tuple[Sequence[str], ...]
    """Texts by column; whole numbers of a workbook without `.0`."""
    lines: tuple[int, ...]
    """Line or row of the file that each row stands in, from 1."""
    decimal: str = "."
    delimiter: str = ","
    heads: tuple[int, ...] = ()
    """Lines in which the line of names comes again."""
    comments: tuple[str, ...] = ()
    """Lines of comments above the first row."""

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.lines)

    def rows(self, kept: Sequence[int]) -> Table:
        """Return the table with some of its rows."""
        cells = tuple([column[i] for i in kept] for column in self.cells)
        return replace(self, cells=cells, lines=tuple(self.lines[i] for i in kept))

    @cached_property
    def values(self) -> Float[np.ndarray, "T C"]:
        """The cells as numbers; nan where one is none."""
        columns = [[_number(cell, self.decimal) for cell in column] for column in self.cells]
        return np.array(columns, dtype=float).reshape(len(self.names), len(self)).T

    def unlike(self, row: int, column: int, says: str) -> FileFormatError:
        """Return the error to raise about a cell: its line and text, and what is wrong."""
        where, cell = f"{self.where}, line {self.lines[row]}", self.cells[column][row][:40]
        return FileFormatError(f"{where}: {self.names[column]} is {cell!r}{says}")

    def numbers(self, column: int) -> Column:
        """Return a column as numbers; FileFormatError names the line of a cell that is none."""
        none = np.flatnonzero(np.isnan(self.values[:, column])).tolist()
        bad = [self.cells[column][i] for i in none]
        for i in none:
            if self.cells[column][i].lower() not in _NAN:
                remedy = "mend that cell"
                if sum(re.search(r"\d", cell) is not None for cell in bad) > 1:
                    remedy = f"so are {len(bad)} of {len(self)} rows: {PLAIN}"
                says = f", expected a number; {remedy}, or keep other columns"
                raise self.unlike(i, column, says)
        return self.values[:, column]

    def columns(self, chosen: Sequence[int]) -> Float[np.ndarray, "T D"]:
        """Return some columns as numbers, as `numbers` does."""
        return np.column_stack([self.numbers(i) for i in chosen] or [np.zeros((0, 0))])

    def is_unnamed(self, column: int) -> bool:
        """Whether a column has no name, as pandas writes an index."""
        return _NO_NAME.fullmatch(self.names[column]) is not None

    def is_number(self, column: int) -> bool:
        """Whether every cell of a column is a number."""
        return not np.any(np.isnan(self.values[:, column]))

    def is_text(self, column: int) -> bool:
        """Whether no cell of a column is a number."""
        return bool(np.all(np.isnan(self.values[:, column])))

    def nanoseconds(self, column: int) -> Int[np.ndarray, " T"] | None:
        """Return dates or times of day from the first on, in [ns]; None where it holds others."""
        if self.is_number(column):
            return None
        for read in (_moment, _span):
            found = [read(_as_iso(cell)) for cell in self.cells[column]]
            if None not in found:
                times = np.array([time - found[0] for time in found], dtype=np.int64)  # type: ignore[operator]
                if read is _span and all(0 <= time < _DAY for time in found if time is not None):
                    # A time of day begins anew at midnight.
                    times += _DAY * np.cumsum(np.diff(times, prepend=0) < -_DAY // 2)
                return times
        return None

    def stamps(self, column: int) -> Column:
        """Return a column as times: dates in [ns] from the first on, else its numbers."""
        dates = self.nanoseconds(column)
        return self.values[:, column] if dates is None else dates.astype(float)


def read_table(
    path: Path, delimiter: str | None = None, decimal: str | None = None, head: Collection[str] = ()
) -> Table:
    """Read a CSV; None infers its delimiter (a name in `DELIMITERS` or itself) and decimal sign.

    The header has one of the names `head`, and rows above are titles. FileFormatError if damaged.
    """
    with named_damage(path, "a table"):
        return _read_csv(path, DELIMITERS.get(delimiter or "", delimiter), decimal, head)


def _read_csv(
    path: Path, delimiter: str | None, decimal: str | None, head: Collection[str]
) -> Table:
    check_bytes(path, path.stat().st_size)
    text = _decoded(path)
    check_table(path, text.count("\n"), 1)  # before lines are split, which takes far more memory
    kept = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip()]
    data = [(i, line) for i, line in kept if not line.lstrip().startswith(_COMMENTS)]
    if not data:
        return Table(str(path), (), False, (), (), ())
    # A first line `sep=;` is Excel's own.
    said = re.fullmatch(r"sep=(.)", data[0][1].strip())
    if said and len(data) > 1:
        delimiter, data = delimiter or said[1], data[1:]
    sample = [line for _, line in data[:_SAMPLE]]
    check_table(path, 1, 1 + max(line.count(mark) for line in sample for mark in ",;\t"))
    delimiter, decimal = _dialect(sample, delimiter, decimal)
    blank = delimiter == DELIMITERS["space"]
    widest = max(len(line.split()) if blank else 1 + line.count(delimiter) for _, line in data)
    check_table(path, len(data), widest)
    cells = _split((f"{line}\n" for _, line in data), delimiter, strict=True)
    rows = [(data[cells.line_num - 1][0], [cell.strip() for cell in row]) for row in cells]
    check_rows(str(path), [] if head else rows)  # of outcomes, a short line is named
    above = [line for i, line in kept if i == data[0][0] - 1 and (i, line) not in data]
    title = (
        [c.strip() for c in next(_split([above[0].lstrip(" #%/")], delimiter), [])] if above else []
    )
    table = _table(str(path), rows, head, decimal, title)
    again = tuple(i for i, line in kept if i > data[0][0] and line in above)
    if table.named and table.lines[:1] == (data[0][0],):  # its names are in that comment
        table = replace(table, heads=again)
    comments = tuple(line for i, line in kept if i < data[0][0])
    return replace(table, delimiter=delimiter, comments=comments)


def _decoded(path: Path) -> str:
    content = path.read_bytes()
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16").rstrip("\0")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
        if not {c for c in text if ord(c) > 126} <= _WESTERN:
            raise FileFormatError(
                f"{path} is no text in UTF-8; save it as CSV in UTF-8, or say its format"
            ) from None
    if "\0" in text and re.search(r"[\x01-\x08\x0e-\x19\x1b-\x1f]", text):
        raise FileFormatError(f"{path} is no text; expected a CSV: say its format")
    text = re.sub(r"\0[\0\s]*$", "", text)  # room that a log did not use
    if text.count("\0") > len(text) / 3 and "\0\0" not in text:
        raise FileFormatError(f"{path} is UTF-16 without a mark of it; save it as CSV in UTF-8")
    if "\0" in text:
        raise FileFormatError(
            f"{path}, line {text.split(chr(0))[0].count(chr(10)) + 1}: NUL bytes, as where writing "
            "was cut off; take them out, tr -d '\\0' < OLD.csv > NEW.csv, and mend that line"
        )
    return text


def _split(lines: Iterable[str], delimiter: str, *, strict: bool = False) -> Any:
    """A reader of the cells of lines (`csv.reader`)."""
    if delimiter == DELIMITERS["space"]:
        lines, delimiter = (line.strip().replace("\t", " ") + "\n" for line in lines), " "
    return csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=strict)


def _dialect(lines: Sequence[str], delimiter: str | None, decimal: str | None) -> tuple[str, str]:
    """Infer the delimiter and decimal sign that make rows of one width, mostly of numbers."""
    body = lines[min(1, len(lines) - 1) :]
    if all(line.endswith((",", ";")) for line in body):  # of some rows, the last cell is empty
        body = [line.rstrip(";,") for line in body]

    def score(dialect: tuple[str, str]) -> tuple[float, int]:
        rows: list[list[str]] = [next(_split([line], dialect[0]), []) for line in body]
        cells = [cell for row in rows for cell in row if cell.strip()]
        numeric = sum(_is_number(cell, dialect[1]) for cell in cells) / max(len(cells), 1)
        width, often = Counter(map(len, rows)).most_common(1)[0]
        return round(numeric * often / len(rows), 2), width

    delimiters = [delimiter] if delimiter else [",", ";", "\t", "|", r"\s+"]
    pairs = product(delimiters, [decimal] if decimal else [".", ","])
    quoted = any('"' in line for line in body)  # between commas, Google Sheets quotes its commas
    apart = (pair for pair in pairs if pair[0] != pair[1] or quoted)
    return max(apart, key=score, default=(",", "."))


def _number(text: str, decimal: str = ".") -> float:
    """Return the number in a text; nan if it is none, or has a point beside a decimal comma."""
    if "_" in text or (decimal == "," and "." in text):
        return math.nan
    try:
        return float(text if decimal == "." else text.replace(decimal, "."))
    except ValueError:
        plain = text.replace("\u2212", "-")  # a minus as spreadsheets and people print it
        plain = _FORTRAN.sub(r"\1e\2", plain)
        if _THOUSANDS.fullmatch(plain):
            plain = re.sub(r"[ '’\u00a0\u202f]", "", plain)
        return _number(plain, decimal) if plain != text else math.nan


def _as_iso(text: str) -> str:
    """Write a date or time of day with the year first, and 24 hours; others as they are.

    The month comes first beside AM or PM, or where the second number is no month.
    """
    if (found := _OF_AN_OFFICE.fullmatch(text)) is None:
        return f"0:{text}" if _MINUTES.fullmatch(text) else text
    first, second, year, hour, minute, seconds, fraction, half = found.groups()
    if half:
        hour = int(hour) % 12 + 12 * (half.lower() == "pm")
    time = f"{int(hour):02d}:{minute}:{seconds}{fraction or ''}"
    if year is None:
        return time
    month, day = (first, second) if half or int(second) > 12 else (second, first)
    return f"{year}-{int(month):02d}-{int(day):02d} {time}"


def _moment(text: str) -> int | None:
    """Return a date in [ns], in UTC unless it has a time zone; None of others."""
    if (found := _MOMENT.fullmatch(text)) is None:
        return None
    year, month, day, *time, fraction, zone, more = (part or "00" for part in found.groups())
    try:
        moment = np.datetime64(f"{year}-{month}-{day}T{':'.join(time)}.{fraction}", "ns")
    except ValueError:  # the 31st of February
        return None
    minutes = 60 * int(zone) + int(f"{zone[0]}{more}")
    return int(moment.astype(np.int64)) - 60 * NS_PER_S * minutes


def _span(text: str) -> int | None:
    """Return a time of day, or since a start, in [ns]; None of others."""
    if (found := _SPAN.fullmatch(text)) is None:
        return None
    days, hours, minutes, seconds = (int(part or 0) for part in found.groups()[1:5])
    whole = ((24 * days + hours) * 60 + minutes) * 60 + seconds
    return (whole * NS_PER_S + int((found[6] or "").ljust(9, "0"))) * (-1 if found[1] == "-" else 1)


def is_value(text: str) -> bool:
    """Whether a cell is a date, a time of day, or stands for no number; so no name."""
    return _DATE.match(text) is not None or text.lower() in (*_NAN, *_NONE)


def _is_number(text: str, decimal: str) -> bool:
    text = text.strip()
    return text.lower() == "nan" or not math.isnan(_number(text, decimal))


def _table(
    where: str,
    rows: list[tuple[int, list[str]]],
    head: Collection[str],
    decimal: str = ".",
    title: Sequence[str] = (),
) -> Table:
    """Return a table of numbered rows; its header may be the `title`, a comment above."""
    above = [any(cell.lower() in head for cell in row) for _, row in rows[:_SAMPLE]]
    rows = _of_one_width(where, rows[above.index(True) if any(above) else 0 :])
    first = rows[0][1]
    units: list[str | None] = [None] * len(first)
    names, named = [f"column {i}" for i in range(1, len(first) + 1)], True
    if not any(_is_number(c, decimal) or _DATE.match(c) for c in first):
        names, rows = first, rows[1:]
    elif len(title) == len(first):
        names = first = list(title)
    elif _numbers_columns(where, first, [row for _, row in rows if row != first], decimal):
        names = [name if c.isdigit() else c for name, c in zip(names, first, strict=True)]
        named, rows = False, rows[1:]
    else:
        named, first = False, []
    if named and len(rows) > 1 and are_units(rows[0][1], decimal):
        units, rows = [known_unit(c) for c in rows[0][1]], rows[1:]
    check_names(where, names)
    heads = tuple(i for i, row in rows if row == first)
    rows = [(i, row) for i, row in rows if row != first]
    cells = [[row[i] for _, row in rows] for i in range(len(names))]
    columns = _without_lists(where, list(zip(names, units, cells, strict=True)))
    kept = [column for column in columns if not _is_padding(column[0], column[2])]
    return Table(
        where,
        tuple(name for name, _, _ in kept),
        named,
        tuple(unit for _, unit, _ in kept),
        tuple(own for _, _, own in kept),
        tuple(number for number, _ in rows),
        decimal,
        heads=heads,
    )


def _numbers_columns(where: str, first: list[str], body: list[list[str]], decimal: str) -> bool:
    """Whether the first row numbers the columns from 0, as pandas does, perhaps behind an index.

    A frame is near the next one, and has decimals. FileFormatError if it may be either.
    """
    start = first.index("0") if "0" in first else 0
    if len(body) < 3 or first[start:] != [str(i) for i in range(len(first) - start)]:
        return False
    says = [_is_number(c, decimal) or is_value(c) for c in (*first[:start], *body[0][:start])]
    if start:
        return all(says[start:]) and not any(says[:start])
    whole = [any(c.lstrip("+-").isdigit() for c in column) for column in zip(*body, strict=True)]
    steps = np.abs(np.diff([[_number(c, decimal) for c in row] for row in (first, *body)], axis=0))
    if np.any(steps[0] > 2 * steps[1:].max(axis=0)):
        return True
    if whole.count(False) > 1 or (len(first) > 2 and np.any(steps[0] != steps[1])):
        raise FileFormatError(
            f"{where}: {','.join(first)} may be a frame, or numbers of columns as pandas writes "
            "them; put a line of names above it if it is a frame, else in its place"
        )
    return False


def _of_one_width(where: str, rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Return rows of one width; FileFormatError names one with more cells than names."""
    width, names = max(len(row) for _, row in rows), len(rows[0][1])
    full = [max((k for k, c in enumerate(row, 1) if c), default=0) for _, row in rows[:_SAMPLE]]
    head = full.index(max(full))
    for line, row in rows:
        if any(row[names:]):
            why = "where a comma is the decimal sign, put semicolons between cells"
            if all(len(row) == names + 1 for _, row in rows[1:]):
                why += "; of R, write it with col.names = NA"
            if any(cell.endswith(";") for cell in row):
                why = "numbers alone in the cells, and units in the head, x [m]"
            if head > 0 and not any(re.match(r"[-+.]?\d", cell) for cell in rows[head][1]):
                why = f"if the names are in line {rows[head][0]}, take out all that is above them"
            raise FileFormatError(
                f"{where}, line {line}: {len(row)} cells under {names} names; name every column, "
                f"or mend that line ({why})"
            )
    return [(i, row + [""] * (width - len(row))) for i, row in rows]


def _without_lists(where: str, columns: list[_Column]) -> list[_Column]:
    """Split columns of lists, `[1.0, 2.0]` in a cell, into columns of numbers."""
    parts: list[_Column] = []
    for name, unit, column in columns:
        if not (column and all(_LIST.fullmatch(cell) for cell in column)):
            parts.append((name, unit, column))
            continue
        rows = [cell.strip("[](){} ").replace(",", " ").split() for cell in column]
        if len(set(map(len, rows))) > 1:
            raise FileFormatError(
                f"{where}: column {name} holds lists of {min(map(len, rows))} to "
                f"{max(map(len, rows))} numbers; write one column a joint"
            )
        bare, own = split_unit(name, any_word=True)
        parts += [
            (f"{bare}_{i}", unit or own, [*part]) for i, part in enumerate(zip(*rows, strict=True))
        ]
    check_table(Path(where), len(columns[0][2]) if columns else 0, len(parts))
    return parts


def are_units(cells: list[str], decimal: str) -> bool:
    """Whether a row holds units of the columns, some of them empty."""
    return (
        any(known_unit(cell) for cell in cells)
        and all(_SECOND_ROW_OF_UNITS.fullmatch(cell) for cell in cells)
        and not any(_is_number(cell, decimal) for cell in cells)
    )


def _is_padding(name: str, column: Sequence[str]) -> bool:
    """Whether a column is left by a trailing delimiter, or the row index of pandas."""
    if _NO_NAME.fullmatch(name) or name == "index":
        return not any(column) or list(column) == [str(i) for i in range(len(column))]
    return not any(column) and name.startswith("column ")

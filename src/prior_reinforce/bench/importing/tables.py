"""Tables as people export them: CSV of any dialect, and the sheets of a workbook.

Encoding, delimiter and decimal sign of a CSV are inferred from its lines: the pair that makes most
cells numbers, in rows of one width. (`csv.Sniffer` knows no decimal comma.) Comment lines (`#`,
`%`, `//`) are dropped, except one right above the first row that names the columns, as
`numpy.savetxt` writes it.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.bench.importing.bounds import check_bytes, check_names, check_table
from prior_reinforce.bench.importing.recording import named_damage
from prior_reinforce.bench.importing.units import known_unit
from prior_reinforce.bench.importing.workbooks import check_workbook
from prior_reinforce.errors import FileFormatError

Column = Float[np.ndarray, " T"]
"""Numbers of T rows."""
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": r"\s+"}
"""How the command line names what stands between two cells."""
_COMMENTS = ("#", "%", "//")
_SAMPLE = 40
"""Lines from which a dialect is inferred."""
_WESTERN = set("°µ²³äöüÄÖÜßàâçéèêëîïôùûñÀÉÈáíóúãõåæøÅÆØ")
"""Non-ASCII characters in tables that a Western Excel saves in its own code page."""
_COMMA = re.compile(r"[+-]?(0,\d{3}|\d+,(\d{1,2}|\d{4,}))")
_DATE = re.compile(r"\d{4}-\d\d-\d\d|\d{1,2}:\d\d")
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

    def numbers(self, column: int) -> Column:
        """Return a column as numbers.

        Raises:
            FileFormatError: A cell that is none, with its line.
        """
        for i in np.flatnonzero(np.isnan(self.values[:, column])).tolist():
            text = self.cells[column][i]
            if text.lower() not in ("nan", "+nan", "-nan"):
                raise FileFormatError(
                    f"{self.where}, line {self.lines[i]}: {self.names[column]} is {text[:40]!r}, "
                    "expected a number; mend that cell, or keep other columns"
                )
        return self.values[:, column]

    def columns(self, chosen: Sequence[int]) -> Float[np.ndarray, "T D"]:
        """Return some columns as numbers, as `numbers` does."""
        return np.column_stack([self.numbers(i) for i in chosen] or [np.zeros((0, 0))])

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
        import pandas as pd

        cells = pd.Series(self.cells[column], dtype=object)
        try:
            times = pd.to_datetime(cells, format="ISO8601", utc=True)
        except (ValueError, TypeError, OverflowError):
            try:
                times = pd.to_timedelta(cells)
            except (ValueError, TypeError, OverflowError):
                return None
        return np.asarray((times - times.iloc[0]).dt.as_unit("ns").astype("int64"))


def read_tables(
    path: Path,
    delimiter: str | None = None,
    decimal: str | None = None,
    head: Collection[str] = (),
) -> list[Table]:
    """Read a CSV, or every sheet of a workbook that holds something.

    Args:
        path: Of the file.
        delimiter: Of a CSV, by its name in `DELIMITERS` or itself; None infers it.
        decimal: Decimal sign of a CSV; None infers it.
        head: Names of which the line of names has one; rows above it are titles.

    Raises:
        FileFormatError: It is no such file.
    """
    with named_damage(path, "a table"):
        if path.suffix.lower() in WORKBOOKS:
            return _read_workbook(path, head)
        return [_read_csv(path, DELIMITERS.get(delimiter or "", delimiter), decimal, head)]


WORKBOOKS = (".xlsx", ".xlsm", ".xls", ".ods")


def _read_workbook(path: Path, head: Collection[str]) -> list[Table]:
    import pandas as pd

    check_workbook(path)
    sheets = pd.read_excel(path, sheet_name=None, header=None, engine="calamine", dtype=object)
    tables = []
    for name, frame in sheets.items():
        rows = [[_as_text(cell) for cell in row] for row in frame.values.tolist()]
        numbered = [(i, row) for i, row in enumerate(rows, 1) if any(row)]
        if numbered:
            where = f"{path}" if len(sheets) == 1 else f"{path} [{name}]"
            tables.append(_table(where, numbered, head))
    if not tables:
        raise FileFormatError(f"{path} has no row; expected a line of column names and frames")
    return tables


def _as_text(cell: Any) -> str:
    """A cell of a workbook; a text such as `148,8` is a number, `1,488` may be a thousand."""
    import pandas as pd

    if isinstance(cell, str):
        return (cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell).strip()
    if isinstance(cell, bool) or (isinstance(cell, float) and cell.is_integer()):
        return str(int(cell))
    return "" if pd.isna(cell) else str(cell)


def _read_csv(
    path: Path, delimiter: str | None, decimal: str | None, head: Collection[str]
) -> Table:
    check_bytes(path, path.stat().st_size)
    kept = [(i, line) for i, line in enumerate(_decoded(path).splitlines(), 1) if line.strip()]
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
    check_table(path, len(data), max(len(_split(line, delimiter)) for _, line in data))
    mark, lines = delimiter, [line for _, line in data]
    if delimiter == DELIMITERS["space"]:
        mark, lines = " ", [line.strip().replace("\t", " ") for line in lines]
    cells = csv.reader(
        (f"{line}\n" for line in lines), delimiter=mark, skipinitialspace=True, strict=True
    )
    rows = [(data[cells.line_num - 1][0], [cell.strip() for cell in row]) for row in cells]
    width = max(len(row) for _, row in rows)
    rows = [(i, row + [""] * (width - len(row))) for i, row in rows]
    above = [line for i, line in kept if i == data[0][0] - 1 and (i, line) not in data]
    title = [c.strip() for c in _split(above[0].lstrip(" #%/"), delimiter)] if above else []
    return _table(str(path), rows, head, decimal, title)


def _decoded(path: Path) -> str:
    content = path.read_bytes()
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
        if not {c for c in text if ord(c) > 126} <= _WESTERN:
            raise FileFormatError(
                f"{path} is no text in UTF-8; save it as CSV in UTF-8, or say its format"
            ) from None
    if "\0" in text:
        raise FileFormatError(f"{path} is no text; expected a CSV: say its format")
    return text


def _split(line: str, delimiter: str) -> list[str]:
    return line.split() if delimiter == r"\s+" else line.split(delimiter)


def _dialect(lines: Sequence[str], delimiter: str | None, decimal: str | None) -> tuple[str, str]:
    """Delimiter and decimal sign under which the lines are rows of one width and mostly numbers."""
    body = lines[min(1, len(lines) - 1) :]

    def score(dialect: tuple[str, str]) -> tuple[float, int]:
        rows = [_split(line.rstrip(";,"), dialect[0]) for line in body]
        cells = [cell for row in rows for cell in row if cell.strip()]
        numeric = sum(_is_number(cell, dialect[1]) for cell in cells) / max(len(cells), 1)
        width, often = Counter(map(len, rows)).most_common(1)[0]
        return round(numeric * often / len(rows), 2), width

    delimiters = [delimiter] if delimiter else [",", ";", "\t", r"\s+"]
    pairs = product(delimiters, [decimal] if decimal else [".", ","])
    return max((pair for pair in pairs if pair[0] != pair[1]), key=score, default=(",", "."))


def _number(text: str, decimal: str = ".") -> float:
    """The number that a text is; nan if it is none.

    A point beside a decimal comma would separate thousands: no number, rather than another one.
    """
    if "_" in text or (decimal == "," and "." in text):
        return math.nan
    try:
        return float(text.replace(decimal, "."))
    except ValueError:
        return math.nan


def _is_number(text: str, decimal: str) -> bool:
    text = text.strip().strip('"')
    return text.lower() == "nan" or not math.isnan(_number(text, decimal))


def _table(
    where: str,
    rows: list[tuple[int, list[str]]],
    head: Collection[str],
    decimal: str = ".",
    title: Sequence[str] = (),
) -> Table:
    """Names, units and cells of rows with the numbers of their lines.

    Args:
        where: File and sheet.
        rows: All of one width.
        head: As in `read_tables`.
        decimal: Decimal sign.
        title: Cells of a comment right above; names, if there are as many as columns.
    """
    above = [any(cell.lower() in head for cell in row) for _, row in rows[:_SAMPLE]]
    rows = rows[above.index(True) if any(above) else 0 :]
    first = rows[0][1]
    units: list[str | None] = [None] * len(first)
    names, named = [f"column {i}" for i in range(1, len(first) + 1)], True
    if not any(_is_number(c, decimal) or _DATE.match(c) for c in first):
        names, rows = first, rows[1:]
    elif len(title) == len(first):
        names = list(title)
    else:
        named = False
    if named and len(rows) > 1 and _are_units(rows[0][1], decimal):
        units, rows = [known_unit(c) for c in rows[0][1]], rows[1:]
    check_names(where, names)
    columns = [[row[i] for _, row in rows] for i in range(len(names))]
    kept = [i for i, name in enumerate(names) if not _is_padding(name, columns[i])]
    return Table(
        where,
        tuple(names[i] for i in kept),
        named,
        tuple(units[i] for i in kept),
        tuple(columns[i] for i in kept),
        tuple(number for number, _ in rows),
        decimal,
    )


def _are_units(cells: list[str], decimal: str) -> bool:
    return (
        any(known_unit(cell) for cell in cells)
        and all(_SECOND_ROW_OF_UNITS.fullmatch(cell) for cell in cells)
        and not any(_is_number(cell, decimal) for cell in cells)
    )


def _is_padding(name: str, column: Sequence[str]) -> bool:
    """Whether a column is what a trailing delimiter leaves, or the running count of pandas."""
    numbered = name.startswith("column ")
    unnamed = not name or name.startswith("Unnamed:") or name == "index"
    if not (numbered or unnamed):
        return False
    return not any(column) or (unnamed and list(column) == [str(i) for i in range(len(column))])


def counts(values: Column) -> bool:
    """Whether a column counts rows or tells the time: it increases with every row."""
    return bool(np.all(np.diff(values) > 0))

"""Tables as people export them, read with pandas: CSV of any dialect, and sheets of a workbook.

Of a CSV, encoding, delimiter and decimal sign are found out from its own lines: the pair that makes
most cells numbers in rows of one width. Comment lines (`#`, `%`, `//`) are left out, but for one
that names the columns right above the first row, as `numpy.savetxt` writes it.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.bench.importing.bounds import check_bytes, check_names, check_table
from prior_reinforce.bench.importing.units import known_unit
from prior_reinforce.bench.importing.workbooks import check_workbook
from prior_reinforce.errors import FileFormatError, PriorReinforceError

Column = Float[np.ndarray, " T"]
"""Numbers of T rows."""
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": r"\s+"}
"""How the command line names what stands between two cells."""
_COMMENTS = ("#", "%", "//")
_SAMPLE = 40
"""Lines that a dialect is found out from."""
_WESTERN = set("°µ²³äöüÄÖÜßàâçéèêëîïôùûñÀÉÈáíóúãõåæøÅÆØ")
"""What stands beside ASCII in tables that a Western Excel saves in its own code page."""
_COMMA = re.compile(r"[+-]?(0,\d{3}|\d+,(\d{1,2}|\d{4,}))")
_SECOND_ROW_OF_UNITS = re.compile(r"[\[(]?[A-Za-zµμ°/^*·0-9.%-]{0,12}[\])]?")


@dataclass(frozen=True)
class Dialect:
    """How a CSV is written; None is found out."""

    delimiter: str | None = None
    """`,`, `;`, a tab, or `\\s+` for any white space."""
    decimal: str | None = None
    """`.` or `,`."""


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of cells under names."""

    where: str
    """File, and sheet where it has several, for messages."""
    names: tuple[str, ...]
    """Of the columns; `column 1`, ... where the file has no line of names."""
    named: bool
    """Whether the file names them."""
    units: tuple[str | None, ...]
    """From a row of units under the names; None where it says none."""
    cells: tuple[Sequence[Any], ...]
    """By column: texts, or numbers and dates of a workbook."""
    lines: tuple[int, ...]
    """Line or row of the file that each row stands in, from 1."""
    decimal: str = "."

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.lines)

    def rows(self, kept: Sequence[int]) -> Table:
        """Return the same with some rows only."""
        cells = tuple([column[i] for i in kept] for column in self.cells)
        lines = tuple(self.lines[i] for i in kept)
        return Table(self.where, self.names, self.named, self.units, cells, lines, self.decimal)

    def texts(self, column: int) -> list[str]:
        """Return a column as texts; whole numbers of a workbook without `.0`."""
        return [_as_text(cell) for cell in self.cells[column]]

    def numbers(self, column: int) -> Column:
        """Return a column as numbers.

        Raises:
            FileFormatError: A cell that is none, with its line.
        """
        values = _numeric(self.cells[column], self.decimal)
        wrong = [i for i, value in enumerate(values) if np.isnan(value)]
        for i in wrong:
            text = _as_text(self.cells[column][i])
            if text.lower() not in ("nan", "+nan", "-nan"):
                raise FileFormatError(
                    f"{self.where}, line {self.lines[i]}: {self.names[column]} is {text[:40]!r}, "
                    "expected a number; mend that cell, or keep other columns"
                )
        return values

    def is_number(self, column: int) -> bool:
        """Whether every cell of a column is a number."""
        return not np.any(np.isnan(_numeric(self.cells[column], self.decimal)))

    def is_text(self, column: int) -> bool:
        """Whether no cell of a column is a number."""
        return bool(np.all(np.isnan(_numeric(self.cells[column], self.decimal))))

    def nanoseconds(self, column: int) -> Int[np.ndarray, " T"] | None:
        """Return dates or times of day from the first on, in [ns]; None where it holds others."""
        if self.is_number(column):
            return None
        import pandas as pd

        cells = pd.Series([str(cell) for cell in self.cells[column]])
        try:
            times = pd.to_datetime(cells, format="ISO8601", utc=True)
        except (ValueError, TypeError, OverflowError):
            try:
                times = pd.to_timedelta(cells)
            except (ValueError, TypeError, OverflowError):
                return None
        return np.asarray((times - times.iloc[0]).dt.as_unit("ns").astype("int64"))


def read_tables(
    path: Path, dialect: Dialect | None = None, head: Collection[str] = ()
) -> list[Table]:
    """Read a CSV, or every sheet of a workbook that holds something.

    Args:
        path: Of the file.
        dialect: What is said of a CSV.
        head: Names of which the line of names has one; rows above it are titles.

    Raises:
        FileFormatError: It is no such file.
    """
    try:
        if path.suffix.lower() in WORKBOOKS:
            return _read_workbook(path, head)
        return [_read_csv(path, dialect or Dialect(), head)]
    except PriorReinforceError:
        raise
    except Exception as error:  # pandas and calamine raise a dozen kinds on damaged bytes
        words = str(error).split("\n")[0][:200] or "no reason given"
        raise FileFormatError(
            f"cannot read {path} as a table ({type(error).__name__}: {words}); it is damaged or "
            "something else: export it again, or say its format"
        ) from error


WORKBOOKS = (".xlsx", ".xlsm", ".xls", ".ods")


def _read_workbook(path: Path, head: Collection[str]) -> list[Table]:
    import pandas as pd

    check_workbook(path)
    sheets = pd.read_excel(path, sheet_name=None, header=None, engine="calamine", dtype=object)
    tables = []
    for name, frame in sheets.items():
        cells = frame.values.tolist()
        rows = [["" if pd.isna(cell) else _cell(cell) for cell in row] for row in cells]
        numbered = [(i, row) for i, row in enumerate(rows, 1) if any(_as_text(c) for c in row)]
        if numbered:
            where = f"{path}" if len(sheets) == 1 else f"{path} [{name}]"
            tables.append(_table(where, _below_titles(numbered, head), ".", None))
    if not tables:
        raise FileFormatError(f"{path} has no row; expected a line of column names and frames")
    return tables


def _cell(cell: Any) -> Any:
    """A cell of a workbook; a text such as `148,8` is a number, `1,488` may be a thousand."""
    return cell.replace(",", ".") if isinstance(cell, str) and _COMMA.fullmatch(cell) else cell


def _below_titles(
    rows: list[tuple[int, list[Any]]], head: Collection[str]
) -> list[tuple[int, list[Any]]]:
    """The rows from the line of names on, where one of the first has one of its names."""
    for i, (_, row) in enumerate(rows[:_SAMPLE]):
        if any(_as_text(cell).lower() in head for cell in row):
            return rows[i:]
    return rows


def _read_csv(path: Path, dialect: Dialect, head: Collection[str]) -> Table:
    import pandas as pd

    check_bytes(path, path.stat().st_size)
    lines = _decoded(path).splitlines()
    kept = [(i, line) for i, line in enumerate(lines, 1) if line.strip()]
    data = [(i, line) for i, line in kept if not line.lstrip().startswith(_COMMENTS)]
    if not data:
        return Table(str(path), (), False, (), (), ())
    # A first line `sep=;` is Excel's own.
    said = re.fullmatch(r"sep=(.)", data[0][1].strip())
    if said and len(data) > 1:
        dialect, data = Dialect(dialect.delimiter or said[1], dialect.decimal), data[1:]
    sample = [line for _, line in data[:_SAMPLE]]
    check_table(path, 1, 1 + max(line.count(mark) for line in sample for mark in ",;\t"))
    delimiter, decimal = _dialect(sample, dialect)
    width = max(_width(line, delimiter) for _, line in data)
    check_table(path, len(data), width)
    frame = pd.read_csv(
        io.StringIO("\n".join(line for _, line in data)),
        sep=delimiter,
        header=None,
        names=list(range(width)),
        dtype=str,
        keep_default_na=False,
        skipinitialspace=True,
        index_col=False,
    )
    rows = [[cell.strip() for cell in row] for row in frame.values.tolist()]
    numbers = [i for i, _ in data] if len(rows) == len(data) else list(range(1, len(rows) + 1))
    above = [line for i, line in kept if i == data[0][0] - 1 and (i, line) not in data]
    title = [c.strip() for c in _split(above[0].lstrip(" #%/"), delimiter)] if above else None
    numbered = _below_titles(list(zip(numbers, rows, strict=True)), head)
    return _table(str(path), numbered, decimal, title)


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


def _width(line: str, delimiter: str) -> int:
    return len(line.split()) if delimiter == r"\s+" else line.count(delimiter) + 1


def _dialect(lines: Sequence[str], given: Dialect) -> tuple[str, str]:
    """Delimiter and decimal sign under which the lines are rows of one width and mostly numbers."""
    best, chosen = (-1.0, -1.0), (",", ".")
    body = lines[min(1, len(lines) - 1) :]
    for delimiter in [given.delimiter] if given.delimiter else [",", ";", "\t", r"\s+"]:
        for decimal in [given.decimal] if given.decimal else [".", ","]:
            if delimiter == decimal:
                continue
            rows = [_split(line.rstrip(";,"), delimiter) for line in body]
            cells = [cell for row in rows for cell in row if cell.strip()]
            numeric = sum(_is_numeric(cell, decimal) for cell in cells) / max(len(cells), 1)
            width, often = Counter(map(len, rows)).most_common(1)[0]
            score = (round(numeric * often / len(rows), 2), float(width))
            if score > best:
                best, chosen = score, (delimiter, decimal)
    return chosen


def _is_numeric(text: str, decimal: str) -> bool:
    text = text.strip().strip('"')
    if decimal == ",":
        if "." in text:
            return False
        text = text.replace(",", ".")
    try:
        float(text)
    except ValueError:
        return False
    return True


def _table(
    where: str, rows: list[tuple[int, list[Any]]], decimal: str, title: list[str] | None
) -> Table:
    """Names, units and cells of rows with the numbers of their lines."""
    first = rows[0][1]
    units: list[str | None] = [None] * len(first)
    if not any(_is_numeric(_as_text(c), decimal) or _is_date(c) for c in first):
        names, named, rows = [_as_text(c) for c in first], True, rows[1:]
    elif title is not None and len(title) == len(first):
        names, named = title, True
    else:
        names, named = [f"column {i}" for i in range(1, len(first) + 1)], False
    if named and len(rows) > 1 and _are_units([_as_text(c) for c in rows[0][1]], decimal):
        units, rows = [known_unit(_as_text(c)) for c in rows[0][1]], rows[1:]
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
        and not any(_is_numeric(cell, decimal) for cell in cells)
    )


def _is_padding(name: str, column: Sequence[Any]) -> bool:
    """Whether a column is what a trailing delimiter leaves, or the running count of pandas."""
    numbered = name.startswith("column ")
    unnamed = not name or name.startswith("Unnamed:") or name == "index"
    if not (numbered or unnamed):
        return False
    texts = [_as_text(cell) for cell in column]
    return not any(texts) or (unnamed and texts == [str(i) for i in range(len(texts))])


def _is_date(cell: Any) -> bool:
    text = str(cell).strip()
    return bool(re.match(r"\d{4}-\d\d-\d\d|\d{1,2}:\d\d", text))


def _as_text(cell: Any) -> str:
    if isinstance(cell, float) and cell.is_integer() and abs(cell) < 1e15:
        cell = int(cell)
    return str(cell).strip()


def _numeric(cells: Sequence[Any], decimal: str) -> Column:
    """Numbers; nan where a cell is none."""
    import pandas as pd

    return np.asarray(
        pd.to_numeric(pd.Series([_plain(cell, decimal) for cell in cells]), errors="coerce"),
        dtype=np.float64,
    )


def counts(values: Column) -> bool:
    """Whether a column counts rows or tells the time: it increases with every row."""
    return bool(np.all(np.diff(values) > 0))


def _plain(cell: Any, decimal: str) -> Any:
    """A cell for pandas: with a decimal point, and None where it can be no number."""
    if not isinstance(cell, str):
        return cell if isinstance(cell, (int, float)) else None
    if decimal == ",":
        # A point would be between thousands: no number, rather than another one.
        return None if "." in cell else cell.replace(",", ".")
    return cell

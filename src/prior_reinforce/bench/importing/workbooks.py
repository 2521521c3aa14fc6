"""Size of a workbook's sheets, checked before they are allocated.

A reader of workbooks allocates all cells up to the last that is not empty, so one stray cell at
XFD1048576 asks for 512 GB. Here the packed XML is passed through once, and nothing of it is kept.
"""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from xml.parsers import expat

from prior_reinforce.bench.importing.bounds import check_bytes, check_table

_REFERENCE = re.compile(r"([A-Z]{1,3})(\d{1,7})")
"""Address of a cell in an .xlsx, such as `XFD1048576`."""
_CHUNK = 1 << 20
"""Bytes passed to the parser at a time."""


def check_workbook(path: Path) -> None:
    """Refuse a workbook with a sheet too large for a recording.

    Raises:
        FileFormatError: It unpacks to too much, or a sheet has too many rows or columns.
        expat.ExpatError, zipfile.BadZipFile: It is damaged.
    """
    check_bytes(path, path.stat().st_size)
    if not zipfile.is_zipfile(path):
        return  # an .xls, of 65,536 rows and 256 columns at most
    with zipfile.ZipFile(path) as packed:
        check_bytes(path, sum(member.file_size for member in packed.infolist()), "unpacks to")
        for member in packed.infolist():
            if member.filename.endswith(".xml"):
                with packed.open(member) as file:
                    extent = _Extent()
                    while chunk := file.read(_CHUNK):
                        extent.feed(chunk)
                check_table(path, extent.rows, extent.columns)


class _Extent:
    """Rows and columns up to the last cell that holds something, of a part of .xlsx or .ods."""

    def __init__(self) -> None:
        self.rows = self.columns = 0
        self._row = self._column = 0
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self.feed = self._parser.Parse

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        name = name.rpartition(":")[2]
        if name == "c" and (cell := _REFERENCE.fullmatch(attributes.get("r", ""))):
            column = 0
            for letter in cell[1]:
                column = 26 * column + ord(letter) - ord("A") + 1
            self._holds(int(cell[2]), column)
        elif name == "table":
            self._row = 0
        elif name == "table-row":
            self._row += int(attributes.get("table:number-rows-repeated", 1))
            self._column = 0
        elif name in ("table-cell", "covered-table-cell"):
            self._column += int(attributes.get("table:number-columns-repeated", 1))
            if any(key.endswith("value-type") for key in attributes):
                self._holds(self._row, self._column)

    def _holds(self, row: int, column: int) -> None:
        self.rows, self.columns = max(self.rows, row), max(self.columns, column)

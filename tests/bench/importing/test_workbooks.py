"""A sheet's size is known before it is laid out."""

import zipfile

import openpyxl
import pytest

from prior_reinforce.bench.importing import read_recordings
from prior_reinforce.bench.importing.workbooks import check_workbook
from prior_reinforce.errors import FileFormatError


def workbook(path, cells):
    book = openpyxl.Workbook()
    for cell, value in cells.items():
        book.active[cell] = value
    book.save(path)
    return path


@pytest.mark.parametrize("cell", ["XFD1048576", "A1048576", "XFD1"])
def test_one_stray_cell_is_refused_before_all_are_allocated(tmp_path, cell):
    cells = {"A1": "t", "B1": "q", "A2": 0, "B2": 1, "A3": 1, "B3": 2}
    path = workbook(tmp_path / "a.xlsx", cells)
    check_workbook(path)
    strays = dict.fromkeys((cell, "D9"), 5)
    workbook(path, cells | strays)
    if cell == "A1048576":  # a million rows of four columns are many, not too many
        check_workbook(path)
    else:
        with pytest.raises(FileFormatError, match="delete stray cells"):
            read_recordings(path)


def test_repeated_cells_of_libreoffice_count(tmp_path):
    row = '<table:table-row table:number-rows-repeated="{}">{}</table:table-row>'
    blank = '<table:table-cell table:number-columns-repeated="16000"/>'
    value = '<table:table-cell office:value-type="float" office:value="1"/>'
    for rows, held in ((row.format(1000000, blank), True), (row.format(9, blank + value), False)):
        path = tmp_path / "a.ods"
        with zipfile.ZipFile(path, "w") as packed:
            packed.writestr(
                "content.xml",
                '<d xmlns:table="t" xmlns:office="o"><table:table>'
                f"{row.format(1, value)}{rows}</table:table></d>",
            )
        if held:
            check_workbook(path)
        else:
            with pytest.raises(FileFormatError, match="16001 columns"):
                check_workbook(path)


def test_what_unpacks_to_a_flood_is_refused(tmp_path):
    path = tmp_path / "a.xlsx"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed,
        packed.open("xl/sharedStrings.xml", "w", force_zip64=True) as file,
    ):
        for _ in range(401):
            file.write(bytes(1_000_000))
    with pytest.raises(FileFormatError, match=r"unpacks to 4.01e\+08 bytes"):
        read_recordings(path)

"""Tables come out of every dialect with the same numbers under the same names."""

import numpy as np
import pandas as pd
import pytest

from prior_reinforce.arm.recordings.tables import read_table
from prior_reinforce.errors import FileFormatError

FRAME = pd.DataFrame({"t": [0.0, 0.25, 0.5], "q 1": [0.5, -1.25, 3e-5], "q 2": [1.0, 2.0, 3.0]})


def numbers(table):
    return np.column_stack([table.numbers(i) for i in range(len(table.names))])


def one(path, **said):
    table = read_table(path, **said)
    return table


@pytest.mark.parametrize("sep", [",", ";", "\t", " "])
@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("index", [False, True])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_whatever_pandas_writes(tmp_path, sep, decimal, index, encoding):
    if sep == decimal:
        return
    path = tmp_path / "a.csv"
    FRAME.to_csv(path, sep=sep, decimal=decimal, index=index, encoding=encoding)
    if sep == " " and index:  # an empty first name is lost between blanks
        return
    table = one(path)
    assert table.names == tuple(FRAME.columns)
    np.testing.assert_array_equal(numbers(table), FRAME)


@pytest.mark.parametrize("sep", [",", ";"])
def test_an_empty_last_cell_makes_no_decimal_comma(tmp_path, sep):
    path = tmp_path / "a.csv"
    path.write_text("episode,landing spot [cm]\n0,101\n1,\n2,151\n".replace(",", sep))
    table = one(path)
    assert table.names == ("episode", "landing spot [cm]")
    assert table.cells == (["0", "1", "2"], ["101", "", "151"])


def test_what_numpy_writes_has_its_names_in_a_comment(tmp_path):
    path = tmp_path / "a.csv"
    np.savetxt(path, FRAME, header="t q1 q2", fmt="%.6g")
    table = one(path)
    assert (table.names, table.named) == (("t", "q1", "q2"), True)
    np.testing.assert_array_equal(numbers(table), FRAME)
    np.savetxt(path, FRAME, header="recorded on Monday, twice", fmt="%.6g")
    assert one(path).names == ("column 1", "column 2", "column 3")


def test_a_table_without_names(tmp_path):
    path = tmp_path / "a.csv"
    FRAME.to_csv(path, header=False, index=False)
    table = one(path)
    assert (table.names, table.named) == (("column 1", "column 2", "column 3"), False)
    np.testing.assert_array_equal(numbers(table), FRAME)


def test_comments_blank_lines_spaces_and_trailing_delimiters(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# log\n\nt, q1 , q2,\n% noted\n0, 1, 2,\n\n0.1,  3, x,\n")
    table = one(path)
    assert table.names == ("t", "q1", "q2")
    assert table.lines == (5, 7)
    np.testing.assert_array_equal(table.numbers(1), [1, 3])
    assert not table.is_number(2)
    with pytest.raises(FileFormatError, match=r"a\.csv, line 7: q2 is 'x', expected a number"):
        table.numbers(2)


@pytest.mark.parametrize("row", ["s;rad;deg", "[s];[rad];[°]", "s;;deg"])
def test_a_row_of_units(tmp_path, row):
    path = tmp_path / "a.csv"
    path.write_text(f"t;q1;q2\n{row}\n0,5;1;2\n0,75;2;3\n", encoding="utf-8")
    table = one(path)
    assert table.units == ("s", None if ";;" in row else "rad", "deg")
    np.testing.assert_array_equal(table.numbers(0), [0.5, 0.75])


def test_excels_own_first_line_and_code_page(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("sep=;\nt;q1 [°]\n0,5;1,5\n1;2\n".encode("cp1252"))
    table = one(path)
    assert table.names == ("t", "q1 [°]")
    np.testing.assert_array_equal(numbers(table), [[0.5, 1.5], [1, 2]])


def test_a_dialect_may_be_said(tmp_path):
    path = tmp_path / "a.csv"
    for delimiter, said in (("|", "|"), (";", "semicolon")):
        path.write_text("a|b\n1,5|2\n3|4\n".replace("|", delimiter))
        table = one(path, delimiter=said, decimal=",")
        np.testing.assert_array_equal(numbers(table), [[1.5, 2], [3, 4]])


@pytest.mark.parametrize("said", [{}, {"decimal": ","}, {"decimal": ",", "delimiter": "comma"}])
def test_decimal_commas_in_quotes_between_commas(tmp_path, said):
    path = tmp_path / "a.csv"
    path.write_text('name,a,b\nx,"0,5","-1,25"\n"y, z","3",2\n')
    table = one(path, **said)
    assert (table.names, table.decimal) == (("name", "a", "b"), ",")
    assert table.cells[0] == ["x", "y, z"]
    np.testing.assert_array_equal(table.values[:, 1:], [[0.5, -1.25], [3, 2]])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("e,x,y\n0,0,84,0,05\n", "line 2: 5 cells under 3 names.*semicolons between cells"),
        ('"t","a"\n"1",0,2\n"2",1,3\n', r"line 2: 3 cells under 2 names.*of R, .*col\.names = NA"),
        ("t,a\n0,2\n1,3,,4\n", "line 3: 4 cells under 2 names"),
    ],
)
def test_cells_under_no_name_are_refused(tmp_path, text, says):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=says):
        one(path)


def test_points_between_thousands_are_no_numbers(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("a;b\n1,5;1.234,5\n2,5;3,5\n")
    with pytest.raises(FileFormatError, match=r"line 2: b is '1\.234,5', expected a number"):
        one(path, decimal=",").numbers(1)
    path.write_text("a;b\n1,5;1.234,5\n2,5;1.235,5\n")
    with pytest.raises(FileFormatError, match=r"so are 2 of 2 rows: .*1000 for 1\.000,0"):
        one(path, decimal=",").numbers(1)


def test_milliseconds_behind_a_colon_are_times_and_frames_of_a_film_are_none(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,f\n09:59:59:990,09:59:59:24\n10:00:00:005,10:00:00:00\n")
    table = one(path)
    assert table.nanoseconds(0).tolist() == [0, 15_000_000]
    assert table.nanoseconds(1) is None


def test_dates_and_times_of_day(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        "d,e,q\n2026-11-21T10:00:00.5,10:00:00.5,1\n2026-11-21T10:00:00.52,10:00:00.52,2"
    )
    table = one(path)
    for column in (0, 1):
        np.testing.assert_array_equal(table.nanoseconds(column), [0, 20_000_000])
    assert table.nanoseconds(2) is None
    path.write_text("q,a\nhigh,1\nlow,2\n")
    assert one(path).nanoseconds(0) is None


@pytest.mark.parametrize("content", [b"a,b\n\xff\xfe,1\n", b"PK\x03\x04\0\0\0"])
def test_bytes_that_are_no_text(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=r"is no text"):
        read_table(path)


def test_an_empty_file_has_no_columns(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# nothing\n\n")
    table = one(path)
    assert (table.names, len(table)) == ((), 0)


@pytest.mark.parametrize(
    "cells",
    [
        ("2026-11-21T10:00", "2026-11-21T10:00:00.000000001", "2026-11-21 10:00:01.5"),
        ("2026-11-21T10:00:00+01:00", "2026-11-21T09:00:00Z", "2026-11-21T04:30:01-0530"),
        ("2026-11-21", "2026-11-22"),
        ("20261121T100000", "20261121T100001.25"),
        ("1969-12-31T23:59:59.75", "2061-01-01T00:00"),
        ("10:00:00", "10:00:00.004", "110:00:01"),
        ("0 days 00:00:01.5", "1 days 00:00:02", "2 days 00:00:00.25"),
    ],
)
def test_dates_and_spans_are_read_as_pandas_reads_them(tmp_path, cells):
    path = tmp_path / "a.csv"
    path.write_text("t,a\n" + "".join(f"{cell},{i}\n" for i, cell in enumerate(cells)))
    try:
        times = pd.to_datetime(pd.Series(cells), format="ISO8601", utc=True)
    except ValueError:
        times = pd.to_timedelta(pd.Series(cells))
    expected = (times - times.iloc[0]).dt.as_unit("ns").astype("int64")
    np.testing.assert_array_equal(one(path).nanoseconds(0), expected)


@pytest.mark.parametrize("second", ["2026-02-31T10:00", "10:61:00", "monday", "", "2026"])
def test_what_is_no_date_is_no_time(tmp_path, second):
    path = tmp_path / "a.csv"
    path.write_text(f"t,a\n2026-11-21T10:00,0\n{second},1\n")
    assert one(path).nanoseconds(0) is None


@pytest.mark.parametrize("mark", ["'", "’", " ", "\u00a0", "\u202f"])
def test_marks_between_thousands_that_no_decimal_sign_is_are_passed_over(tmp_path, mark):
    path = tmp_path / "a.csv"
    path.write_text(f"episode;x;y\n0;1{mark}012,5;-250,0\n1;980,0;12{mark}345{mark}678,0\n")
    table = read_table(path)
    assert [table.numbers(i).tolist() for i in (1, 2)] == [[1012.5, 980.0], [-250.0, 12345678.0]]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("11/26/2026 12:59:59.900 PM", "11/26/2026 1:00:00.150 PM"),
        ("26.11.2026 23:59:59,900", "27.11.2026 00:00:00,150"),
        ("11:59:59.900 AM", "12:00:00.150 PM"),
    ],
)
def test_times_as_office_programs_write_them(tmp_path, before, after):
    path = tmp_path / "a.csv"
    path.write_text(f"time;q1\n{before};0.5\n{after};0.75\n")
    assert read_table(path).stamps(0).tolist() == [0.0, 250e6]


def test_whole_numbers_with_blanks_between_are_no_number(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("episode;x;y\n0;100 200 300;1\n1;200 300 400;2\n")
    table = read_table(path)
    with pytest.raises(FileFormatError, match="'100 200 300', expected a number"):
        table.numbers(1)


def test_a_time_of_day_goes_on_at_midnight(tmp_path):
    (tmp_path / "a.csv").write_text("clock,a\n23:59:59.5,1\n00:00:00,2\n00:00:00.5,3\n")
    times = read_table(tmp_path / "a.csv").stamps(0)
    np.testing.assert_array_equal(times, [0, 5e8, 1e9])
    # A date says its day, and a span none.
    for cells, step in (
        ("2026-05-03 14:02,2026-05-02 14:02", -86400),
        ("26:00:00,00:00:00", -93600),
    ):
        (tmp_path / "a.csv").write_text("clock,a\n{},1\n{},2\n".format(*cells.split(",")))
        assert read_table(tmp_path / "a.csv").stamps(0)[1] == step * 1e9


FLOATS = pd.DataFrame(0.3 + np.outer(np.linspace(0, 1, 40) ** 2, [1, -1, 2]))


@pytest.mark.parametrize(
    ("write", "names"),
    [
        (dict(index=False), ("column 1", "column 2", "column 3")),
        (dict(), ("column 2", "column 3", "column 4")),
        (dict(index_label="t"), ("t", "column 2", "column 3", "column 4")),
    ],
)
@pytest.mark.parametrize("scale", [1, 1000])
def test_numbers_that_pandas_writes_over_columns_without_names_are_no_row(
    tmp_path, write, names, scale
):
    frame = FLOATS if scale == 1 else (scale * FLOATS).astype(int)
    frame.to_csv(tmp_path / "a.csv", **write)
    table = read_table(tmp_path / "a.csv")
    assert (table.names, table.named, len(table)) == (names, False, 40)
    np.testing.assert_allclose(table.values[:, -3:], frame)


def test_an_index_without_a_name_before_such_numbers_stays(tmp_path):
    FLOATS.set_axis(FLOATS.index / 10).to_csv(tmp_path / "a.csv")
    table = read_table(tmp_path / "a.csv")
    assert table.names == ("", "column 2", "column 3", "column 4")


@pytest.mark.parametrize(
    "rows",
    [
        ("0,1,2", "0,1,2", "0,1,2", "0,1,2"),
        ("0,1,2", "1,2,3", "2,3,4", "3,4,5"),
        ("0,1", "20,1", "39,0", "60,0"),
        ("0,1", "1,0.98", "2,0.95", "3,0.9"),
        ("push,0,1", "push,0.1,0.98", "push,0.2,0.95", "push,0.3,0.9"),
        ("nan,0,1", "0.4,0.1,0.98", "0.3,0.2,0.95", "0.2,0.3,0.9"),
    ],
)
def test_a_first_frame_may_hold_such_numbers(tmp_path, rows):
    (tmp_path / "a.csv").write_text("\n".join(rows))
    table = read_table(tmp_path / "a.csv")
    assert (table.named, len(table)) == (False, 4)


def test_numbers_that_may_be_a_frame_or_a_head_are_refused(tmp_path):
    (tmp_path / "a.csv").write_text("0,1,2\n0,-1,3\n2,-3,5\n3,-5,7\n")
    with pytest.raises(FileFormatError, match=r"a\.csv: 0,1,2 may be a frame, or numbers of"):
        read_table(tmp_path / "a.csv")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_room_at_the_end_that_a_log_did_not_use_holds_nothing(tmp_path, encoding):
    (tmp_path / "a.csv").write_bytes("t,a\n0,1\n1,2\n".encode(encoding) + bytes(64))
    np.testing.assert_array_equal(numbers(read_table(tmp_path / "a.csv")), [[0, 1], [1, 2]])


def test_nul_bytes_elsewhere_are_called_so(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"t,a\n0,1\n1,\0\0\n2,3\n")
    with pytest.raises(FileFormatError, match=r"a\.csv, line 3: NUL bytes.* tr -d '\\0' <"):
        read_table(tmp_path / "a.csv")


def test_a_first_row_of_0_and_1_is_refused_where_it_may_be_a_frame(tmp_path):
    t = np.arange(30) / 50
    rows = [f"{a:g},{b:.6g}" for a, b in zip(t, np.cos(3 * t), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    with pytest.raises(FileFormatError, match="0,1 may be a frame, or numbers of columns"):
        read_table(tmp_path / "a.csv")


def test_utf_16_without_a_mark_is_called_so(tmp_path):
    (tmp_path / "a.csv").write_bytes("t,q\n0,1\n1,2.5\n".encode("utf-16-le"))
    with pytest.raises(FileFormatError, match="UTF-16 without a mark"):
        read_table(tmp_path / "a.csv")


def test_unused_room_may_end_in_a_newline(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"t,q\n0,1\n1,2.5\n" + 40 * b"\0" + b"\n")
    assert len(read_table(tmp_path / "a.csv")) == 2


def test_lines_above_the_names_are_to_be_taken_out(tmp_path):
    path = tmp_path / "0.csv"
    path.write_text("Recorder v2\n,1\nt,q1,q2\n0,1,2\n1,2,3\n")
    with pytest.raises(FileFormatError, match="names are in line 3, take out all that is above"):
        read_table(path)


def test_units_in_cells_are_to_be_put_in_the_head_though_semicolons_are_there(tmp_path):
    path = tmp_path / "outcomes.csv"
    path.write_text("episode; x; y\n" + "".join(f"throw_{i}; 0.{i} m; 1 m\n" for i in range(5)))
    with pytest.raises(FileFormatError, match=r"units in the head, x \[m\]"):
        read_table(path)


@pytest.mark.parametrize("form", ["{:02d}:{:02d}.{:02d}", "{:02d}:{:02d},{:02d}"])
def test_minutes_and_seconds_are_times(tmp_path, form):
    path = tmp_path / "0.csv"
    cells = [form.format(i // 6000, i // 100 % 60, i % 100) for i in range(5990, 6010)]
    path.write_text("\n".join(["t;q", *(f"{cell};0" for cell in cells)]))
    np.testing.assert_allclose(read_table(path).stamps(0), np.arange(20) * 1e7)


@pytest.mark.parametrize("end", ["", ","])
def test_names_that_no_cell_is_under_in_any_row_are_refused(tmp_path, end):
    """The last names would be of others' numbers: of a rate in the place of a joint."""
    path = tmp_path / "a.csv"
    path.write_text(f"q1,q2,q3,dq1,dq2,dq3\n0.1,0.2,1.1,1.2{end}\n0.3,0.4,1.3,1.4{end}\n")
    with pytest.raises(FileFormatError, match=rf"6 names in line 1, and {4 + len(end)} cells"):
        one(path)


def test_rows_that_are_cut_off_at_the_end_are_read_with_empty_cells(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,q1,q2,\n0,0.1,0.2,\n1,0.3,0.4\n2,0.5\n")
    assert one(path).cells[2] == ["0.2", "0.4", ""]
    path.write_text("t,q1,q2,\n0,0.1,0.2\n1,0.3,0.4\n")
    assert one(path).names == ("t", "q1", "q2")


def test_the_names_of_a_head_of_several_lines_begin_with_its_first(tmp_path):
    path = tmp_path / "a.csv"
    heads = "Recorded at ,Wed Oct 28\n\nStamp,Position,Velocity\nseconds,elbow,elbow,\n"
    path.write_text(f"{heads}0.1,0.2,0.3,\n0.2,0.3,0.4,\n")
    with pytest.raises(FileFormatError, match="names are in line 3"):
        one(path)


def test_yaml_is_called_so(tmp_path):
    path = tmp_path / "a.txt"
    frame = "header:\n  stamp:\n    sec: 1\nname:\n- elbow\nposition:\n- 0.25\n---\n"
    path.write_text(frame * 3)
    with pytest.raises(FileFormatError, match=r"is YAML.*--csv"):
        one(path)

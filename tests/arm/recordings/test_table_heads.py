"""Lines of names that stand above a table's rows."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.table_heads import with_one_header
from prior_reinforce.arm.recordings.tables import read_table


def headed(tmp_path, *lines):
    (tmp_path / "a.csv").write_text("\n".join(lines))
    return with_one_header(read_table(tmp_path / "a.csv"))


def test_the_last_of_several_lines_may_say_units(tmp_path):
    read = headed(tmp_path, "joint,pan,lift", "of,state,state", "time,deg,deg", "0,1,2", "1,3,4")
    assert read.names == ("joint/of", "pan/state", "lift/state")
    assert read.units == (None, "deg", "deg")
    np.testing.assert_array_equal(read.values, [[0, 1, 2], [1, 3, 4]])


@pytest.mark.parametrize("cell", ["None", "N/A", "nan", "2026-05-03"])
def test_a_first_row_without_a_number_is_no_line_of_names(tmp_path, cell):
    read = headed(tmp_path, "a,b,c", f"{cell},{cell},{cell}", "1,2,3")
    assert (read.names, len(read)) == (("a", "b", "c"), 2)


@pytest.mark.parametrize("frame", ["", "base_link"])
@pytest.mark.parametrize("rest", [",nan,nan,nan,nan", ",0,0", ""])
def test_an_echo_of_joint_states(tmp_path, frame, rest):
    rows = [f"17,{k}00,{frame},pan,lift,{k}e-07,{-k}{rest}" for k in range(4)]
    names = headed(tmp_path, *rows).names
    assert names[:2] == ("sec", "nanosec")
    assert names[-(2 + 2 + rest.count(",")) :][:4] == ("name0", "name1", "position0", "position1")


@pytest.mark.parametrize(
    "row",
    [
        "0.0{k},0.5,move,0.3",
        "0.0{k},0.5,move,0.3,0.4",
        "{k}.5,0.5,auto,swing,0.3",
        "{k},-3,auto,swing,0.3,0.4",
    ],
)
def test_rows_of_others_with_words_have_no_names(tmp_path, row):
    assert not headed(tmp_path, *(row.format(k=k) for k in range(4))).named

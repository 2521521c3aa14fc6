"""Which number in a recording's name a row gives, and what is said where a column is missing."""

import pytest

from prior_reinforce.arm.recordings.outcome_names import (
    columns_of,
    digits_at_end,
    how_to_renumber,
    keys_of,
    number_of,
    order_of,
    other_places,
    refuse_unlike,
    remedy_for,
    rows_of,
    telling_column,
    telling_word,
)
from prior_reinforce.arm.recordings.tables import read_table
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError
from tests.arm.recordings.recorded import table


def test_the_seconds_of_a_time_are_no_number_of_an_episode():
    assert digits_at_end("2024-05-03_14-02-03") == digits_at_end("20240503T140203") == ""
    assert digits_at_end("demo_003") == digits_at_end("set-2_3") == "3"
    assert digits_at_end("2024-05-03") == digits_at_end("log_2024-05-03_1402") == ""
    assert digits_at_end("2024-05-03_demo_003") == digits_at_end("2024-05-03_3") == "3"
    assert digits_at_end("throw_03.05.2024") == ""
    assert digits_at_end("log_10-10-03") == digits_at_end("log_10-10-03.250") == ""
    assert digits_at_end("s01_02_03") == "3"
    assert digits_at_end("2-01-03") == digits_at_end("set-10_11-3") == "3"


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("throw_1_take2", "1"),
        ("anna-Throw007_take2", "7"),
        ("throw_2024-05-03_4", "4"),
        ("throw2_03.05.2024", "2"),
        ("overthrow_1_take2", "2"),
        ("take_2", "2"),
        ("throw", ""),
    ],
)
def test_the_number_behind_a_word(name, number):
    assert number_of(name, "throw") == number


@pytest.mark.parametrize(
    ("names", "rows"),
    [
        (["2024-05-02_throw_1", "2024-05-01_throw_2"], "12"),
        (["02.05.2024_1", "01.05.2024_2"], "12"),
        (["01_throw_001", "02_throw_002"], "12"),
        (["set2_1", "set2_2"], "12"),
        (["day1_1", "day1_2", "day2_3"], "123"),
        (["cam7_1", "cam5_2"], "12"),
        (["2_a_1", "1_a_2"], ["2_a_1", "1_a_2"]),
        (["throw2_take1", "throw2_take2"], "12"),
        (["throw7_take1", "throw5_take2"], "12"),
        (["a", "b"], "12"),
        ([], "12"),
    ],
)
def test_the_number_at_the_end_counts_where_no_other_fits(names, rows):
    for word in ("throw", "episode"):
        told = telling_word(word, names, names, rows)
        assert [number_of(name, told) for name in names] == [*map(digits_at_end, names)]


@pytest.mark.parametrize("names", [["2_1", "1_2"], ["throw_01_take2", "throw_02_take1"]])
def test_two_numbers_that_both_fit_are_refused(names):
    with pytest.raises(
        InvalidDemonstrationsError, match=rf"{names[0]} may be row \d or row \d: .*"
    ):
        telling_word("episode", names, names, "12")


def test_some_of_the_episodes_are_numbered_as_all_are():
    there = ["throw2_take1", "throw2_take2", "throw2_take3"]
    assert telling_word("throw", there[1:2], there, "123") == ""
    again = ["throw1_take1", "throw1_take2", "throw2_take1"]
    assert telling_word("throw", again[1:], again, "12") == "throw"


def test_a_time_of_day_is_no_number_behind_a_word():
    assert number_of("throw_2024-05-03_01-02-03_2", "throw") == "2"
    assert number_of("throw_20240503_140203_take5", "throw") == "5"
    assert number_of("throw_14-02-03_take5", "throw") == "5"


def test_rows_of_other_sources_do_not_hide_that_two_numbers_fit():
    names = ["throw_3_take1", "throw_4_take2"]
    with pytest.raises(InvalidDemonstrationsError, match="throw_3_take1 may be row 3 or row 1"):
        telling_word("episode", names, names, "12345")
    assert telling_word("throw", names, names, "12345") == "throw"


def test_rows_that_say_the_word_themselves_decide():
    names = ["throw_1_take2", "throw_2_take1"]
    assert telling_word("episode", names, names, ["throw_1", "throw_2"]) == "throw"


@pytest.mark.parametrize(
    ("there", "says"),
    [
        (["error_x", "error_y"], "error_x, error_y may be measured from a target"),
        (["dx", "dy"], "to them, as x, y (x is ahead"),
        (["x", "Z"], "Z is no x, y; add it, and turn"),
        (["length", "width"], "rename or add it"),
        (["hose", "coffee"], "rename or add it"),
    ],
)
def test_errors_and_depths_are_not_to_be_renamed(there, says):
    assert says in remedy_for(["x", "y"], there)


def test_a_column_may_be_called_by_where_it_counts_up_to():
    assert columns_of(["x", "y"], ["X", "right"]) == {"x": [(0, 1)], "y": [(1, -1)]}


THROWS = ["throw_1", "throw_2", "throw_3", "throw_4"]


def told(tmp_path, head, rows, there):
    """Row of each recording, of a table with columns that may name it."""
    cells = read_table(
        table(tmp_path, f"{head},x,y\n" + "".join(f"{r},1,0\n" for r in rows.split()))
    )
    named = range(len(cells.names) - 2)
    word, found = telling_column(keys_of(cells, 0, [*named]), there, there, "t.csv")
    return [*rows_of(there, word, found).values()]


@pytest.mark.parametrize("head", ["trial,episode", "run,throw", "take,throw"])
def test_two_columns_that_name_other_recordings_are_refused_by_name(tmp_path, head):
    one, other = head.split(",")
    with pytest.raises(
        InvalidDemonstrationsError, match=f"in {one} and in {other} .* call it note"
    ):
        told(tmp_path, head, "1,4 2,1 3,3 4,2", THROWS)
    assert told(tmp_path, head, "2,2 1,1 4,4 3,3", THROWS) == [1, 0, 3, 2]


@pytest.mark.parametrize("cell", ["throw_{}.csv", "throw_{}", "rec/throw_{}.npz"])
def test_the_column_of_the_recordings_exact_names_decides(tmp_path, cell):
    rows = " ".join(f"{i},{cell.format(n)}" for i, n in enumerate((4, 1, 3, 2), 1))
    assert told(tmp_path, "episode,file", rows, THROWS) == [1, 3, 2, 0]
    assert told(tmp_path, "trial,episode", "1,3 2,2 3,1 4,0", [*"0123"]) == [3, 2, 1, 0]


def test_names_of_other_recordings_beside_numbers_are_no_silent_answer(tmp_path):
    with pytest.raises(InvalidDemonstrationsError, match=r"in episode and in pair .* call it note"):
        told(tmp_path, "episode,pair", "1,throw_2 2,throw_1 3,throw_4 4,throw_3", THROWS)
    some = "1,none 2,throw_1 3,throw_2 4,throw_3"
    assert told(tmp_path, "episode,after", some, THROWS) == [0, 1, 2, 3]


def test_columns_that_tell_rows_apart_together_are_both_in_the_recordings_names(tmp_path):
    rows, names = "1,1 1,2 2,1 2,2", [f"run{i}_throw{j}" for j in (1, 2) for i in (1, 2)]
    assert told(tmp_path, "run,throw", rows, names) == [0, 2, 1, 3]
    with pytest.raises(
        InvalidDemonstrationsError, match=r"run and throw together.*\(run_1_throw_1"
    ):
        told(tmp_path, "run,throw", rows, THROWS)
    with pytest.raises(FileFormatError, match="line 4: episode 1, 2 again"):
        told(tmp_path, "run,throw", "1,1 1,2 1,2 2,2", names)


def test_a_session_beside_numbers_says_nothing_but_a_number_that_comes_again_does(tmp_path):
    assert told(tmp_path, "run,throw", "1,2 1,1 2,4 2,3", THROWS) == [1, 0, 3, 2]
    with pytest.raises(FileFormatError, match="line 5: episode 3 again"):
        told(tmp_path, "trial,episode", "1,2 2,1 3,3 4,3", THROWS)


def test_whole_numbers_with_decimals_are_numbers(tmp_path):
    assert told(tmp_path, "episode", "0 2 1", ["0.0", "1.0", "2.0"]) == [0, 2, 1]
    assert told(tmp_path, "episode", "2.0 1.0", ["throw_1", "throw_2"]) == [1, 0]


def test_rows_of_motions_in_their_order_are_in_that_of_their_numbers():
    assert order_of(["throw 12", "throw 3", "throw 7"]) == [2, 0, 1]
    assert order_of(["1", "1", "0"]) == order_of(["a", "b", "c"]) == [0, 1, 2]


def test_columns_that_name_some_recordings_alike_agree():
    keys = [("trial", ("1", "2")), ("episode", ("1", "9"))]
    refuse_unlike("t.csv", keys, [{"a": 0, "b": 1}, {"a": 0}])
    with pytest.raises(InvalidDemonstrationsError, match="in trial and in episode"):
        refuse_unlike("t.csv", keys, [{"a": 0}, {"b": 0}])


@pytest.mark.parametrize(
    "others", ["landing_x landing_y", "x_meas y_meas", "x_ist y_ist", "xLanded yLanded", "x2 y2"]
)
def test_other_columns_that_may_be_the_outcomes_are_asked_about(tmp_path, others):
    with pytest.raises(FileFormatError, match=others.replace(" ", ", ") + " beside x, y: .*note_"):
        other_places(tmp_path, ["x", "y"], others.split())


def test_columns_that_are_no_outcomes_by_their_names_are_left_out(tmp_path):
    beside = ["goal_x", "goal_y", "x_release", "y_release", "x_err", "y_err", "z", "speed", "x_cam"]
    assert other_places(tmp_path, ["x", "y"], beside) == beside[:6]
    assert other_places(tmp_path, [], beside) == []
    others = ["velocity_x", "velocity_y", "x_px", "y_px"]
    assert other_places(tmp_path, ["x", "y"], others) == others
    assert other_places(tmp_path, ["x", "y"], ["note_x2", "note_y2"]) == ["note_x2", "note_y2"]
    assert other_places(tmp_path, ["angle"], ["elbow_angle"]) == ["elbow_angle"]


def test_rows_with_whole_names_of_some_episodes_are_not_to_be_numbered_anew():
    takes = ["take-1", "take-2", "take-3"]
    assert how_to_renumber("", takes, ["take-2", "take-3"]) == ""
    assert "renumber it" in how_to_renumber("", takes, ["throw-2", "throw-3"])

"""Which number in a recording's name a row gives, and what is said where a column is missing."""

import pytest

from prior_reinforce.arm.recordings.outcome_names import (
    columns_of,
    digits_at_end,
    number_of,
    remedy_for,
    telling_word,
)
from prior_reinforce.errors import InvalidDemonstrationsError


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

"""Numbers as people write them."""

import time

from prior_reinforce.numerals import patterns, read_numbers, with_points


def test_numbers_with_what_stands_behind_plus_minus():
    assert read_numbers("0.05 +- 0.003, -0.02±0.001 1") == [
        (0.05, 0.003), (-0.02, 0.001), (1.0, None),
    ]  # fmt: skip
    assert read_numbers("0.05 +- x") is None


def test_a_comma_is_decimal_where_there_are_as_many_numbers():
    assert read_numbers(with_points("5+-1,2+-1", 2)) == [(5, 1), (2, 1)]
    assert with_points("0,92 0,1 m", 2) == "0.92 0.1 m"


def test_a_text_of_any_length_is_read_at_once():
    begun = time.process_time()
    assert not patterns(("m", "m"))[1].findall("x" * 30_000)  # quadratic in it: 17 s
    assert time.process_time() - begun < 1

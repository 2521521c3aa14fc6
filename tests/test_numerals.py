"""Numbers as people write them."""

from prior_reinforce.numerals import read_numbers, with_points


def test_numbers_with_what_stands_behind_plus_minus():
    assert read_numbers("0.05 +- 0.003, -0.02±0.001 1") == [
        (0.05, 0.003), (-0.02, 0.001), (1.0, None),
    ]  # fmt: skip
    assert read_numbers("0.05 +- x") is None


def test_a_comma_is_decimal_where_there_are_as_many_numbers():
    assert read_numbers(with_points("5+-1,2+-1", 2)) == [(5, 1), (2, 1)]
    assert with_points("0,92 0,1 m", 2) == "0.92 0.1 m"

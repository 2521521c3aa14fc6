"""Errors, places and lengths, said in words or numbers."""

import numpy as np
import pytest

from prior_reinforce.errors import InvalidFeedbackError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.parsing import from_words, read_place
from prior_reinforce.wording import (
    in_words,
    say_chance,
    say_cost,
    say_length,
    say_place,
    say_trials,
    to_words,
    too_far,
)

METRES = OutcomeFormat.metres(2)
MIXED = OutcomeFormat(("x", "t"), ("m", "s"))


def of(*units, names="xyzabc"):
    return OutcomeFormat(tuple(names[: len(units)]), units)


INF = np.inf


@pytest.mark.parametrize(
    ("error", "words"),
    [
        ([0.05, 0.02], "5 cm long, 2 cm left"),
        ([-0.1, 0.0], "10 cm short"),
        ([0.0, -0.003], "0.3 cm right"),
        ([0.0, 0.0], "on the goal"),
        ([0.01, 0.0, -0.02], "1 cm long, 2 cm low"),
        ([-0.02], "2 cm short"),
    ],
)
def test_errors_are_said_in_centimetres(error, words):
    assert to_words(error) == words


@pytest.mark.parametrize(
    ("units", "expected"),
    [(["m"], True), (["m"] * 3, True), (["m"] * 4, False), (["m", "s"], False), (["cm"], False)],
)
def test_words_are_for_three_lengths_at_most(units, expected):
    assert in_words(of(*units)) == expected


def test_what_has_no_words_is_said_by_names_and_units():
    error = np.array([0.0123456, -0.5])
    assert to_words(error, MIXED) == "x +0.0123 m, t -0.5 s"
    assert to_words(error, METRES) == "1.2 cm long, 50 cm right"
    assert to_words([-0.00001, 0.0], MIXED) == "x +0 m, t +0 s"
    assert say_place([0.92, 0.3], MIXED) == "x 0.92 m, t 0.3 s"
    assert (
        say_place([0.1, -0.2, 0.3, 0.4], of(*"mmmm", names="abcd"))
        == "a 0.1 m, b -0.2 m, c 0.3 m, d 0.4 m"
    )


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ([0.9204, -0.1], "92 cm ahead, 10 cm right"),
        ([1.0, 0.0], "100 cm ahead, 0 cm left"),
        ([-0.0004, -0.0004], "0 cm ahead, 0 cm left"),
        ([-0.1, 0.25, -0.051], "10 cm behind, 25 cm left, 5.1 cm down"),
        ([0.653], "65.3 cm ahead"),
    ],
)
def test_places_are_said_as_seen_from_the_base(place, said):
    assert say_place(place, OutcomeFormat.metres(len(place))) == said


@pytest.mark.parametrize(
    ("length", "form", "said"),
    [
        (0.015, METRES, "1.5 cm"),
        (0.0, METRES, "0 cm"),
        (0.2, of("rad", "rad"), "0.2 rad"),
        (0.25, MIXED, "0.25"),
        (0.12345, MIXED, "0.123"),
    ],
)
def test_lengths(length, form, said):
    assert say_length(length, form) == said


def test_the_papers_count_is_demonstrations_plus_trials():
    assert say_cost(1, 1) == "N = 1 demonstration + 1 trial = 2"
    assert say_cost(6, 2) == "N = 6 demonstrations + 2 trials = 8"
    assert say_cost(6, 1.25) == "N = 6 demonstrations + 1.2 trials = 7.2"


def test_trials_to_go_are_counted_up_to_ten():
    assert say_trials(2.24) == "about 2.2"
    assert say_trials(67.3) == "more than 10"


def test_a_chance_is_one_of_three_words():
    said = [say_chance(p) for p in (0.0, 0.0999, 0.1, 0.43, 0.6499, 0.65, 1.0)]
    assert said == ["unlikely"] * 2 + ["possible"] * 3 + ["likely"] * 2


@pytest.mark.parametrize("unit", ["%", "degrees", "°", "inch", "turn", "M", "Seconds", "pins"])
def test_a_unit_in_another_spelling_is_read_as_it_is_printed(unit):
    form = OutcomeFormat(("a",), (unit,))
    assert form.units == (unit,)
    said = say_place([3.0], form).removeprefix("a ")
    np.testing.assert_allclose(read_place(said, form), [3.0])
    word = "late" if unit == "Seconds" else "long"
    np.testing.assert_allclose(from_words(f"{said} {word}", form).error_seen, [3.0])


@pytest.mark.parametrize(
    ("text", "units", "place"),
    [
        ("3,5 N", ["N"], [3.5]),
        ("3,5 °C", ["°C"], [3.5]),
        ("3,5 N·m", ["N·m"], [3.5]),
        ('1,5" 0', ["in", "in"], [1.5, 0]),
        ("0,92; 0,1", ["m", "m"], [0.92, 0.1]),
        ("0,5 0,25 cm", ["m", "m"], [0.005, 0.0025]),
        ("0.92; 0.1", ["m", "m"], [0.92, 0.1]),
    ],
)
def test_a_comma_is_decimal_before_any_unit_and_between_semicolons(text, units, place):
    np.testing.assert_allclose(read_place(text, of(*units)), place)


@pytest.mark.parametrize("text", ["1,500 N", "1,500 °C", '1,500"', "1,500; 0,300"])
def test_what_may_be_a_thousand_of_any_unit_is_refused(text):
    units = {"N": ["N"], "C": ["°C"], '"': ["in"]}.get(text[-1], ["m", "m"])
    with pytest.raises(InvalidFeedbackError, match=r"may be a thousand; write 1500, or 1\.500"):
        read_place(text, of(*units))


def test_a_range_has_decimal_commas():
    for text in ("1,5-2,5 cm short", "1,5 – 2,5 cm short", "1,5cm-2,5 cm short"):
        seen = from_words(text, METRES)
        np.testing.assert_allclose([seen.low[0], seen.high[0]], [-0.025, -0.015])
    assert from_words("1,5 +- 0,5 cm short", METRES).sd[0] == pytest.approx(0.005)
    with pytest.raises(InvalidFeedbackError, match="may be a thousand"):
        from_words("1,500-2,500 mm short", METRES)


def test_one_number_with_a_comma_is_not_two_far_ones():
    with pytest.raises(InvalidFeedbackError, match="'0,92' may be one number; give 2 finite"):
        read_place("0,92", METRES)


def test_no_empty_example_is_given_of_a_task_that_has_none():
    with pytest.raises(InvalidFeedbackError, match=r'left, right, or "hit" or "miss"$'):
        from_words("green", of("pins", "pins"))


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ([1.0, 0.4], ""),
        ([1.0, 0.5], "long and left"),
        ([0.1, -0.9], "right"),
        ([-0.7, 0.6], "short and left"),
        ([-0.9, 0.1], "short"),
    ],
)
def test_words_for_too_far_where_a_throw_goes_to_a_side(goal, words):
    assert too_far(goal, METRES) == words
    assert too_far([*goal, 0.3], of("m", "m", "m")) == words


def test_no_words_for_too_far_where_outcomes_have_none():
    assert too_far([0.0, 0.9], MIXED) == ""
    assert too_far([-0.9], of("m")) == ""
    assert too_far([0.9, 0.0], of("m", "m", names="yx")) == "left"

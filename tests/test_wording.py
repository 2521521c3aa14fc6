"""Errors, places and lengths, said in words or numbers."""

import numpy as np
import pytest

from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.parsing import from_words, read_place
from prior_reinforce.wording import in_words, say_chance, say_length, say_place, to_words

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

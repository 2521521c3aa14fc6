"""Everyday words, said as `parsing` reads them."""

import time

import pytest

from prior_reinforce.parsing import from_words
from prior_reinforce.phrases import plainer, values_by_name


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("distance 120 cm, height 58 cm", "120 cm; 58 cm"),
        ("Height: 58 cm, distance = 120 cm", "120 cm; 58 cm"),
        ("distance 1,2 m height 0,5 m", "1,2 m; 0,5 m"),
        ("120 cm distance, height 58 cm", None),
        ("distance 120 cm", None),
        ("distance 120 cm, distance 58 cm", None),
    ],
)
def test_values_are_taken_by_their_names(text, values):
    assert values_by_name(text, ("distance", "height")) == values


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("No hit", "miss"),
        ("did not hit", "miss"),
        ("about 5cm past the goal", "5cm long"),
        ("overshoot", "long"),
        ("between 5 and 7 cm long", "5-7 cm long"),
        ("between 5cm and 7.5cm long", "5cm-7.5cm long"),
        ("1 1/2 in short, 1/4 in left", "1.5 in short, 0.25 in left"),
        ("2 ft short", "24 in short"),
        ("too far", "far"),
        ("5cms past the goal, straight", "5cm long, 0cm left"),
        ("between one and two cm long", "1-2 cm long"),
        ("Half a foot short", "6 in short"),
        ("far too long", "long"),
        ("Missed completely", "miss"),
        ("almost hit", "miss"),
        ("nearly", "miss"),
        ("perfect", "on the goal"),
        ("exact", "on the goal"),
        ("bullseye!", "on the goal!"),
        ("zero", "0"),
        ("5cm long, 2 cm left", "5cm long, 2 cm left"),
    ],
)
def test_phrases_are_said_as_words_that_are_read(text, means):
    assert plainer(text) == means
    assert from_words(text).said


def test_digits_of_any_number_are_read_at_once():
    begun = time.process_time()
    assert plainer("5" * 20_000) == "5" * 20_000  # quadratic in them: 11 s
    assert time.process_time() - begun < 1

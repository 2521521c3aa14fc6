"""Everyday words, said as `parsing` reads them."""

import pytest

from prior_reinforce.phrases import values_by_name


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

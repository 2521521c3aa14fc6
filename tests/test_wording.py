"""Words for errors: said and read back."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prior_reinforce.errors import InvalidFeedbackError
from prior_reinforce.wording import from_words, to_words


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
    ("words", "error"),
    [
        ("5cm long, 2cm left", [0.05, 0.02]),
        ("2 cm right and 10 cm short", [-0.10, -0.02]),
        ("5 long", [0.05, 0.0]),
        ("20 mm left", [0.0, 0.02]),
        ("0.1m short", [-0.1, 0.0]),
        ("Hit", [0.0, 0.0]),
    ],
)
def test_words_are_read(words, error):
    np.testing.assert_allclose(from_words(words, 2), error, atol=1e-12)


@pytest.mark.parametrize(
    "words",
    ["", "far", "5 cm", "long", "5 cm long, 2 cm short", "5cm high", "-5cm long", "5 km long"],
)
def test_other_words_are_refused_with_the_remedy(words):
    with pytest.raises(InvalidFeedbackError, match=r"cannot read|twice"):
        from_words(words, 2)


@pytest.mark.parametrize("words", ["0.05 long", "5cm short, 0.02 left"])
def test_metres_without_their_unit_are_not_taken_for_a_hit(words):
    with pytest.raises(InvalidFeedbackError, match="has no unit and would be 0"):
        from_words(words, 2)


@given(st.lists(st.integers(-900, 900), min_size=1, max_size=3))
def test_words_say_tenths_of_centimetres_without_loss(tenths):
    error = np.array(tenths) / 1000
    np.testing.assert_allclose(from_words(to_words(error), len(tenths)), error, atol=1e-12)


@given(st.text(max_size=30))
def test_no_text_causes_anything_but_the_named_error(text):
    with contextlib.suppress(InvalidFeedbackError):
        assert from_words(text, 2).shape == (2,)

"""What an outcome's numbers mean, and how near counts as reached."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError
from prior_reinforce.formats import OutcomeFormat, as_bare_error, in_tolerances

MIXED = OutcomeFormat(("x", "t"), ("m", "s"))


def test_lengths_are_x_y_and_z_or_numbered():
    assert str(OutcomeFormat.metres(3)) == "x [m], y [m], z [m]"
    assert OutcomeFormat.metres(4).names == ("0", "1", "2", "3")


def test_one_tolerance_is_that_of_every_component():
    form = OutcomeFormat.metres(2).within(0.015)
    assert form.tolerance == (0.015, 0.015)
    np.testing.assert_allclose(form.least_sd, 0.005)
    assert np.all(OutcomeFormat.metres(2).least_sd == 0)
    assert MIXED.within([0.015, 0.02]) == OutcomeFormat(("x", "t"), ("m", "s"), (0.015, 0.02))


@pytest.mark.parametrize(
    ("tolerance", "message"),
    [
        (0.015, "one number, 0.015, for outcomes of several units"),
        ([0.015], r"one for each of x \[m\], t \[s\]"),
        ([0.015, 0.0], "positive"),
        ([0.015, np.nan], "positive"),
        ("2cm", "positive"),
        ([[0.015], [0.02, 0.03]], "positive"),
        ((), "positive"),
    ],
)
def test_other_tolerances_are_refused(tolerance, message):
    with pytest.raises(ConfigurationError, match=message):
        MIXED.within(tolerance)


@pytest.mark.parametrize(
    ("names", "units", "tolerance", "message"),
    [
        (("x", "x"), ("m", "m"), (), "differ"),
        (("x", "y"), ("m",), (), "2 outcome names"),
        (("x", "y"), ("m", "m"), (0.1,), "one for each"),
    ],
)
def test_a_format_that_cannot_be_is_refused(names, units, tolerance, message):
    with pytest.raises(ConfigurationError, match=message):
        OutcomeFormat(names, units, tolerance)


def test_a_hit_is_one_tolerance_away_at_most():
    assert in_tolerances([0.009, 0.016], [0.015, 0.02]) == pytest.approx(1.0)


def test_what_an_adapter_expects_without_a_number_excuses_no_error():
    form = OutcomeFormat(("x", "y"), ("m", "m"), (0.015, 0.015))
    with pytest.raises(InvalidFeedbackError, match="looks like centimetres"):
        as_bare_error([20.0, 15.0], np.array([0.9, 0.1]), form, expected=[np.nan, np.nan])


def test_a_computed_error_may_be_as_large_as_the_goal_is_far():
    form = OutcomeFormat(("x", "y", "turn"), ("m", "m", "rad"), (0.05, 0.05, 0.05))
    goal = np.array([0.2, -2.4, 0.5])
    computed = [-1.0427512, 3.0870445, 0.1]
    np.testing.assert_array_equal(as_bare_error(computed, goal, form), computed)
    for typed, why in (
        ([-1.043, 3.087, 0.1], "x of -1.043 m looks like centimetres"),
        ([-4.9427512, 3.0870445, 0.1], "x of -4.94275 m looks like centimetres"),
        ([0.1, -30.4412345, 0.1], "y of -30.4412 m looks like centimetres"),
    ):
        with pytest.raises(InvalidFeedbackError, match=why):
            as_bare_error(typed, goal, form)
    shown = [[0.3, -2.0, 0.1], [0.0, -5.5, 0.0]]
    computed = [-4.9427512, 9.0870445, 0.1]
    np.testing.assert_array_equal(as_bare_error(computed, goal, form, shown=shown), computed)
    outcome = goal + np.array([0.0123456, -0.0345678, 0.01])
    with pytest.raises(InvalidFeedbackError, match="looks like where the object ended"):
        as_bare_error(outcome, goal, form)

"""Numbers that a caller gives: what comes out is a checked copy, what cannot be used is named."""

import numpy as np
import pytest

from prior_reinforce.arrays import (
    as_error,
    as_goal,
    as_outcomes,
    as_plans,
    check_spread,
    is_positive,
    say_flat,
)
from prior_reinforce.errors import (
    InvalidDemonstrationsError,
    InvalidFeedbackError,
    InvalidGoalError,
    InvalidPlanError,
)


@pytest.mark.parametrize(
    "check",
    [
        lambda values: as_plans(values, 2, single=True),
        lambda values: as_outcomes(values, 3),
    ],
)
def test_arrays_are_read_only_copies(check):
    given = np.array([[0.1, 0.2], [0.3, 0.1], [0.2, 0.2]])
    checked = check(given)
    np.testing.assert_array_equal(checked, given)
    assert not np.shares_memory(checked, given)
    assert not checked.flags.writeable


@pytest.mark.parametrize("goal", [[1.0], [1.0, 2.0, 3.0], [np.nan, 0.0], ["a", "b"], 1.0])
def test_bad_goals_are_named(goal):
    with pytest.raises(InvalidGoalError):
        as_goal(goal, ("x", "y"))


@pytest.mark.parametrize("error", [[1.0], [np.inf, 0.0], [[0.0, 0.0]], "far", [[1], [2, 3]]])
def test_bad_errors_are_named(error):
    with pytest.raises(InvalidFeedbackError):
        as_error(error, 2)


@pytest.mark.parametrize(
    ("plans", "message"),
    [
        ([[1.0, 2.0]], "at least two frames"),
        ([[1.0, 2.0, 3.0]] * 2, "3 action dimensions"),
        ([1.0, 2.0], "shape"),
        ([["a", "b"]] * 2, "of numbers"),
        ([[1.0, 2.0], [np.nan, 0.0]], r"element \(1, 0\) is nan"),
    ],
)
def test_bad_plans_are_named(plans, message):
    with pytest.raises(InvalidPlanError, match=message):
        as_plans(plans, 2, single=True)


@pytest.mark.parametrize("scale", [1.0, 1e-200, 1e6])
def test_outcomes_on_a_line_are_found_at_any_scale(scale):
    line = np.array([[0.1, 0.2], [0.2, 0.4], [0.3, 0.6]]) * scale
    with pytest.raises(InvalidDemonstrationsError, match="one line"):
        check_spread(line)
    bent = line.copy()
    bent[2, 1] *= 1.1
    check_spread(bent)


@pytest.mark.parametrize(("off", "flat"), [(0.0, True), (0.05, True), (0.4, False)])
@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e3])
def test_outcomes_that_are_almost_on_a_line_are_told_whatever_their_units(off, flat, scale):
    along = np.arange(4.0)
    outcomes = np.column_stack([along, scale * (along + off * np.array([1, -1, -1, 1]))])
    assert ("almost on one line" in say_flat(outcomes)) is flat
    assert bool(say_flat(outcomes)) is flat


def test_two_outcomes_of_two_components_are_on_a_line_and_one_tells_nothing():
    assert "one line" in say_flat(np.array([[0.1, 0.2], [0.3, 0.1]]))
    assert "one plane" in say_flat(np.eye(3))
    assert say_flat(np.array([[0.1], [0.3]])) == say_flat(np.array([[0.1, 0.2]])) == ""


def test_one_number_is_a_vector_of_one():
    np.testing.assert_array_equal(as_goal(1.2, ["x"]), [1.2])
    np.testing.assert_array_equal(as_error(np.float32(0.5), 1), [0.5])
    np.testing.assert_array_equal(as_outcomes([0.4, 0.5, 0.7], 3), [[0.4], [0.5], [0.7]])
    for numbers, n in (([0.4, 0.5], 3), (0.4, 1), ([[0.4], [0.5, 0.6]], 2)):
        with pytest.raises(InvalidDemonstrationsError, match=r"shape|of numbers"):
            as_outcomes(numbers, n)
    with pytest.raises(InvalidGoalError, match="2 components"):
        as_goal(1.2, ["x", "y"])


@pytest.mark.parametrize("value", [0, -1.0, np.nan, np.inf, None, "1", True, [1.0]])
def test_what_is_no_positive_number_is_told(value):
    assert not is_positive(value)
    assert is_positive(0.01)
    assert is_positive(np.float32(2))


@pytest.mark.filterwarnings("ignore:__array__")  # of torch itself
def test_a_tensor_that_has_a_gradient_is_named():
    torch = pytest.importorskip("torch")
    with pytest.raises(InvalidFeedbackError, match="detach"):
        as_error(torch.tensor([0.05, 0.02], requires_grad=True), 2)

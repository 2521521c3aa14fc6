"""What is said where a table lacks a component."""

import pytest

from prior_reinforce.arm.recordings.outcome_columns import columns_of, remedy_for


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

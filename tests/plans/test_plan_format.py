"""What the numbers of a plan's frames mean; how turns and signs move is in `test_whole_turns`."""

import pytest

from prior_reinforce.errors import InvalidPlanError
from prior_reinforce.plans.plan_format import PlanFormat


@pytest.mark.parametrize(
    ("names", "units", "dt", "message"),
    [
        ((), (), 0.1, "at least one"),
        (("a", "a"), ("rad", "rad"), 0.1, "differ"),
        (("a", "b"), ("rad",), 0.1, "as many units"),
        (("a",), ("rad",), 0.0, "positive"),
        (("a",), ("rad",), float("nan"), "positive"),
    ],
)
def test_bad_formats_are_named(names, units, dt, message):
    with pytest.raises(InvalidPlanError, match=message):
        PlanFormat(names, units, dt)


def test_a_text_is_no_list_of_names():
    with pytest.raises(InvalidPlanError, match=r"units must be a list such as \['rad'\], got a"):
        PlanFormat(("pan", "arm"), "rad", 0.02)
    with pytest.raises(InvalidPlanError, match="names must be a list"):
        PlanFormat("pan", ("rad",), 0.02)

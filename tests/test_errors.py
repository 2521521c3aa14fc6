"""What an error carries beside its message."""

import pickle
from typing import Literal

import pytest

from prior_reinforce.errors import ConfigurationError, UnclearUnitsError, one_of, warn_caller


def test_a_remedy_is_carried_apart_and_said_behind_the_problem():
    error = ConfigurationError("dt is 0; that is no time", remedy="give more")
    assert (error.problem, error.remedy) == ("dt is 0; that is no time", "give more")
    assert str(error) == "dt is 0; that is no time; give more"
    again = pickle.loads(pickle.dumps(error))  # as from a worker process
    assert (str(again), again.problem) == (str(error), error.problem)


def test_without_a_remedy_the_message_is_the_problem():
    assert str(ConfigurationError("no limits")) == "no limits"
    assert ConfigurationError("no limits").remedy == ""


def test_unclear_units_are_settled_by_their_options():
    error = UnclearUnitsError("x is taken for m", "--units m", "no outcomes")
    assert error.problem == "x is taken for m"
    assert str(error) == "x is taken for m; if so, add: --units m; and no outcomes"


def test_values_of_a_literal_are_listed():
    assert one_of(Literal["a", "b"] | None) == "; use one of a, b"
    assert one_of(Literal["a"] | int) == ""


def test_a_warning_is_of_the_line_outside_the_package_however_deep_it_comes_from():
    inside = {"__name__": "prior_reinforce.anything", "warn_caller": warn_caller}
    exec("def deep(n): deep(n - 1) if n else warn_caller('look here')", inside)
    for n in (0, 5):
        with pytest.warns(UserWarning, match="look here") as warned:
            inside["deep"](n)
        assert [each.filename for each in warned] == [__file__]

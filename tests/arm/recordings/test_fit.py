"""Outcomes that do not fit their motions are doubted, and no others."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from prior_reinforce.arm.recordings.fit import slips
from prior_reinforce.simulation.tasks import make_task


def named(n):
    return tuple(f"throw_{i}" for i in range(n))


@pytest.mark.slow
def test_two_rows_that_were_exchanged_are_doubted_and_no_others():
    shown = make_task("fishing").demonstrations("A")
    outcomes, found = shown.outcomes_seen.copy(), 0
    for i, j in combinations(range(shown.n), 2):
        other = outcomes.copy()
        other[[i, j]] = other[[j, i]]
        doubted = slips(replace(shown, outcomes_seen=other), named(shown.n))
        assert [slip.rows for slip in doubted] in ([], [(i, j)])
        found += len(doubted)
    assert found >= 8


@pytest.mark.parametrize(
    "task", ["basketball-v1", "basketball-fr3", "curling", "curling-round", "fishing", "so101"]
)
@pytest.mark.parametrize("which", ["A", "B"])
def test_sets_that_are_right_are_not_doubted(task, which):
    shown = make_task(task).demonstrations(which)
    assert slips(shown, named(shown.n)) == []


@pytest.mark.filterwarnings("ignore:an outcome of")
@pytest.mark.parametrize("factor", [10.0, 100.0])
def test_a_decimal_point_is_named_with_its_row(factor):
    shown = make_task("fishing").demonstrations("A")
    outcomes = np.array(shown.outcomes_seen)
    outcomes[2, 0] *= factor
    (slip,) = slips(replace(shown, outcomes_seen=outcomes), named(shown.n))
    assert slip.rows == (2,)
    assert f"of throw_2, {outcomes[2, 0]:.4g}, may be {factor:g} times too large" in slip.what
    assert slip.better > 1


def test_an_outcome_on_the_axis_has_no_sign_to_lose():
    shown = make_task("fishing").demonstrations("A")
    outcomes = np.array(shown.outcomes_seen)
    outcomes[2, 1] = 0.0
    slips(replace(shown, outcomes_seen=outcomes), named(shown.n))

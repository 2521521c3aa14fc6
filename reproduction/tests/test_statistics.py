"""Intervals: they hold the truth as often as they say, also over few trainings."""

import numpy as np
import pytest

from reproduction.statistics import (
    SHARE,
    bootstrap_difference,
    bootstrap_mean,
    mean_of_groups,
    p_above,
    reached_by,
    trials_counted,
)


@pytest.mark.parametrize("goal_spread", [0.0, 0.3])
def test_the_interval_holds_the_truth_over_six_trainings_that_share_goals(goal_spread):
    rng = np.random.default_rng(0)
    held = 0
    for number in range(200):
        training = rng.normal(0.0, 0.15, (6, 1))
        goal = rng.normal(0.0, goal_spread, (1, 30))
        interval = bootstrap_mean(training + goal + rng.normal(0.0, 0.4, (6, 30)), seed=number)
        held += interval.low <= 0.0 <= interval.high
    assert held >= 0.93 * 200


def test_what_all_trainings_share_is_uncertain_through_the_goals_alone():
    """Thirty equal rows: the interval of a mean over 50 goals, hardly widened."""
    goals = np.random.default_rng(1).normal(0.0, 1.0, 50)
    interval = bootstrap_mean(np.stack([goals] * 30))
    half = 1.96 * goals.std() / np.sqrt(50)
    assert interval.value == pytest.approx(goals.mean())
    assert (interval.high - interval.low) / 2 == pytest.approx(half, rel=0.15)


@pytest.mark.parametrize("n", [3, 4])
def test_the_interval_holds_the_truth_over_so_few_trainings_and_nothing_else(n):
    rng = np.random.default_rng(3)
    held = 0
    for number in range(200):
        interval = bootstrap_mean(rng.normal(0.0, 1.0, (n, 1)), seed=number)
        held += interval.low <= 0.0 <= interval.high
    assert held >= 0.9 * 200  # the smallest to the largest holds it in 75 % and 87.5 %


def test_an_interval_ends_where_the_quantity_does():
    certain = bootstrap_mean(np.ones((3, 5)))
    assert (certain.value, certain.low, certain.high) == (1.0, 1.0, 1.0)
    shares = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    assert bootstrap_mean(shares).high > 1.0
    seen = bootstrap_mean(shares, within=SHARE)
    assert 0.0 <= seen.low <= seen.value < seen.high == 1.0


def test_one_goal_that_differs_leaves_open_which_is_above():
    a = np.ones((6, 100))
    a[0, 0] = 0.0
    difference = bootstrap_difference(a, np.ones((6, 100)), within=SHARE)
    assert difference.low < difference.value < 0.0 < difference.high


def test_a_paired_difference_does_not_know_what_both_share():
    rng = np.random.default_rng(2)
    shared = rng.normal(0.0, 5.0, (6, 40))
    difference = bootstrap_difference(shared + 0.5, shared)
    assert (difference.low, difference.high) == pytest.approx((0.5, 0.5))


def test_goals_that_were_never_reached_count_as_missed():
    np.testing.assert_array_equal(reached_by(np.array([0, 1, 3]), 2), [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(trials_counted(np.array([0, 1, 3]), 10), [11.0, 1.0, 3.0])


def test_groups_weigh_as_they_are_told_however_many_trainings_they_have():
    few, many = np.full((2, 5), 1.0), np.full((8, 5), 3.0)
    assert mean_of_groups([few, many]).value == 2.0
    assert mean_of_groups([few, many], [3, 1]).value == 1.5
    assert mean_of_groups([few, many], within=(1, 2.5)).high <= 2.5


def test_the_interval_over_groups_holds_the_truth():
    rng = np.random.default_rng(0)
    held = 0
    for number in range(200):
        rows = [rng.normal(0.0, 0.15, (m, 1)) + rng.normal(0.0, 0.4, (m, 20)) for m in (4, 3, 4)]
        interval = mean_of_groups(rows, seed=number)
        held += interval.low <= 0.0 <= interval.high
    assert held >= 0.92 * 200


def test_the_p_value_is_below_two_and_a_half_percent_where_the_interval_is_above_the_bound():
    rng = np.random.default_rng(4)
    for _ in range(50):
        values = rng.normal(rng.uniform(-0.5, 0.5), 0.4, (6, 20))
        interval = bootstrap_mean(values)
        p = p_above([values], 0.0)
        assert abs(p - 0.025) < 1e-3 or (p < 0.025) == (interval.low > 0.0)


def test_p_values_of_what_is_not_so_are_spread_evenly():
    """Under no effect, one in twenty is below 5 %, or fewer."""
    rng = np.random.default_rng(5)
    p = [p_above([rng.normal(0.0, 0.4, (6, 1)) + rng.normal(0, 0.4, (6, 20))], 0.0)
         for _ in range(300)]  # fmt: skip
    assert np.mean(np.array(p) < 0.05) <= 0.07

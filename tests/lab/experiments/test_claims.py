"""Verdicts: decided by the interval, and by nothing where trainings are too few."""

import pytest

from prior_reinforce.lab.experiments.claims import Verdict, above, above_by_round, all_of, at_most
from prior_reinforce.lab.experiments.statistics import Interval

CONFIRMED, NOT_CONFIRMED, OPEN = Verdict.CONFIRMED, Verdict.NOT_CONFIRMED, Verdict.OPEN


def test_above_asks_for_the_whole_interval():
    assert above(Interval(0.95, 0.91, 0.98), 0.9, trainings=6) is CONFIRMED
    assert above(Interval(0.92, 0.88, 0.96), 0.9, trainings=6) is OPEN
    assert above(Interval(0.80, 0.70, 0.89), 0.9, trainings=6) is NOT_CONFIRMED


def test_no_difference_is_not_above():
    assert above(Interval(0.0, 0.0, 0.0), 0.0, trainings=6) is NOT_CONFIRMED


def test_at_most_is_confirmed_at_the_bound_itself():
    assert at_most(Interval(2.5, 2.1, 2.9), 2.9, trainings=6) is CONFIRMED
    assert at_most(Interval(2.5, 2.1, 3.0), 2.9, trainings=6) is OPEN
    assert at_most(Interval(3.5, 3.0, 4.0), 2.9, trainings=6) is NOT_CONFIRMED


@pytest.mark.parametrize("judge", [above, at_most])
@pytest.mark.parametrize("value", [-1.0, 1.0])
def test_two_trainings_decide_nothing(judge, value):
    assert judge(Interval(value, value, value), 0.0, trainings=2) is OPEN


def test_a_claim_of_parts_is_as_good_as_its_worst_part():
    assert all_of([CONFIRMED, CONFIRMED]) is CONFIRMED
    assert all_of([CONFIRMED, OPEN]) is OPEN
    assert all_of([OPEN, NOT_CONFIRMED, CONFIRMED]) is NOT_CONFIRMED
    assert all_of([]) is OPEN


def point(value, half=0.01):
    return Interval(value, value - half, value + half)


def test_by_round_leaves_out_rounds_before_the_claim_and_rounds_that_both_have_won():
    won = Interval(1.0, 1.0, 1.0)
    none = Interval(0.0, 0.0, 0.0)
    ours, other = [point(0.2), point(0.9), won], [point(0.3), point(0.5), won]
    difference = [point(-0.1), point(0.4), none]
    assert above_by_round(ours, other, difference, 2, trainings=6) is CONFIRMED
    assert above_by_round(ours, other, difference, 1, trainings=6) is NOT_CONFIRMED


def test_by_round_asks_every_round():
    ours, other = [point(0.2), point(0.9), point(0.9)], [point(0.2), point(0.5), point(0.9)]
    difference = [point(0.0), point(0.4), point(0.0, half=0.05)]
    assert above_by_round(ours, other, difference, 2, trainings=6) is OPEN

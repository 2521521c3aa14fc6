"""What perception says of a trial, and what follows from it."""

import json

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prior_reinforce.errors import InvalidFeedbackError
from prior_reinforce.readings import Reading, ReadingRecord

RADIUS = np.array([0.015, 0.015])
INF = np.inf


@pytest.mark.parametrize(
    ("word", "low", "high"),
    [
        *[(0, -1, 1), (2, 1, 3.5), (5, 3.5, 7.5), (10, 7.5, 15), (20, 15, 25), (100, 95, 105)],
        *[(-2, -3.5, -1), (-10, -15, -7.5), (-30, -35, -25)],
    ],
)
def test_an_observers_words_are_intervals_in_centimetres(word, low, high):
    reading = Reading.by_eye([word / 100])
    np.testing.assert_allclose(100 * reading.low, low)
    np.testing.assert_allclose(100 * reading.high, high)
    assert reading.sd.tolist() == [0.0]


def test_a_two_beside_zeros_may_be_a_miss_shared_among_the_components():
    for k in (1, 2, 3):
        reading = Reading.by_eye([-0.02, 0, 0][:k])
        np.testing.assert_allclose(reading.high[0], -0.01 / np.sqrt(k))
    assert Reading.by_eye([0.02, 0.05]).low[0] == 0.01


def test_an_error_is_expected_in_the_middle_of_its_interval():
    assert Reading.by_eye([-0.1, 0.05]).expected.tolist() == pytest.approx([-0.1125, 0.055])
    assert Reading.measured([0.03, -0.01], 0.005).expected.tolist() == [0.03, -0.01]
    open_ended = Reading([0.05, 0.02], [0.0, 0.01], [np.inf, 0.035], [0.0, 0.0])
    assert open_ended.expected.tolist() == pytest.approx([0.05, 0.0225])
    assert Reading.only(False, 2).expected.tolist() == [0.0, 0.0]


def test_what_is_no_word_of_an_observer_is_an_estimate_by_hand():
    reading = Reading.by_eye([0.04, 0.05])
    np.testing.assert_allclose(reading.sd, [np.sqrt(0.008**2 + 0.01**2), 0])
    assert reading.low[0] == reading.high[0] == 0.04
    np.testing.assert_allclose(Reading.estimated([0.0, -0.08]).sd, [0.01, np.hypot(0.01, 0.016)])


def test_a_hit_is_within_the_tolerance_whatever_was_seen():
    cut = Reading.by_eye([0.02, 0.0], hit=True).within(RADIUS)
    np.testing.assert_allclose(cut.low, [0.01 / np.sqrt(2), -0.01])
    np.testing.assert_allclose(cut.high, [0.015, 0.01])
    for seen in (Reading.by_eye([0.05, 0.0], hit=True), Reading.estimated([0.05, 0.0], hit=True)):
        believed = seen.within(RADIUS)
        assert (believed.low[0], believed.high[0], believed.sd[0]) == (-0.015, 0.015, 0.0)
    alone = Reading.only(True, 2).within(RADIUS)
    np.testing.assert_array_equal([alone.low, alone.high], [-RADIUS, RADIUS])


def test_a_hit_that_was_measured_keeps_its_number():
    cut = Reading.measured([0.006, 0.018], 0.002, hit=True).within(RADIUS)
    np.testing.assert_array_equal(cut.low, [0.006, 0.015])
    np.testing.assert_array_equal(cut.low, cut.high)
    np.testing.assert_array_equal(cut.sd, [0.002, 0.002])


def test_a_miss_was_farther_off_than_the_other_components_can_make_up_for():
    cut = Reading.by_eye([-0.02, 0.0], hit=False).within(RADIUS)
    np.testing.assert_allclose(cut.high, [-np.sqrt(0.015**2 - 0.01**2), 0.01])
    assert cut.low[0] == -0.035
    far = Reading.by_eye([0.05, -0.02], hit=False)
    np.testing.assert_array_equal(far.within(RADIUS).low, far.low)
    alone = Reading.only(False, 2).within(RADIUS)
    assert np.all(np.isinf(alone.low))
    np.testing.assert_array_equal(
        [cut.missed_by_at_least, alone.missed_by_at_least], [RADIUS, RADIUS]
    )
    assert Reading.only(True, 2).within(RADIUS).missed_by_at_least is None


def test_nothing_changes_where_it_was_not_seen_whether_it_hit():
    reading = Reading.by_eye([0.02, 0.0])
    assert reading.within(RADIUS) is reading


def test_a_number_farther_off_than_its_noise_explains_is_a_miss_without_being_told():
    far, near = ([1.5 * RADIUS[0], 0.0], 0.2 * RADIUS[0]), ([1.3 * RADIUS[0], 0.0], 0.2 * RADIUS[0])
    np.testing.assert_array_equal(Reading.measured(*far).within(RADIUS).missed_by_at_least, RADIUS)
    assert Reading.measured(*near).within(RADIUS).missed_by_at_least is None


coordinates = st.floats(-0.3, 0.3)


@pytest.mark.slow
@given(coordinates, coordinates)
def test_no_interval_is_cut_off_from_the_truth(x, y):
    from prior_reinforce.environment import Rollout
    from prior_reinforce.perception.eye import Eye

    error = np.array([x, y])
    hit = bool(np.linalg.norm(error) <= 0.015)
    seen = Eye().perceive(Rollout(error, True), np.zeros(2), np.random.default_rng(0))
    cut = seen.with_hit(hit).within(RADIUS)
    assert np.all(cut.low - 1e-9 <= error)
    assert np.all(error <= cut.high + 1e-9)


def test_a_reading_comes_back_from_plain_text_with_its_open_ends():
    reading = Reading([0.05, 0.0], [0.01, -INF], [INF, INF], [0.002, 0.0], False, "long")
    text = json.dumps(msgspec.to_builtins(reading.record()), allow_nan=False)
    again = Reading.from_record(msgspec.json.decode(text, type=ReadingRecord))
    for name in ("error_seen", "low", "high", "sd"):
        np.testing.assert_array_equal(getattr(again, name), getattr(reading, name))
    assert (again.hit, again.said) == (False, "long")


def test_a_lost_object_stays_lost_in_plain_text_and_cannot_have_hit():
    reading = Reading.only(False, 2, lost=True)
    again = Reading.from_record(reading.within(RADIUS).record())
    assert (again.lost, again.hit, again.has_number) == (True, False, False)
    with pytest.raises(InvalidFeedbackError, match="say one of them"):
        reading.with_hit(True)
    with pytest.raises(InvalidFeedbackError, match="say one of them"):
        Reading([0.1, 0.0], [0.1, 0.0], [0.1, 0.0], [0.0, 0.0], False, lost=True)


def test_a_mere_miss_has_no_number():
    assert not Reading.only(False, 2).has_number
    assert Reading.only(True, 2).has_number
    assert Reading([0.05, 0.0], [0.01, -INF], [INF, INF], [0.0, 0.0]).has_number


def test_a_reading_shares_nothing_with_what_it_was_made_of():
    error = np.array([0.05, 0.02])
    reading = Reading.measured(error, 0.01)
    error[:] = 9.0
    assert reading.error_seen.tolist() == [0.05, 0.02]
    with pytest.raises(ValueError, match="read-only"):
        reading.low[0] = 1.0


@pytest.mark.parametrize(
    ("parts", "problem"),
    [
        (([np.nan, 0], [0, 0], [0, 0], [0, 0]), "finite"),
        (([0, 0], [0, 0], [0], [0, 0]), "high must be 2 numbers"),
        (([0, 0], [np.nan, 0], [0, 0], [0, 0]), "low must be"),
        (([0, 0], [1, 0], [0, 0], [0, 0]), "lower end first"),
        (([0, 0], [INF, 0], [INF, 0], [0, 0]), "cannot lie"),
        (([0, 0], [0, 0], [0, 0], [-1, 0]), "sd must be 0 or more"),
        (([0, 0], [0, 0], [0, 0], [INF, 0]), "sd must be 0 or more"),
        (([0, 0], [0, 0], [0, 0], [0, 0], 1), "hit must be"),
    ],
)
def test_impossible_readings_are_refused(parts, problem):
    with pytest.raises(InvalidFeedbackError, match=problem):
        Reading(*(np.array(p, float) if isinstance(p, list) else p for p in parts))

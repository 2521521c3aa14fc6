import numpy as np
import pytest

from prior_reinforce.tasks.zoo.physics import (
    GRAVITY,
    Arm,
    first_passage,
    flight,
    lift_off,
    moving,
    on_parabola,
)

ELBOW = Arm("zyx", ((0.0, 0.0, 0.4), (0.0, 0.0, 0.3), (0.1, 0.0, 0.2)), base=(0.0, 0.0, 0.1))


def test_an_arm_reaches_where_its_angles_say_worked_by_hand():
    up, forward, left = ELBOW.hand(
        np.array([[0.0, 0.0, 0.0], [0.0, np.pi / 2, 0.0], [np.pi / 2, np.pi / 2, np.pi / 2]])
    )
    np.testing.assert_allclose(up, [0.1, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(forward, [0.5, 0.0, 0.4], atol=1e-12)
    # The last joint turns the hand about the forearm's own x, which points down by then.
    np.testing.assert_allclose(left, [0.2, 0.3, 0.4], atol=1e-12)


def test_a_direction_turns_with_the_hand_and_links_do_not_move_it():
    turned = ELBOW.direction(np.array([np.pi / 2, np.pi / 2, 0.0]), (0.0, 0.0, 1.0))
    np.testing.assert_allclose(turned, [0.0, 1.0, 0.0], atol=1e-12)


def test_a_passage_is_interpolated_between_frames_and_only_upwards():
    ramp = np.array([1.0, 0.0, 0.05, 0.24, 0.54, 0.83, 0.98, 1.0])
    assert first_passage(ramp, 0.5, 0.02) == pytest.approx(0.02 * (3 + 0.26 / 0.30))
    assert first_passage(ramp[:3], 0.5, 0.02) is None


def test_a_parabola_comes_down_where_the_formula_says():
    start, velocity = np.array([0.1, 0.2, 0.8]), np.array([2.0, -1.0, 3.0])
    place, time = flight(start, velocity, height=0.3)
    expected = (3.0 + np.sqrt(9.0 + 2 * GRAVITY * 0.5)) / GRAVITY
    assert time == pytest.approx(expected)
    np.testing.assert_allclose(place, [0.1 + 2 * expected, 0.2 - expected, 0.3])
    np.testing.assert_allclose(on_parabola(start, velocity, time), place)
    assert flight(start, velocity, height=2.0) is None


def test_a_ball_leaves_a_hand_that_falls_faster_than_it():
    """z = -c t^4 pulls away from a ball where 12 c t^2 = g."""
    c, times = 2.0, np.arange(81) * 0.0125
    falling = np.stack([times, 0 * times, -c * times**4], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (81, 1))
    leaves = lift_off(moving(falling, 0.0125), up)
    assert leaves == pytest.approx(np.sqrt(GRAVITY / (12 * c)), abs=1e-3)
    assert lift_off(moving(0.1 * falling, 0.0125), up) is None
    assert lift_off(moving(falling, 0.0125), -up) is None  # it never lay in the hand

import numpy as np
import pytest

from reproduction.zoo.physics import (
    GRAVITY,
    Arm,
    first_passage,
    flight,
    flight_in_air,
    hung,
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


def test_a_ball_that_drops_through_air_falls_as_the_closed_form_says():
    """h = ln cosh(t sqrt(g c)) / c for quadratic drag c; sideways nothing moves."""
    drag, time = 0.3, 0.7
    height = np.log(np.cosh(time * np.sqrt(GRAVITY * drag))) / drag
    place = flight_in_air(np.array([0.4, 0.1, height]), np.zeros(3), drag)
    np.testing.assert_allclose(place, [0.4, 0.1, 0.0], atol=1e-7)


def test_air_shortens_a_throw_and_none_is_a_parabola():
    start, velocity = np.array([0.0, 0.0, 0.9]), np.array([2.5, 0.5, 2.0])
    free, braked = (flight_in_air(start, velocity, drag) for drag in (0.0, 0.25))
    np.testing.assert_allclose(free, flight(start, velocity)[0], atol=1e-9)
    assert 0.5 * free[0] < braked[0] < 0.95 * free[0]
    assert braked[1] / braked[0] == pytest.approx(0.2)
    assert flight_in_air(-start, velocity, 0.1) is None


def still(frames=101):
    return moving(np.tile([0.3, 0.1, 1.0], (frames, 1)), 0.02)


def test_a_weight_on_a_pivot_that_stands_hangs_still():
    place, velocity = hung(still(), 0.4, until=1.0, step=0.01)
    np.testing.assert_allclose(place, [0.3, 0.1, 0.6], atol=1e-12)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-12)


def test_a_weight_behind_a_steadily_accelerating_pivot_swings_like_a_pendulum_tilted_by_a_over_g():
    """Small: angle = -(a / g) (1 - cos(w t)), with w^2 = g / length."""
    length, a = 0.4, 0.2
    times = np.arange(101) * 0.02
    pivot = moving(np.stack([a * times**2 / 2, 0 * times, 1 + 0 * times], axis=1), 0.02)
    place, _ = hung(pivot, length, until=0.8, step=0.01)
    angle = -a / GRAVITY * (1 - np.cos(np.sqrt(GRAVITY / length) * 0.8))
    assert place[0] - pivot(0.8)[0] == pytest.approx(length * angle, abs=1e-5)
    assert np.linalg.norm(place - pivot(0.8)) == pytest.approx(length, abs=1e-8)


def test_a_weight_on_a_pivot_that_stops_keeps_its_energy():
    times = np.arange(151) * 0.02
    x = 0.3 * np.clip(times / 0.4, 0, 1) ** 3 * (10 - 15 * np.clip(times / 0.4, 0, 1))
    x += 0.3 * 6 * np.clip(times / 0.4, 0, 1) ** 5
    pivot = moving(np.stack([x, 0 * x, 1 + 0 * x], axis=1), 0.02)
    energies = []
    for until in (0.7, 1.1, 2.4):
        place, velocity = hung(pivot, 0.5, until, step=0.01)
        energies.append(velocity @ velocity / 2 + GRAVITY * place[2])
    assert np.ptp(energies) < 1e-4
    assert energies[0] - GRAVITY * 0.5 > 0.1  # it does swing

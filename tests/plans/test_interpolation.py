"""Interpolation to 1 kHz against a polynomial, its own differences, and its linearity."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from prior_reinforce.errors import InvalidPlanError
from prior_reinforce.plans.interpolation import interp_columns, interpolate
from prior_reinforce.plans.interpolation import minimum_jerk as course


def minimum_jerk(amplitude: float, duration: float, frames: int) -> tuple[np.ndarray, float]:
    """A rest-to-rest swing, whose peaks have closed forms; shape (frames, 1)."""
    s = np.linspace(0, 1, frames)[:, None]
    return amplitude * (10 * s**3 - 15 * s**4 + 6 * s**5), duration / (frames - 1)


def test_peaks_of_a_minimum_jerk_swing_have_their_closed_forms():
    frames, dt = minimum_jerk(0.8, 1.39, 140)
    fine = interpolate(frames, dt)
    assert np.abs(fine.dq).max() == pytest.approx(15 / 8 * 0.8 / 1.39, rel=1e-4)
    assert np.abs(fine.ddq).max() == pytest.approx(10 / np.sqrt(3) * 0.8 / 1.39**2, rel=1e-3)
    # The jerk is largest at the ends, 60 A / T^3; the spline's is constant over each interval.
    assert np.abs(fine.dddq).max() == pytest.approx(60 * 0.8 / 1.39**3, rel=0.05)


def test_every_frame_is_passed_through():
    frames = np.random.default_rng(0).normal(size=(62, 3))
    fine = interpolate(frames, 0.01)
    np.testing.assert_allclose(fine.q[::10], frames, atol=1e-12)
    assert fine.t[-1] == pytest.approx(0.61)


def test_holds_keep_the_end_poses_at_rest():
    frames, dt = minimum_jerk(1.0, 0.5, 51)
    fine = interpolate(frames, dt, hold_before=0.02, hold_after=0.15)
    before, after = fine.t < 0, fine.t > 0.5 + 1e-9
    assert before.sum() == 20
    assert after.sum() == 150
    for held, pose in ((before, frames[0]), (after, frames[-1])):
        np.testing.assert_array_equal(fine.q[held], np.broadcast_to(pose, (held.sum(), 1)))
        assert not fine.dq[held].any()
        assert not fine.ddq[held].any()


def test_derivatives_agree_with_differences_of_the_stream():
    frames, dt = minimum_jerk(1.0, 0.7, 71)
    fine = interpolate(frames, dt, hold_before=0.01, hold_after=0.01)
    middle = np.gradient(fine.q, 0.001, axis=0)
    np.testing.assert_allclose(middle[2:-2], fine.dq[2:-2], atol=1e-3)


def test_a_step_of_acceleration_where_a_hold_ends_shows_in_the_jerk():
    ramp = np.linspace(0, 1, 101)[:, None]
    fine = interpolate(ramp, 0.01, hold_before=0.01)
    start = int(np.flatnonzero(fine.t == 0)[0])
    assert fine.dddq[start, 0] == pytest.approx(fine.ddq[start, 0] * 1000)
    assert fine.ddq[start, 0] > 50
    # Without samples of the hold, the first sample still counts the step from rest.
    alone = interpolate(ramp, 0.01)
    assert alone.dddq[0, 0] == pytest.approx(alone.ddq[0, 0] * 1000)


def test_a_time_step_that_no_binary_fraction_holds_adds_no_sample():
    assert interpolate(np.zeros((140, 1)), 0.01).t.size == 1391


@pytest.mark.slow
@settings(max_examples=30)
@given(st.integers(2, 40), st.floats(0.002, 0.1), st.integers(0, 2**32 - 1))
def test_interpolation_is_linear_in_the_frames(horizon, dt, seed):
    frames = np.random.default_rng(seed).normal(size=(horizon, 2))
    matrices, fine = interpolate(np.eye(horizon), dt), interpolate(frames, dt)
    np.testing.assert_allclose(matrices.q @ frames, fine.q, atol=1e-9)
    scale = np.abs(fine.dddq).max() + 1
    np.testing.assert_allclose(matrices.dddq @ frames, fine.dddq, atol=1e-9 * scale)


@pytest.mark.parametrize(
    ("frames", "dt", "options"),
    [
        (np.zeros((1, 7)), 0.01, {}),
        (np.zeros(7), 0.01, {}),
        (np.full((5, 7), np.nan), 0.01, {}),
        (np.zeros((5, 7)), 0.0, {}),
        (np.zeros((5, 7)), 0.01, {"rate": np.inf}),
        (np.zeros((5, 7)), 0.01, {"hold_before": -1.0}),
    ],
)
def test_bad_input_is_named(frames, dt, options):
    with pytest.raises(InvalidPlanError, match="got"):
        interpolate(frames, dt, **options)


def test_a_minimum_jerk_course_is_held_beyond_its_ends():
    np.testing.assert_allclose(course(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])), [0, 0, 0.5, 1, 1])
    slope = np.gradient(course(np.linspace(0, 1, 1001)), 1e-3)
    assert abs(slope.max() - 15 / 8) < 1e-4


def test_columns_are_interpolated_each_and_held_beyond_their_ends():
    columns = np.array([[0.0, 10.0], [1.0, 30.0], [3.0, 30.0]])
    at = np.array([-1.0, 0.5, 1.5, 9.0])
    found = interp_columns(at, np.array([0.0, 1.0, 2.0]), columns)
    np.testing.assert_allclose(found, [[0.0, 10.0], [0.5, 20.0], [2.0, 30.0], [3.0, 30.0]])
    assert interp_columns(at, np.arange(3.0), columns[:, :0]).shape == (4, 0)

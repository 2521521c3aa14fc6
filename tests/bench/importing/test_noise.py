"""Noise is measured where nothing moves, and nothing below it counts as motion."""

import numpy as np
import pytest

from prior_reinforce.bench.importing.noise import (
    acceleration_of,
    held_channels,
    is_step,
    moving_ends,
    noise_of,
)
from prior_reinforce.plans.interpolation import join_frames
from tests.bench.importing.recorded import sampled

RAD = ("rad",)


@pytest.mark.parametrize("rate", [100, 1000])
@pytest.mark.parametrize("sigma", [0.0, 2e-5, 3e-4])
def test_noise_is_measured_beside_a_motion(rate, sigma):
    q = sampled(0, rate)[1]
    noisy = q + np.random.default_rng(1).normal(0, sigma, q.shape) if sigma else q
    assert noise_of(noisy) == pytest.approx(sigma, rel=0.5, abs=2e-8 if rate == 1000 else 2e-6)


def test_encoder_counts_are_noise_too():
    count = 2e-4
    q = sampled(0, 500)[1]
    rng = np.random.default_rng(0)
    counted = count * np.round((q + rng.normal(0, count / 2, q.shape)) / count)
    assert np.all(noise_of(counted) < 2 * count)
    assert held_channels(counted, RAD * 7).tolist() == [i in (2, 6) for i in range(7)]


@pytest.mark.parametrize("sigma", [0.0, 2e-5, 5e-4])
def test_a_joint_that_moves_by_its_noise_only_is_held(sigma):
    rng = np.random.default_rng(0)
    still = 0.8 + rng.normal(0, sigma, (3000, 1))
    assert held_channels(still, RAD).all()
    ramp = still + np.linspace(0, 0.02, 3000)[:, None]
    assert not held_channels(ramp, RAD).any()


@pytest.mark.parametrize("rate", [50, 1000])
def test_a_slow_end_is_rest_and_a_fast_one_is_not(rate):
    t = np.arange(2 * rate) / rate
    noise = np.random.default_rng(0).normal(0, 2e-5, (len(t), 2))
    # The gate's line is 0.05 rad/s.
    q = np.column_stack([0.03 * t, 0.08 * t]) + noise
    starts, ends = moving_ends(t, q, RAD * 2)
    assert starts.tolist() == ends.tolist() == [False, True]


def test_units_without_a_floor_are_held_against_their_own_speed():
    t = np.arange(100) / 100
    _, ends = moving_ends(t, np.column_stack([1e4 * np.minimum(t, 0.5), 1e4 * t]), ("1", "1"))
    assert ends.tolist() == [False, True]


def test_a_jump_is_told_from_a_motion_and_from_noise():
    t = np.arange(100) / 100
    noise = np.random.default_rng(0).normal(0, 2e-5, 100)
    q = np.column_stack([0.08 * (t > 0.5), np.sin(3 * t), noise])
    assert is_step(q, ("m", "rad", "rad")).tolist() == [True, False, False]


def test_coarse_noise_at_rest_is_no_speed():
    """A milliradian at 50 Hz: two frames apart it looks like 0.07 rad/s."""
    t = np.arange(150) / 50
    s = np.clip(t - 1, 0, 1)
    swing = 10 * s**3 - 15 * s**4 + 6 * s**5
    noise = np.random.default_rng(0).normal(0, 1e-3, (30, 150))
    starts, ends = moving_ends(t, (swing + noise).T, RAD * 30)
    assert not starts.any()
    assert not ends.any()


def test_noise_alone_accelerates_by_as_much_as_the_spline_through_it():
    sigma, dt = 2e-5, 0.0125
    noise = np.random.default_rng(0).normal(0, sigma, (20_000, 1))
    knots = join_frames(noise, dt)(np.arange(100, 19_900) * dt, 2)
    assert knots.std() == pytest.approx(6 * sigma / dt**2, rel=0.03)
    assert acceleration_of(np.array([sigma]), dt) == pytest.approx(2.5 * knots.std(), rel=0.03)

"""What kind of signal a channel is, how much of it is noise, and where it rests."""

import numpy as np
import pytest

from prior_reinforce.plans.signals import (
    analyse,
    moving_ends,
    moving_rows,
    noise,
    without_noise,
)
from prior_reinforce.units import rates
from tests.arm.recordings.recorded import sampled

FRAMES = np.arange(90)
RAMP = (0.0, 0.05, 0.24, 0.54, 0.83, 0.98, 1.0)
OPENS = (40, 52, 47, 60)
RAD = ("rad",)


def swing(start: float = 20, duration: float = 40) -> np.ndarray:
    s = np.clip((FRAMES - start) / duration, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def gripper(opens: int) -> np.ndarray:
    return np.interp(FRAMES - opens, np.arange(len(RAMP)), RAMP)


def plans() -> np.ndarray:
    """A joint, a base that is turned and then held, a gripper, a valve."""
    rng = np.random.default_rng(0)
    return np.stack(
        [
            np.stack(
                [
                    (1 + 0.1 * i) * swing(15 + i),
                    0.3 * i + 2e-5 * rng.normal(size=90),
                    gripper(at),
                    (at < FRAMES).astype(float),
                ],
                axis=1,
            )
            for i, at in enumerate(OPENS)
        ]
    )


def kinds(motions, units):
    return analyse(motions, units, 0.0125).kinds


def held(motions, units=RAD):
    return analyse(motions, units, 0.01).held.tolist()


def test_each_channel_has_its_kind():
    assert kinds(plans(), ("rad", "rad", "1", "1")) == ("smooth", "held", "step", "switch")


def test_a_quick_motion_of_all_joints_is_no_step():
    quick = np.stack([np.stack([a * swing(40, 8), swing(41, 7)], axis=1) for a in (1, 1.2, 1.4)])
    assert kinds(quick, ("rad", "rad")) == ("smooth", "smooth")


@pytest.mark.parametrize("amplitude", [3e-4, 1e-2])
def test_a_channel_that_moves_little_is_not_held(amplitude: float):
    moved = plans()
    moved[:, :, 1] = amplitude * moved[:, :, 0]
    assert kinds(moved, ("rad", "rad", "1", "1"))[1] == "smooth"


@pytest.mark.parametrize("sigma", [1e-5, 1e-4, 3e-4, 1e-3, 3e-3])
@pytest.mark.parametrize("padded", [0, 10, 30])
def test_a_joint_with_nothing_but_noise_is_held(sigma, padded):
    """Also where demonstrations that ended early repeat their last pose."""
    rng = np.random.default_rng(0)
    noisy = 0.4 + sigma * rng.normal(size=(6, 90, 1))
    for i in range(1, 6):
        noisy[i, 90 - padded :] = noisy[i, 89 - padded]
    moving = np.stack([swing(15 + i)[:, None] for i in range(6)])
    assert held(np.concatenate([noisy, moving], axis=2), RAD * 2) == [True, False]


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
def test_a_joint_that_flickers_by_a_count_is_held(share):
    rng = np.random.default_rng(0)
    counts = 7.7e-4 * (rng.random((6, 140, 1)) < share)
    assert held(counts) == [True]


@pytest.mark.parametrize("sigma", [1e-4, 1e-3])
def test_a_small_motion_in_noise_is_a_motion(sigma):
    """Six times its noise."""
    rng = np.random.default_rng(0)
    moves = 6 * sigma * swing()[:, None] + sigma * rng.normal(size=(6, 90, 1))
    assert held(moves) == [False]


def test_a_trigger_that_is_pulled_for_one_frame_is_not_held():
    rng = np.random.default_rng(0)
    pulled = (FRAMES == 40).astype(float) + 1e-3 * rng.normal(size=(6, 90))
    assert held(pulled[:, :, None]) == [False]


@pytest.mark.parametrize("sigma", [0.0, 2e-5, 2e-4])
def test_a_gripper_is_a_step_in_the_noise_of_its_encoder(sigma):
    rng = np.random.default_rng(0)
    recorded = plans()
    recorded[:, :, 2] = 0.08 * recorded[:, :, 2] + sigma * rng.normal(size=(4, 90))
    assert kinds(recorded, ("rad", "rad", "m", "1"))[2] == "step"


def test_noise_is_estimated_to_a_quarter_beside_a_motion():
    rng = np.random.default_rng(3)
    noisy = plans()[:, :, :1] + 1e-3 * rng.normal(size=(4, 90, 1))
    assert noise(noisy)[0] == pytest.approx(1e-3, rel=0.25)
    assert noise(np.random.default_rng(0).normal(size=(3, 12, 2))).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("rate", [100, 1000])
@pytest.mark.parametrize("sigma", [0.0, 2e-5, 3e-4])
def test_noise_is_measured_beside_a_recorded_motion(rate, sigma):
    q = sampled(0, rate)[1]
    noisy = q + np.random.default_rng(1).normal(0, sigma, q.shape) if sigma else q
    assert noise([noisy]) == pytest.approx(sigma, rel=0.5, abs=2e-8 if rate == 1000 else 2e-6)


def test_encoder_counts_are_noise_too():
    count = 2e-4
    q = sampled(0, 500)[1]
    rng = np.random.default_rng(0)
    counted = count * np.round((q + rng.normal(0, count / 2, q.shape)) / count)
    assert np.all(noise([counted]) < 2 * count)
    assert held([counted], RAD * 7) == [i in (2, 6) for i in range(7)]


@pytest.mark.parametrize("sigma", [0.0, 2e-5, 5e-4])
def test_a_joint_that_moves_by_its_noise_only_is_held(sigma):
    rng = np.random.default_rng(0)
    still = 0.8 + rng.normal(0, sigma, (3000, 1))
    assert held([still]) == [True]
    ramp = still + np.linspace(0, 0.02, 3000)[:, None]
    assert held([ramp]) == [False]


def test_increments_are_held_where_their_sum_is():
    lift = np.diff(0.01 * swing(0, 90), prepend=0.0)[None, :, None]
    assert np.abs(lift).max() < 3e-4
    assert analyse(lift, ("m",), 0.01, (0,)).kinds == ("smooth",)
    assert analyse(0 * lift, ("m",), 0.01, (0,)).kinds == ("held",)


def test_a_held_channel_is_its_mean_and_all_else_stays():
    given = plans()
    still = without_noise(given, np.array([False, True, False, False]))
    np.testing.assert_array_equal(np.ptp(still[:, :, 1], axis=1), 0)
    np.testing.assert_allclose(still[:, 0, 1], given[:, :, 1].mean(axis=1))
    np.testing.assert_array_equal(still[:, :, [0, 2, 3]], given[:, :, [0, 2, 3]])


def test_a_constant_channel_keeps_its_last_digit():
    given = np.full((2, 90, 1), 0.1)
    np.testing.assert_array_equal(without_noise(given, np.array([True])), given)


def test_dimensions_rest_each_on_its_own():
    given = np.zeros((2, 5, 2))
    given[0, :, 0] = [0, 0, 1, 2, 3]
    given[:, :, 1] = [0, 1, 2, 3, 3.009]
    signals = analyse(given, RAD * 2, 0.01)
    assert signals.rest_start == (True, False)
    assert signals.rest_end == (False, True)


def test_trimming_follows_the_largest_range_of_a_unit_and_has_a_floor():
    recordings = [np.array([[0.0, 0, 0], [2, 0.1, 0.01]]), np.array([[0.0, 0, 0], [1, 0.2, 0]])]
    band = analyse(recordings, ("rad", "rad", "m"), 0.01).trim_band
    np.testing.assert_allclose(band, [0.01, 0.01, 5e-4])


def test_moving_rows_of_a_motion_that_returns():
    there_and_back = np.array([[0.0], [0.001], [0.5], [1.0], [0.5], [0.001], [0.0]])
    assert moving_rows(there_and_back, np.array([0.01])) == (2, 4)
    assert moving_rows(np.zeros((4, 1)), np.array([0.01])) is None


def ends(t, q, units):
    starts, ends = moving_ends(t, q, units, analyse([q], units, t[1] - t[0]), rates(units))
    return starts.tolist(), ends.tolist()


@pytest.mark.parametrize("rate", [50, 1000])
def test_a_slow_end_is_rest_and_a_fast_one_is_not(rate):
    t = np.arange(2 * rate) / rate
    noisy = np.random.default_rng(0).normal(0, 2e-5, (len(t), 2))
    # The gate's line is 0.05 rad/s.
    q = np.column_stack([0.03 * t, 0.08 * t]) + noisy
    assert ends(t, q, RAD * 2) == ([False, True], [False, True])


def test_units_without_a_floor_are_held_against_their_own_speed():
    t = np.arange(100) / 100
    q = np.column_stack([1e4 * np.minimum(t, 0.5), 1e4 * t])
    assert ends(t, q, ("1", "1"))[1] == [False, True]


def test_coarse_noise_at_rest_is_no_speed():
    """A milliradian at 50 Hz: two frames apart it looks like 0.07 rad/s."""
    t = np.arange(150) / 50
    s = np.clip(t - 1, 0, 1)
    path = 10 * s**3 - 15 * s**4 + 6 * s**5
    noisy = np.random.default_rng(0).normal(0, 1e-3, (30, 150))
    assert ends(t, (path + noisy).T, RAD * 30) == ([False] * 30, [False] * 30)

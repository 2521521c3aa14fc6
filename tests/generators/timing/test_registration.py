"""Known starts and tempos are found, whatever else differs between motions."""

import tracemalloc

import numpy as np
import pytest

from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.generators.timing import registration
from prior_reinforce.generators.timing.registration import (
    best_correlations,
    correlation_lags,
    even_subset,
)
from prior_reinforce.generators.timing.timeline import decompose
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.speeds import SMOOTHING, velocity_profiles
from prior_reinforce.simulation.tasks import make_task

STARTS = np.array([5.3, 31.0, 12.7, 24.1])
TEMPOS = np.array([1.0, 1.15, 0.85, 1.05])
SIZES = np.array([0.9, 1.0, 1.1, 0.95])
OUTCOMES = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])


def swings(tempos=(1.0,) * 4, horizon=90) -> np.ndarray:
    """Two joints of a minimum-jerk swing of 40 frames, at STARTS."""
    durations = 40 * np.asarray(tempos)[:, None]
    s = np.clip((np.arange(horizon) - STARTS[:, None]) / durations, 0, 1)
    swing = SIZES[:, None] * (10 * s**3 - 15 * s**4 + 6 * s**5)
    return np.stack([0.2 + swing, 1.5 - 0.7 * swing], axis=-1)


def demonstrations(plans, units=("rad", "rad")) -> Demonstrations:
    names = tuple(f"joint{d + 1}" for d in range(plans.shape[2]))
    return Demonstrations(plans, OUTCOMES, PlanFormat(names, units, 0.0125))


def with_gripper(opens) -> Demonstrations:
    ramp = (0.0, 0.05, 0.24, 0.54, 0.83, 0.98, 1.0)
    channel = [np.interp(np.arange(90) - at, np.arange(7), ramp) for at in opens]
    return demonstrations(np.dstack([swings(), np.stack(channel)]), ("rad", "rad", "1"))


def stroke(frames, begins, lasts):
    s = np.clip((frames - begins) / lasts, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def wind_ups_and_strikes() -> tuple[np.ndarray, np.ndarray]:
    """A wind-up as fast as people like, then the same strike; and when it comes."""
    frames = np.arange(140.0)
    wind_ups = np.array([20.0, 30.0, 40.0, 50.0])
    strikes = STARTS + wind_ups + 2
    each = zip(STARTS, wind_ups, strikes, SIZES, strict=True)
    swing = [
        size * stroke(frames, hit, 20) - 1.2 * stroke(frames, back, lasts)
        for back, lasts, hit, size in each
    ]
    return np.stack(swing)[:, :, None] * [1.0, -0.7], strikes


def lags_of(plans):
    return correlation_lags(np.stack(velocity_profiles(plans, ("rad", "rad"), SMOOTHING / 0.0125)))


def test_starts_come_back():
    found = decompose(demonstrations(swings()), "start")
    off = found.numbers[:, 0] - STARTS
    np.testing.assert_allclose(off, off.mean(), atol=0.02)


def test_motions_of_uneven_pace_start_so_that_their_strikes_coincide():
    plans, strikes = wind_ups_and_strikes()
    starts = decompose(demonstrations(plans), "start").numbers[:, 0]
    assert np.ptp(-lags_of(plans) - strikes) > 3.0
    assert np.ptp(starts - strikes) < 1.1


def test_a_gripper_times_motions_of_uneven_pace_all_the_same():
    plans, strikes = wind_ups_and_strikes()
    opens = np.round(strikes) + np.array([3, 5, 4, 6])
    channel = np.stack([np.clip(np.arange(140) - at, 0, 1) for at in opens])
    demos = demonstrations(np.dstack([plans, channel]), ("rad", "rad", "1"))
    starts = decompose(demos, "start").numbers[:, 0]
    np.testing.assert_allclose(starts - starts[0], opens - opens[0], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("ahead", [0.6, 1.0])
def test_pushes_to_either_side_that_differ_in_their_start_alone_keep_it(ahead):
    """Their mean goes straight on, and would be matched where only that channel moves."""
    frames, sides = np.arange(120.0), np.array([-1.0, 0.0, 1.0, -0.8, 0.1, 0.9])
    begins = np.array([10.0, 22.0, 31.0, 15.0, 27.0, 38.0])
    plans = np.stack(
        [
            np.stack([ahead * stroke(frames, b, 40), side * stroke(frames, b + 8, 32)], axis=1)
            for b, side in zip(begins, sides, strict=True)
        ]
    )
    outcomes = np.stack([1.0 + 0.1 * np.arange(6) % 0.3, sides], axis=1)
    plan_format = PlanFormat(("x", "y"), ("rad", "rad"), 0.0125)
    starts = decompose(Demonstrations(plans, outcomes, plan_format), "start").numbers[:, 0]
    np.testing.assert_allclose(starts - starts.mean(), begins - begins.mean(), atol=0.3)


@pytest.mark.slow
def test_a_mirrored_motion_is_not_carried_off():
    plans = swings()
    plans[3] = plans[3, :1] - (plans[3] - plans[3, :1])
    starts = decompose(demonstrations(plans), "start").numbers[:, 0]
    np.testing.assert_allclose(np.diff(starts), -np.diff(lags_of(plans)), rtol=0, atol=1e-9)
    # It agrees with the others at no lag, so that rounding would carry it anywhere.
    assert np.ptp(lags_of(plans)) < 80  # two lengths of a motion


@pytest.mark.slow
def test_estimates_that_differ_by_little_do_not_move_our_own_demonstrations():
    demos = make_task("curling").demonstrations("A")  # by 0.6 % of the motion
    starts = decompose(demos, "start").numbers[:, 0]
    smoothing = SMOOTHING / demos.format.dt
    profiles = np.stack(velocity_profiles(demos.plans, demos.format.units, smoothing))
    np.testing.assert_allclose(np.diff(starts), -np.diff(correlation_lags(profiles)), atol=1e-6)


def test_motions_that_differ_in_when_they_start_stay_where_they_agree_as_wholes():
    starts = decompose(demonstrations(swings()), "start").numbers[:, 0]
    np.testing.assert_allclose(np.diff(starts), -np.diff(lags_of(swings())), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_tempos_come_back():
    found = decompose(demonstrations(swings(TEMPOS)), "tempo")
    expected = np.log(TEMPOS) - np.log(TEMPOS).mean()
    np.testing.assert_allclose(found.numbers[:, 1], expected, atol=0.015)


def test_what_does_not_move_has_no_timing():
    still = swings()
    still[2] = 0.4
    with pytest.raises(InvalidDemonstrationsError, match="does not move"):
        decompose(demonstrations(still), "start")


def test_a_gripper_that_keeps_to_a_clock_is_no_start():
    """Closed at frame 8 in all demonstrations, whenever the arm starts."""
    demos = with_gripper((2, 2, 2, 2))
    found = decompose(demos, "start")
    off = found.numbers[:, 0] - STARTS
    np.testing.assert_allclose(off, off.mean(), atol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.1, 2.0, 5.0])
def test_a_channel_that_moves_as_it_likes_does_not_time_the_others_whatever_its_unit(size):
    frames, at_will = np.arange(90.0), np.array([28.0, 6.0, 33.0, 11.0])
    turn = np.array([1.0, -0.8, 0.9, 1.2])[:, None] * stroke(frames, at_will[:, None], 40)
    plans = np.dstack([swings()[:, :, 0], size * turn])
    starts = decompose(demonstrations(plans), "start").numbers[:, 0]
    np.testing.assert_allclose(starts - starts.mean(), STARTS - STARTS.mean(), atol=0.3)


def test_motions_are_compared_at_every_delay_without_all_of_their_scans_at_once():
    centres = np.linspace(40, 160, 40)[:, None]
    profiles = np.exp(-(((np.arange(200) - centres) / 10) ** 2))[:, :, None]
    tracemalloc.start()
    found = best_correlations(profiles)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    np.testing.assert_allclose(found, 1.0, atol=1e-3)  # one bump, at forty delays
    all_at_once = 8 * 40 * 40 * 8 * 2 * 200  # bytes, at eight lags a frame
    assert peak < all_at_once / 3


def test_what_demonstrations_agree_in_is_found_once_for_all_warps_and_for_some(monkeypatch):
    demos, asked = demonstrations(swings()), []
    agree = registration._scaled_by_agreement
    monkeypatch.setattr(
        registration, "_scaled_by_agreement", lambda each: asked.append(1) or agree(each)
    )
    for kind in ("none", "start", "tempo"):
        decompose(demos, kind)
        assert len(decompose(demos, kind, (3, 1)).numbers) == 2
    assert len(asked) == 1


def test_some_of_the_demonstrations_start_as_they_do_among_all():
    """They are swings of one shape, so that the others do not count."""
    some = decompose(demonstrations(swings()), "start", (3, 1)).numbers[:, 0]
    np.testing.assert_allclose(np.diff(some), STARTS[1] - STARTS[3], atol=0.02)


def test_of_many_demonstrations_some_tell_how_to_learn_from_all():
    assert even_subset(24).tolist() == list(range(24))
    some = even_subset(200)
    assert len(some) == len(set(some.tolist())) == 24
    assert (some[0], some[-1]) == (0, 199)

"""Shapes and warps: known starts and tempos come back, and so does every plan, however it ends."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.plans.alignment import correlation_lags
from prior_reinforce.plans.motions import Demonstrations, PlanFormat
from prior_reinforce.plans.timing import SMOOTHING, velocity_profiles
from prior_reinforce.plans.warping import Timeline, take_apart

STARTS = np.array([5.3, 31.0, 12.7, 24.1])
TEMPOS = np.array([1.0, 1.15, 0.85, 1.05])
SIZES = np.array([0.9, 1.0, 1.1, 0.95])
OUTCOMES = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])
KINDS = ("none", "start", "tempo", "warp")


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


def played(demos, kind):
    apart = take_apart(demos, kind)
    return apart, apart.timeline.play(apart.shapes, apart.numbers)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("horizon", [90, 55], ids=["at rest", "cut in mid-swing"])
def test_demonstrations_come_back_to_a_tenth_of_a_milliradian(kind, horizon):
    demos = demonstrations(swings(TEMPOS, horizon))
    _, plans = played(demos, kind)
    assert np.sqrt(np.mean((plans - demos.plans) ** 2, axis=1)).max() < 1e-4


@pytest.mark.parametrize("kind", KINDS)
def test_a_joint_that_is_held_but_for_noise_is_one_number_a_plan(kind):
    rng = np.random.default_rng(0)
    base = np.linspace(-0.3, 0.3, 4)[:, None] + rng.normal(0, 2e-5, (4, 90))
    demos = demonstrations(np.dstack([swings(TEMPOS), base]), ("rad",) * 3)
    apart, plans = played(demos, kind)
    assert np.ptp(plans[:, :, 2], axis=1).max() < 1e-12
    assert np.sqrt(np.mean((plans - demos.plans) ** 2, axis=1)).max() < 1e-4
    assert (
        apart.timeline.per_frame
        == played(demonstrations(swings(TEMPOS)), kind)[0].timeline.per_frame
    )


def test_starts_come_back():
    apart = take_apart(demonstrations(swings()), "start")
    off = apart.numbers[:, 0] - STARTS
    np.testing.assert_allclose(off, off.mean(), atol=0.02)


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


def stroke(frames, begins, lasts):
    s = np.clip((frames - begins) / lasts, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def lags_of(plans):
    return correlation_lags(velocity_profiles(plans, ("rad", "rad"), SMOOTHING / 0.0125))


def test_motions_of_uneven_pace_start_so_that_their_strikes_coincide():
    plans, strikes = wind_ups_and_strikes()
    starts = take_apart(demonstrations(plans), "start").numbers[:, 0]
    assert np.ptp(-lags_of(plans) - strikes) > 3.0
    assert np.ptp(starts - strikes) < 1.1


def test_a_gripper_times_motions_of_uneven_pace_all_the_same():
    plans, strikes = wind_ups_and_strikes()
    opens = np.round(strikes) + np.array([3, 5, 4, 6])
    channel = np.stack([np.clip(np.arange(140) - at, 0, 1) for at in opens])
    demos = demonstrations(np.dstack([plans, channel]), ("rad", "rad", "1"))
    starts = take_apart(demos, "start").numbers[:, 0]
    np.testing.assert_allclose(starts - starts[0], opens - opens[0], atol=1e-9)


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
    starts = take_apart(Demonstrations(plans, outcomes, plan_format), "start").numbers[:, 0]
    np.testing.assert_allclose(starts - starts.mean(), begins - begins.mean(), atol=0.3)


def test_a_mirrored_motion_is_not_carried_off():
    plans = swings()
    plans[3] = plans[3, :1] - (plans[3] - plans[3, :1])
    starts = take_apart(demonstrations(plans), "start").numbers[:, 0]
    np.testing.assert_allclose(np.diff(starts), -np.diff(lags_of(plans)), rtol=0, atol=1e-9)


def test_estimates_that_differ_by_little_do_not_move_our_own_demonstrations():
    demos = make_task("curling").demonstrations("A")  # by 0.6 % of the motion
    starts = take_apart(demos, "start").numbers[:, 0]
    profiles = velocity_profiles(demos.plans, demos.format.units, SMOOTHING / demos.format.dt)
    np.testing.assert_allclose(np.diff(starts), -np.diff(correlation_lags(profiles)), atol=1e-6)


def test_motions_that_differ_in_when_they_start_stay_where_they_agree_as_wholes():
    starts = take_apart(demonstrations(swings()), "start").numbers[:, 0]
    np.testing.assert_allclose(np.diff(starts), -np.diff(lags_of(swings())), rtol=0, atol=1e-12)


def test_tempos_come_back():
    apart = take_apart(demonstrations(swings(TEMPOS)), "tempo")
    expected = np.log(TEMPOS) - np.log(TEMPOS).mean()
    np.testing.assert_allclose(apart.numbers[:, 1], expected, atol=0.015)


def test_a_warp_takes_a_pause_out_of_a_motion():
    """Two phases, and between them a rest of other lengths: their shapes are one."""

    def two_phases(pause: float) -> np.ndarray:
        a = np.clip((np.arange(120) - 20) / 25, 0, 1)
        b = np.clip((np.arange(120) - 45 - pause) / 25, 0, 1)
        return sum(10 * s**3 - 15 * s**4 + 6 * s**5 for s in (a, b))

    plans = np.stack([two_phases(p)[:, None] * np.ones(2) for p in (2.0, 8.0, 5.0, 11.0)])
    spread = {}
    for kind in ("start", "warp"):
        apart = take_apart(demonstrations(plans), kind)
        spread[kind] = apart.shapes.std(axis=0).max()
    assert spread["warp"] < 0.5 * spread["start"]


def test_beyond_its_recording_a_motion_goes_on():
    """Cut at full speed: a later start uncovers frames that nobody recorded."""
    demos = demonstrations(swings(horizon=45))
    apart = take_apart(demos, "start")
    latest = np.argmax(STARTS)
    numbers = apart.numbers[[latest]] - 6.0
    (plan,) = apart.timeline.play(apart.shapes[[latest]], numbers)
    steps = np.diff(plan[:, 0])
    assert steps[-6:].min() > 0.8 * np.diff(demos.plans[latest, :, 0])[-1]


def test_a_gripper_is_timed_by_itself_and_comes_back_as_recorded():
    demos = with_gripper((30, 60, 41, 52))
    apart, plans = played(demos, "start")
    assert apart.timeline.n_numbers == 2
    np.testing.assert_allclose(plans[:, :, 2], demos.plans[:, :, 2], atol=1e-12)
    names, units = apart.names(demos.format)
    assert names[-1] == "time of joint3, change 1"
    assert units[-2:] == ("frame", "frame")


def test_between_two_openings_the_gripper_opens_once_and_as_fast():
    demos = with_gripper((30, 60, 41, 52))
    apart = take_apart(demos, "start")
    (plan,) = apart.timeline.play(
        apart.shapes[:2].mean(axis=0)[None], apart.numbers[:2].mean(axis=0)[None]
    )
    steps = np.diff(plan[:, 2])
    assert steps.min() >= -1e-12
    assert np.count_nonzero(steps > 0.01) == 6
    assert np.argmax(plan[:, 2] > 0.5) == pytest.approx(48, abs=1)


def test_what_does_not_move_has_no_timing():
    still = swings()
    still[2] = 0.4
    with pytest.raises(InvalidDemonstrationsError, match="does not move"):
        take_apart(demonstrations(still), "start")


def test_numbers_are_kept_near_the_demonstrated_ones():
    apart = take_apart(demonstrations(swings()), "start")
    far = apart.timeline.play(apart.shapes[:1], np.array([[1e6]]))
    farthest = apart.timeline.play(apart.shapes[:1], np.array([apart.timeline.highest]))
    np.testing.assert_array_equal(far, farthest)


def test_a_timeline_survives_its_settings():
    demos = with_gripper((30, 60, 41, 52))
    apart, plans = played(demos, "tempo")
    again = Timeline.restore(apart.timeline.settings())
    np.testing.assert_array_equal(again.play(apart.shapes, apart.numbers), plans)
    with pytest.raises(ValueError, match="no warp"):
        Timeline.restore({**replace(apart.timeline).settings(), "kind": "late"})


def test_a_step_that_has_just_changed_does_not_go_on():
    """Cut in mid-swing, a valve that closes in the last frames stays between its values."""
    plans = swings(horizon=40)
    valve = np.zeros((4, 40, 1))
    for i, (opens, closes) in enumerate([(10, 38), (20, 34), (14, 35), (12, 36)]):
        valve[i, opens:closes] = 1.0
    demos = demonstrations(np.dstack([plans, valve]), ("rad", "rad", "1"))
    _, back = played(demos, "start")
    assert back[:, :, 2].min() >= -1e-9
    assert back[:, :, 2].max() <= 1 + 1e-9
    np.testing.assert_allclose(back[:, :, 2], valve[:, :, 0], atol=1e-9)


def test_a_gripper_that_keeps_to_a_clock_is_no_start():
    """Closed at frame 8 in all demonstrations, whenever the arm starts."""
    demos = with_gripper((2, 2, 2, 2))
    apart = take_apart(demos, "start")
    off = apart.numbers[:, 0] - STARTS
    np.testing.assert_allclose(off, off.mean(), atol=0.05)


def test_a_few_frames_are_kept_as_recorded():
    demos = demonstrations(swings(horizon=90)[:, ::18])
    assert take_apart(demos, "start").timeline.kind == "none"


def test_a_switch_takes_no_values_but_its_own():
    switch = np.array([np.arange(90) > at for at in (30, 61, 42, 55)], dtype=float)
    demos = demonstrations(np.dstack([swings(), switch]), ("rad", "rad", "1"))
    apart, back = played(demos, "start")
    np.testing.assert_array_equal(back[:, :, 2], switch)
    weights = np.array([[0.31, 0.27, 0.22, 0.2]])
    (plan,) = apart.timeline.play(
        np.tensordot(weights, apart.shapes, axes=1), weights @ apart.numbers
    )
    assert set(plan[:, 2]) == {0.0, 1.0}


def test_a_switch_that_changes_in_some_demonstrations_only_does_not_overshoot():
    switch = np.array([np.arange(90) > at for at in (30, 61, 99, 55)], dtype=float)
    demos = demonstrations(np.dstack([swings(), switch]), ("rad", "rad", "1"))
    apart = take_apart(demos, "start")
    assert apart.timeline.linear == (2,)
    plans = apart.timeline.play(apart.shapes, apart.numbers + 0.4)
    assert plans[:, :, 2].min() >= 0
    assert plans[:, :, 2].max() <= 1


def test_a_channel_that_jumps_keeps_its_values_where_the_motion_is_eased():
    switch = np.zeros((4, 90))
    for row, start in zip(switch, STARTS.astype(int), strict=True):
        row[start + 30 :] = 1.0
    switch[0, 2:4] = 1.0  # once more: it cannot be timed by itself
    demos = demonstrations(np.dstack([swings(), switch]), ("rad", "rad", "1"))
    apart = take_apart(demos, "start")
    assert apart.timeline.linear == (2,)
    late = apart.numbers + 85 - 30 - STARTS[:, None]  # all jump at frame 85, and go on beyond 89
    assert apart.timeline.rests == (True, True)
    assert apart.timeline.cut_off(apart.shapes, late)[:, 1].all()
    timeline = replace(apart.timeline, highest=(100.0,))
    np.testing.assert_allclose(timeline.play(apart.shapes, late)[:, -1, 2], 1, atol=1e-9)


@pytest.mark.parametrize("by", [-12.0, 12.0])
def test_a_motion_that_would_be_cut_off_where_all_rest_is_eased(by):
    """Tele-operated plans: a hand drifts to the last frame, so what is moved is cut."""
    demos = make_task("curling").demonstrations("A")
    apart = take_apart(demos, "start")
    timeline, edge = apart.timeline, 0 if by < 0 else -1
    assert timeline.rests == (True, True)
    beyond = np.clip(apart.numbers + by, timeline.lowest, timeline.highest)

    def left(which):
        steps = np.abs(np.diff(which.play(apart.shapes, beyond), axis=1)).max(axis=2)
        return (steps[:, edge] / steps.max(axis=1)).max()

    assert left(replace(timeline, rests=(False, False))) > 0.02
    assert left(timeline) < 0.002
    np.testing.assert_allclose(timeline.play(apart.shapes, apart.numbers), demos.plans, atol=1e-5)


def test_what_demonstrations_do_not_rest_in_is_played_on():
    demos = make_task("zoo-scoop").demonstrations("cut-6-0")
    assert not take_apart(demos, "start").timeline.rests[1]

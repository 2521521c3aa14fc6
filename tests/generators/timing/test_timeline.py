"""Shapes and warps: every plan is reproduced, however it ends."""

from dataclasses import asdict, replace

import msgspec
import numpy as np
import pytest

from prior_reinforce.generators.timing.timeline import Timeline, decompose
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.tasks import make_task

STARTS = np.array([5.3, 31.0, 12.7, 24.1])
TEMPOS = np.array([1.0, 1.15, 0.85, 1.05])
SIZES = np.array([0.9, 1.0, 1.1, 0.95])
OUTCOMES = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])
KINDS = ("none", "start", "tempo")


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
    found = decompose(demos, kind)
    return found, found.timeline.reconstruct(found.shapes, found.numbers)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("horizon", [90, 55], ids=["at rest", "cut in mid-swing"])
def test_demonstrations_come_back_to_a_tenth_of_a_milliradian(kind, horizon):
    demos = demonstrations(swings(TEMPOS, horizon))
    _, plans = played(demos, kind)
    assert np.sqrt(np.mean((plans - demos.plans) ** 2, axis=1)).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_joint_that_is_held_but_for_noise_is_one_number_a_plan(kind):
    rng = np.random.default_rng(0)
    base = np.linspace(-0.3, 0.3, 4)[:, None] + rng.normal(0, 2e-5, (4, 90))
    demos = demonstrations(np.dstack([swings(TEMPOS), base]), ("rad",) * 3)
    found, plans = played(demos, kind)
    assert np.ptp(plans[:, :, 2], axis=1).max() < 1e-12
    assert np.sqrt(np.mean((plans - demos.plans) ** 2, axis=1)).max() < 1e-4
    assert (
        found.timeline.per_frame
        == played(demonstrations(swings(TEMPOS)), kind)[0].timeline.per_frame
    )


@pytest.mark.slow
def test_beyond_its_recording_a_motion_goes_on():
    """Cut at full speed: a later start uncovers frames that nobody recorded."""
    demos = demonstrations(swings(horizon=45))
    found = decompose(demos, "start")
    latest = np.argmax(STARTS)
    numbers = found.numbers[[latest]] - 6.0
    (plan,) = found.timeline.reconstruct(found.shapes[[latest]], numbers)
    steps = np.diff(plan[:, 0])
    assert steps[-6:].min() > 0.8 * np.diff(demos.plans[latest, :, 0])[-1]


def test_a_gripper_is_timed_by_itself_and_comes_back_as_recorded():
    demos = with_gripper((30, 60, 41, 52))
    found, plans = played(demos, "start")
    assert found.timeline.n_numbers == 2
    np.testing.assert_allclose(plans[:, :, 2], demos.plans[:, :, 2], atol=1e-12)
    names, units = found.timeline.names(demos.format)
    assert names[-1] == "time of joint3, change 1"
    assert units[-2:] == ("frame", "frame")


def test_between_two_openings_the_gripper_opens_once_and_as_fast():
    demos = with_gripper((30, 60, 41, 52))
    found = decompose(demos, "start")
    (plan,) = found.timeline.reconstruct(
        found.shapes[:2].mean(axis=0)[None], found.numbers[:2].mean(axis=0)[None]
    )
    steps = np.diff(plan[:, 2])
    assert steps.min() >= -1e-12
    assert np.count_nonzero(steps > 0.01) == 6
    assert np.argmax(plan[:, 2] > 0.5) == pytest.approx(48, abs=1)


def test_numbers_are_kept_near_the_demonstrated_ones():
    found = decompose(demonstrations(swings()), "start")
    far = found.timeline.reconstruct(found.shapes[:1], np.array([[1e6]]))
    farthest = found.timeline.reconstruct(found.shapes[:1], np.array([found.timeline.highest]))
    np.testing.assert_array_equal(far, farthest)


@pytest.mark.slow
def test_a_timeline_survives_its_settings():
    demos = with_gripper((30, 60, 41, 52))
    found, plans = played(demos, "tempo")
    again = msgspec.convert(asdict(found.timeline), Timeline)
    np.testing.assert_array_equal(again.reconstruct(found.shapes, found.numbers), plans)
    with pytest.raises(ValueError, match="late"):
        msgspec.convert({**asdict(found.timeline), "kind": "late"}, Timeline)


@pytest.mark.slow
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


@pytest.mark.parametrize(("every", "share"), [(18, 2e-2), (10, 4e-3), (6, 5e-4)])
def test_a_few_frames_are_moved_too_and_come_back_as_nearly_as_a_spline_can(every, share):
    demos = demonstrations(swings(horizon=90)[:, ::every])
    found, back = played(demos, "start")
    assert found.timeline.kind == "start"
    rms = np.sqrt(np.mean((back - demos.plans) ** 2, axis=1))
    assert rms.max() <= share * np.ptp(demos.plans)


def test_a_switch_takes_no_values_but_its_own():
    switch = np.array([np.arange(90) > at for at in (30, 61, 42, 55)], dtype=float)
    demos = demonstrations(np.dstack([swings(), switch]), ("rad", "rad", "1"))
    found, back = played(demos, "start")
    np.testing.assert_array_equal(back[:, :, 2], switch)
    weights = np.array([[0.31, 0.27, 0.22, 0.2]])
    (plan,) = found.timeline.reconstruct(
        np.tensordot(weights, found.shapes, axes=1), weights @ found.numbers
    )
    assert set(plan[:, 2]) == {0.0, 1.0}


@pytest.mark.slow
def test_a_switch_that_changes_in_some_demonstrations_only_does_not_overshoot():
    switch = np.array([np.arange(90) > at for at in (30, 61, 99, 55)], dtype=float)
    demos = demonstrations(np.dstack([swings(), switch]), ("rad", "rad", "1"))
    found = decompose(demos, "start")
    assert found.timeline.linear == (2,)
    plans = found.timeline.reconstruct(found.shapes, found.numbers + 0.4)
    assert plans[:, :, 2].min() >= 0
    assert plans[:, :, 2].max() <= 1


def test_a_channel_that_jumps_keeps_its_values_where_the_motion_is_eased():
    switch = np.zeros((4, 90))
    for row, start in zip(switch, STARTS.astype(int), strict=True):
        row[start + 30 :] = 1.0
    switch[0, 2:4] = 1.0  # once more: it cannot be timed by itself
    demos = demonstrations(np.dstack([swings(), switch]), ("rad", "rad", "1"))
    found = decompose(demos, "start")
    assert found.timeline.linear == (2,)
    late = found.numbers + 85 - 30 - STARTS[:, None]  # all jump at frame 85, and go on beyond 89
    assert found.timeline.rests == (True, True)
    assert found.timeline.cut_off(found.shapes, late)[:, 1].all()
    timeline = replace(found.timeline, highest=(100.0,))
    np.testing.assert_allclose(timeline.reconstruct(found.shapes, late)[:, -1, 2], 1, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("by", [-12.0, 12.0])
def test_a_motion_that_would_be_cut_off_where_all_rest_is_eased(by):
    """Tele-operated plans: a hand drifts to the last frame, so what is moved is cut."""
    demos = make_task("curling").demonstrations("A")
    found = decompose(demos, "start")
    timeline, edge = found.timeline, 0 if by < 0 else -1
    assert timeline.rests == (True, True)
    beyond = np.clip(found.numbers + by, timeline.lowest, timeline.highest)

    def left(which):
        steps = np.abs(np.diff(which.reconstruct(found.shapes, beyond), axis=1)).max(axis=2)
        return (steps[:, edge] / steps.max(axis=1)).max()

    assert left(replace(timeline, rests=(False, False))) > 0.02
    assert left(timeline) < 0.002
    np.testing.assert_allclose(
        timeline.reconstruct(found.shapes, found.numbers), demos.plans, atol=1e-5
    )

"""Start times as a channel of their own: nothing is lost, and only where motions rest."""

import re
from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.generators.timed import StartTimeCodec
from prior_reinforce.plans.motions import Demonstrations, PlanFormat
from prior_reinforce.tasks import make_task

STARTS = [5, 31, 12, 44]
WHY = {
    "ends in mid-swing": r"demonstration 1 still moves at its last frame, with \d+% of its peak",
    "slow and late would not fit": (
        r"demonstration 0's motion, begun as early as demonstration 2's, would begin \d+ frames"
    ),
}


def demonstrations(*, plans=None, horizon=90):
    """Minimum-jerk swings of 40 frames that start at STARTS, two joints and a constant one."""
    phase = np.clip((np.arange(horizon)[None] - np.array(STARTS)[:, None]) / 40, 0, 1)
    swing = 10 * phase**3 - 15 * phase**4 + 6 * phase**5
    size = np.array([0.9, 1.0, 1.1, 0.95])[:, None]
    if plans is None:
        plans = np.stack([0.2 + size * swing, 1.5 - 0.7 * size * swing, 0 * swing + 0.3], axis=-1)
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])
    return Demonstrations(plans, outcomes, PlanFormat(("a", "b", "c"), ("rad",) * 3, 0.0125))


def fit(demos, **changes):
    settings = {
        "start_times": True,
        "representation": "frames",
        "frames_per_point": 4,
        "length_multiple": 4,
        "margin": 0.05,
    }
    return StartTimeCodec.fit(demos, **(settings | changes))


def test_plans_come_back_to_the_last_bit_from_frames():
    demos = demonstrations()
    codec, codes = fit(demos)
    assert codec.starts is not None
    np.testing.assert_allclose(codec.decode(codes), demos.plans, atol=1e-12)


def test_plans_come_back_from_control_points():
    demos = demonstrations()
    codec, codes = fit(demos, representation="splines")
    np.testing.assert_allclose(codec.decode(codes), demos.plans, atol=3e-3)


def test_the_cut_out_motions_start_together_and_the_channel_says_when():
    demos = demonstrations()
    codec, codes = fit(demos)
    assert codec.channels == codes.shape[1] == codec.motion.channels + 1
    earliest, latest = codec.starts
    assert latest - earliest == max(STARTS) - min(STARTS)
    expected = 2 * (np.array(STARTS) - min(STARTS)) / (max(STARTS) - min(STARTS)) - 1
    np.testing.assert_allclose(codes[:, -1], np.repeat(expected[:, None], codes.shape[2], axis=1))
    # The same swing but for its size: without its start time it is the same code but for a scale.
    centred = codes[:, :3] - codes[:, :3].mean(axis=2, keepdims=True)
    shapes = centred[:, 0].reshape(4, -1)
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    assert np.all(shapes @ shapes.T > 0.999)


def test_codes_between_two_demonstrations_are_swings_of_full_speed_in_between():
    """Averaging frames would halve the peak speed of two swings that do not overlap."""
    demos = demonstrations()
    codec, codes = fit(demos)
    middle = codec.decode(codes[[0, 3]].mean(axis=0, keepdims=True))[0]
    speed = np.abs(np.diff(middle[:, 0]))
    demonstrated = np.abs(np.diff(demos.plans[[0, 3], :, 0], axis=1)).max(axis=1)
    assert speed.max() > 0.98 * demonstrated.min()
    assert np.argmax(speed) == pytest.approx((STARTS[0] + STARTS[3]) / 2 + 20, abs=2)


def test_a_start_beyond_the_demonstrated_ones_is_not_used():
    codec, codes = fit(demonstrations())
    codes[:, -1] = 5.0
    moving = np.abs(np.diff(codec.decode(codes)[:, :, 0], axis=1)) > 0
    assert np.all(moving.argmax(axis=1) == moving.argmax(axis=1)[0])
    assert moving.argmax(axis=1)[0] == max(STARTS)


@pytest.mark.parametrize(
    "how", ["switched off", "ends in mid-swing", "same start", "slow and late would not fit"]
)
def test_whole_plans_are_coded_where_there_is_nothing_to_cut(how):
    demos = demonstrations()
    if how == "ends in mid-swing":
        demos = demonstrations(plans=demos.plans[:, :55])
    if how == "same start":
        demos = demonstrations(
            plans=demos.plans[[0, 0, 0, 0]] * np.array([1, 1.1, 1.2, 1.3])[:, None, None]
        )
    if how == "slow and late would not fit":
        plans = demos.plans[:, :86].copy()
        plans[0] = demos.plans[0, np.clip((np.arange(86) - 5) // 2 + 5, 0, 85)]  # half as fast
        demos = demonstrations(plans=plans)
    codec, codes = fit(demos, start_times=how != "switched off")
    assert codec.starts is None
    if how in ("switched off", "same start"):
        assert codec.whole_because is None
    else:
        assert re.search(WHY[how], codec.whole_because)
    np.testing.assert_allclose(codec.decode(codes), demos.plans, atol=1e-3)


def test_a_restored_codec_decodes_alike():
    codec, codes = fit(demonstrations(), representation="splines")
    again = StartTimeCodec.restore(
        codec.settings(), codec.motion.plan_range, codec.motion.code_range
    )
    np.testing.assert_array_equal(again.decode(codes), codec.decode(codes))
    assert (again.horizon, again.action_dim, again.channels) == (90, 3, 4)


def test_why_whole_plans_are_coded_is_kept_on_disk():
    demos = demonstrations()
    codec, _ = fit(demonstrations(plans=demos.plans[:, :55]))
    ranges = codec.motion.plan_range, codec.motion.code_range
    again = StartTimeCodec.restore(codec.settings(), *ranges)
    assert again.whole_because == codec.whole_because
    assert again.whole_because
    before_it_was_kept = codec.settings()
    del before_it_was_kept["whole_because"]
    assert StartTimeCodec.restore(before_it_was_kept, *ranges).whole_because is None


def test_a_trembling_hand_rests_where_it_hardly_moves():
    """Tele-operation never rests exactly; what holding removes of its tremor is small."""
    demos = demonstrations()
    rng = np.random.default_rng(0)
    t = np.arange(90) * 0.0125
    phases = rng.uniform(0, 2 * np.pi, (4, 1, 3))
    tremor = 0.006 * np.sin(2 * np.pi * 1.1 * t[None, :, None] + phases)
    trembling = demonstrations(plans=demos.plans + tremor)
    codec, codes = fit(trembling)
    assert codec.starts is not None
    assert codec.starts[1] - codec.starts[0] == pytest.approx(max(STARTS) - min(STARTS), abs=2)
    moving = np.ptp(trembling.plans, axis=(0, 1))[:2]
    lost = np.abs(codec.decode(codes) - trembling.plans)[:, :, :2].max(axis=(0, 1))
    assert np.all(lost < 0.03 * moving)


def test_a_small_dimension_that_still_moves_at_the_end_is_not_held():
    demos = demonstrations()
    t = np.arange(90)[None] - np.array(STARTS)[:, None]
    plans = demos.plans.copy()
    plans[:, :, 2] = 0.01 * np.clip((t - 20) / 60, 0, 1)  # cut off at full speed
    moving = demonstrations(plans=plans)
    codec, codes = fit(replace(moving, format=replace(moving.format, units=("rad", "rad", "m"))))
    assert codec.starts is None
    assert re.search(r"demonstration 1 .* last frame, with 4\d% of its peak", codec.whole_because)
    np.testing.assert_allclose(codec.decode(codes), plans, atol=1e-12)


@pytest.mark.parametrize("name", ["A", "B"])
def test_a_trembling_hand_is_not_jerked_where_its_tremor_is_held(name):
    """Cut in mid-swing, the shipped curling sets' tremor would jerk the wrist."""
    demos = make_task("curling").demonstrations(name)
    codec, codes = fit(demos, representation="splines")
    jolts = np.abs(np.diff(codec.decode(codes), n=2, axis=1)).max(axis=(0, 1))
    shown = np.abs(np.diff(demos.plans, n=2, axis=1)).max(axis=(0, 1))
    assert codec.starts is not None
    assert np.all(jolts <= 1.1 * shown)

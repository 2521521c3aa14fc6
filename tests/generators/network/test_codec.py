"""Codes: what is coded how, and that it comes back."""

import tracemalloc

import numpy as np
import pytest
from scipy.interpolate import BSpline

from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.generators.network.codec import PlanCodec
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.tasks import make_task


def swing(times, start, duration):
    """Minimum-jerk time course from 0 to 1."""
    s = np.clip((times - start) / duration, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)


def throws(n, horizon=140):
    """Plans of two joints that swing at different times, and a third that is constant."""
    rng = np.random.default_rng(0)
    t = np.arange(horizon) / horizon
    paths = np.stack([swing(t, start, 0.6) for start in rng.uniform(0.02, 0.3, n)])
    reach = rng.permutation(np.linspace(0.8, 1.1, n))[:, None]
    side = np.broadcast_to(rng.uniform(-0.3, 0.3, (n, 1)), paths.shape)
    return np.stack([reach * paths - 1, 2 - 0.8 * reach * paths, side], axis=-1)


def codec_of(plans, representation="splines", margin=0.05, multiple=4, per_plan=()):
    names = tuple(f"d{d}" for d in range(plans.shape[2]))
    plan_format = PlanFormat(names, ("1",) * len(names), 0.0125, per_plan)
    outcomes = np.linspace(0.0, 1.0, len(plans))[:, None]
    return PlanCodec.fit(
        Demonstrations(plans, outcomes, plan_format),
        representation=representation,
        frames_per_point=4,
        length_multiple=multiple,
        margin=margin,
    )


def round_trip(codec, plans):
    return codec.decode(codec.encode(plans))


def test_throws_come_back_from_splines_within_a_tenth_of_a_milliradian_rms():
    plans = throws(6)
    codec = codec_of(plans)
    assert codec.kinds == ("spline", "spline", "number")
    assert codec.length == 36
    residual = round_trip(codec, plans) - plans
    assert np.sqrt(np.mean(residual**2)) < 1e-4


def test_a_cubic_comes_back_exactly():
    t = np.linspace(0, 1, 60)
    plans = np.stack([a * t**3 - t + a for a in (0.5, 1.0, 2.0)])[:, :, None]
    np.testing.assert_allclose(round_trip(codec_of(plans), plans), plans, atol=1e-12)


@pytest.mark.parametrize("horizon", [2, 5, 62, 139])
@pytest.mark.parametrize("representation", ["splines", "frames"])
def test_any_horizon_comes_back(horizon, representation):
    plans = throws(3, horizon)
    codec = codec_of(plans, representation)
    assert codec.length % 4 == 0
    np.testing.assert_allclose(round_trip(codec, plans), plans, atol=4e-3)


def test_mixed_dimensions_are_each_coded_as_they_need():
    t = np.arange(140) / 140
    n = 3
    plans = np.zeros((n, 140, 6))
    for i in range(n):
        start = 0.1 * i
        plans[i, :, 0] = swing(t, start, 0.6)
        plans[i, :, 1] = t > 0.3 + start  # gripper
        plans[i, :, 2] = 0.7  # constant
        plans[i, :, 3] = np.gradient(swing(t, start, 0.6))  # increments
        plans[i, :, 4] = swing(t, 0.5, 1.0)  # ends in mid-swing
        plans[i, :, 5] = np.random.default_rng(i).normal(size=140)  # recorded noise
    codec = codec_of(plans)
    assert codec.kinds == ("spline", "frames", "number", "spline", "spline", "frames")
    assert codec.levels == ((), (0.0, 1.0), (), (), (), ())
    assert codec.shape[0] == 4 + 2 * 4
    back = round_trip(codec, plans)
    np.testing.assert_array_equal(back[:, :, 1:3], plans[:, :, 1:3])
    np.testing.assert_allclose(back[:, :, 5], plans[:, :, 5], atol=1e-12)
    np.testing.assert_allclose(back[:, :, [0, 4]], plans[:, :, [0, 4]], atol=2e-3)
    np.testing.assert_allclose(back[:, :, 3], plans[:, :, 3], atol=2e-3 * np.ptp(plans[:, :, 3]))


def test_codes_of_demonstrations_fill_minus_one_to_one():
    for representation in ("splines", "frames"):
        plans = throws(4)
        codes = codec_of(plans, representation).encode(plans)
        np.testing.assert_allclose(codes.min(axis=(0, 2)), -1, atol=1e-12)
        np.testing.assert_allclose(codes.max(axis=(0, 2)), 1, atol=1e-12)


def test_any_code_decodes_into_range_and_to_rest_at_both_ends():
    plans = throws(4)
    codec = codec_of(plans)
    assert all(codec.rest_start)
    assert all(codec.rest_end)
    codes = np.random.default_rng(0).normal(scale=3, size=(50, *codec.shape))
    decoded = codec.decode(codes)
    low, high = plans.min(axis=(0, 1)), plans.max(axis=(0, 1))
    assert np.all(decoded >= low - 0.05 * (high - low) - 1e-12)
    assert np.all(decoded <= high + 0.05 * (high - low) + 1e-12)
    # At a tied end only the cube of time is left: 1/64 of the next point's distance a frame on.
    calm = codec.decode(np.random.default_rng(0).uniform(-0.9, 0.9, codes.shape))
    speed = np.abs(np.diff(calm, axis=1))
    assert np.all(speed[:, 0] < 0.02 * (high - low))
    assert np.all(speed[:, -1] < 0.02 * (high - low))


def test_a_swing_that_is_cut_off_is_not_brought_to_rest():
    t = np.arange(100) / 100
    plans = np.stack([swing(t, start, 1.2) for start in (0.0, 0.1, 0.2)])[:, :, None]
    codec = codec_of(plans)
    assert codec.rest_start == (True,)
    assert codec.rest_end == (False,)
    back = round_trip(codec, plans)
    np.testing.assert_allclose(
        np.diff(back, axis=1)[:, -1], np.diff(plans, axis=1)[:, -1], rtol=0.02
    )


def test_settings_and_arrays_are_all_there_is():
    plans = throws(3)
    codec = codec_of(plans)
    again = PlanCodec.restore(codec.settings(), codec.plan_range, codec.code_range)
    codes = np.random.default_rng(0).normal(size=(5, *codec.shape))
    np.testing.assert_array_equal(again.decode(codes), codec.decode(codes))


def test_ripple_between_control_points_hardly_accelerates_the_plan():
    """An alternating error of the code moves a third of what the bare spline would, or less."""
    horizon, points = 93, 24
    t = np.linspace(0, 1, horizon)[None, :, None]
    swings = np.array([0.8, 1.0, 1.2])[:, None, None] * (t**3 * (10 - 15 * t + 6 * t**2))
    codec = codec_of(swings, margin=0.5)
    assert codec.length == points
    codes = codec.encode(swings)
    np.testing.assert_allclose(codec.decode(codes), swings, atol=1e-4)
    inner = (np.arange(points) > 4) & (np.arange(points) < points - 5)
    ripple = 0.01 * np.where(inner, (-1.0) ** np.arange(points), 0.0)
    moved = codec.decode(codes + ripple) - codec.decode(codes)
    # The bare spline: second differences of its basis, for the same ripple of the control points.
    half = (codec.code_range[1, 0] - codec.code_range[0, 0]) / 2
    knots = np.concatenate([[0] * 3, np.linspace(0, horizon - 1, points - 2), [horizon - 1] * 3])
    bare = BSpline(knots, half * ripple, 3)(np.arange(horizon))
    assert np.abs(np.diff(moved[0, :, 0], 2)).max() < np.abs(np.diff(bare, 2)).max() / 3


@pytest.mark.parametrize("representation", ["splines", "frames"])
def test_one_number_a_plan_is_coded_by_its_value_and_decoded_by_the_mean(representation):
    plans = throws(3)
    plans[:, :, 1] = np.array([4.0, 31.0, 12.0])[:, None]
    codec = codec_of(plans, representation, margin=0.1, per_plan=("d1",))
    assert codec.kinds[1] == "number"
    codes = codec.encode(plans)
    channel = 1 if representation == "splines" else int(np.ceil(140 / codec.length))
    expected = 2 * (np.array([4.0, 31.0, 12.0]) - 4) / 27 - 1
    np.testing.assert_allclose(codes[:, channel], np.tile(expected[:, None], codec.length))
    codes[:, channel] += np.linspace(-0.5, 0.5, codec.length)  # its mean stays
    np.testing.assert_allclose(codec.decode(codes)[:, :, 1], plans[:, :, 1])
    codes[:, channel] = 9.0
    np.testing.assert_allclose(codec.decode(codes)[:, :, 1], 31 + 0.1 * 27)  # the margin


def test_an_angle_that_each_plan_holds_is_no_switch_however_few_plans_there_are():
    plans = throws(3)
    codec = codec_of(plans, "frames")
    assert codec.levels == ((), (), ())
    codes = codec.encode(plans)
    halfway = codec.decode(0.5 * (codes[:1] + codes[1:2]))
    np.testing.assert_allclose(halfway, 0.5 * (plans[:1] + plans[1:2]), atol=1e-12)


@pytest.mark.slow
def test_fine_frames_take_no_square_of_memory():
    """A matrix of frames by control points would take 32 MB."""
    plans = throws(6, horizon=4000)
    tracemalloc.start()
    codec = codec_of(plans)
    back = round_trip(codec, plans)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert codec.kinds == ("spline", "spline", "number")
    np.testing.assert_allclose(back, plans, atol=2e-4)
    assert peak < 16e6


@pytest.mark.parametrize(("smoothing", "passes"), [(0.0, False), (0.04, True)])
def test_smoothed_frames_pass_a_gate_that_refuses_what_a_network_leaves_rough(smoothing, passes):
    """0.7 mrad from frame to frame, as plans of the paper's network have after 20,000 steps."""
    demonstrations = make_task("basketball-v1").demonstrations("A")
    codec = PlanCodec.fit(
        demonstrations,
        representation="frames",
        frames_per_point=4,
        length_multiple=4,
        margin=0.0,
        smoothing=smoothing,
    )
    rough = np.random.default_rng(0).normal(0.0, 0.7e-3, demonstrations.plans.shape)
    (frames,) = codec.decode(codec.encode(demonstrations.plans + rough))[:1]
    report = check_plan(Plan(frames, demonstrations.format), robot_limits("panda"), demonstrations)
    assert report.refused != passes

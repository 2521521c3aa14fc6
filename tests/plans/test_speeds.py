"""How fast a plan moves, and when: known motions, at every threshold."""

import numpy as np
import pytest

from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.speeds import (
    frames_at_rest,
    mean_frame,
    motion_span,
    onset,
    velocity_profiles,
)
from reproduction.recipes.alignment import recorded_speeds

STARTS = np.array([5, 31, 12, 44])


def demonstrations(tremor: float = 0.0) -> Demonstrations:
    """Minimum-jerk swings of 40 frames in 90, of a joint and of a slide, and a constant joint."""
    phase = np.clip((np.arange(90) - STARTS[:, None]) / 40, 0, 1)
    swing = 10 * phase**3 - 15 * phase**4 + 6 * phase**5
    plans = np.stack([swing, 0.01 * swing, 0 * swing + 0.3], axis=-1)
    shake = np.sin(0.086 * np.arange(90)[None, :, None] + np.arange(4)[:, None, None])
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])
    plan_format = PlanFormat(("a", "slide", "c"), ("rad", "m", "rad"), 0.0125)
    return Demonstrations(plans + tremor * shake * [1, 0.01, 1], outcomes, plan_format)


def test_profiles_of_a_unit_share_a_scale_and_units_count_alike():
    demos = demonstrations()
    profiles = np.stack(velocity_profiles(demos.plans, demos.format.units, 0.0))
    # Of the joints one rests: the other is sqrt(2) times the pooled rms; the slide is alone.
    np.testing.assert_allclose(profiles[:, :, 0], np.sqrt(2) * profiles[:, :, 1], atol=1e-9)
    np.testing.assert_array_equal(profiles[:, :, 2], 0)
    assert np.mean(profiles[:, :, 1] ** 2) == pytest.approx(1)


def test_constant_plans_have_no_speed():
    profiles = velocity_profiles(np.full((2, 9, 1), 0.1) + 1e-17, ("rad",), 2.0)
    np.testing.assert_array_equal(profiles, 0)


def test_a_swing_moves_fastest_in_its_middle():
    demos = demonstrations()
    smoothed = np.linalg.norm(velocity_profiles(demos.plans, demos.format.units, 2.4), axis=2)
    np.testing.assert_allclose(smoothed.argmax(axis=1), STARTS + 20, atol=1)
    for start, speed in zip(STARTS, recorded_speeds(demos.plans, demos.format.units), strict=True):
        assert mean_frame(speed**2) == pytest.approx(start + 20, abs=1e-6)
        # 5 % of the peak of 30 u^2 (1 - u)^2 is reached at u = 0.059.
        assert onset(speed) == start + np.ceil(0.059 * 40)


def test_rest_ends_at_a_two_hundredth_of_the_peak():
    speed = np.array([0, 0.004, 0.006, 1, 0.3, 0.005, 0])
    assert frames_at_rest(speed) == (2, 2)
    assert frames_at_rest(np.zeros(7)) == (7, 7)


def test_a_motion_spans_its_threshold_crossings_and_a_tenth_more():
    """A linear rise and fall between frames 20 and 60: 5 % of the peak is a frame inside."""
    speed = np.clip(1 - np.abs(np.arange(100) - 40) / 20, 0, None)
    np.testing.assert_allclose(motion_span(speed), [21 - 3.8, 59 + 3.8])


def test_a_motion_at_the_ends_of_its_recording_keeps_them():
    np.testing.assert_array_equal(motion_span(np.ones(30)), [0, 29])
    np.testing.assert_array_equal(motion_span(np.zeros(30)), [0, 29])

"""Plans before they begin and after they have ended."""

import numpy as np

from prior_reinforce.generators.timing.extrapolation import ExtrapolatedPlans
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from reproduction.recipes.alignment import recorded_speeds

STARTS = np.array([5, 31, 12, 44])
NO_JUMPS = np.zeros(3, dtype=bool)


def speeds(demos):
    return recorded_speeds(demos.plans, demos.format.units)


def demonstrations(tremor: float = 0.0) -> Demonstrations:
    """Minimum-jerk swings of 40 frames in 90, of a joint and of a slide, and a constant joint."""
    phase = np.clip((np.arange(90) - STARTS[:, None]) / 40, 0, 1)
    swing = 10 * phase**3 - 15 * phase**4 + 6 * phase**5
    plans = np.stack([swing, 0.01 * swing, 0 * swing + 0.3], axis=-1)
    shake = np.sin(0.086 * np.arange(90)[None, :, None] + np.arange(4)[:, None, None])
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])
    plan_format = PlanFormat(("a", "slide", "c"), ("rad", "m", "rad"), 0.0125)
    return Demonstrations(plans + tremor * shake * [1, 0.01, 1], outcomes, plan_format)


def test_a_plan_holds_where_it_rests_and_goes_on_where_it_moves():
    demos = demonstrations()
    extrapolated = ExtrapolatedPlans(demos.plans[:, :45], NO_JUMPS, speeds(demos)[:, :45])
    at_rest, moving = (
        extrapolated(3, np.array([-9.0, 0.0])),
        extrapolated(1, np.array([44.0, 46.0])),
    )
    np.testing.assert_allclose(at_rest[0], at_rest[1], atol=1e-12)
    velocity = (demos.plans[1, 44] - demos.plans[1, 41]) / 3
    np.testing.assert_allclose(moving[1], demos.plans[1, 44] + 2 * velocity, atol=1e-12)


def test_whole_frames_are_as_recorded_and_parts_between():
    demos = demonstrations()
    extrapolated = ExtrapolatedPlans(demos.plans, NO_JUMPS, speeds(demos))
    np.testing.assert_allclose(extrapolated(0, np.arange(90.0)), demos.plans[0], atol=1e-12)
    (half,) = extrapolated(0, np.array([20.5]))
    assert demos.plans[0, 20, 0] < half[0] < demos.plans[0, 21, 0]

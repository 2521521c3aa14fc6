"""Which goals can be reached, by the plans that are made for them."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import OutOfReachError
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.base import Generator
from prior_reinforce.generators.reach import farthest_between, goals_around, reach, refusal
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import TurnJoint, TurnPath, turn_and_scale

GOALS = np.stack(
    np.meshgrid(np.linspace(0.5, 1.5, 7), np.linspace(-0.6, 0.6, 7), indexing="ij"), -1
)


def learned(symmetry, outcome=(1.0, 0.0)):
    s = np.linspace(0, 1, 50)
    s = s**3 * (10 - 15 * s + 6 * s**2)
    ready = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, np.pi / 4])
    plan = ready + s[:, None] * np.array([0.1, 0.4, 0.0, 0.5, 0.05, 0.3, 0.1])
    form = PlanFormat(tuple(f"joint{i}" for i in range(1, 8)), ("rad",) * 7, 0.02)
    one = Demonstrations(plan[None], [outcome], form, symmetry=symmetry)
    return make_generator("auto").fit(one, seed=0)


def gentle(plan, goal):
    """At most 0.3 rad to the left, and no faster than 1.2 times the demonstration."""
    if plan[:, 0].max() > 0.4:
        return "joint1 beyond 0.4 rad"
    return "too fast" if np.abs(np.diff(plan[:, 3])).max() > 1.2 * 0.0191 else ""


def test_goals_are_reached_where_their_plans_pass():
    generator = learned(turn_and_scale(TurnJoint()))
    assert refusal(generator, [1.0, 0.0], gentle) == ""
    assert "joint1" in refusal(generator, [1.0, 0.6], gentle)
    assert "too fast" in refusal(generator, [1.5, 0.0], gentle)
    found = reach(generator, GOALS, gentle)
    assert found.reached.shape == (7, 7)
    for goal, reached in zip(GOALS.reshape(-1, 2), found.reached.ravel(), strict=True):
        assert reached == (refusal(generator, goal, gentle) == "")
    assert 0 < found.reached.mean() < 1


def test_the_nearest_goal_that_passes_is_found_at_the_edge():
    generator = learned(turn_and_scale(TurnJoint()))
    found = reach(generator, GOALS, gentle)
    np.testing.assert_array_equal(found.nearest(generator, [1.0, 0.1], gentle), [1.0, 0.1])
    near = found.nearest(generator, [1.0, 0.6], gentle)
    assert refusal(generator, near, gentle) == ""
    assert 0.25 < np.arctan2(near[1], near[0]) <= 0.3
    assert np.linalg.norm(near - [1.0, 0.6]) < 0.35


def test_the_nearest_goal_passes_as_it_is_said():
    generator = learned(turn_and_scale(TurnJoint()))
    within, wanted = np.array([1.0, 0.0]), np.array([1.0, 0.6])
    said = lambda goal: np.ceil(goal * 10) / 10  # noqa: E731
    plainly = farthest_between(generator, within, wanted, gentle)
    assert refusal(generator, said(plainly), gentle) != ""
    rounded = farthest_between(generator, within, wanted, gentle, said)
    np.testing.assert_allclose(rounded, [1.0, 0.3])


def test_nothing_in_reach_is_said():
    generator = learned(turn_and_scale(TurnJoint()))
    found = reach(generator, GOALS[::3, ::3], lambda *_: "never")
    with pytest.raises(OutOfReachError, match=r"no goal can be reached .*never"):
        found.nearest(generator, [1.0, 0.0], lambda *_: "never")


def test_what_kinematics_cannot_do_is_out_of_reach_by_name():
    turn = TurnPath(robot_limits("panda").chain, (1.2, 0.0), tuple(range(7)))
    generator = learned(turn_and_scale(turn, (1.2, 0.0)), outcome=(1.5, 0.0))
    assert refusal(generator, [1.5, 0.01], lambda *_: "") == ""
    why = refusal(generator, [0.9, 0.0], lambda *_: "")
    assert why.startswith("turned by")
    assert "demonstrate" not in why  # what to do is said once, with the nearest goal


def test_all_of_why_a_goal_is_out_of_reach_is_said_and_no_remedy():
    class NeverReaches(Generator):
        def _fit(self, demonstrations, seed, progress):
            pass

        def _generate(self, conditions):
            raise OutOfReachError("joint 1 stops; joint 2 too", remedy="go nearer")

    generator = NeverReaches()
    generator._outcome_dim = 2
    assert refusal(generator, [1.0, 0.0], lambda *_: "") == "joint 1 stops; joint 2 too"


def test_goals_are_tried_all_round_as_far_as_a_symmetry_is_believed():
    form = PlanFormat(("joint1",), ("rad",), 0.02)
    plans = np.linspace(0, 1, 20)[None, :, None]
    one = Demonstrations(plans, [(1.0, 0.0)], form, symmetry=turn_and_scale(TurnJoint()))
    goals = goals_around(one)
    distances = np.linalg.norm(goals, axis=-1)
    np.testing.assert_allclose(distances[:, 0], np.exp(np.linspace(-0.9, 0.9, len(goals))))
    np.testing.assert_allclose(np.ptp(distances, axis=1), 0, atol=1e-12)
    bearings = np.arctan2(goals[4, :, 1], goals[4, :, 0])
    np.testing.assert_allclose(bearings[1:-1], np.linspace(-np.pi, np.pi, goals.shape[1])[1:-1])
    assert not np.any(one.far_outside(goals[0, 3]))
    apart = replace(one, plans=np.repeat(plans, 2, axis=0), outcomes_seen=[(1.0, 0.0), (0.8, 0.6)])
    bearings = np.unwrap(np.arctan2(*np.moveaxis(goals_around(apart)[4], -1, 0)[::-1]))
    assert np.ptp(bearings) <= 2 * np.pi + 1e-9  # no goal twice

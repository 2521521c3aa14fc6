"""Known swings land where the formula says; shifts in time matter where a clock decides."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from prior_reinforce.tasks.zoo.physics import GRAVITY, flight
from prior_reinforce.tasks.zoo.throws import GripperThrow, Lob, Scoop


def outcome(task, plan):
    (rollout,) = task.rollout(plan[None], None)
    assert rollout.valid
    return rollout.outcome


def circling(task, lean, pace, frames, at):
    """Joint 2 leans at a constant pace, through `lean` at time `at`; the rest is straight."""
    plan = np.zeros((frames, task.format.action_dim))
    plan[:, 1] = lean + pace * (np.arange(frames) * task.format.dt - at)
    return plan


def on_a_circle(lean, pace, radius, centre):
    """Place and velocity of a hand that leans forward at a constant pace."""
    place = np.array([radius * np.sin(lean), 0.0, centre + radius * np.cos(lean)])
    return place, radius * pace * np.array([np.cos(lean), 0.0, -np.sin(lean)])


def later(plan, frames):
    return np.concatenate([np.repeat(plan[:1], frames, axis=0), plan[:-frames]])


def test_a_lob_leaves_a_turning_arm_at_its_clock_along_the_tangent():
    task = Lob()
    start, velocity = on_a_circle(-0.6, 2.0, radius=0.92, centre=0.25)
    plan = circling(task, -0.6, 2.0, task.horizon, task.clock * task.format.dt)
    start[0] += 0.03 * np.cos(-0.6)  # the hand is 3 cm ahead of the last joint
    start[2] += 0.03 * np.sin(0.6)
    velocity += 0.03 * 2.0 * np.array([np.sin(0.6), 0.0, -np.cos(0.6)])
    np.testing.assert_allclose(outcome(task, plan), flight(start, velocity)[0][:2], atol=1e-5)


def test_a_lob_that_begins_later_lands_elsewhere_and_a_short_plan_never():
    task = Lob()
    plan = task.demonstrations("clean-6-0").plans[0]
    assert abs(outcome(task, later(plan, 3))[0] - outcome(task, plan)[0]) > 0.1
    (rollout,) = task.rollout(plan[None, : task.clock], None)
    assert not rollout.valid


def test_a_ball_in_a_scoop_flies_the_same_whenever_the_swing_begins():
    task = Scoop()
    plan = task.demonstrations("clean-6-0").plans[0]
    np.testing.assert_allclose(outcome(task, later(plan, 7)), outcome(task, plan), atol=2e-3)


def test_a_swing_turned_to_the_left_lands_turned_to_the_left():
    task = Scoop()
    plan = task.demonstrations("clean-6-0").plans[0]
    x, y = outcome(task, plan)
    turned = plan + np.eye(7)[0] * 0.3
    expected = [x * np.cos(0.3) - y * np.sin(0.3), x * np.sin(0.3) + y * np.cos(0.3)]
    np.testing.assert_allclose(outcome(task, turned), expected, atol=1e-9)


def test_a_scoop_that_is_swung_gently_drops_the_ball_as_it_tips():
    task = Scoop()
    plan = task.demonstrations("clean-6-0").plans[0]
    times = np.arange(len(plan))
    slow = CubicSpline(times, plan)(np.linspace(0, times[-1], 6 * len(plan)))
    assert outcome(task, slow)[0] < 0.3
    (rollout,) = task.rollout(np.repeat(plan[:1], 140, axis=0)[None], None)
    assert not rollout.valid  # it lies in the scoop


def test_a_gripper_lets_go_as_it_passes_one_half_and_the_ball_rises_as_high_as_it_must():
    task = GripperThrow()
    plan = circling(task, -0.7, 3.0, 60, at=30.3 * task.format.dt)
    plan[29:, 3] = np.clip([0.24, 0.44, 0.64, *[1.0] * 28], 0, 1)  # one half at frame 30.3
    start, velocity = on_a_circle(-0.7, 3.0, radius=0.65, centre=0.4)
    landed = flight(start, velocity)[0]
    apex = start[2] + velocity[2] ** 2 / (2 * GRAVITY)
    np.testing.assert_allclose(outcome(task, plan), [*landed[:2], apex], atol=1e-5)
    np.testing.assert_allclose(outcome(task, later(plan, 5)), outcome(task, plan), atol=1e-5)


def test_a_gripper_that_stays_shut_keeps_the_ball():
    task = GripperThrow()
    plan = circling(task, -0.7, 3.0, 60, at=0.6)
    (rollout,) = task.rollout(plan[None], None)
    assert not rollout.valid
    np.testing.assert_array_equal(rollout.outcome, np.zeros(3))


@pytest.mark.parametrize("task", [Lob(), Scoop(), GripperThrow()], ids=lambda task: task.name)
def test_repeated_throws_spread_by_less_than_the_tolerance(task):
    plans = np.repeat(task.demonstrations("clean-6-0").plans[:1], 50, axis=0)
    rollouts = task.rollout(plans, np.random.default_rng(0))
    spread = np.linalg.norm(np.std([r.outcome for r in rollouts], axis=0))
    assert 0.05 * task.tolerance < spread < 0.5 * task.tolerance

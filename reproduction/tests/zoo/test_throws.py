"""Known swings land where the formula says; shifts in time matter where a clock decides."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from prior_reinforce.formats import in_tolerances
from reproduction.zoo.physics import GRAVITY, flight
from reproduction.zoo.throws import (
    Arrival,
    Bounce,
    Catapult,
    Drag,
    GripperThrow,
    Hoop,
    Lob,
    Scoop,
)


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


def test_a_ball_that_bounces_lands_where_two_parabolas_end():
    task = Bounce()
    task.bandwidth = None
    plan = circling(task, task.latch, 4.0, 60, at=0.4)
    start, velocity = on_a_circle(task.latch, 4.0, radius=0.6, centre=0.35)
    (first, time) = flight(start, velocity)
    up = task.restitution * (GRAVITY * time - velocity[2])
    second = first[0] + task.slip * velocity[0] * 2 * up / GRAVITY
    np.testing.assert_allclose(outcome(task, plan), [second, 0.0], atol=1e-5)


def test_a_light_ball_falls_shorter_than_a_heavy_one_from_the_same_swing():
    light, heavy = Drag(), Drag()
    heavy.drag = 0.0
    plan = np.zeros((40, 2))
    plan[:, 0] = light.latch + 4.0 * (np.arange(40) * light.format.dt - 0.5)
    start, velocity = on_a_circle(light.latch, 4.0, radius=0.75, centre=0.5)
    assert outcome(heavy, plan)[0] == pytest.approx(flight(start, velocity)[0][0], abs=1e-4)
    assert outcome(light, plan)[0] < 0.9 * outcome(heavy, plan)[0]


def test_a_throw_that_begins_later_lands_in_the_same_place_later():
    task = Arrival()
    plan = circling(task, task.latch, 4.0, 80, at=0.7)
    start, velocity = on_a_circle(task.latch, 4.0, radius=0.45, centre=0.65)
    place, time = flight(start, velocity)
    np.testing.assert_allclose(outcome(task, plan), [place[0], 0.7 + time], atol=1e-5)
    plan = task.demonstrations("clean-6-0").plans[0]
    moved = outcome(task, later(plan, 4)) - outcome(task, plan)
    np.testing.assert_allclose(moved, [0.0, 4 * task.format.dt], atol=1e-6)


def test_a_ball_passes_a_window_where_the_parabola_does():
    task = Hoop()
    plan = circling(task, -0.5, 4.0, 60, at=30 * task.format.dt)
    plan[:, 6] = np.where(np.arange(60) < 29.5, 1.0, 0.0)
    plan[30, 6] = 0.5
    hand = task.arm.hand(plan[:, :6])
    radius, lean = (
        np.hypot(hand[30, 0], hand[30, 2] - 0.16),
        np.arctan2(hand[30, 0], hand[30, 2] - 0.16),
    )
    start, velocity = on_a_circle(lean, 4.0, radius, centre=0.16)
    time = (task.window - start[0]) / velocity[0]
    height = start[2] + velocity[2] * time - GRAVITY * time**2 / 2
    np.testing.assert_allclose(outcome(task, plan), [hand[30, 1], height, time], atol=1e-4)


def test_a_catapult_depends_on_its_draw_and_elevation_at_the_trigger_alone():
    task = Catapult()
    plan = np.zeros((40, 3))
    plan[:, :2] = np.random.default_rng(0).uniform(size=(40, 2))
    plan[19:21, :2] = [0.12, 0.6]
    plan[20:, 2] = 1.0
    speed = task.stiffness * 0.12
    velocity = speed * np.array([np.cos(0.6), 0.0, np.sin(0.6)])
    landed = flight(np.array([0.0, 0.0, task.height]), velocity)[0][0]
    assert outcome(task, plan)[0] == pytest.approx(landed)


@pytest.mark.parametrize(
    "task", [Bounce(), Drag(), GripperThrow(), Hoop(), Catapult()], ids=lambda task: task.name
)
def test_a_throw_without_a_clock_is_the_same_whenever_it_begins(task):
    plan = task.demonstrations("clean-6-0").plans[0]
    np.testing.assert_allclose(outcome(task, later(plan, 3)), outcome(task, plan), atol=2e-4)


@pytest.mark.parametrize(
    "task",
    [Lob(), Scoop(), GripperThrow(), Bounce(), Drag(), Arrival(), Hoop(), Catapult()],
    ids=lambda task: task.name,
)
def test_repeated_throws_spread_by_less_than_the_tolerance(task):
    plans = np.repeat(task.demonstrations("clean-6-0").plans[:1], 50, axis=0)
    rollouts = task.rollout(plans, np.random.default_rng(0))
    spread = np.std([r.outcome for r in rollouts], axis=0)
    assert 0.05 < in_tolerances(spread, task.tolerance) < 0.7

"""SO-101 Shot: its servos by closed forms, and that its demonstrations do what they say."""

import mujoco
import numpy as np
import pytest

from prior_reinforce.arm.robots.limits import match_joints
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.simulation.tasks.so101 import (
    LAG,
    SPEED,
    SO101Shot,
    servo_lag,
    servo_speed,
)


@pytest.fixture(scope="module")
def task():
    return SO101Shot()


def steps(goal, position, lag, n, dt=1e-4):
    for _ in range(n):
        position = position + dt * servo_speed(goal, position, lag)
    return position


def test_a_small_step_is_followed_as_by_a_first_order_lag():
    goal = np.array([0.1])
    assert steps(goal, np.zeros(1), 0.1, 1000) == pytest.approx(0.1 * (1 - np.exp(-1)), rel=1e-3)


def test_a_large_step_is_followed_at_the_servos_speed():
    assert steps(np.array([3.0]), np.zeros(1), 0.1, 1000) == pytest.approx(0.1 * SPEED)


def test_half_the_stiffness_lags_twice_as_much():
    assert servo_lag(16) == pytest.approx(2 * servo_lag(32)) == pytest.approx(0.0674, abs=1e-4)


def test_goals_that_are_sent_ahead_by_the_lag_are_followed_without_any(task):
    speed, position = 1.5, np.zeros(1)
    for k in range(1000):
        position = position + 1e-3 * servo_speed(
            np.array([speed * (k * 1e-3 + LAG)]), position, LAG
        )
    assert position == pytest.approx(speed * 1.0, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["A", "B"])
def test_demonstrations_stay_within_the_servos_speed_and_land_where_they_say(task, name):
    demos = task.demonstrations(name)
    assert demos.n == 6
    assert np.abs(np.diff(demos.plans, axis=1)).max() / task.format.dt < 0.6 * SPEED
    landed = np.array([rollout.outcome for rollout in task.rollout(demos.plans, None)])
    # What was recorded was disturbed as any execution is.
    assert np.linalg.norm(landed - demos.outcomes_seen, axis=1).max() < 0.012


@pytest.mark.slow
def test_repetitions_differ_by_less_than_the_cup_forgives(task):
    plan = task.demonstrations("A").plans[4]
    rollouts = task.rollout(np.repeat(plan[None], 12, axis=0), np.random.default_rng(0))
    assert all(rollout.valid for rollout in rollouts)
    spread = np.array([rollout.outcome for rollout in rollouts]).std(axis=0)
    assert 0.0005 < spread.max() < task.tolerance / 2


def test_an_arm_that_stays_where_it_is_throws_nothing(task):
    plan = np.repeat(task.demonstrations("A").plans[0, :1], 20, axis=0)
    (rollout,) = task.rollout(plan[None], None)
    assert not rollout.valid


def test_the_model_turns_as_far_as_the_limits_say(task):
    limits = robot_limits("so101")
    columns = match_joints(task.format, limits)
    assert len(columns) == 5
    for joint in range(4):
        assert task.model.jnt_range[joint][1] <= limits.upper[joint] + 0.05


def test_zero_is_the_middle_of_the_published_arm(task):
    """Tip in the base's frame, from so101_new_calib.xml at zero, moved by the base's offset."""
    data = mujoco.MjData(task.model)
    mujoco.mj_kinematics(task.model, data)
    expected = [0.3914 - 0.03884, -0.0002, 0.2265]
    assert data.site("arm/gripper").xpos == pytest.approx(expected, abs=4e-4)

"""What all tasks on the simulated Panda share: its limits, and batches of rollouts."""

import numpy as np
import pytest

from prior_reinforce.bench.robots.presets import robot_limits
from prior_reinforce.lab.tasks import TASKS, make_task, panda
from prior_reinforce.lab.tasks.curling import Curling
from prior_reinforce.lab.tasks.panda_task import first_descent

PANDA = robot_limits("panda")
WAYS = {"curling-round": 2}


def final_states(rollouts):
    return np.array([rollout.key_frame.state for rollout in rollouts])


@pytest.mark.slow
def test_batches_draw_their_disturbances_one_after_another():
    task = Curling()
    plans = np.resize(task.demonstrations("A").plans[:, :2], (Curling.batch + 1, 2, 7))
    together = task.rollout(plans, np.random.default_rng(3))
    rng = np.random.default_rng(3)
    apart = [
        rollout
        for first in range(0, len(plans), Curling.batch)
        for rollout in task.rollout(plans[first : first + Curling.batch], rng)
    ]
    assert len(together) == len(plans)
    np.testing.assert_array_equal(final_states(together), final_states(apart))
    assert len(np.unique(final_states(together)[:, 0])) == len(plans)


@pytest.mark.parametrize(
    "name", [name for name in TASKS.members if "zoo" not in name and name != "so101"]
)
def test_demonstrations_leave_a_tenth_of_the_arms_limits_at_1_khz_and_rest_at_both_ends(name):
    task = make_task(name)
    for name in task.demonstration_sets:
        plans = task.demonstrations(name).plans
        assert 6 <= len(plans) / WAYS.get(task.name, 1) <= 8
        n_steps = round(plans.shape[1] * task.format.dt / panda.STEP) + 50
        joints = task.joint_plans(plans)
        position, velocity = panda.setpoints(joints, task.format.dt, n_steps)
        acceleration = np.diff(velocity, axis=1) / panda.STEP
        jerk = np.diff(acceleration, axis=1) / panda.STEP
        assert np.all((position > PANDA.lower) & (position < PANDA.upper))
        assert np.all(np.abs(velocity) < 0.9 * PANDA.velocity)
        assert np.all(np.abs(acceleration) < 0.9 * PANDA.acceleration)
        assert np.all(np.abs(jerk) < 0.9 * PANDA.jerk)
        np.testing.assert_allclose(np.diff(plans[:, :2], axis=1), 0.0, atol=1e-4)
        np.testing.assert_allclose(np.diff(plans[:, -2:], axis=1), 0.0, atol=1e-4)


def test_the_first_descent_is_interpolated_by_hand():
    heights = [0.05, 0.30, 0.20, 0.12, 0.06, 0.30, 0.0]
    path = np.column_stack([np.arange(7.0), 2 * np.arange(7.0), heights])
    row, part, place = first_descent(path, 0.10)
    assert row == 3
    assert part == pytest.approx(1 / 3)
    np.testing.assert_allclose(place, [3 + 1 / 3, 6 + 2 / 3])
    assert first_descent(path[:4], 0.10) is None

"""What all tasks on the simulated Panda share: its limits, and batches of rollouts."""

import numpy as np
import pytest

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.plans.kinematics import tool_tip
from prior_reinforce.simulation.tasks import TASKS, make_task, panda
from prior_reinforce.simulation.tasks.curling import Curling
from prior_reinforce.simulation.tasks.panda_task import first_descent

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


@pytest.mark.parametrize(
    ("name", "within"),
    [
        ("basketball-v1", 0.02),
        ("basketball-v3", 0.02),
        ("so101", 0.02),
        ("curling", 1.0),  # other joints drive the same push, and lag otherwise
        ("fishing", 0.4),
    ],
)
def test_a_moved_demonstration_lands_where_the_symmetry_says(name, within):
    task = make_task(name)
    demos = task.demonstrations("A").only([0, 3])
    symmetry = demos.symmetry
    true = np.array([rollout.outcome for rollout in task.rollout(demos.plans, None)])
    z = symmetry.chart.to(true)
    for component in np.flatnonzero(symmetry.exact):
        w = (0.3 if symmetry.name != "shift" else 0.1) * np.eye(symmetry.k)[component]
        moved = task.rollout([symmetry.move(plan, w) for plan in demos.plans], None)
        expected = symmetry.chart.back(z + w)
        off = [np.linalg.norm(r.outcome - to) for r, to in zip(moved, expected, strict=True)]
        assert max(off) < within * task.tolerance


@pytest.mark.parametrize("name", ["basketball-v1", "so101", "curling"])
def test_a_faster_motion_carries_farther_by_about_the_nominal_law(name):
    task = make_task(name)
    demos = task.demonstrations("A").only([0, 3])
    symmetry = demos.symmetry
    for w in (-0.1, 0.1):
        moved = [symmetry.move(plan, np.array([w, 0.0])) for plan in demos.plans]
        for plan, before in zip(moved, task.rollout(demos.plans, None), strict=True):
            (after,) = task.rollout(plan[None], None)
            went = symmetry.chart.to(after.outcome) - symmetry.chart.to(before.outcome)
            assert 0.5 < went[0] / w < 1.5
            assert abs(went[1]) < 0.03


def test_the_chain_of_a_scene_is_the_published_one():
    task = Curling()
    chain, published = panda.chain_of(task.model), PANDA.chain
    q = np.random.default_rng(4).uniform(-1.0, 1.0, (5, 7))
    flange = (0.0, 0.0, 0.107)
    np.testing.assert_allclose(tool_tip(chain, q, flange), tool_tip(published, q), atol=1e-9)

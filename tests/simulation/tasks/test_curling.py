"""Curling: friction's law, direction, repeatability, smoothness, loss, film, sets."""

import mujoco
import numpy as np
import pytest

from prior_reinforce.simulation.tasks import panda
from prior_reinforce.simulation.tasks.curling import (
    FRICTION,
    STONE_RADIUS,
    STONE_START,
    TARGET_BEHIND,
    Curling,
)
from prior_reinforce.simulation.tasks.inverse_kinematics import joint_paths
from prior_reinforce.simulation.tasks.panda_task import Disturbances
from reproduction.demonstrations import curling as making

GRAVITY = 9.81


@pytest.fixture(scope="module")
def task() -> Curling:
    return Curling()


def pushes(
    headings: list[float], speed: float = 0.9, start: float = 0.3, gap: float = 0.02
) -> np.ndarray:
    dt = Curling.format.dt
    poses = [
        making.push(heading, speed, start, making.STROKE_TIME, gap, 0.0, 0.0, dt)
        for heading in headings
    ]
    return joint_paths(np.array(poses), dt)


def outcomes(rollouts) -> np.ndarray:
    return np.array([rollout.outcome for rollout in rollouts])


def test_the_scene_has_the_documented_constants(task):
    model = task.model
    np.testing.assert_array_equal(model.body("stone").pos[:2], STONE_START)
    assert model.geom("stone").size[0] == model.geom("target").size[0] == STONE_RADIUS
    np.testing.assert_array_equal(model.body("target").pos[:2], [TARGET_BEHIND, 0.0])
    assert task.scene.goal_offset == (-TARGET_BEHIND, 0.0)
    assert set(model.geom_friction[task._feet, 0]) == {FRICTION}
    assert model.geom("tool/bar").size[0] == making.BAR_RADIUS
    np.testing.assert_allclose(model.site("tool/bar").pos, [0, 0, making.HANDLE])


@pytest.mark.parametrize("speed", [0.4, 0.8, 1.2])
def test_a_sliding_stone_stops_after_v_squared_over_two_mu_g(task, speed):
    data = mujoco.MjData(task.model)
    stone = task.model.joint("stone")
    for _ in range(100):  # let it settle on its feet
        mujoco.mj_step(task.model, data)
    data.qpos[stone.qposadr[0] : stone.qposadr[0] + 2] = [0.5, -0.1]
    heading = np.array([0.8, 0.6])
    data.qvel[stone.dofadr[0] : stone.dofadr[0] + 2] = speed * heading
    for _ in range(round(speed / (FRICTION * GRAVITY) / panda.STEP) + 200):
        mujoco.mj_step(task.model, data)
    moved = data.qpos[stone.qposadr[0] : stone.qposadr[0] + 2] - [0.5, -0.1]
    expected = speed**2 / (2 * FRICTION * GRAVITY)
    np.testing.assert_allclose(moved, expected * heading, rtol=0.01, atol=5e-4)


def test_heading_decides_direction_and_left_mirrors_right(task):
    headings = [0.0, 0.25, -0.25]
    ways = outcomes(task.rollout(pushes(headings), None)) - STONE_START
    np.testing.assert_allclose(np.arctan2(ways[:, 1], ways[:, 0]), headings, atol=0.01)
    np.testing.assert_allclose(ways[1], ways[2] * [1, -1], atol=5e-3)


def test_starting_later_changes_nothing(task):
    soon, late = pushes([0.1], start=0.1), pushes([0.1], start=0.1 + 40 * Curling.format.dt)
    first, second = outcomes(task.rollout(np.concatenate([soon, late]), None))
    np.testing.assert_allclose(first, second, atol=1e-3)


def test_an_untouched_stone_rests_at_its_start_and_one_off_the_table_is_lost(task):
    still = np.repeat(pushes([0.0])[:, :1], 140, axis=1)
    (rollout,) = task.rollout(still, None)
    assert rollout.valid
    np.testing.assert_allclose(rollout.outcome, STONE_START, atol=1e-4)
    slippery = Curling()
    slippery.model.geom_friction[slippery._feet, 0] = 0.01
    (rollout,) = slippery.rollout(pushes([0.0], speed=1.1), None)
    assert not rollout.valid
    np.testing.assert_array_equal(rollout.outcome, [0.0, 0.0])


def test_a_stone_that_goes_too_far_is_stopped_by_the_target(task):
    """As in the film: the target stands, and an overshooting stone stays before it."""
    plan = pushes([0.0])
    (free,) = task.rollout(plan, None)
    models, states, controls = task._prepare(plan, None)
    data = mujoco.MjData(models[0])
    mujoco.mj_setState(models[0], data, states[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    data.mocap_pos[0] = [free.outcome[0] - 0.06, 0.0, 0.0]
    for control in controls[0]:
        data.ctrl[:] = control
        mujoco.mj_step(models[0], data)
    gap = data.body("target").xpos[0] - data.body("stone").xpos[0]
    assert gap > 2 * STONE_RADIUS - 1e-3
    assert data.body("stone").xpos[0] < free.outcome[0] - 0.03


def test_demonstrations_start_over_a_third_of_the_horizon(task):
    for name in task.demonstration_sets:
        plans = task.demonstrations(name).plans
        speed = np.diff(plans[:, :, 5], axis=1) ** 2  # squared, or the tremor counts
        middle = (speed * np.arange(speed.shape[1])).sum(axis=1) / speed.sum(axis=1)
        assert np.ptp(middle) == pytest.approx(plans.shape[1] / 3, rel=0.15)


@pytest.mark.slow
def test_a_repeated_plan_stops_within_about_half_a_centimetre(task):
    plans = np.repeat(pushes([0.1]), 64, axis=0)
    spread = outcomes(task.rollout(plans, np.random.default_rng(0))).std(axis=0)
    assert np.all((spread > 0.0005) & (spread < 0.006))
    quiet = Curling(Disturbances(pose=0.0, servo=0.0, scene=0.0, start=0.0))
    stopped = outcomes(quiet.rollout(plans[:4], np.random.default_rng(0)))
    np.testing.assert_array_equal(stopped, np.repeat(stopped[:1], 4, axis=0))


@pytest.mark.slow
def test_distance_grows_smoothly_with_speed(task):
    plans = np.concatenate([pushes([0.15], speed=value) for value in np.linspace(0.66, 1.1, 17)])
    rollouts = task.rollout(plans, None)
    assert all(rollout.valid for rollout in rollouts)
    distance = np.linalg.norm(outcomes(rollouts) - STONE_START, axis=1)
    steps = np.diff(distance)
    assert np.all((steps > 0.008) & (steps < 0.04))
    low, high = task.region - STONE_START
    assert distance[0] < low[0]
    assert distance[-1] > np.hypot(*high)


@pytest.mark.slow
def test_film_has_the_asked_pictures_with_the_target_in_them(task):
    plan = task.demonstrations("A").plans[0]
    here, there = (
        list(task.film(plan, np.array(goal), width=160, height=120, frames_per_second=2))
        for goal in ([0.9, 0.1], [0.8, -0.1])
    )
    assert len(here) == 7
    assert here[0].shape == (120, 160, 3)
    assert not np.array_equal(here[0], there[0])
    assert not np.array_equal(here[0], here[-1])

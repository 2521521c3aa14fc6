"""Fishing: the rope's physics, the touch, repeatability, smoothness, loss, regeneration."""

import mujoco
import numpy as np
import pytest

from prior_reinforce.simulation.tasks import panda
from prior_reinforce.simulation.tasks.fishing import HOOK_RADIUS, TABLE, Fishing
from prior_reinforce.simulation.tasks.panda_task import Disturbances
from reproduction.demonstrations import fishing as making

GRAVITY = 9.81


@pytest.fixture(scope="module")
def task() -> Fishing:
    return Fishing()


def casts(azimuths: list[float], reach: float = 0.4, start: float = 0.3) -> np.ndarray:
    hand = np.stack([making.READY, making.RAISED, making.CAST])
    hand[:, 0] += reach * making.FURTHER
    durations = np.array([making.RAISE_TIME, making.CAST_TIME])
    even = np.zeros(1)  # pace
    return np.array(
        [making.cast(az, hand, start, durations, Fishing.format.dt, even) for az in azimuths]
    )


def outcomes(rollouts) -> np.ndarray:
    return np.array([rollout.outcome for rollout in rollouts])


def started(task: Fishing, plans: np.ndarray) -> tuple[mujoco.MjData, np.ndarray]:
    _, states, controls = task._prepare(plans, None)
    data = mujoco.MjData(task.model)
    mujoco.mj_setState(task.model, data, states[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    mujoco.mj_forward(task.model, data)
    return data, controls[0]


def test_rope_and_table_have_the_documented_constants(task):
    model = task.model
    bends = task._bends
    assert len(bends) + 1 == 14  # segments, the first on the swivel
    np.testing.assert_allclose(model.jnt_stiffness[bends] * 0.025, 1e-5)  # EI = k * length
    assert np.all(model.dof_damping[model.jnt_dofadr[bends]] > 0)
    assert model.geom("tool/hook").size[0] == HOOK_RADIUS
    table = model.geom("table")
    np.testing.assert_allclose(
        [table.pos[:2] - table.size[:2], table.pos[:2] + table.size[:2]], TABLE
    )
    assert table.pos[2] + table.size[2] == 0.0


def test_the_rope_starts_settled(task):
    data, controls = started(task, np.repeat(casts([0.1])[:, :1], 140, axis=1))
    tip, hook = (data.sensor(f"tool/{name}").data.copy() for name in ("tip", "hook"))
    np.testing.assert_allclose(hook - tip, [0, 0, -(14 * 0.025 + HOOK_RADIUS)], atol=1e-9)
    for control in controls[:1000]:
        data.ctrl[:] = control
        mujoco.mj_step(task.model, data)
    mujoco.mj_forward(task.model, data)
    np.testing.assert_allclose(data.sensor("tool/hook").data, hook, atol=5e-4)


def test_a_swinging_rope_has_a_pendulums_period(task):
    """Rope as a thin rod of mass m, hook as a point M: T = 2 pi sqrt(I / (M d + m L / 2) g)."""
    quiet = Fishing()
    data, controls = started(quiet, np.repeat(casts([0.0])[:, :1], 140, axis=1))
    tip = data.sensor("tool/tip").data.copy()
    turn = np.array([np.cos(0.02), 0.0, np.sin(0.02), 0.0])
    swivel = data.qpos[quiet._swivel : quiet._swivel + 4]
    mujoco.mju_mulQuat(swivel, swivel.copy(), turn)
    swing = []
    for control in controls[:2500]:
        data.ctrl[:] = control
        mujoco.mj_step(quiet.model, data)
        swing.append(data.sensor("tool/hook").data[0] - data.sensor("tool/tip").data[0])
    crossings = np.flatnonzero(np.diff(np.sign(np.array(swing))))
    period = 2 * np.mean(np.diff(crossings)) * panda.STEP
    length, rope, hook = 14 * 0.025, 14 * 0.00015, 0.008
    centre = length + HOOK_RADIUS
    inertia = rope * length**2 / 3 + hook * (centre**2 + 0.4 * HOOK_RADIUS**2)
    expected = 2 * np.pi * np.sqrt(inertia / (GRAVITY * (rope * length / 2 + hook * centre)))
    assert tip[2] > centre
    assert period == pytest.approx(expected, rel=0.02)


def test_the_outcome_is_where_hook_and_table_first_touch(task):
    plans = casts([0.1])
    (rollout,) = task.rollout(plans, None)
    data, controls = started(task, plans)
    hook, table = task.model.geom("tool/hook").id, task.model.geom("table").id
    step = 0
    for control in controls:
        pairs = [set(contact.geom.tolist()) for contact in data.contact[: data.ncon]]
        if {hook, table} in pairs:
            break
        data.ctrl[:] = control
        mujoco.mj_step(task.model, data)
        step += 1
    np.testing.assert_allclose(data.geom("tool/hook").xpos[:2], rollout.outcome, atol=4e-3)
    assert rollout.key_frame.time == pytest.approx(step * panda.STEP - task.lead_in, abs=3e-3)
    assert rollout.valid


def test_the_cast_is_symmetric_about_the_base_axis(task):
    straight, left, right = outcomes(task.rollout(casts([0.0, 0.2, -0.2]), None))
    radius = np.hypot(*straight)
    for turned, angle in ((left, 0.2), (right, -0.2)):
        expected = radius * np.array([np.cos(angle), np.sin(angle)])
        np.testing.assert_allclose(turned, expected, atol=3e-3)


def test_a_hook_that_never_touches_is_lost(task):
    (rollout,) = task.rollout(np.repeat(casts([0.0])[:, :1], 140, axis=1), None)
    assert not rollout.valid
    np.testing.assert_array_equal(rollout.outcome, [0.0, 0.0])


def test_demonstrations_start_over_a_third_of_the_horizon(task):
    for name in task.demonstration_sets:
        plans = task.demonstrations(name).plans
        speed = np.diff(plans[:, :, 2], axis=1) ** 2  # squared, or the tremor counts
        middle = (speed * np.arange(speed.shape[1])).sum(axis=1) / speed.sum(axis=1)
        assert np.ptp(middle) == pytest.approx(plans.shape[1] / 3, rel=0.15)


@pytest.mark.slow
def test_a_repeated_plan_lands_within_about_three_millimetres(task):
    plans = np.repeat(casts([0.1]), 16, axis=0)
    spread = outcomes(task.rollout(plans, np.random.default_rng(0))).std(axis=0)
    assert np.all((spread > 0.001) & (spread < 0.0045))
    quiet = Fishing(Disturbances(pose=0.0, servo=0.0, scene=0.0, start=0.0))
    landed = outcomes(quiet.rollout(plans[:2], np.random.default_rng(0)))
    np.testing.assert_array_equal(landed[0], landed[1])


@pytest.mark.slow
def test_reach_moves_the_touch_smoothly_through_the_region(task):
    plans = np.concatenate([casts([0.1], reach=value) for value in np.linspace(-0.4, 1.3, 14)])
    rollouts = task.rollout(plans, None)
    assert all(rollout.valid for rollout in rollouts)
    distance = np.linalg.norm(outcomes(rollouts), axis=1)
    assert np.all((np.diff(distance) > 0.01) & (np.diff(distance) < 0.035))
    low, high = task.region
    assert distance[0] < low[0] + 0.005
    assert distance[-1] > np.hypot(*high)


@pytest.mark.slow
def test_film_has_the_asked_pictures(task):
    plan = task.demonstrations("A").plans[0]
    frames = list(task.film(plan, np.array([0.9, 0.1]), width=160, height=120, frames_per_second=2))
    assert len(frames) == 7
    assert not np.array_equal(frames[0], frames[3])

"""What every task promises (tasks/base.py), checked on its own shipped demonstrations."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, InvalidPlanError
from prior_reinforce.tasks import TASKS, make_task
from prior_reinforce.tasks.base import Task


@pytest.fixture(scope="module", params=TASKS.members)
def task(request: pytest.FixtureRequest) -> Task:
    return make_task(request.param)


def test_a_task_knows_its_name(task, request):
    assert task.name == request.node.callspec.params["task"]


@pytest.fixture(scope="module")
def plans(task: Task) -> np.ndarray:
    return task.demonstrations("A").plans[:3]


def outcomes(rollouts) -> np.ndarray:
    return np.array([rollout.outcome for rollout in rollouts])


def test_the_same_seed_gives_the_same_outcomes_and_another_seed_others(task, plans):
    first = outcomes(task.rollout(plans, np.random.default_rng(3)))
    again = outcomes(task.rollout(plans, np.random.default_rng(3)))
    other = outcomes(task.rollout(plans, np.random.default_rng(4)))
    np.testing.assert_array_equal(first, again)
    assert np.all(np.any(first != other, axis=1))


def test_without_disturbances_a_plan_has_one_outcome_whatever_its_batch(task, plans):
    batch = outcomes(task.rollout(plans, None))
    single = outcomes([task.rollout(plan[None], None)[0] for plan in plans])
    np.testing.assert_array_equal(batch, single)


def test_outcomes_have_k_finite_components_and_key_frames_fit_the_model(task, plans):
    for rollout in task.rollout(plans, np.random.default_rng(0)):
        assert rollout.outcome.shape == (len(task.outcome_names),)
        assert np.all(np.isfinite(rollout.outcome))
        assert rollout.valid
        assert rollout.key_frame is not None
        assert rollout.key_frame.state.shape == (rollout.key_frame.model.nq,)
        assert np.isfinite(rollout.key_frame.time)


def test_a_motionless_arm_gives_a_finite_outcome_outside_the_region(task, plans):
    still = np.repeat(plans[:1, :1], plans.shape[1], axis=1)
    (rollout,) = task.rollout(still, np.random.default_rng(0))
    assert np.all(np.isfinite(rollout.outcome))
    low, high = task.region
    assert np.any((rollout.outcome < low) | (rollout.outcome > high))


def test_inputs_are_neither_changed_nor_kept(task, plans):
    mine = plans[:1].copy()
    (rollout,) = task.rollout(mine, None)
    np.testing.assert_array_equal(mine, plans[:1])
    rollout.outcome[:] = -1.0
    mine[:] = 0.0
    (again,) = task.rollout(plans[:1], None)
    assert np.all(again.outcome != -1.0)


@pytest.mark.parametrize("bad", ["shape", "nan"])
def test_bad_plans_are_refused_by_name(task, plans, bad):
    broken = (
        plans[:, :, :-1] if bad == "shape" else np.where(plans == plans[0, 0, 0], np.nan, plans)
    )
    with pytest.raises(InvalidPlanError):
        task.rollout(broken, None)


def test_goals_fill_the_region_and_stay_in_it(task):
    goals = task.sample_goals(2000, np.random.default_rng(0))
    low, high = task.region
    assert np.all((goals >= low) & (goals <= high))
    np.testing.assert_allclose(goals.min(axis=0), low, atol=0.01 * (high - low).max())
    np.testing.assert_allclose(goals.max(axis=0), high, atol=0.01 * (high - low).max())


def test_demonstrations_fit_the_task_and_surround_most_of_its_region(task):
    for name in task.demonstration_sets:
        demonstrations = task.demonstrations(name)
        assert demonstrations.format == task.format
        low, high = task.region
        seen = demonstrations.outcomes_seen
        assert np.all(np.ptp(seen, axis=0) >= 0.8 * (high - low))


def test_an_unknown_demonstration_set_is_named(task):
    with pytest.raises(ConfigurationError, match="'Z'"):
        task.demonstrations("Z")


def test_the_scene_has_the_goal_and_both_cameras(task, plans):
    model = task.rollout(plans[:1], None)[0].key_frame.model
    assert model.body("goal").mocapid[0] >= 0
    assert {model.cam(i).name for i in range(model.ncam)} >= {"birdseye", "film"}

"""What every task keeps to, checked on its own shipped demonstrations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.errors import ConfigurationError, InvalidPlanError


class TaskContract:
    """Inherit it, and name the task: `make = staticmethod(Toss)`."""

    make: Callable[[], Task]
    """Makes the task; called once."""

    @pytest.fixture(scope="class")
    @classmethod
    def task(cls) -> Task:
        """The task, made once for all tests, as a scene may take a while to load."""
        return cls.make()

    @pytest.fixture(scope="class")
    @classmethod
    def plans(cls, task: Task) -> Plans:
        """A few of its demonstrations."""
        return task.demonstrations(task.demonstration_sets[0]).plans[:3]

    def test_the_same_seed_gives_the_same_outcomes_and_another_seed_others(
        self, task: Task, plans: Plans
    ) -> None:
        first, again, other = (
            _outcomes(task.rollout(plans, np.random.default_rng(seed))) for seed in (3, 3, 4)
        )
        np.testing.assert_array_equal(first, again)
        assert np.all(np.any(first != other, axis=1))

    def test_without_disturbances_a_plan_has_one_outcome_whatever_its_batch(
        self, task: Task, plans: Plans
    ) -> None:
        batch = _outcomes(task.rollout(plans, None))
        single = _outcomes([task.rollout(plan[None], None)[0] for plan in plans])
        np.testing.assert_array_equal(batch, single)

    def test_outcomes_have_k_finite_components(self, task: Task, plans: Plans) -> None:
        for rollout in task.rollout(plans, np.random.default_rng(0)):
            assert rollout.outcome.shape == (len(task.outcome_names),)
            assert np.all(np.isfinite(rollout.outcome))
            assert rollout.valid

    def test_a_motionless_arm_gives_a_finite_outcome_outside_the_region(
        self, task: Task, plans: Plans
    ) -> None:
        still = np.repeat(plans[:1, :1], plans.shape[1], axis=1)
        (rollout,) = task.rollout(still, np.random.default_rng(0))
        assert np.all(np.isfinite(rollout.outcome))
        low, high = task.region
        assert np.any((rollout.outcome < low) | (rollout.outcome > high))

    def test_inputs_are_neither_changed_nor_kept(self, task: Task, plans: Plans) -> None:
        mine = plans[:1].copy()
        (rollout,) = task.rollout(mine, None)
        np.testing.assert_array_equal(mine, plans[:1])
        rollout.outcome[:] = -1.0
        mine[:] = 0.0
        (again,) = task.rollout(plans[:1], None)
        assert np.all(again.outcome != -1.0)

    @pytest.mark.parametrize("bad", ["shape", "nan"])
    def test_bad_plans_are_refused_by_name(self, task: Task, plans: Plans, bad: str) -> None:
        broken = (
            plans[:, :, :-1] if bad == "shape" else np.where(plans == plans[0, 0, 0], np.nan, plans)
        )
        with pytest.raises(InvalidPlanError):
            task.rollout(broken, None)

    def test_goals_fill_the_region_and_stay_in_it(self, task: Task) -> None:
        goals = task.sample_goals(2000, np.random.default_rng(0))
        low, high = task.region
        assert np.all((goals >= low) & (goals <= high))
        np.testing.assert_allclose(goals.min(axis=0), low, atol=0.01 * (high - low).max())
        np.testing.assert_allclose(goals.max(axis=0), high, atol=0.01 * (high - low).max())

    def test_demonstrations_fit_the_task_and_surround_most_of_its_region(self, task: Task) -> None:
        for name in task.demonstration_sets:
            demonstrations = task.demonstrations(name)
            assert demonstrations.format == task.format
            low, high = task.region
            assert np.all(np.ptp(demonstrations.outcomes_seen, axis=0) >= 0.8 * (high - low))

    def test_an_unknown_demonstration_set_is_named(self, task: Task) -> None:
        with pytest.raises(ConfigurationError, match="'Z'"):
            task.demonstrations("Z")

    def test_key_frames_fit_the_model(self, task: Task, plans: Plans) -> None:
        _need_scene(task)
        for rollout in task.rollout(plans, np.random.default_rng(0)):
            assert rollout.key_frame is not None
            assert rollout.key_frame.state.shape == (rollout.key_frame.model.nq,)
            assert np.isfinite(rollout.key_frame.time)

    def test_the_scene_has_the_goal_and_both_cameras(self, task: Task, plans: Plans) -> None:
        _need_scene(task)
        key_frame = task.rollout(plans[:1], None)[0].key_frame
        assert key_frame is not None
        model = key_frame.model
        assert model.body("goal").mocapid[0] >= 0
        assert {model.cam(i).name for i in range(model.ncam)} >= {"birdseye", "film"}


def _outcomes(rollouts: list[Rollout]) -> Points:
    return np.array([rollout.outcome for rollout in rollouts])


def _need_scene(task: Task) -> None:
    if task.scene is None:
        pytest.skip("the task says nothing of a scene for a camera")

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
        assert np.array_equal(first, again), "the same seed gives the same outcomes, bit for bit"
        assert np.all(np.any(first != other, axis=1)), (
            "another seed disturbs every outcome otherwise; draw disturbances from the rng"
        )

    def test_without_disturbances_a_plan_has_one_outcome_whatever_its_batch(
        self, task: Task, plans: Plans
    ) -> None:
        batch = _outcomes(task.rollout(plans, None))
        single = _outcomes([task.rollout(plan[None], None)[0] for plan in plans])
        same = np.array_equal(batch, single)
        assert same, "with rng None, a plan has one outcome, whichever plans it is run with"

    def test_outcomes_have_k_finite_components(self, task: Task, plans: Plans) -> None:
        for rollout in task.rollout(plans, np.random.default_rng(0)):
            k = task.outcome_format.outcome_dim
            assert rollout.outcome.shape == (k,), f"an outcome has k = {k} components, as named"
            assert np.all(np.isfinite(rollout.outcome)), "every outcome is finite"
            assert rollout.valid, "demonstrated plans have valid outcomes"

    def test_a_motionless_arm_gives_a_finite_outcome_outside_the_region(
        self, task: Task, plans: Plans
    ) -> None:
        still = np.repeat(plans[:1, :1], plans.shape[1], axis=1)
        (rollout,) = task.rollout(still, np.random.default_rng(0))
        outcome = rollout.outcome
        assert np.all(np.isfinite(outcome)), "an arm that stays still has a finite outcome, too"
        low, high = task.region
        assert np.any((outcome < low) | (outcome > high)), (
            f"an arm that stays still reaches {outcome}, within the region {low} to {high}"
        )

    def test_inputs_are_neither_changed_nor_kept(self, task: Task, plans: Plans) -> None:
        mine = plans[:1].copy()
        (rollout,) = task.rollout(mine, None)
        assert np.array_equal(mine, plans[:1]), "rollout leaves its plans as they were"
        rollout.outcome[:] = -1.0
        mine[:] = 0.0
        (again,) = task.rollout(plans[:1], None)
        assert np.all(again.outcome != -1.0), "rollout returns a fresh outcome each time"

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
        assert np.all((goals >= low) & (goals <= high)), "every goal lies in the region"
        ends, near = np.array([goals.min(axis=0), goals.max(axis=0)]), 0.01 * (high - low).max()
        fill = np.all(np.abs(ends - task.region) < near)
        assert fill, f"2000 goals fill the region {low} to {high}, and they lie in {ends.tolist()}"

    def test_demonstrations_fit_the_task_and_surround_most_of_its_region(self, task: Task) -> None:
        for name in task.demonstration_sets:
            demonstrations = task.demonstrations(name)
            assert demonstrations.format == task.format, "demonstrations have the task's format"
            low, high = task.region
            extent = np.ptp(demonstrations.outcomes_seen, axis=0)
            assert np.all(extent >= 0.8 * (high - low)), (
                f"demonstrations {name} extend over {extent}, less than 80 % of the region's "
                f"{high - low}"
            )

    def test_an_unknown_demonstration_set_is_named(self, task: Task) -> None:
        with pytest.raises(ConfigurationError, match="'Z'"):
            task.demonstrations("Z")

    def test_key_frames_fit_the_model(self, task: Task, plans: Plans) -> None:
        _need_scene(task)
        for rollout in task.rollout(plans, np.random.default_rng(0)):
            frame = rollout.key_frame
            assert frame is not None, "a task with a scene gives each rollout a key frame"
            assert frame.state.shape == (frame.model.nq,), "a key frame's state is the model's qpos"
            assert np.isfinite(frame.time), "a key frame's time is finite"

    def test_the_scene_has_the_goal_and_both_cameras(self, task: Task, plans: Plans) -> None:
        _need_scene(task)
        key_frame = task.rollout(plans[:1], None)[0].key_frame
        assert key_frame is not None, "a task with a scene gives each rollout a key frame"
        model = key_frame.model
        assert model.body("goal").mocapid[0] >= 0, "the scene's body `goal` is a mocap body"
        cameras = {model.cam(i).name for i in range(model.ncam)}
        assert cameras >= {"birdseye", "film"}, f"the scene has {cameras}; a camera is missing"


def _outcomes(rollouts: list[Rollout]) -> Points:
    return np.array([rollout.outcome for rollout in rollouts])


def _need_scene(task: Task) -> None:
    if task.scene is None:
        pytest.skip("the task says nothing of a scene for a camera")

import numpy as np
import pytest

from prior_reinforce.errors import RenderingUnavailableError
from prior_reinforce.simulation.tasks import make_task
from reproduction.following import follow
from reproduction.zoo.pushes import Slide


def test_a_task_without_a_scene_says_that_it_has_no_pictures():
    task = make_task("zoo-lob")
    with pytest.raises(RenderingUnavailableError, match="zoo-lob has no pictures"):
        task.film(np.zeros((75, 7)), np.zeros(2))


def test_disturbances_of_zero_are_the_undisturbed_execution():
    task = make_task("zoo-scoop")
    plan = task.demonstrations("clean-6-0").plans[0]
    np.testing.assert_array_equal(task.execute(plan), task.execute(plan, np.zeros(7 + 1)))


@pytest.mark.parametrize("task", ["zoo-swing", "zoo-lob", "zoo-drag", "zoo-slide", "zoo-strike"])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_a_wild_plan_throws_out_of_the_world_is_lost(task):
    made = make_task(task)
    plans = made.demonstrations("clean-6-0").plans
    wild = plans.mean(axis=0) + 1e4 * (plans - plans.mean(axis=0))
    for rollout in made.rollout(wild, None):
        assert np.all(np.abs(rollout.outcome) <= 100)
        assert rollout.valid or not rollout.outcome.any()


def test_servos_follow_the_plan_and_then_come_to_rest_in_its_last_frame():
    seen = []

    class Spy(Slide):
        def _execute(self, plan, disturbed):
            seen.append(plan)

    plan = np.linspace(0.0, 0.3, 60)[:, None]
    Spy().execute(plan)
    held = np.concatenate([plan, np.tile(plan[-1:], (15, 1))])
    np.testing.assert_array_equal(seen[0], follow(held, Slide.format.dt, Slide.bandwidth))
    assert seen[0][-1, 0] == pytest.approx(0.3, abs=1e-4)

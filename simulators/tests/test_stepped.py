"""A task that is stepped from outside ends where its rollout does."""

import numpy as np
import pytest

from prior_reinforce.plans.interpolation import interpolate
from prior_reinforce.simulation.tasks import make_task
from simulators.stepped import SteppedTask


@pytest.mark.parametrize("name", ["basketball-fr3", "basketball-v1"])
def test_set_points_of_a_plan_give_its_rollout(name):
    task = make_task(name)
    plan = task.demonstrations("A").plans[1]
    stepped = SteppedTask(task, plan[0])
    assert stepped.q == pytest.approx(plan[0], abs=2e-3)  # the ball weighs on the servo
    for _ in range(2):
        stepped.begin()
        for target in interpolate(plan, task.format.dt, hold_after=task.lead_out).q:
            stepped.step(target)
        rollout = stepped.end()
        assert rollout.valid
        assert rollout.outcome == pytest.approx(task.rollout(plan[None], None)[0].outcome, abs=1e-4)
        assert np.abs(stepped.dq).max() < 1e-3
        stepped.load(plan[0])


def test_a_set_point_that_follows_on_none_is_no_jump():
    task = make_task("basketball-fr3")
    start = task.demonstrations("A").plans[0, 0]
    stepped = SteppedTask(task, start)
    stepped.hold(start + 1e-3)
    stepped.step(start + 1e-3)
    assert np.abs(stepped.dq).max() < 0.05

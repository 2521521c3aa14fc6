import numpy as np

from prior_reinforce.adapters.frozen import FrozenAdapter
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat


def observe(adapter, condition, outcome):
    """Take in a trial by its outcome: seen from a goal at 0, that is the error."""
    adapter.observe(condition, np.zeros(len(outcome)), outcome)


def test_the_condition_is_the_goal_whatever_was_seen():
    adapter, goal = FrozenAdapter(), np.array([0.9, 0.1])
    plans = np.random.default_rng(0).normal(size=(3, 4, 1))
    outcomes = np.array([[0.8, -0.2], [1.0, 0.0], [0.9, 0.2]])
    adapter.start(Demonstrations(plans, outcomes, PlanFormat(("j1",), ("rad",), 0.02)))
    observe(adapter, goal, goal + 0.1)
    np.testing.assert_array_equal(adapter.propose(goal), goal)

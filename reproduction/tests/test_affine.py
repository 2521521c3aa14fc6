"""The ridge rival: it learns what is affine, and forgets nothing."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.testing import AdapterContract
from reproduction.affine import RidgeAdapter

SQUARE = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0], [0.1, 0.2]])


class TestContract(AdapterContract):
    make = staticmethod(RidgeAdapter)


def test_an_affine_world_is_learned_from_trials_anywhere():
    adapter = RidgeAdapter(penalty=1e-8)
    plans = np.zeros((5, 2, 1)) + np.arange(5)[:, None, None]
    adapter.start(Demonstrations(plans, SQUARE, PlanFormat(("j1",), ("rad",), 0.02)))
    slope, shift = np.array([[1.3, 0.2], [-0.1, 0.9]]), np.array([0.1, -0.05])
    for goal in np.vstack([SQUARE / 2, SQUARE[:3] / 3]):
        condition = goal  # wherever it is asked
        adapter.observe(condition, goal, slope @ condition + shift - goal)
    for goal in np.array([[0.3, 0.0], [-0.7, 0.4]]):  # of which none was tried
        np.testing.assert_allclose(slope @ adapter.propose(goal) + shift, goal, atol=1e-3)


def test_the_first_trial_asks_for_the_goal_itself_and_a_penalty_is_positive():
    adapter = RidgeAdapter()
    plans = np.zeros((5, 2, 1)) + np.arange(5)[:, None, None]
    adapter.start(Demonstrations(plans, SQUARE, PlanFormat(("j1",), ("rad",), 0.02)))
    np.testing.assert_array_equal(adapter.propose(SQUARE[4]), SQUARE[4])
    with pytest.raises(ConfigurationError, match="positive"):
        RidgeAdapter(penalty=0.0)

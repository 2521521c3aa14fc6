import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from reproduction.adapters.broyden import BroydenAdapter

SQUARE = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])  # spread 1


def started(**settings):
    adapter = BroydenAdapter(**settings)
    plans = np.zeros((4, 2, 1)) + np.arange(4)[:, None, None]
    adapter.start(Demonstrations(plans, SQUARE, PlanFormat(("j1",), ("rad",), 0.02)))
    return adapter


def test_it_begins_as_a_proportional_rule():
    adapter = started(gain=0.8)
    goal = np.array([0.2, 0.1])
    np.testing.assert_allclose(adapter.propose(goal), goal)
    adapter.observe(goal, goal, np.array([0.1, 0.0]))
    np.testing.assert_allclose(adapter.propose(goal), [0.12, 0.1])


def test_one_step_tells_the_slope_along_it_by_hand():
    adapter, goal = started(gain=1.0), np.zeros(2)
    for x in (0.4, 0.2):  # r = 1.6 c along x, the rest as asked for
        adapter.observe(np.array([x, 0.0]), goal, np.array([1.6 * x, 0.0]))
    np.testing.assert_allclose(adapter._slope, [[1.6, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(adapter.propose(goal), [0.0, 0.0], atol=1e-12)


def test_a_linear_world_is_solved_to_a_thousandth_in_four_trials():
    A, shift, goal = np.array([[1.3, 0.2], [-0.1, 0.9]]), np.array([0.1, -0.05]), np.array([0.3, 0])
    adapter = started(gain=1.0)
    for _ in range(2 * 2):
        condition = adapter.propose(goal)
        error = A @ condition + shift - goal
        adapter.observe(condition, goal, error)
    assert np.linalg.norm(error) < 1e-3


def test_a_wild_secant_is_bounded():
    adapter, goal = started(), np.zeros(2)
    adapter.observe(np.array([0.1, 0.0]), goal, np.array([1.0, 0.0]))
    adapter.observe(np.array([0.1001, 0.0]), goal, np.array([-1.0, 0.0]))
    singular = np.linalg.svd(adapter._slope)[1]
    assert singular.max() <= 2 + 1e-12
    assert singular.min() >= 0.5 - 1e-12


@pytest.mark.parametrize("gain", [0.0, -1.0, float("nan")])
def test_a_gain_that_is_not_positive_is_refused(gain):
    with pytest.raises(ConfigurationError, match="gain"):
        BroydenAdapter(gain)

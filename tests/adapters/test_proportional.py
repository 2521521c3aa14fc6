import numpy as np
import pytest

from prior_reinforce.adapters.proportional import ProportionalAdapter
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat


def observe(adapter, condition, outcome):
    """Take in a trial by its outcome: seen from a goal at 0, that is the error."""
    adapter.observe(condition, np.zeros(len(outcome)), outcome)


DEMONSTRATIONS = Demonstrations(
    np.random.default_rng(0).normal(size=(3, 4, 1)),
    np.array([[0.8, -0.2], [1.0, 0.0], [0.9, 0.2]]),
    PlanFormat(("j1",), ("rad",), 0.02),
)


def test_the_paper_s_rule_by_hand():
    adapter = ProportionalAdapter()
    adapter.start(DEMONSTRATIONS)
    goal = np.array([0.9, 0.1])
    np.testing.assert_array_equal(adapter.propose(goal), goal)
    observe(adapter, goal, goal + np.array([0.05, -0.02]))
    np.testing.assert_allclose(adapter.propose(goal), [0.86, 0.116])
    observe(adapter, np.array([0.86, 0.116]), goal + np.array([-0.01, 0.0]))
    np.testing.assert_allclose(adapter.propose(goal), [0.868, 0.116])


def test_for_another_goal_the_way_there_counts_as_error():
    adapter = ProportionalAdapter(gain=0.5)
    adapter.start(DEMONSTRATIONS)
    observe(adapter, np.array([0.9, 0.1]), np.array([0.92, 0.1]))
    np.testing.assert_allclose(adapter.propose(np.array([1.0, 0.1])), [0.94, 0.1])


@pytest.mark.parametrize("gain", [0.0, -1.0, float("nan"), float("inf")])
def test_a_gain_that_does_not_correct_is_refused(gain):
    with pytest.raises(ConfigurationError, match="gain"):
        ProportionalAdapter(gain=gain)

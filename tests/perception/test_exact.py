import numpy as np

from prior_reinforce.environment import Rollout
from prior_reinforce.perception.exact import Exact


def test_sees_outcome_minus_goal():
    rollout = Rollout(outcome=np.array([0.75, -0.5]), valid=True)
    seen = Exact().perceive(rollout, np.array([0.5, 0.25]), np.random.default_rng(0))
    np.testing.assert_array_equal(seen.error_seen, [0.25, -0.75])


def test_draws_nothing():
    rng = np.random.default_rng(0)
    Exact().perceive(Rollout(outcome=np.zeros(2), valid=True), np.ones(2), rng)
    assert rng.random() == np.random.default_rng(0).random()

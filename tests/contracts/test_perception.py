"""What every numeric perception keeps to. A new one: add a line to FACTORIES."""

from collections.abc import Callable

import numpy as np
import pytest

from prior_reinforce.perception.amplified import Amplified
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.exact import Exact
from prior_reinforce.perception.eye import Eye
from prior_reinforce.rollouts import Rollout

FACTORIES: list[Callable[[], Perception]] = [Exact, Eye, Amplified]

pytestmark = [pytest.mark.parametrize("make", FACTORIES)]


def rollout(outcome: np.ndarray, valid: bool = True) -> Rollout:
    return Rollout(outcome=np.asarray(outcome, dtype=float), valid=valid)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_the_same_seed_sees_the_same_finite_error(make, k):
    outcome, goal = np.linspace(0.9, 0.3, k), np.full(k, 0.5)
    seen = [make().perceive(rollout(outcome), goal, np.random.default_rng(3)) for _ in range(2)]
    assert seen[0].shape == (k,)
    assert seen[0].dtype == float
    assert np.all(np.isfinite(seen[0]))
    np.testing.assert_array_equal(seen[0], seen[1])


def test_it_returns_a_fresh_array_and_leaves_its_inputs(make):
    trial, goal = rollout([0.9, 0.1]), np.array([0.8, 0.3])
    seen = make().perceive(trial, goal, np.random.default_rng(0))
    seen[:] = 99.0
    np.testing.assert_array_equal(trial.outcome, [0.9, 0.1])
    np.testing.assert_array_equal(goal, [0.8, 0.3])


def test_a_large_error_is_seen_on_its_own_side(make):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        seen = make().perceive(rollout([1.1, 0.0]), np.array([0.9, 0.3]), rng)
        assert seen[0] > 0.1
        assert seen[1] < -0.15


def test_a_lost_ball_is_seen_where_the_task_says_it_went(make):
    seen = make().perceive(
        rollout([0.0, 0.0], valid=False), np.array([0.9, 0.0]), np.random.default_rng(1)
    )
    assert seen[0] < -0.5

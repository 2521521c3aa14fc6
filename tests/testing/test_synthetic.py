import numpy as np
import pytest

from prior_reinforce.testing import synthetic_demonstrations


@pytest.mark.parametrize(("n", "horizon", "action_dim", "k"), [(2, 5, 1, 1), (6, 40, 7, 3)])
def test_demonstrations_move_smoothly_from_rest_to_rest(n, horizon, action_dim, k):
    demos = synthetic_demonstrations(n, horizon=horizon, action_dim=action_dim, k=k, seed=1)
    assert demos.plans.shape == (n, horizon, action_dim)
    assert demos.outcomes_seen.shape == (n, k)
    travel = np.ptp(demos.plans, axis=1)
    np.testing.assert_allclose(travel, 1.0, atol=1e-12)  # every joint by one
    np.testing.assert_allclose(demos.plans[:, -1] - demos.plans[:, 0], travel)
    if horizon == 40:
        assert np.abs(np.diff(demos.plans, axis=1)).max() < 1.5 / 0.6 / 39 + 1e-12


def test_a_seed_tells_them_apart():
    first, again, other = (synthetic_demonstrations(seed=seed) for seed in (0, 0, 1))
    assert first.sha256 == again.sha256 != other.sha256

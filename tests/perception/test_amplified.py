import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.amplified import Amplified
from prior_reinforce.rollouts import Rollout


def see(perception: Amplified, error: list[float], n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    rollout = Rollout(outcome=np.array(error), valid=True)
    goal = np.zeros(len(error))
    return np.stack([perception.perceive(rollout, goal, rng) for _ in range(n)])


def test_one_factor_scales_the_whole_vector():
    seen = see(Amplified(noise_sd=0.0), [0.3, -0.1, 0.2], n=2000)
    factors = seen / [0.3, -0.1, 0.2]
    np.testing.assert_allclose(factors, factors[:, :1] * np.ones(3))
    assert factors.min() >= 0.7
    assert factors.max() <= 1.4
    # Uniform on (0.7, 1.4): mean 1.05, standard deviation 0.7 / sqrt(12) = 0.2021.
    assert factors[:, 0].mean() == pytest.approx(1.05, abs=4 * 0.2021 / np.sqrt(2000))
    assert factors[:, 0].std() == pytest.approx(0.2021, rel=0.05)


def test_the_noise_of_each_component_is_independent_and_of_the_stated_size():
    seen = see(Amplified(), [0.0, 0.0], n=4000)
    np.testing.assert_allclose(np.cov(seen.T), 1e-4 * np.eye(2), atol=1e-5)
    np.testing.assert_allclose(seen.mean(axis=0), 0.0, atol=4 * 0.01 / np.sqrt(4000))


def test_without_scaling_or_noise_it_is_exact():
    seen = see(Amplified(scale_low=1.0, scale_high=1.0, noise_sd=0.0), [0.02, 0.5], n=1)
    np.testing.assert_array_equal(seen[0], [0.02, 0.5])


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"scale_low": -0.1}, "scale_low"),
        ({"scale_low": 1.5}, "scale_low"),
        ({"scale_high": float("inf")}, "scale_high"),
        ({"noise_sd": -1.0}, "noise_sd"),
        ({"noise_sd": float("nan")}, "noise_sd"),
    ],
)
def test_settings_out_of_range_are_refused(settings, word):
    with pytest.raises(ConfigurationError, match=word):
        Amplified(**settings)

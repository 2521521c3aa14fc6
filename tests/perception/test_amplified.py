import numpy as np
import pytest

from prior_reinforce.environment import Rollout
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.amplified import Amplified


def see(perception: Amplified, error: list[float], n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    rollout = Rollout(outcome=np.array(error), valid=True)
    goal = np.zeros(len(error))
    return np.stack([perception.perceive(rollout, goal, rng).error_seen for _ in range(n)])


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


def test_the_spread_of_a_reading_is_that_of_the_truth_behind_it():
    perception, rng = Amplified(), np.random.default_rng(1)
    true = rng.normal(scale=0.1, size=(4000, 1))
    readings = [perception.perceive(Rollout(e, True), np.zeros(1), rng) for e in true]
    off = [(e - r.low)[0] / r.sd[0] for e, r in zip(true, readings, strict=True)]
    # Uniform factors are no Gaussian, and the error is not drawn beforehand: to 10 %.
    assert np.std(off) == pytest.approx(1.0, abs=0.1)
    assert np.mean(off) == pytest.approx(0.0, abs=0.1)


def test_the_mean_of_the_truth_behind_a_reading_by_hand():
    reading = Amplified(noise_sd=0.0).perceive(
        Rollout(np.array([0.1]), True), np.zeros(1), np.random.default_rng(0)
    )
    mean = np.log(1.4 / 0.7) / 0.7
    np.testing.assert_allclose(reading.low, mean * reading.error_seen)
    spread = np.sqrt(1 / (0.7 * 1.4) - mean**2)
    np.testing.assert_allclose(reading.sd, spread * reading.error_seen)


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

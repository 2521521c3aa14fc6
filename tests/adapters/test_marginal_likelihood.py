import numpy as np
import pytest
from scipy.stats import multivariate_normal

from prior_reinforce.adapters.marginal_likelihood import log_marginal_likelihood, maximise

BOUNDS = {"amplitude_bounds": (1e-5, 1e5), "length_scale_bounds": (1e-5, 1e5)}


def data(seed: int, n: int = 7, k: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(n, k))
    return inputs, np.sin(2 * inputs) + rng.normal(size=(n, k)), rng.uniform(1e-3, 1e-1, size=n)


def test_one_point_by_hand():
    # y ~ N(0, a + alpha) = N(0, 4): -y^2 / 8 - log(8 pi) / 2 for y = 2, whatever the length scale.
    value = log_marginal_likelihood(
        np.array([[5.0]]),
        np.array([[2.0]]),
        amplitude=3.0,
        length_scale=0.7,
        jitter=np.array([1.0]),
    )
    assert value == pytest.approx(-0.5 - 0.5 * np.log(8 * np.pi))


@pytest.mark.parametrize("seed", range(5))
def test_likelihood_is_that_of_a_multivariate_normal(seed):
    inputs, targets, jitter = data(seed)
    squared = ((inputs[:, None] - inputs[None]) ** 2).sum(axis=2)
    covariance = 1.7 * np.exp(-squared / (2 * 0.6**2)) + np.diag(jitter)
    expected = sum(multivariate_normal(cov=covariance).logpdf(y) for y in targets.T)
    value = log_marginal_likelihood(inputs, targets, amplitude=1.7, length_scale=0.6, jitter=jitter)
    assert value == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("seed", range(20))
def test_no_kernel_near_the_maximum_or_far_from_it_is_better(seed):
    inputs, targets, jitter = data(seed, n=2 + seed % 8, k=1 + seed % 3)
    fit = maximise(inputs, targets, jitter=jitter, **BOUNDS)
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(200, 2)) * np.repeat([1e-4, 1e-2, 1.0, 5.0], 50)[:, None]
    for step in steps:
        log_a, log_l = np.clip(
            np.log([fit.amplitude, fit.length_scale]) + step, *np.log([1e-5, 1e5])
        )
        other = log_marginal_likelihood(
            inputs, targets, amplitude=np.exp(log_a), length_scale=np.exp(log_l), jitter=jitter
        )
        assert other <= fit.log_likelihood + 1e-7


def test_the_reported_likelihood_is_that_of_the_reported_kernel():
    inputs, targets, jitter = data(3)
    fit = maximise(inputs, targets, jitter=jitter, **BOUNDS)
    value = log_marginal_likelihood(
        inputs, targets, amplitude=fit.amplitude, length_scale=fit.length_scale, jitter=jitter
    )
    assert value == pytest.approx(fit.log_likelihood, abs=1e-10)


def test_kernel_stays_within_its_bounds_and_uses_them():
    inputs = np.random.default_rng(0).normal(size=(6, 2))
    tight = {"amplitude_bounds": (0.5, 2.0), "length_scale_bounds": (0.1, 0.3)}
    fit = maximise(inputs, 50.0 * inputs, jitter=np.full(6, 1e-2), **tight)
    assert fit.amplitude == 2.0
    assert 0.1 <= fit.length_scale <= 0.3


def test_targets_of_pure_noise_want_no_kernel():
    rng = np.random.default_rng(1)
    inputs, targets = rng.normal(size=(12, 2)), 1e-3 * rng.normal(size=(12, 2))
    fit = maximise(inputs, targets, jitter=np.ones(12), **BOUNDS)
    assert fit.amplitude == pytest.approx(1e-5)


def test_coinciding_inputs_are_no_trouble():
    inputs = np.zeros((4, 2))
    fit = maximise(inputs, np.ones((4, 2)), jitter=np.full(4, 1e-3), **BOUNDS)
    assert np.isfinite(fit.log_likelihood)

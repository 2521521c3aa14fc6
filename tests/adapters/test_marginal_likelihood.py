import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import multivariate_normal

from prior_reinforce.adapters.marginal_likelihood import Kernel, maximise

BOUNDS = {"amplitude_bounds": (1e-5, 1e5), "length_scale_bounds": (1e-5, 1e5)}


def data(seed: int, n: int = 7, k: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(n, k))
    return inputs, np.sin(2 * inputs) + rng.normal(size=(n, k)), rng.uniform(1e-3, 1e-1, size=n)


def log_marginal_likelihood(kernel, inputs, targets, jitter):
    """Of one kernel, by Cholesky: no part of what is tested."""
    covariance = kernel(inputs, inputs) + np.diag(jitter)
    factor = cholesky(covariance, lower=True)
    whitened = solve_triangular(factor, targets, lower=True)
    log_det = 2.0 * np.log(np.diag(factor)).sum() + len(inputs) * np.log(2.0 * np.pi)
    return -0.5 * (np.square(whitened).sum() + targets.shape[1] * log_det)


def greatest(kernel, inputs, targets, jitter):
    """The same as `maximise` says: the greatest where there is no other."""
    amplitudes, lengths = [kernel.amplitude] * 2, [kernel.length_scale] * 2
    bounds = {"amplitude_bounds": amplitudes, "length_scale_bounds": lengths}
    return maximise(inputs, targets, jitter=jitter, **bounds)[1]


def test_one_point_by_hand():
    # y ~ N(0, a + alpha) = N(0, 4): -y^2 / 8 - log(8 pi) / 2 for y = 2, whatever the length scale.
    point, target = np.array([[5.0]]), np.array([[2.0]])
    value = greatest(Kernel(3.0, 0.7), point, target, np.array([1.0]))
    assert value == pytest.approx(-0.5 - 0.5 * np.log(8 * np.pi))


def test_posterior_of_one_point_by_hand():
    # a = 2, alpha = 0.5, y = 3 at x = 0: mean(x) = 2 exp(-x^2 / 2 l^2) / 2.5 * 3.
    kernel, origin = Kernel(amplitude=2.0, length_scale=2.0), np.array([[0.0]])
    weights = kernel.weights(origin, np.array([[3.0]]), np.array([0.5]))
    expected = [[2.4], [2.4 * np.exp(-0.5)], [0.0]]
    points = np.array([[0.0], [2.0], [200.0]])
    np.testing.assert_allclose(kernel(points, origin) @ weights, expected)


@pytest.mark.parametrize("seed", range(5))
def test_likelihood_is_that_of_a_multivariate_normal(seed):
    inputs, targets, jitter = data(seed)
    squared = ((inputs[:, None] - inputs[None]) ** 2).sum(axis=2)
    covariance = 1.7 * np.exp(-squared / (2 * 0.6**2)) + np.diag(jitter)
    expected = sum(multivariate_normal(cov=covariance).logpdf(y) for y in targets.T)
    for value_of in (greatest, log_marginal_likelihood):
        value = value_of(Kernel(1.7, 0.6), inputs, targets, jitter)
        assert value == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("seed", range(20))
def test_no_kernel_near_the_maximum_or_far_from_it_is_better(seed):
    inputs, targets, jitter = data(seed, n=2 + seed % 8, k=1 + seed % 3)
    kernel, likelihood = maximise(inputs, targets, jitter=jitter, **BOUNDS)
    best = np.log([kernel.amplitude, kernel.length_scale])
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(200, 2)) * np.repeat([1e-4, 1e-2, 1.0, 5.0], 50)[:, None]
    for step in steps:
        other = Kernel(*np.exp(np.clip(best + step, *np.log([1e-5, 1e5]))))
        assert log_marginal_likelihood(other, inputs, targets, jitter) <= likelihood + 1e-7


def test_the_reported_likelihood_is_that_of_the_reported_kernel():
    inputs, targets, jitter = data(3)
    kernel, likelihood = maximise(inputs, targets, jitter=jitter, **BOUNDS)
    value = log_marginal_likelihood(kernel, inputs, targets, jitter)
    assert value == pytest.approx(likelihood, abs=1e-10)


def test_kernel_stays_within_its_bounds_and_uses_them():
    inputs = np.random.default_rng(0).normal(size=(6, 2))
    tight = {"amplitude_bounds": (0.5, 2.0), "length_scale_bounds": (0.1, 0.3)}
    kernel, _ = maximise(inputs, 50.0 * inputs, jitter=np.full(6, 1e-2), **tight)
    assert kernel.amplitude == 2.0
    assert 0.1 <= kernel.length_scale <= 0.3


def test_targets_of_pure_noise_want_no_kernel():
    rng = np.random.default_rng(1)
    inputs, targets = rng.normal(size=(12, 2)), 1e-3 * rng.normal(size=(12, 2))
    kernel, _ = maximise(inputs, targets, jitter=np.ones(12), **BOUNDS)
    assert kernel.amplitude == pytest.approx(1e-5)


def test_coinciding_inputs_by_hand():
    # R is all ones, whatever the length scale: one eigenvalue, 4, and y lies along it. There the
    # variance is 4 a + alpha, and likeliest equal to |y|^2 = 4.
    inputs = np.zeros((4, 2))
    kernel, _ = maximise(inputs, np.ones((4, 2)), jitter=np.full(4, 1e-3), **BOUNDS)
    assert kernel.amplitude == pytest.approx(1 - 1e-3 / 4)
    weights = kernel.weights(inputs, np.ones((4, 2)), np.full(4, 1e-3))
    np.testing.assert_allclose(kernel(inputs, inputs) @ weights, 1 - 1e-3 / 4)

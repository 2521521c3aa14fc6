"""Held against closed forms, numerical integration and sampling."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from prior_reinforce.adapters.expectation_propagation import Readings, _cavity, infer, tilted

INF = np.inf


def likelihood(d, low, high, variance, e, width):
    s = np.sqrt(variance)
    if low == high:
        return (1 - e) * norm.pdf(low, d, s) + e / width
    read = norm.cdf((high - d) / s) - norm.cdf((low - d) / s)
    return (1 - e) * read + e * min(high - low, width) / width


def covariance(at: np.ndarray, reach: float = 0.8, sd: float = 0.3) -> np.ndarray:
    return sd**2 * np.exp(-0.5 * np.square(at[:, None] - at) / reach**2)


@pytest.mark.slow
@pytest.mark.parametrize("e", [1e-12, 0.01, 0.3])
@pytest.mark.parametrize(
    ("low", "high", "variance"),
    [
        (0.1, 0.4, 0.001),
        (-0.4, -0.1, 0.04),
        (0.2, 0.2, 0.01),
        (0.3, INF, 0.002),
        (-INF, -0.2, 0.002),
        (-INF, INF, 0.01),
        (1.5, 1.6, 0.0009),
    ],
)
def test_tilted_moments_are_those_of_numerical_integration(low, high, variance, e):
    mean, prior = 0.05, 0.09
    readings = Readings(np.array([[low]]), np.array([[high]]), np.array([[variance]]), e, 8.0)
    shape = np.full((1, 1, 1), 1.0)
    log_z, new_mean, new_variance = tilted(mean * shape, prior * shape, readings)

    def moment(power, about=0.0):
        def density(d):
            read = likelihood(d, low, high, variance, e, 8.0)
            return (d - about) ** power * norm.pdf(d, mean, np.sqrt(prior)) * read

        breaks = [p for p in (low, high, mean) if np.isfinite(p)]
        return quad(density, -4, 4, points=breaks, limit=500, epsabs=1e-16)[0]

    z = moment(0)
    assert log_z[0, 0, 0] == pytest.approx(np.log(z), abs=1e-6)
    expected = moment(1) / z
    assert new_mean[0, 0, 0] == pytest.approx(expected, abs=1e-6)
    assert new_variance[0, 0, 0] == pytest.approx(moment(2, expected) / z, rel=1e-4)


def test_moments_are_finite_however_far_the_interval_lies():
    low = np.array([[50.0, -60.0, 1e3]])
    readings = Readings(low, low + 0.01, np.full((1, 3), 1e-6), 0.01)
    shape = np.ones((1, 1, 3))
    for moment in tilted(0 * shape, 0.01 * shape, readings):
        assert np.all(np.isfinite(moment))


def test_numbers_give_gaussian_process_regression():
    rng = np.random.default_rng(0)
    at, y = rng.uniform(-1, 1, 7), rng.normal(scale=0.3, size=(2, 7))
    variance = rng.uniform(0.001, 0.02, size=(2, 7))
    models = np.stack([covariance(at), covariance(at, 0.4, 0.5)])
    posterior = infer(models, Readings(y, y, variance, outlier=1e-9))
    evidence = np.zeros((2, 2))
    for m, K in enumerate(models):
        for k in range(2):
            total = K + np.diag(variance[k])
            np.testing.assert_allclose(
                posterior.weights[m, k], np.linalg.solve(total, y[k]), rtol=1e-3, atol=1e-3
            )
            np.testing.assert_allclose(
                K @ posterior.precision[m, k] @ K, K @ np.linalg.solve(total, K), atol=1e-6
            )
            evidence[m, k] = multivariate_normal.logpdf(y[k], np.zeros(7), total)
    np.testing.assert_allclose(posterior.log_evidence, evidence, atol=1e-3)
    share = np.exp(evidence - evidence.max(axis=0))
    np.testing.assert_allclose(posterior.model_weights, share / share.sum(axis=0), atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_means_spreads_and_evidence_are_those_of_a_million_samples(seed):
    rng = np.random.default_rng(seed)
    at = rng.uniform(-1, 1, 5)
    K = covariance(at, rng.uniform(0.4, 1.2), 0.3) + 1e-9 * np.eye(5)
    truth = rng.multivariate_normal(np.zeros(5), K)
    edges = np.array([-INF, -0.75, -0.35, -0.1, 0.1, 0.35, 0.75, INF])
    bin_ = np.searchsorted(edges, truth) - 1
    low, high, variance = edges[bin_], edges[bin_ + 1], np.full(5, 0.001)
    readings = Readings(low[None], high[None], variance[None], 0.01, 8.0)
    posterior = infer(K[None], readings)
    samples = rng.multivariate_normal(np.zeros(5), K, size=1_000_000)
    weight = np.prod(
        [likelihood(samples[:, i], low[i], high[i], 0.001, 0.01, 8.0) for i in range(5)], axis=0
    )
    mean = np.average(samples, weights=weight, axis=0)
    sd = np.sqrt(np.average((samples - mean) ** 2, weights=weight, axis=0))
    ours = K @ posterior.weights[0, 0]
    spread = np.sqrt(np.diag(K - K @ posterior.precision[0, 0] @ K))
    np.testing.assert_allclose(ours, mean, atol=0.06 * sd.max())
    np.testing.assert_allclose(spread, sd, rtol=0.06)
    assert posterior.log_evidence[0, 0] == pytest.approx(np.log(weight.mean()), abs=0.1)


def test_what_says_nothing_changes_nothing():
    K = covariance(np.array([0.0, 0.5]))
    far = np.full((1, 2), INF)
    posterior = infer(K[None], Readings(-far, far, np.full((1, 2), 0.01)))
    np.testing.assert_allclose(posterior.weights, 0.0, atol=1e-6)
    np.testing.assert_allclose(posterior.precision, 0.0, atol=1e-6)


def test_ten_times_the_same_word_say_less_than_ten_numbers():
    K = covariance(np.zeros(10)) + 1e-9 * np.eye(10)
    low, high = np.full((1, 10), 0.2), np.full((1, 10), 0.5)
    number, spread = np.full((1, 10), 0.35), np.full((1, 10), 0.3**2 / 12 + 1e-4)
    sds = []
    for readings in (Readings(low, high, 0 * low + 1e-4), Readings(number, number, spread)):
        posterior = infer(K[None], readings)
        sds.append(np.sqrt(K[0, 0] - K[0] @ posterior.precision[0, 0] @ K[0]))
    assert sds[0] > 1.5 * sds[1]


def test_beginning_with_what_was_known_ends_at_the_same_posterior():
    rng = np.random.default_rng(3)
    at, low = rng.uniform(-1, 1, 9), rng.normal(scale=0.2, size=(2, 9))
    K = np.stack([covariance(at), covariance(at, 0.4, 0.5)])
    readings = [Readings(low[:, :n], low[:, :n] + 0.1, 0.001 + 0 * low[:, :n]) for n in (6, 9)]
    known = infer(K[:, :6, :6], readings[0])
    again, afresh = (
        infer(K, readings[1], previous=known),
        infer(K, readings[1]),
    )
    sds = np.sqrt(np.diagonal(K, axis1=1, axis2=2))[:, None]
    means = (np.einsum("mij,mkj->mki", K, posterior.weights) for posterior in (again, afresh))
    np.testing.assert_allclose(*means, atol=0.01 * sds.min())
    # Improbable models are not updated: their evidence is that of filtering.
    np.testing.assert_allclose(again.log_evidence, afresh.log_evidence, atol=0.1)


def contradicting(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Covariance, and numbers of which half lie at -8 and half at 1.4, nearer than 0.3 together."""
    rng = np.random.default_rng(seed)
    at = np.sort(rng.uniform(0, 0.3, 12))
    numbers = np.where(rng.uniform(size=12) < 0.5, -8.0, 1.4) + 0.3 * rng.normal(size=12)
    return covariance(at, 2.5, 10.0) + 1e-5 * np.eye(12), numbers


def evidence_by_enumeration(K: np.ndarray, y: np.ndarray, variance: float, e: float, width: float):
    """Log evidence, summed over which readings say something."""
    logs = []
    for said in itertools.product((False, True), repeat=len(y)):
        some = np.flatnonzero(said)
        C = K[np.ix_(some, some)] + variance * np.eye(len(some))
        fit = multivariate_normal.logpdf(y[some], np.zeros(len(some)), C) if len(some) else 0.0
        log_odds = len(some) * np.log(1 - e) + (len(y) - len(some)) * np.log(e / width)
        logs.append(fit + log_odds)
    return np.logaddexp.reduce(logs)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_readings_that_contradict_each_other_have_no_evidence_that_diverges(seed):
    K, y = contradicting(seed)
    variance, e, width = 4e-6, 0.002, 8.0
    readings = Readings(y[None], y[None], np.full((1, 12), variance), e, width)
    posterior = infer(K[None], readings)
    assert np.all(np.isfinite(posterior.weights))
    assert np.all(np.isfinite(posterior.precision))
    nothing_said = len(y) * np.log(e / width)
    at_most = len(y) * np.log((1 - e) / np.sqrt(2 * np.pi * variance) + e / width)
    assert nothing_said - 20.0 < posterior.log_evidence[0, 0] < at_most


@pytest.mark.slow
@pytest.mark.parametrize("seed", [16, 22, 40])
def test_their_evidence_is_near_the_one_by_enumeration(seed):
    K, y = contradicting(seed)
    readings = Readings(y[None], y[None], np.full((1, 12), 4e-6), 0.002, 8.0)
    exact = evidence_by_enumeration(K, y, 4e-6, 0.002, 8.0)
    assert infer(K[None], readings).log_evidence[0, 0] == pytest.approx(exact, abs=15.0)


def test_where_updates_swing_a_latent_without_its_site_keeps_a_variance():
    mean, variance, tau, nu = np.reshape([0.3, 0.1, 12.0, 5.0], (4, 1, 1, 1))
    cavity_mean, cavity_tau = _cavity(mean, variance, tau, nu)
    assert cavity_tau > 0
    assert cavity_mean == mean


def test_without_a_reading_the_rest_say_what_they_say_alone():
    """Sites of numbers do not depend on each other, so that the posterior is known beforehand."""
    rng = np.random.default_rng(2)
    at, y = rng.uniform(-1, 1, 7), rng.normal(scale=0.3, size=(2, 7))
    K, variance = covariance(at)[None], rng.uniform(0.001, 0.02, size=(2, 7))
    all_of_them, rest = Readings(y, y, variance, outlier=1e-9), np.array([0, 1, 2, 4, 5, 6])
    some, among = all_of_them.select(np.s_[:, rest]), K[:, rest[:, None], rest]
    left = infer(K, all_of_them).without(3, among[:, None], some, np.zeros(1))
    alone = infer(among, some)
    np.testing.assert_allclose(left.precision, alone.precision, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(left.weights, alone.weights, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(left.log_evidence, alone.log_evidence, atol=1e-6)


def test_an_improbable_model_is_taken_in_all_the_same_and_may_become_the_best():
    """Numbers with a scatter that one model allows and the other, first better, does not."""
    at = np.linspace(-1, 1, 12)
    models = np.stack([covariance(at, sd=0.3) + s**2 * np.eye(12) for s in (0.001, 0.2)])
    y = np.sin(at)[None] * 0.2
    y[:, 6:] += 0.3 * np.array([1, -1, 1, -1, 1, -1])
    variance = np.full((1, 12), 1e-5)
    known, shares = None, []
    for n in range(1, 13):
        told = Readings(y, y, variance).select(np.s_[:, :n])
        known = infer(models[:, :n, :n], told, previous=known)
        shares.append(known.model_weights[:, 0])
    assert shares[5][0] > 0.999
    assert shares[-1][1] > 0.999

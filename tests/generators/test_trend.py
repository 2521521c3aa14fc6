"""What an affine function of the outcome explains is not left to a network."""

import numpy as np
import pytest

from prior_reinforce.generators.trend import AffineTrend

RNG = np.random.default_rng(0)
OUTCOMES = RNG.uniform(-1, 1, (7, 2))
CODES = RNG.uniform(-1, 1, (7, 3, 4))


def test_residuals_have_neither_mean_nor_slope_and_fill_the_unit_range():
    residuals = AffineTrend.fit(OUTCOMES, CODES).remove(OUTCOMES, CODES)
    np.testing.assert_allclose(residuals.sum(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(np.tensordot(OUTCOMES.T, residuals, axes=1), 0, atol=1e-12)
    np.testing.assert_allclose(np.abs(residuals).max(axis=(0, 2)), 1)


@pytest.mark.parametrize("trend", [AffineTrend.fit(OUTCOMES, CODES), AffineTrend.zero(2, 3, 4)])
def test_what_was_removed_is_restored(trend):
    residuals = trend.remove(OUTCOMES, CODES)
    np.testing.assert_allclose(trend.restore(OUTCOMES, residuals), CODES, atol=1e-12)


def test_without_a_trend_residuals_are_the_codes():
    assert np.array_equal(AffineTrend.zero(2, 3, 4).remove(OUTCOMES, CODES), CODES)


def test_affine_codes_leave_nothing_and_go_on_beyond_the_demonstrations():
    def codes(r):
        return (1 + r @ [2.0, -1.0])[:, None, None] * np.ones((1, 3, 4))

    trend = AffineTrend.fit(OUTCOMES, codes(OUTCOMES))
    np.testing.assert_allclose(trend.remove(OUTCOMES, codes(OUTCOMES)), 0, atol=1e-12)
    far = np.array([[3.0, -2.0]])
    np.testing.assert_allclose(trend.restore(far, np.zeros((1, 3, 4))), codes(far))


@pytest.mark.parametrize("n", [1, 2])
def test_too_few_demonstrations_for_a_slope_have_a_mean(n):
    trend = AffineTrend.fit(OUTCOMES[:n], CODES[:n])
    np.testing.assert_allclose(
        trend.restore(np.array([[9.0, 9.0]]), np.zeros((1, 3, 4)))[0], CODES[:n].mean(axis=0)
    )


def test_landing_that_is_linear_in_codes_is_told_by_the_trend_alone():
    # Outcomes are a linear function of codes in which people vary freely besides.
    reads = RNG.normal(size=(12, 2))
    codes = RNG.normal(size=(9, 12))
    outcomes = codes @ reads
    trend = AffineTrend.fit(outcomes, codes.reshape(9, 3, 4))
    wished = np.array([[0.3, -0.7]])
    lands = trend.restore(wished, np.zeros((1, 3, 4))).reshape(1, 12) @ reads
    np.testing.assert_allclose(lands, wished, atol=1e-10)
    landing_of_residuals = trend.remove(outcomes, codes.reshape(9, 3, 4)) * trend.scale
    np.testing.assert_allclose(landing_of_residuals.reshape(9, 12) @ reads, 0, atol=1e-10)

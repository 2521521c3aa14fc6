"""The probability of a hit after misses, against integrals."""

import numpy as np
import pytest
from scipy.stats import norm

from prior_reinforce.adapters.misses import Belief, p_hit_after

SD, OUTLIER = 0.02, 0.01


def belief(mean, variance, at_missed, among_missed, cross, share=(1.0,)) -> Belief:
    """Of one model and one component."""
    return Belief(
        np.array(share),
        np.array(at_missed, float)[None, None],
        np.array(among_missed, float)[None, None],
        np.array(mean, float)[None, None],
        np.array(variance, float)[None, None],
        np.array(cross, float)[None, None],
    )


@pytest.mark.parametrize("aim", [0.0, 0.05, 0.12, -0.2])
def test_beside_what_missed_is_what_the_integral_says(aim):
    """One displacement for all conditions, N(0.03, 0.1^2); 0 missed by 0.06 at least."""
    same = belief([0.03], [0.01], [0.03], [[0.01]], [[0.01]])
    said = p_hit_after(
        same, np.array([[0.0]]), np.array([0.06]), np.array([[aim]]), 0.06, SD, OUTLIER
    )
    d = np.linspace(-0.7, 0.7, 20001)
    left = norm.pdf(d, 0.03, 0.1) * (0.99 * norm.cdf((abs(d) - 0.06) / SD) + OUTLIER)
    hit = norm.cdf((0.06 - abs(d - aim)) / SD)
    assert said[0] == pytest.approx(np.sum(left * hit) / np.sum(left), abs=0.05)


def test_a_miss_elsewhere_tells_nothing():
    aims = np.array([[0.0], [0.1]])
    apart = belief([0.0, 0.0], [0.01, 0.01], [0.0], [[0.01]], [[0.0], [0.0]])
    said = p_hit_after(apart, np.array([[0.0]]), np.array([0.06]), aims, 0.06, SD, OUTLIER)
    d = np.linspace(-0.7, 0.7, 20001)
    density = norm.pdf(d, 0.0, 0.1)
    hits = [np.sum(density * norm.cdf((0.06 - abs(d - a)) / SD)) for a in (0.0, 0.1)]
    np.testing.assert_allclose(said, hits / density.sum(), atol=0.05)


def test_models_count_by_how_well_they_told_the_miss():
    """One model is sure that 0 hits, the other that it misses: after a miss the other is left."""
    both = Belief(
        np.array([0.5, 0.5]),
        np.array([[[0.0]], [[0.3]]]),
        np.full((2, 1, 1, 1), 1e-6),
        np.array([[[0.0, 0.0]], [[0.3, 0.3]]]),
        np.full((2, 1, 2), 1e-6),
        np.full((2, 1, 2, 1), 1e-6),
    )
    aims = np.array([[0.0], [0.3]])
    said = p_hit_after(both, np.array([[0.0]]), np.array([0.1]), aims, 0.1, SD, OUTLIER)
    np.testing.assert_allclose(said, [0.01, 0.99], atol=0.01)


def test_twenty_misses_at_one_condition_are_no_contradiction():
    sure = belief([0.0], [1e-6], np.zeros(20), np.full((20, 20), 1e-6), np.full((1, 20), 1e-6))
    said = p_hit_after(
        sure, np.zeros((20, 1)), np.full(20, 0.1), np.array([[0.0]]), 0.1, SD, OUTLIER
    )
    assert said[0] == pytest.approx(1.0, abs=1e-3)

"""The probability of a hit after misses, against integrals."""

import numpy as np
import pytest
import scipy.special
from scipy.special import ndtr
from scipy.stats import norm

from prior_reinforce.adapters.p_hit import Prediction, Targets, ball_probability, p_hit_given_misses

OUTLIER = 0.01


def belief(mean, variance, at_missed, among_missed, cross) -> Prediction:
    """Of one history, one model and one component."""
    return Prediction(
        1.0,
        np.ones((1, 1)),
        np.array(at_missed, float)[None, None],
        np.array(among_missed, float)[None, None],
        np.array(mean, float)[None, None],
        np.array(variance, float)[None, None],
        np.array(cross, float)[None, None],
    )


def targets(aims, radius) -> Targets:
    """All of one size; aims of one component may be plain numbers."""
    aims = np.reshape(aims, (len(aims), -1)).astype(float)
    return Targets(aims, np.full(aims.shape, radius))


@pytest.mark.parametrize("aim", [0.0, 0.05, 0.12, -0.2])
def test_beside_what_missed_is_what_the_integral_says(aim):
    """One displacement for all conditions, N(0.03, 0.1^2); 0 missed by 0.06 at least."""
    same = belief([0.03], [0.01], [0.03], [[0.01]], [[0.01]])
    said = p_hit_given_misses([same], targets([0.0], 0.06), targets([aim], 0.06), OUTLIER)
    d = np.linspace(-0.7, 0.7, 20001)
    left = norm.pdf(d, 0.03, 0.1) * (0.99 * norm.cdf((abs(d) - 0.06) / 0.006) + OUTLIER)
    hit = norm.cdf((0.06 - abs(d - aim)) / 0.006)
    assert said[0] == pytest.approx(np.sum(left * hit) / np.sum(left), abs=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("k", [2, 3])
def test_balls_are_missed_and_hit_as_often_as_in_a_million_throws(k):
    """Displacements at a missed condition and at two others that go with it more and less."""
    rng = np.random.default_rng(k)
    together = 0.09**2 * np.array([[1.0, 0.95, 0.4], [0.95, 1.0, 0.3], [0.4, 0.3, 1.0]])
    mean = np.array([[0.02, 0.0, -0.01]] * k)
    aims = np.array([[0.0] * k, [0.02] + [0.0] * (k - 1), [0.0] * k])
    throws = np.stack([rng.multivariate_normal(m, together, size=1_000_000) for m in mean])
    hit = np.sqrt(np.sum((throws - aims.T[:, None]) ** 2, axis=0)) < 0.07
    believed = Prediction(
        1.0,
        np.ones((1, k)),
        mean[None, :, :1],
        np.broadcast_to(together[:1, :1], (1, k, 1, 1)),
        mean[None, :, 1:],
        np.broadcast_to(np.diag(together)[1:], (1, k, 2)),
        np.broadcast_to(together[1:, :1], (1, k, 2, 1)),
    )
    said = p_hit_given_misses(
        [believed], targets(aims[:1], 0.07), targets(aims[1:], 0.07), outlier=1e-9
    )
    np.testing.assert_allclose(said, hit[~hit[:, 0], 1:].mean(axis=0), atol=0.02)
    assert said[0] < 0.75 * hit[:, 1].mean()


def test_a_miss_elsewhere_tells_nothing():
    apart = belief([0.0, 0.0], [0.01, 0.01], [0.0], [[0.01]], [[0.0], [0.0]])
    said = p_hit_given_misses([apart], targets([0.0], 0.06), targets([0.0, 0.1], 0.06), OUTLIER)
    d = np.linspace(-0.7, 0.7, 20001)
    density = norm.pdf(d, 0.0, 0.1)
    hits = [np.sum(density * norm.cdf((0.06 - abs(d - a)) / 0.006)) for a in (0.0, 0.1)]
    np.testing.assert_allclose(said, hits / density.sum(), atol=0.04)


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("are", ["models", "histories"])
def test_what_told_the_miss_best_is_left(share, are):
    """One model or history is sure that 0 hits, the other that it misses."""
    places, shares = np.array([0.0, 0.3]), np.array([share, 1 - share])

    def sure(of, probability, share):
        n = len(of)
        tiny = np.full((n, 1, 1), 1e-6)
        at = of[:, None, None]
        two = (
            np.concatenate([at, at], axis=2),
            np.full((n, 1, 2), 1e-6),
            np.full((n, 1, 2, 1), 1e-6),
        )
        return Prediction(probability, share, at, tiny[..., None], *two)

    if are == "models":
        beliefs = [sure(places, 1.0, shares[:, None])]
    else:
        beliefs = [sure(places[[i]], shares[i], np.ones((1, 1))) for i in range(2)]
    said = p_hit_given_misses(beliefs, targets([0.0], 0.1), targets([0.0, 0.3], 0.1), OUTLIER)
    first = share * OUTLIER / (share * OUTLIER + 1 - share)
    np.testing.assert_allclose(said, [first, 1 - first], atol=0.005)


def test_twenty_misses_at_one_condition_are_no_contradiction():
    sure = belief([0.0], [1e-6], np.zeros(20), np.full((20, 20), 1e-6), np.full((1, 20), 1e-6))
    said = p_hit_given_misses([sure], targets(np.zeros(20), 0.1), targets([0.0], 0.1), OUTLIER)
    assert said[0] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("k", [1, 2, 3, 4])
@pytest.mark.parametrize("sd", [0.01, 0.1, 1.0])
def test_the_share_within_a_ball_is_that_of_samples_whatever_its_size(k, sd):
    rng = np.random.default_rng(k)
    mean = 0.05 * rng.normal(size=k)
    sds = sd * rng.uniform(0.5, 1.5, size=k)
    share = ball_probability(mean[None, :, None] / 0.1, sds[None, :, None] / 0.1, np.ones((1, k)))[
        0
    ]
    samples = mean + sds * rng.normal(size=(400_000, k))
    assert share == pytest.approx(np.mean(np.linalg.norm(samples, axis=1) < 0.1), abs=0.006)


@pytest.mark.slow
@pytest.mark.parametrize("k", [1, 2, 3])
def test_each_component_is_a_mixture_of_its_own(k):
    rng = np.random.default_rng(k)
    mean, sd = 0.1 * rng.normal(size=(3, k)), rng.uniform(0.02, 0.2, size=(3, k))
    share = rng.dirichlet(np.ones(3), size=k).T
    radii = np.array([0.1, 0.2])
    said = ball_probability(*(np.stack([of] * 2, 2) / radii for of in (mean, sd)), share)
    model = np.stack([rng.choice(3, p=share[:, j], size=400_000) for j in range(k)], axis=1)
    samples = rng.normal(mean[model, np.arange(k)], sd[model, np.arange(k)])
    distance = np.linalg.norm(samples, axis=1)
    np.testing.assert_allclose(said, [np.mean(distance < r) for r in (0.1, 0.2)], atol=0.005)


@pytest.mark.slow
@pytest.mark.parametrize(("k", "off"), [(3, 0.005), (4, 0.08)])
def test_a_hundred_candidates_share_the_cells_of_one_and_the_best_stays_the_best(
    k, off, monkeypatch
):
    asked = []
    monkeypatch.setattr(scipy.special, "ndtr", lambda x, own=ndtr: asked.append(x.size) or own(x))
    rng = np.random.default_rng(0)
    mean, share = rng.normal(size=(5, k, 100)), rng.dirichlet(np.ones(5), size=k).T
    sd = 0.1 * rng.uniform(0.5, 1.5, size=mean.shape)
    together = ball_probability(mean, sd, share)
    work = sum(asked)
    alone = [ball_probability(mean[..., [i]], sd[..., [i]], share)[0] for i in range(100)]
    np.testing.assert_allclose(together, alone, atol=off)
    assert together.argmax() == np.argmax(alone)
    assert work < 0.1 * (sum(asked) - work)

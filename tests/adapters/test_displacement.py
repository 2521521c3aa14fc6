import numpy as np
import pytest

from prior_reinforce.adapters.displacement import BayesianConfig, DisplacementPrior
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat

OUTCOMES = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.2], [1.0, 0.2], [0.9, 0.0]])


def prior(noise=0.0, correction=(), **settings) -> DisplacementPrior:
    demonstrations = Demonstrations(
        np.random.default_rng(0).normal(size=(len(OUTCOMES), 4, 1)),
        OUTCOMES,
        PlanFormat(("j1",), ("rad",), 0.02),
        outcome_noise=np.full(OUTCOMES.shape, noise),
        outcome_correction=np.reshape(correction, (-1, OUTCOMES.shape[1])),
    )
    return DisplacementPrior(BayesianConfig(**settings), demonstrations)


def test_models_are_all_combinations_of_what_may_be_wrong():
    settings = {"generator_sd": (0.1, 0.3), "execution_sd": (0.02,), "p_changed": 0.2}
    share = np.exp(prior(**settings).log_prior)
    assert share.tolist() == pytest.approx([0.48, 0.12, 0.32, 0.08])


def of_labels(**settings) -> DisplacementPrior:
    return prior(generator_sd=(1e-9,), hardware_sd=(1e-9, 1e-9), **settings)


def test_a_demonstration_was_one_execution_whose_outcome_is_off_by_itself():
    """The next execution of the same plan is off by as much again."""
    only_noise = of_labels(execution_sd=(0.1, 0.3))
    at = only_noise.normalisation.apply(OUTCOMES)
    for covariance, sd in zip(only_noise.covariance(at, at), (0.1, 0.3) * 2, strict=True):
        np.testing.assert_allclose(covariance, sd**2 * np.eye(len(at)), atol=1e-9)
    np.testing.assert_allclose(only_noise.variance(at), [[0.02] * 5, [0.18] * 5] * 2, atol=1e-9)


def test_stated_noise_of_labels_adds_to_that_of_their_execution():
    stated = of_labels(noise=0.02, execution_sd=(0.02,))
    weights = np.square(stated._weights(OUTCOMES[:1])).sum()
    assert weights < 1.0  # what is uncertain is smoothed
    each = (0.02 / stated.normalisation.scale[0]) ** 2 + 0.02**2
    at = stated.normalisation.apply(OUTCOMES[:1])
    np.testing.assert_allclose(stated.variance(at)[:, 0], weights * each + 0.02**2, atol=1e-9)


def of_generator(**settings) -> DisplacementPrior:
    return prior(
        generator_sd=(0.5,),
        hardware_sd=(1e-9, 1e-9),
        execution_sd=(1e-9,),
        **settings,
    )


def test_demonstrations_are_readings_of_what_the_generator_gets_wrong():
    """Nothing at a demonstration, and the more the farther from all of them."""
    believed = of_generator()
    assert np.abs(believed.covariance(*[believed.normalisation.apply(OUTCOMES)] * 2)).max() < 1e-9
    places = np.array([[0.8, -0.15], [0.8, -0.1], [0.8, 0.0], [0.5, 0.0]])
    sd = np.sqrt(believed.variance(believed.normalisation.apply(places))[0])
    assert np.all(np.diff(sd) > 0)
    assert sd[2] < 0.3 < sd[3]


@pytest.mark.slow
def test_what_the_generator_gets_wrong_is_what_weights_make_of_a_random_landing():
    """Landings F are drawn at demonstrations and beside them; the weights carry over a part."""
    believed, rng = of_generator(), np.random.default_rng(1)
    at = np.vstack([OUTCOMES, [[0.85, 0.1], [0.95, -0.1]]])
    scaled = believed.normalisation.apply(at)
    apart = np.linalg.norm(scaled[:, None] - scaled, axis=-1) * np.sqrt(5.0) / 1.4
    matern = 0.25 * (1.0 + apart + apart**2 / 3.0) * np.exp(-apart)
    landed = rng.multivariate_normal(np.zeros(7), matern, size=400_000)
    off = landed[:, 5:] - landed[:, :5] @ believed._weights(at[5:]).T
    np.testing.assert_allclose(
        believed.covariance(scaled[5:], scaled[5:])[0], np.cov(off.T), rtol=0.03, atol=2e-5
    )


def test_what_is_different_from_the_demonstrations_day_is_shared_and_can_be_left_out():
    of_hardware = prior(generator_sd=(1e-9,), execution_sd=(1e-9,), hardware_sd=(0.03, 0.3))
    at = of_hardware.normalisation.apply(OUTCOMES[:1])
    same, changed = of_hardware.covariance(at, at)[:, 0, 0]
    assert (same, changed) == pytest.approx((0.03**2, 0.3**2))
    assert of_hardware.variance(at)[:, 0] == pytest.approx([0.03**2, 0.3**2])
    assert of_hardware.covariance(at, at, hardware=False).max() == pytest.approx(0.0, abs=1e-12)
    assert of_hardware.variance(at, hardware=False).max() == pytest.approx(0.0, abs=1e-12)


def test_variances_are_those_of_the_covariance_and_the_noise():
    believed = prior(noise=0.01)
    at = believed.normalisation.apply(np.random.default_rng(0).uniform(0.7, 1.1, size=(9, 2)))
    diagonal = np.diagonal(believed.covariance(at, at), axis1=1, axis2=2)
    np.testing.assert_allclose(believed.variance(at), diagonal + believed.noise_variance[:, None])


def test_one_more_demonstration_makes_less_unknown_beside_it():
    believed = prior(noise=0.02)
    at = believed.normalisation.apply(np.array([[0.95, 0.1]]))
    assert np.all(believed.with_demonstration(at).variance(at) < believed.variance(at))


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"generator_sd": ()}, "generator_sd"),
        ({"execution_sd": (0.1, -0.1)}, "execution_sd"),
        ({"generator_reach": 0.0}, "generator_reach"),
        ({"execution_sd": (float("nan"),)}, "execution_sd"),
        ({"outlier": 1.7}, "outlier"),
        ({"p_changed": 1.0}, "p_changed"),
        ({"p_change": 0.0}, "p_change"),
        ({"hardware_sd": (0.1,)}, "hardware_sd"),
        ({"hardware_sd": 0.1}, "hardware_sd"),
    ],
)
def test_settings_out_of_range_are_refused(settings, word):
    with pytest.raises(ConfigurationError, match=word):
        BayesianConfig(**settings)


def test_what_labels_say_to_be_off_is_expected_between_them_too():
    """An affine correction is that everywhere, since the weights reproduce what is affine."""
    plain = prior(noise=0.02)
    correction = OUTCOMES @ np.array([[0.1, 0.02], [0.0, -0.05]]) + [0.01, 0.0]
    known = prior(noise=0.02, correction=correction)
    places = np.random.default_rng(0).uniform([0.75, -0.25], [1.05, 0.25], size=(20, 2))
    at = known.normalisation.apply(places)
    expected = places @ np.array([[0.1, 0.02], [0.0, -0.05]]) + [0.01, 0.0]
    scale = known.normalisation.scale
    np.testing.assert_allclose(known.mean(at).T * scale, expected, atol=1e-9)
    assert not plain.mean(at).any()
    np.testing.assert_array_equal(known.covariance(at, at), plain.covariance(at, at))
    more = known.with_demonstration(at[:1])  # whose label is off as its neighbours' are
    np.testing.assert_allclose(more.mean(at), known.mean(at), atol=1e-9)

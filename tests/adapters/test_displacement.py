import numpy as np
import pytest

from prior_reinforce.adapters.displacement import BayesianConfig, DisplacementPrior
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations, PlanFormat

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
    share = np.exp(prior(label_sd=(0.03, 0.1), p_generator=0.1, p_changed=0.2).log_share)
    assert share.tolist() == pytest.approx([0.72, 0.18, 0.08, 0.02] * 2)


def test_at_a_demonstration_its_own_label_is_off_and_no_other():
    """Its weights are 1 for itself: 0.3 spreads of label, and what is rough, changed or wrong."""
    only_labels = prior(label_sd=(0.3,), rough_sd=1e-9, generator_sd=1e-9, hardware_sd=(1e-9, 1e-9))
    at = only_labels.normalisation.apply(OUTCOMES)
    np.testing.assert_allclose(
        only_labels.covariance(at, 0, at, 0)[0], 0.09 * np.eye(len(at)), atol=1e-9
    )
    np.testing.assert_allclose(only_labels.variance(at, 0)[0], 0.09, atol=1e-9)


def test_stated_noise_of_labels_adds_to_what_they_may_be_off_besides():
    stated, unstated = prior(noise=0.02), prior(noise=0.0)
    at = stated.normalisation.apply(OUTCOMES[:1])
    weights = np.square(stated._weights(OUTCOMES[:1])).sum()
    more = (stated.variance(at, 0) - unstated.variance(at, 0))[:, 0]
    smoothed = (weights - 1.0) * np.array([0.03, 0.1]).repeat(4) ** 2
    expected = weights * (0.02 / stated.normalisation.scale[0]) ** 2 + smoothed
    np.testing.assert_allclose(more, expected, atol=1e-9)


def test_changed_hardware_is_shared_by_its_own_trials_alone():
    of_hardware = prior(label_sd=(1e-9,), rough_sd=1e-9, generator_sd=1e-9, hardware_sd=(0.03, 0.3))
    at = of_hardware.normalisation.apply(OUTCOMES[:1])
    same, changed = of_hardware.covariance(at, 0, at, 0)[:2, 0, 0]
    assert (same, changed) == pytest.approx((0.03**2, 0.3**2))
    assert of_hardware.covariance(at, 0, at, 1).max() == pytest.approx(0.0, abs=1e-12)
    assert of_hardware.covariance(at, 1, at, 1)[:2, 0, 0] == pytest.approx(0.3**2)


def test_two_places_differ_by_what_their_covariance_leaves():
    believed = prior()
    a, b = believed.normalisation.apply(OUTCOMES[:2])
    both = believed.covariance(np.stack([a, b]), 0, np.stack([a, b]), 0)
    difference = both[:, 0, 0] + both[:, 1, 1] - 2 * both[:, 0, 1]
    assert believed.of_difference(a[None], b, 0)[:, 0] == pytest.approx(difference)
    assert believed.of_difference(a[None], a, 0) == pytest.approx(0.0, abs=1e-12)


def test_one_more_demonstration_makes_less_unknown_beside_it():
    believed = prior(noise=0.02)
    at = believed.normalisation.apply(np.array([[0.95, 0.1]]))
    assert np.all(believed.with_demonstration(at).variance(at, 0) < believed.variance(at, 0))


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"label_sd": ()}, "label_sd"),
        ({"label_sd": (0.1, -0.1)}, "label_sd"),
        ({"rough_reach": 0.0}, "rough_reach"),
        ({"execution_sd": float("nan")}, "execution_sd"),
        ({"outlier": 1.7}, "outlier"),
        ({"p_changed": 1.0}, "p_changed"),
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
    np.testing.assert_array_equal(known.covariance(at, 0, at, 0), plain.covariance(at, 0, at, 0))
    more = known.with_demonstration(at[:1])  # whose label is off as its neighbours' are
    np.testing.assert_allclose(more.mean(at), known.mean(at), atol=1e-9)

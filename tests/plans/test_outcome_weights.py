"""Weights over demonstrations against values worked by hand and against SciPy."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from prior_reinforce.plans.outcome_weights import (
    amplification,
    left_out_errors,
    smooth_weights,
)

OUTCOMES = np.random.default_rng(0).uniform(size=(6, 2))
CONDITIONS = np.random.default_rng(1).uniform(-0.3, 1.3, size=(20, 2))


@pytest.mark.parametrize("kernel", ["linear", "thin-plate", "cubic"])
def test_smooth_weights_interpolate_as_scipy_does(kernel: str):
    """SciPy's RBFInterpolator of the same kernel and tail, on outcomes scaled the same way."""
    values = np.random.default_rng(2).normal(size=(6, 3))
    scale = np.ptp(OUTCOMES, axis=0)
    theirs = RBFInterpolator(
        OUTCOMES / scale,
        values,
        kernel={"thin-plate": "thin_plate_spline"}.get(kernel, kernel),
        degree=1,
    )
    ours = smooth_weights(OUTCOMES, kernel=kernel)(CONDITIONS) @ values
    np.testing.assert_allclose(ours, theirs(CONDITIONS / scale), atol=1e-9)


@pytest.mark.parametrize("kernel", ["linear", "thin-plate", "cubic"])
def test_smooth_weights_reproduce_an_affine_dependence_everywhere(kernel: str):
    slope = np.array([[0.4, -1.0], [2.0, 0.3]])
    weights = smooth_weights(OUTCOMES, kernel=kernel)(CONDITIONS)
    np.testing.assert_allclose(weights @ (OUTCOMES @ slope + 3), CONDITIONS @ slope + 3, atol=1e-10)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)


def test_an_uncertain_outcome_counts_for_less_at_its_place_and_what_is_affine_stays():
    noise = np.zeros_like(OUTCOMES)
    noise[2] = 0.2 * np.ptp(OUTCOMES, axis=0)
    weights = smooth_weights(OUTCOMES, noise=noise)(OUTCOMES)
    assert weights[2, 2] < 0.9
    np.testing.assert_allclose(np.delete(weights, 2, 0), np.delete(np.eye(6), 2, 0), atol=1e-9)
    np.testing.assert_allclose(weights @ OUTCOMES, OUTCOMES, atol=1e-9)


def test_two_demonstrations_of_two_components_are_joined_without_an_affine_tail():
    outcomes = np.array([[0.0, 0.0], [1.0, 2.0]])
    middle = smooth_weights(outcomes, kernel="linear")(outcomes.mean(axis=0)[None])
    np.testing.assert_allclose(middle, [[0.5, 0.5]])
    at_ends = smooth_weights(outcomes, kernel="linear")(outcomes)
    np.testing.assert_allclose(at_ends, np.eye(2), atol=1e-12)


def test_the_unit_of_a_component_does_not_matter():
    """Metres and milliseconds: every component counts relative to its demonstrated range."""
    factor = np.array([1.0, 1000.0])

    def weights(conditions: np.ndarray, outcomes: np.ndarray) -> np.ndarray:
        return smooth_weights(outcomes, kernel="thin-plate")(conditions)

    np.testing.assert_allclose(
        weights(CONDITIONS * factor, OUTCOMES * factor), weights(CONDITIONS, OUTCOMES), atol=1e-9
    )


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("kernel", ["linear", "thin-plate", "cubic"])
def test_demonstrations_of_one_outcome_are_averaged(kernel, noise):
    repeated = np.vstack([OUTCOMES, OUTCOMES[2] + 1e-9])  # to rounding
    weights = smooth_weights(repeated, kernel=kernel, noise=np.full((7, 2), noise))(CONDITIONS)
    np.testing.assert_allclose(weights[:, 2], weights[:, 6], atol=1e-9)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-9)
    if not noise:
        alone = smooth_weights(OUTCOMES, kernel=kernel)(CONDITIONS)
        np.testing.assert_allclose(weights[:, 2] + weights[:, 6], alone[:, 2], atol=1e-3)


def test_amplification_half_way_between_two_is_a_half():
    outcomes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    assert amplification(smooth_weights(outcomes), outcomes) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("outcomes", "kernel"),
    [
        (np.stack(np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0]), -1).reshape(-1, 2), "cubic"),
        (
            np.array([[0.0, 0], [0.9, 0.1], [1.0, 0.15], [1.0, 1], [0.1, 0.9], [2, 0.4]]),
            "linear",
        ),
        (np.array([[0.0], [0.45], [0.5], [0.52], [0.9], [1.0]]), "linear"),
    ],
    ids=["a grid", "two close together", "on a line"],
)
def test_where_outcomes_lie_close_together_plans_bend_less(outcomes, kernel):
    """Cubic weights of two close together are a slope: what differs by chance would grow."""
    spread = amplification(smooth_weights(outcomes, kernel="cubic"), outcomes)
    assert (spread > 1.0) == (kernel == "linear")
    at = outcomes[:1] + 0.3
    expected = smooth_weights(outcomes, kernel=kernel)(at)
    np.testing.assert_array_equal(smooth_weights(outcomes)(at), expected)


def test_no_conditions_have_no_weights():
    assert smooth_weights(OUTCOMES)(CONDITIONS[:0]).shape == (0, len(OUTCOMES))


@pytest.mark.parametrize(("n", "k"), [(3, 1), (3, 2), (4, 2), (9, 2), (30, 3)])
def test_what_is_left_out_is_missed_as_if_the_others_were_learned_alone(n, k):
    rng = np.random.default_rng([n, k])
    outcomes, values = rng.uniform(size=(n, k)) * [1.0, 300.0, 0.2][:k], rng.normal(size=(n, 4))
    expected = []
    for i in range(n):
        others = np.delete(np.arange(n), i)
        scale = np.ptp(outcomes[others], axis=0)
        spline = RBFInterpolator(
            outcomes[others] / scale, values[others], kernel="linear", degree=int(n - 1 > k)
        )
        expected.append(values[i] - spline(outcomes[i : i + 1] / scale)[0])
    np.testing.assert_allclose(left_out_errors(outcomes, values), expected, atol=1e-4)

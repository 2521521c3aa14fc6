"""Mixtures of demonstrations: values worked by hand, and what each must reproduce."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.interpolation import (
    SmoothInterpolation,
    SmoothInterpolationConfig,
)
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat

FORMAT = PlanFormat(("joint1", "gripper"), ("rad", "1"), 0.02)


def demonstrations(n: int = 6) -> Demonstrations:
    rng = np.random.default_rng(0)
    return Demonstrations(rng.normal(size=(n, 11, 2)), rng.uniform(size=(n, 2)), FORMAT)


@pytest.mark.parametrize("n", [2, 3, 6])
@pytest.mark.parametrize("kernel", ["cubic", "thin-plate", "linear"])
def test_interpolation_returns_every_demonstration_at_its_outcome(n: int, kernel: str):
    demos = demonstrations(n)
    generator = SmoothInterpolation(SmoothInterpolationConfig(kernel=kernel)).fit(demos, seed=0)
    np.testing.assert_allclose(generator.generate(demos.outcomes_seen), demos.plans, atol=1e-10)


def test_interpolation_is_exact_where_plans_depend_affinely_on_outcomes():
    """Six plans from one affine family: new members come out exactly, inside and outside."""
    rng = np.random.default_rng(3)
    base, slopes = rng.normal(size=(11, 2)), rng.normal(size=(2, 11, 2))
    outcomes = rng.uniform(size=(6, 2))
    demos = Demonstrations(base + np.tensordot(outcomes, slopes, 1), outcomes, FORMAT)
    asked = rng.uniform(-0.5, 1.5, size=(20, 2))
    generated = SmoothInterpolation().fit(demos, seed=0).generate(asked)
    np.testing.assert_allclose(generated, base + np.tensordot(asked, slopes, 1), atol=1e-10)


def test_a_kernel_that_is_not_the_usual_one_is_said():
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0]), axis=-1).reshape(6, 2)
    close = np.vstack([grid, grid[0] + 0.001])  # a millimetre beside another
    said = [
        SmoothInterpolation()
        .fit(Demonstrations(rng.normal(size=(len(of), 11, 2)), of, FORMAT), seed=0)
        .remarks
        for of in (grid, close)
    ]
    assert said == [
        (),
        ("kernel: linear, since outcomes lie too close together for a cubic spline",),
    ]


def test_interpolation_refuses_an_unknown_kernel():
    with pytest.raises(ConfigurationError, match=r"kernel.*gaussian"):
        SmoothInterpolationConfig(kernel="gaussian")  # type: ignore[arg-type]


def test_plans_of_nearly_one_outcome_are_not_steep_where_outcomes_were_seen_coarsely():
    rng = np.random.default_rng(5)
    outcomes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5], [0.5, 0.52]])
    plans = rng.normal(size=(6, 11, 2))
    steep = {}
    for noise in (0.0, 0.1):
        demos = Demonstrations(plans, outcomes, FORMAT, outcome_noise=np.full((6, 2), noise))
        near = SmoothInterpolation().fit(demos, seed=0).generate(outcomes[4:])
        steep[noise] = np.abs(near[1] - near[0]).max()
    assert steep[0.1] < 0.2 * steep[0.0]


def test_weights_are_fitted_by_fit_and_not_by_generate(monkeypatch, throws, tmp_path):
    demos = throws(8)
    fitted = SmoothInterpolation().fit(demos, seed=0)
    fitted.save(tmp_path)
    expected = fitted.generate(demos.outcomes_seen)
    loaded = SmoothInterpolation.load(tmp_path)
    monkeypatch.delattr("scipy.interpolate.RBFInterpolator")
    for generator in (fitted, loaded):
        np.testing.assert_array_equal(generator.generate(demos.outcomes_seen), expected)


def test_fitted_again_it_has_the_weights_of_the_new_outcomes(throws):
    demos, others = throws(6), throws(6, seed=1)
    generator = SmoothInterpolation().fit(demos, seed=0).fit(others, seed=0)
    np.testing.assert_allclose(generator.generate(others.outcomes_seen), others.plans, atol=1e-9)

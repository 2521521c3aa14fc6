"""Charts: there and back, derivatives, and no jump amid the outcomes."""

import numpy as np
import pytest

from prior_reinforce.plans.symmetry.charts import Cartesian, LogDistance, Polar

CHARTS = [
    (Polar(), 2),
    (Polar((0.43, -0.1), ahead=2.0), 2),
    (Polar((0.1, 0.2)), 3),
    (LogDistance(), 1),
    (LogDistance(), 2),
    (Cartesian(), 3),
]


@pytest.mark.parametrize(("chart", "k"), CHARTS)
def test_outcomes_come_back(chart, k):
    outcomes = np.random.default_rng(0).uniform(0.5, 1.5, (40, k))
    outcomes[::2] *= [-1.0] * k if isinstance(chart, (Polar, Cartesian)) else [1.0] * k
    np.testing.assert_allclose(chart.back(chart.to(outcomes)), outcomes, atol=1e-12)
    np.testing.assert_allclose(chart.back(chart.to(outcomes[0])), outcomes[0], atol=1e-12)


@pytest.mark.parametrize(("chart", "k"), CHARTS)
def test_the_jacobian_is_the_derivative_of_back(chart, k):
    z, step = np.random.default_rng(1).uniform(-0.5, 0.5, (5, k)), 1e-6
    moved = [(chart.back(z + step * e) - chart.back(z - step * e)) / (2 * step) for e in np.eye(k)]
    np.testing.assert_allclose(chart.jacobian(z), np.stack(moved, axis=-1), atol=1e-8)
    np.testing.assert_allclose(chart.jacobian(z[0]), chart.jacobian(z)[0], atol=1e-12)


def test_polar_is_the_log_of_the_distance_and_the_bearing_about_the_centre():
    z = Polar((1.0, 2.0)).to(np.array([[1.0, 4.0, 7.0]]))
    np.testing.assert_allclose(z, [[np.log(2.0), np.pi / 2, 7.0]])
    assert Polar().units(("m", "m", "s")) == ("1", "rad", "s")


def test_bearings_do_not_jump_amid_outcomes_behind_the_base():
    outcomes = np.array([[-1.0, 0.05], [-1.0, -0.05]])
    assert np.ptp(Polar().to(outcomes)[:, 1]) > 6.0
    chart = Polar().around(outcomes)
    np.testing.assert_allclose(np.ptp(chart.to(outcomes)[:, 1]), 2 * np.arctan(0.05))
    np.testing.assert_allclose(chart.back(chart.to(outcomes)), outcomes, atol=1e-12)

import numpy as np
import pytest

from prior_reinforce.adapters import make_adapter
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.testing import AdapterContract
from reproduction.rivals import (
    BayesianOptimisationAdapter,
    CmaEsAdapter,
    NewtonAdapter,
    NormOptimalAdapter,
)

SQUARE = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])  # spread 1
A, SHIFT, GOAL = np.array([[1.3, 0.2], [-0.1, 0.9]]), np.array([0.1, -0.05]), np.array([0.3, 0.0])


class TestNewtonContract(AdapterContract):
    make = staticmethod(NewtonAdapter)


class TestNormOptimalContract(AdapterContract):
    make = staticmethod(NormOptimalAdapter)


class TestCmaEsContract(AdapterContract):
    make = staticmethod(CmaEsAdapter)


@pytest.mark.slow
class TestBayesianOptimisationContract(AdapterContract):
    make = staticmethod(BayesianOptimisationAdapter)


def started(adapter):
    plans = np.zeros((4, 2, 1)) + np.arange(4)[:, None, None]
    adapter.start(Demonstrations(plans, SQUARE, PlanFormat(("j1",), ("rad",), 0.02)))
    return adapter


def errors(adapter, n):
    """How far n trials of a linear world miss, told exactly."""
    found = []
    for _ in range(n):
        condition = adapter.propose(GOAL)
        error = A @ condition + SHIFT - GOAL
        adapter.observe(condition, GOAL, error)
        found.append(np.linalg.norm(error))
    return found


def test_newtons_slope_is_the_derivative_of_the_interpolated_outcomes():
    adapter = started(NewtonAdapter(gain=1.0, reach=0.7, smoothing=1e-6))
    tried = np.array([[0.5, 0.1], [0.2, -0.3], [0.1, 0.2]])
    for condition in tried:
        adapter.observe(condition, GOAL, A @ condition + SHIFT - GOAL)

    def off(c):  # the interpolator, written once more
        known = np.vstack([SQUARE, tried])
        values = np.vstack([0 * SQUARE, tried @ A.T + SHIFT - tried])

        def kernel(x, y):
            return np.exp(-0.5 * np.square(x[:, None] - y[None]).sum(axis=-1) / 0.7**2)

        return kernel(c[None], known) @ np.linalg.solve(kernel(known, known), values)

    steps = 1e-5 * np.eye(2)
    slope = (
        np.eye(2) + np.array([(off(tried[-1] + s) - off(tried[-1] - s))[0] / 2e-5 for s in steps]).T
    )
    expected = tried[-1] - np.linalg.solve(slope, A @ tried[-1] + SHIFT - GOAL)
    np.testing.assert_allclose(adapter.propose(GOAL), expected, atol=1e-3)


def test_norm_optimal_control_weighs_an_error_against_a_step_by_hand():
    adapter = started(NormOptimalAdapter(effort=0.25, stiffness=1.0))
    adapter.observe(GOAL, GOAL, np.array([0.1, 0.0]))  # A = I: the step is 1 / 1.25 of the error
    np.testing.assert_allclose(adapter.propose(GOAL), [0.3 - 0.08, 0.0])


def test_norm_optimal_control_fits_the_slope_that_trials_show():
    adapter = started(NormOptimalAdapter(effort=1e-9, stiffness=1e-9))
    assert errors(adapter, 5)[-1] < 1e-3


def test_newton_solves_a_linear_world():
    assert errors(started(NewtonAdapter(gain=1.0, smoothing=1e-3)), 6)[-1] < 5e-3


@pytest.mark.parametrize(
    "rival", [CmaEsAdapter, pytest.param(BayesianOptimisationAdapter, marks=pytest.mark.slow)]
)
def test_searches_come_nearer_than_the_goal_itself(rival):
    missed = errors(started(rival()), 15)
    assert min(missed) < 0.5 * missed[0]


def test_cma_es_leaves_the_global_generator_alone():
    np.random.seed(1)  # noqa: NPY002  # the global one is what this is about
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    errors(started(CmaEsAdapter()), 6)
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


def test_bayesian_optimisation_leaves_torch_s_generator_alone():
    import torch

    before = torch.random.get_rng_state()
    errors(started(BayesianOptimisationAdapter()), 3)
    assert torch.equal(torch.random.get_rng_state(), before)


def test_they_are_chosen_by_their_class_with_settings():
    rival = make_adapter("reproduction.rivals:NewtonAdapter,gain=0.5")
    assert rival.gain == 0.5
    with pytest.raises(ConfigurationError, match="gain must be a positive number"):
        NewtonAdapter(gain=0.0)

"""Nearest demonstrations, mixed: values worked by hand, and what each must reproduce."""

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from reproduction.generators.nearest import (
    NearestNeighbours,
    NearestNeighboursConfig,
    inverse_distance_weights,
)

FORMAT = PlanFormat(("joint1", "gripper"), ("rad", "1"), 0.02)
OUTCOMES = np.random.default_rng(0).uniform(size=(6, 2))
CONDITIONS = np.random.default_rng(1).uniform(-0.3, 1.3, size=(20, 2))


def demonstrations(n: int = 6) -> Demonstrations:
    rng = np.random.default_rng(0)
    return Demonstrations(rng.normal(size=(n, 11, 2)), rng.uniform(size=(n, 2)), FORMAT)


def test_nearest_mixes_two_neighbours_by_inverse_distance():
    """A goal at a third of the way between two outcomes: weights 2/3 and 1/3 with power 1."""
    outcomes = np.array([[0.0], [3.0], [30.0]])
    plans = np.random.default_rng(0).normal(size=(3, 5, 2))
    config = NearestNeighboursConfig(neighbours=2, power=1.0)
    generator = NearestNeighbours(config).fit(
        Demonstrations(plans, outcomes, FORMAT, OutcomeFormat(("x",), ("cm",))), seed=0
    )
    generated = generator.generate(np.array([[1.0]]))
    np.testing.assert_allclose(generated[0], (2 * plans[0] + plans[1]) / 3)


@pytest.mark.parametrize("n", [2, 3, 6])
def test_nearest_returns_every_demonstration_exactly_at_its_outcome(n: int):
    demos = demonstrations(n)
    generated = NearestNeighbours().fit(demos, seed=0).generate(demos.outcomes_seen)
    np.testing.assert_array_equal(generated, demos.plans)


def test_nearest_never_leaves_the_range_of_its_demonstrations():
    demos = demonstrations()
    far = np.random.default_rng(1).normal(scale=10, size=(50, 2))
    generated = NearestNeighbours().fit(demos, seed=0).generate(far)
    assert np.all(generated <= demos.plans.max(axis=0) + 1e-12)
    assert np.all(generated >= demos.plans.min(axis=0) - 1e-12)


@pytest.mark.parametrize(("setting", "value"), [("neighbours", 0), ("power", 0.0)])
def test_nearest_refuses_senseless_settings(setting: str, value: float):
    with pytest.raises(ConfigurationError, match=setting):
        NearestNeighboursConfig(**{setting: value})


def test_inverse_distance_is_the_value_worked_by_hand():
    """Distances 1, 2, 3: with power 1 the nearest two weigh 2:1; with power 2 all, 36:9:4."""
    outcomes = np.array([[0.0], [3.0], [4.0]])
    conditions = np.array([[1.0]])
    weights = inverse_distance_weights(conditions, outcomes, neighbours=2, power=1.0)
    np.testing.assert_allclose(weights, [[2 / 3, 1 / 3, 0]])
    weights = inverse_distance_weights(conditions, outcomes, neighbours=3, power=2.0)
    np.testing.assert_allclose(weights, np.array([[36, 9, 4]]) / 49)


def test_inverse_distance_returns_a_demonstration_exactly_at_its_outcome():
    weights = inverse_distance_weights(OUTCOMES, OUTCOMES, neighbours=4, power=2.0)
    np.testing.assert_array_equal(weights, np.eye(6))


def test_inverse_distance_survives_great_powers_and_tiny_distances():
    conditions = OUTCOMES + 1e-14
    weights = inverse_distance_weights(conditions, OUTCOMES, neighbours=6, power=50.0)
    np.testing.assert_allclose(weights, np.eye(6), atol=1e-12)


def test_the_nearest_of_one_outcome_are_averaged_there_and_beside_it():
    repeated = np.vstack([OUTCOMES, OUTCOMES[2]])
    at, beside = inverse_distance_weights(
        np.array([OUTCOMES[2], OUTCOMES[2] + 1e-9]), repeated, neighbours=4, power=2.0
    )
    np.testing.assert_array_equal(at[[2, 6]], [0.5, 0.5])
    np.testing.assert_allclose(beside[[2, 6]], [0.5, 0.5])


def test_the_unit_of_a_component_does_not_matter():
    """Metres and milliseconds: every component counts relative to its demonstrated range."""
    factor = np.array([1.0, 1000.0])
    settings = {"neighbours": 3, "power": 2.0}
    np.testing.assert_allclose(
        inverse_distance_weights(CONDITIONS * factor, OUTCOMES * factor, **settings),
        inverse_distance_weights(CONDITIONS, OUTCOMES, **settings),
        atol=1e-9,
    )

import itertools
import os
import warnings

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from prior_reinforce.adapters.gaussian_process import GaussianProcessAdapter, GaussianProcessConfig
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading
from prior_reinforce.simulation.tasks import make_task


def observe(adapter, condition, outcome):
    """Take in a trial by its outcome: seen from a goal at 0, that is the error."""
    adapter.observe(condition, np.zeros(len(outcome)), outcome)


DATA_SETS = int(os.environ.get("DATA_SETS", "20"))  # reproduction/docs/decisions-adapter.md: 200
REGION = np.array([[0.80, -0.25], [1.05, 0.25]])


def demonstrations(outcomes: np.ndarray, units: tuple[str, ...] = ()) -> Demonstrations:
    plans = np.random.default_rng(0).normal(size=(len(outcomes), 4, 1))
    return Demonstrations(
        plans,
        outcomes,
        PlanFormat(("j1",), ("rad",), 0.02),
        OutcomeFormat(tuple("xyz"[: len(units)]), units),
    )


def spread_over_region(seed: int, n: int = 6) -> np.ndarray:
    corners = np.array([[0.1, 0.1], [0.1, 0.5], [0.1, 0.9], [0.9, 0.1], [0.9, 0.5], [0.9, 0.9]])
    jitter = np.random.default_rng(seed).uniform(-0.1, 0.1, size=(n, 2))
    return REGION[0] + (REGION[1] - REGION[0]) * (corners[:n] + jitter)


def random_adapter(seed: int) -> GaussianProcessAdapter:
    """An adapter after random trials: k, n, m, noise, jitters and near-duplicates all vary."""
    rng = np.random.default_rng(seed)
    k = 1 + seed % 3
    adapter = GaussianProcessAdapter(
        GaussianProcessConfig(
            memory_size=[2, None, 1][seed % 3],
            demonstration_jitter_bounds=(float(10 ** rng.uniform(-4, -2)), 0.3),
            trial_jitter=float(10 ** rng.uniform(-4, -1)),
        )
    )
    outcomes = rng.uniform(size=(rng.integers(k + 2, 9), k)) * [0.25, 0.5, 0.4][:k]
    adapter.start(demonstrations(outcomes))
    spread = 1e-4 if seed % 4 == 0 else 0.2
    centre = rng.uniform(size=k) * 0.3
    for outcome in centre + spread * rng.normal(size=(rng.integers(0, 6), k)):
        observe(adapter, outcome + rng.normal(size=k) * rng.choice([0.005, 0.02, 0.1]), outcome)
    return adapter


def reference(adapter: GaussianProcessAdapter, restarts: int) -> GaussianProcessRegressor:
    regressor = GaussianProcessRegressor(
        ConstantKernel(1.0, (1e-5, 1e5)) * RBF(1.0, (1e-5, 1e5)),
        alpha=adapter.jitter_,
        n_restarts_optimizer=restarts,
        random_state=0,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a kernel at its bounds is expected
        return regressor.fit(adapter.memory_outcomes_, adapter.memory_conditions_)


def assert_no_worse_than_scikit_learn(seeds: range, restarts: int) -> int:
    """Return for how many seeds both found the same kernel, on which predictions must agree."""
    same = 0
    for seed in seeds:
        adapter = random_adapter(seed)
        fitted = reference(adapter, restarts)
        likelihood = fitted.log_marginal_likelihood_value_
        assert likelihood <= adapter.log_marginal_likelihood_ + 1e-6, seed
        amplitude, length_scale = np.exp(fitted.kernel_.theta)
        if np.allclose(
            [amplitude, length_scale], [adapter.amplitude_, adapter.length_scale_], 1e-3
        ):
            same += 1
            points = np.random.default_rng(seed).normal(size=(5, adapter.memory_outcomes_.shape[1]))
            expected = fitted.predict(points).reshape(points.shape)
            offset, scale = adapter._normalisation.offset, adapter._normalisation.scale
            for point, value in zip(points, expected, strict=True):
                proposed = (adapter.propose(point * scale + offset) - offset) / scale
                np.testing.assert_allclose(proposed, value, atol=1e-3)
    return same


@pytest.mark.slow
def test_never_less_likely_than_scikit_learn_with_its_restarts():
    assert assert_no_worse_than_scikit_learn(range(6), restarts=50) >= 4


@pytest.mark.slow
def test_never_less_likely_than_scikit_learn_on_many_data_sets():
    assert assert_no_worse_than_scikit_learn(range(6, DATA_SETS), restarts=50) >= 0.75 * (
        DATA_SETS - 6
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_predictions_are_scikit_learns_given_the_same_kernel(seed):
    adapter = random_adapter(seed)
    kernel = ConstantKernel(adapter.amplitude_, "fixed") * RBF(adapter.length_scale_, "fixed")
    fitted = GaussianProcessRegressor(kernel, alpha=adapter.jitter_, optimizer=None)
    fitted.fit(adapter.memory_outcomes_, adapter.memory_conditions_)
    assert adapter.log_marginal_likelihood_ == pytest.approx(
        fitted.log_marginal_likelihood_value_, abs=1e-6
    )
    points = np.random.default_rng(seed).normal(size=(5, adapter.memory_outcomes_.shape[1]))
    expected = fitted.predict(points).reshape(points.shape)
    units = adapter._normalisation
    proposed = [units.apply(adapter.propose(units.undo(point))) for point in points]
    np.testing.assert_allclose(proposed, expected, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_first_condition_is_the_goal(seed):
    outcomes = spread_over_region(seed)
    adapter = GaussianProcessAdapter()
    adapter.start(demonstrations(outcomes))
    weights = np.random.default_rng(seed).dirichlet(np.ones(6), size=200)
    inside = [np.linalg.norm(adapter.propose(goal) - goal) for goal in weights @ outcomes]
    assert max(inside) < 0.0002
    centre = outcomes.mean(axis=0)
    outside = [centre + 1.25 * (corner - centre) for corner in outcomes]
    assert max(np.linalg.norm(adapter.propose(goal) - goal) for goal in outside) < 0.001


def largest_miss_between(outcomes: np.ndarray, units: tuple[str, ...] = ()) -> float:
    """How far first conditions are from goals among the outcomes, in their spreads."""
    adapter = GaussianProcessAdapter()
    adapter.start(demonstrations(outcomes, units))
    weights = np.random.default_rng(0).dirichlet(np.ones(len(outcomes)), size=8)
    missed = [adapter.propose(goal) - goal for goal in weights @ outcomes]
    return float(np.abs(missed / adapter._normalisation.scale).max())


@pytest.mark.slow
@pytest.mark.slow
@pytest.mark.parametrize("prior_set", ["A", "B"])
@pytest.mark.parametrize("task", ["basketball-v1", "curling", "fishing"])
def test_the_first_condition_is_the_goal_for_every_subset_of_a_prior_set(task, prior_set):
    outcomes = make_task(task).demonstrations(prior_set).outcomes_seen
    for n in range(2, len(outcomes) + 1):
        for subset in itertools.combinations(range(len(outcomes)), n):
            assert largest_miss_between(outcomes[list(subset)]) < 0.02, subset


@pytest.mark.slow
@pytest.mark.parametrize("k", [1, 2, 3])
@pytest.mark.parametrize("n", [2, 3, 4, 5, 6, 8])
def test_the_first_condition_is_the_goal_however_few_demonstrations_there_are(n, k):
    for seed in range(10):
        outcomes = np.random.default_rng([k, n, seed]).uniform(size=(n, k)) * [0.5, 9.0, 0.4][:k]
        assert largest_miss_between(outcomes, ("m", "s", "m")[:k]) < 0.02, seed


def test_few_demonstrations_are_joined_by_points_of_the_convention_by_hand():
    outcomes = np.array([[0.7, 0.0], [1.1, 0.2]])  # spread sqrt((0.04 + 0.01) / 2)
    adapter = GaussianProcessAdapter()
    adapter.start(demonstrations(outcomes))
    around = 2 * np.sqrt(0.025) * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    expected = np.vstack([outcomes, np.array([0.9, 0.1]) + around])
    np.testing.assert_allclose(adapter._normalisation.undo(adapter.memory_outcomes_), expected)
    np.testing.assert_array_equal(adapter.memory_conditions_, adapter.memory_outcomes_)


def test_a_single_demonstration_is_joined_by_them_as_well_and_trials_are_followed():
    shown = make_task("basketball-v1").demonstrations("A").only([0])
    adapter, goal, off = GaussianProcessAdapter(), np.array([1.0, 0.1]), np.array([0.04, -0.02])
    adapter.start(shown)
    np.testing.assert_allclose(adapter.propose(goal), goal, atol=0.01)
    for _ in range(3):
        condition = adapter.propose(goal)
        adapter.observe(condition, goal, Reading.measured(condition + off - goal, 0.001))
    np.testing.assert_allclose(adapter.propose(goal) + off, goal, atol=0.01)


def test_two_demonstrations_are_enough_to_follow_an_offset():
    adapter = GaussianProcessAdapter()
    adapter.start(demonstrations(np.array([[0.8, -0.2], [1.0, 0.2]])))
    goal, offset = np.array([0.95, -0.05]), np.array([0.03, -0.02])
    for _ in range(4):
        condition = adapter.propose(goal)
        observe(adapter, condition, condition + offset)
    assert np.linalg.norm(adapter.propose(goal) + offset - goal) < 0.005


def test_far_outside_a_condition_returns_to_the_demonstrations_mean():
    outcomes = spread_over_region(0)
    adapter = GaussianProcessAdapter()
    adapter.start(demonstrations(outcomes))
    far = outcomes.mean(axis=0) + np.array([50.0, 0.0])
    np.testing.assert_allclose(adapter.propose(far), outcomes.mean(axis=0), atol=1e-6)


def test_the_memory_starts_with_conditions_equal_to_outcomes():
    outcomes = spread_over_region(1)
    adapter = GaussianProcessAdapter()
    adapter.start(demonstrations(outcomes))
    np.testing.assert_array_equal(adapter.memory_conditions_, adapter.memory_outcomes_)
    np.testing.assert_allclose(adapter._normalisation.undo(adapter.memory_outcomes_), outcomes)


def test_trials_are_learned_from_and_the_oldest_is_forgotten():
    outcomes = spread_over_region(1)
    adapter = GaussianProcessAdapter(GaussianProcessConfig(memory_size=2))
    adapter.start(demonstrations(outcomes))
    trials = np.random.default_rng(0).uniform(*REGION, size=(4, 2, 2))
    undo = adapter._normalisation.undo
    for count, (condition, outcome) in enumerate(trials, start=1):
        observe(adapter, condition, outcome)
        kept = trials[max(0, count - 2) : count]
        expected_outcomes = np.vstack([outcomes, kept[:, 1]])
        expected_conditions = np.vstack([outcomes, kept[:, 0]])
        np.testing.assert_allclose(undo(adapter.memory_outcomes_), expected_outcomes)
        np.testing.assert_allclose(undo(adapter.memory_conditions_), expected_conditions)


def test_the_demonstrations_are_trusted_as_far_as_trials_obey_them_by_hand():
    outcomes = np.array([[-0.1, -0.1], [0.1, -0.1], [-0.1, 0.1], [0.1, 0.1]])  # spread 0.1
    adapter = GaussianProcessAdapter(
        GaussianProcessConfig(trial_jitter=0.5, demonstration_jitter_bounds=(1e-2, 0.4))
    )
    adapter.start(demonstrations(outcomes))
    assert adapter.jitter_.tolist() == [1e-2] * 8  # four join them
    observe(adapter, np.array([0.02, 0.0]), np.array([0.06, 0.02]))  # (0.4, 0.2) spreads away
    np.testing.assert_allclose(adapter.jitter_, [0.1] * 8 + [0.5])
    observe(adapter, np.array([0.0, 0.0]), np.array([0.0, 0.0]))
    np.testing.assert_allclose(adapter.jitter_, [0.05] * 8 + [0.5] * 2)
    observe(adapter, np.array([0.0, 0.0]), np.array([3.0, 0.0]))  # lost
    np.testing.assert_allclose(adapter.jitter_, [0.4] * 8 + [0.5] * 2)


def test_what_was_forgotten_leaves_no_trace():
    goal, trials = np.array([0.9, 0.0]), np.random.default_rng(0).uniform(*REGION, size=(4, 2, 2))
    proposals = []
    for first in (0, 2):
        adapter = GaussianProcessAdapter(GaussianProcessConfig(memory_size=2))
        adapter.start(demonstrations(spread_over_region(1)))
        for condition, outcome in trials[first:]:
            observe(adapter, condition, outcome)
        proposals.append(adapter.propose(goal))
    np.testing.assert_array_equal(*proposals)


def test_m_of_infinity_keeps_every_trial():
    adapter = GaussianProcessAdapter(GaussianProcessConfig(memory_size=None))
    adapter.start(demonstrations(spread_over_region(1)))
    for condition, outcome in np.random.default_rng(0).uniform(*REGION, size=(7, 2, 2)):
        observe(adapter, condition, outcome)
    assert len(adapter.memory_outcomes_) == 13


def test_the_order_of_the_demonstrations_does_not_matter():
    outcomes, order = spread_over_region(2), [3, 1, 5, 0, 4, 2]
    proposals = []
    for arrangement in (outcomes, outcomes[order]):
        adapter = GaussianProcessAdapter()
        adapter.start(demonstrations(arrangement))
        observe(adapter, np.array([0.9, 0.0]), np.array([0.93, -0.02]))
        proposals.append(adapter.propose(np.array([0.9, 0.0])))
    np.testing.assert_allclose(*proposals, atol=1e-6)


def test_a_constant_offset_is_corrected_for():
    adapter = GaussianProcessAdapter()
    adapter.start(demonstrations(spread_over_region(3)))
    goal, offset = np.array([0.92, 0.05]), np.array([0.03, -0.02])
    errors = []
    for _ in range(5):
        condition = adapter.propose(goal)
        errors.append(np.linalg.norm(condition + offset - goal))
        observe(adapter, condition, condition + offset)
    assert errors[0] == pytest.approx(np.linalg.norm(offset), abs=0.002)
    assert errors[1] < 0.5 * errors[0]
    assert errors[-1] < 0.005


def test_units_do_not_matter_when_all_components_share_one():
    outcomes = spread_over_region(4)
    proposals = []
    for factor in (1.0, 100.0):
        adapter = GaussianProcessAdapter()
        adapter.start(demonstrations(factor * outcomes, units=("u", "u")))
        observe(adapter, factor * np.array([0.9, 0.0]), factor * np.array([0.93, -0.02]))
        proposals.append(adapter.propose(factor * np.array([0.9, 0.0])) / factor)
    np.testing.assert_allclose(*proposals, atol=1e-7)


def test_metres_and_milliseconds_are_as_good_as_metres_and_seconds():
    outcomes = spread_over_region(4)
    proposals = []
    for factor in ([1.0, 1.0], [1.0, 1000.0]):
        adapter = GaussianProcessAdapter()
        adapter.start(demonstrations(factor * outcomes, units=("m", "s")))
        observe(adapter, factor * np.array([0.9, 0.0]), factor * np.array([0.93, -0.02]))
        proposals.append(adapter.propose(factor * np.array([0.9, 0.0])) / factor)
    np.testing.assert_allclose(*proposals, atol=1e-7)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"memory_size": 0}, "memory_size"),
        ({"demonstration_jitter_bounds": (0.0, 1.0)}, "demonstration_jitter_bounds"),
        ({"demonstration_jitter_bounds": (0.2, 0.1)}, "demonstration_jitter_bounds"),
        ({"trial_jitter": float("nan")}, "trial_jitter"),
        ({"amplitude_bounds": (0.0, 1.0)}, "amplitude_bounds"),
        ({"length_scale_bounds": (2.0, 1.0)}, "length_scale_bounds"),
    ],
)
def test_settings_out_of_range_are_refused(settings, word):
    with pytest.raises(ConfigurationError, match=word):
        GaussianProcessConfig(**settings)

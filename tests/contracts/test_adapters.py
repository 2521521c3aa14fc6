"""What every condition adapter keeps to; the members are taken from their registry."""

import numpy as np
import pytest

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.errors import InvalidFeedbackError, InvalidGoalError, NotFittedError
from prior_reinforce.plans.motions import Demonstrations, PlanFormat

UNITS = {1: ("m",), 2: ("m", "m"), 3: ("m", "m", "s")}
SCALES = {1: [0.3], 2: [0.25, 0.5], 3: [0.25, 0.5, 40.0]}


def demonstrations(k: int, n: int = 6) -> Demonstrations:
    rng = np.random.default_rng(k)
    outcomes = rng.uniform(size=(n, k)) * SCALES[k]
    format_ = PlanFormat(("joint1",), ("rad",), 0.02)
    return Demonstrations(rng.normal(size=(n, 4, 1)), outcomes, format_, outcome_units=UNITS[k])


def trials(k: int, n: int = 4) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(50 + k)
    conditions = rng.uniform(size=(n, k)) * SCALES[k]
    errors = rng.normal(scale=0.05, size=(n, k)) * SCALES[k]
    return list(zip(conditions, conditions + errors, strict=True))


@pytest.fixture(params=ADAPTERS.members)
def make(request):
    return lambda: ADAPTERS.make(request.param)


each_k = pytest.mark.parametrize("k", [1, 2, 3])


@each_k
def test_proposals_are_finite_vectors_and_the_same_every_time(make, k):
    proposals = []
    for _ in range(2):
        adapter = make()
        adapter.start(demonstrations(k))
        goal = 0.4 * np.array(SCALES[k])
        proposals.append([adapter.propose(goal)])
        for condition, outcome in trials(k):
            adapter.observe(condition, outcome)
            proposals[-1].append(adapter.propose(goal))
    assert np.shape(proposals[0]) == (5, k)
    assert np.all(np.isfinite(proposals[0]))
    np.testing.assert_array_equal(proposals[0], proposals[1])


@each_k
def test_proposing_changes_nothing_and_aliases_nothing(make, k):
    adapter = make()
    adapter.start(demonstrations(k))
    for condition, outcome in trials(k):
        given = condition.copy(), outcome.copy()
        adapter.observe(*given)
        given[0][:], given[1][:] = 1e3, -1e3
    goal = 0.4 * np.array(SCALES[k])
    kept = goal.copy()
    first = adapter.propose(goal)
    value = first.copy()
    first[:] = 1e3
    adapter.propose(2.0 * goal)  # another goal in between must leave no trace
    np.testing.assert_array_equal(adapter.propose(goal), value)
    np.testing.assert_array_equal(goal, kept)

    clean = make()
    clean.start(demonstrations(k))
    for condition, outcome in trials(k):
        clean.observe(condition, outcome)
    np.testing.assert_array_equal(clean.propose(goal), value)


@each_k
def test_starting_again_forgets_every_trial(make, k):
    goal = 0.4 * np.array(SCALES[k])
    fresh, used = make(), make()
    fresh.start(demonstrations(k))
    used.start(demonstrations(k, n=8))
    for condition, outcome in trials(k):
        used.observe(condition, outcome)
    used.start(demonstrations(k))
    np.testing.assert_array_equal(used.propose(goal), fresh.propose(goal))


@each_k
def test_the_first_condition_is_the_goal_to_within_a_hundredth_of_the_region(make, k):
    adapter = make()
    adapter.start(demonstrations(k))
    goal = demonstrations(k).outcomes_seen.mean(axis=0)
    assert np.all(np.abs(adapter.propose(goal) - goal) < 0.01 * np.array(SCALES[k]))


def test_before_start_it_says_what_to_call(make):
    with pytest.raises(NotFittedError, match=r"start\(demonstrations\)"):
        make().propose(np.zeros(2))
    with pytest.raises(NotFittedError, match=r"start\(demonstrations\)"):
        make().observe(np.zeros(2), np.zeros(2))


@pytest.mark.parametrize("bad", [np.zeros(3), np.zeros((1, 2)), np.array([0.1, np.nan]), "far"])
def test_bad_vectors_are_named_errors_and_leave_no_trace(make, bad):
    adapter = make()
    adapter.start(demonstrations(2))
    good, goal = trials(2)[0], np.array([0.1, 0.2])
    adapter.observe(*good)
    before = adapter.propose(goal)
    with pytest.raises(InvalidGoalError, match="goal"):
        adapter.propose(bad)
    with pytest.raises(InvalidFeedbackError, match="condition"):
        adapter.observe(bad, good[1])
    with pytest.raises(InvalidFeedbackError, match="outcome"):
        adapter.observe(good[0], bad)
    np.testing.assert_array_equal(adapter.propose(goal), before)


def test_a_trial_repeated_to_the_last_bit_is_no_trouble(make):
    adapter = make()
    adapter.start(demonstrations(2))
    for _ in range(5):
        adapter.observe(*trials(2)[0])
    assert np.all(np.isfinite(adapter.propose(np.array([0.1, 0.2]))))

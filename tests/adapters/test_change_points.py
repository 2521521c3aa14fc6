import numpy as np
import pytest

from prior_reinforce.adapters.change_points import Change, branch
from prior_reinforce.adapters.memory import Inputs
from prior_reinforce.readings import Reading
from tests.adapters.test_bayesian import GOAL, after_two_hits

OTHER = np.array([0.85, -0.1])


def test_a_change_concerns_trials_from_it_on_of_all_goals_or_of_one():
    goals = np.array([[0.0, 1.0], [2.0, 3.0], [0.0, 1.0], [2.0, 3.0]])
    inputs = Inputs(goals, np.array([-1, 2, 3, 4]), goals)
    assert Change(3, 0.8).affects(inputs).tolist() == [False, False, True, True]
    of_one = Change(2, 0.8, goals[1])
    assert of_one.affects(inputs).tolist() == [False, True, False, True]


@pytest.mark.slow
def test_a_shift_is_the_same_everywhere_and_changed_hardware_is_not():
    adapter = after_two_hits()
    at = np.array([[0.0, 0.0], [2.0, 0.0]])
    inputs = Inputs(at, np.array([2, 2]), at)
    shift = Change(1, 0.8).covariance(adapter._trials._prior, inputs, inputs)
    np.testing.assert_allclose(shift, 0.64)
    stretch = Change(1, 0.0).covariance(adapter._trials._prior, inputs, inputs)
    np.testing.assert_allclose(np.diag(stretch), 0.09)
    assert stretch[0, 1] == pytest.approx(0.09 * np.exp(-0.5 * (2.0 / 2.5) ** 2))
    before = Change(3, 0.8).covariance(adapter._trials._prior, inputs, inputs)
    assert not before.any()


def happened(adapter, error):
    """What may have happened where a third trial, for the first goal, came down so far off."""
    told = after_two_hits()
    told.observe(GOAL, GOAL, Reading.measured(error, 0.002))
    may_be = branch(
        adapter._trials._histories,
        adapter._trials._prior,
        adapter._trials._memory,
        told._trials._memory.select(slice(-1, None)),
    )
    return [(history.changes, history.mistaken) for history in may_be]


@pytest.mark.slow
def test_what_was_expected_splits_nothing():
    assert happened(after_two_hits(), [0.002, 0.0]) == [((), frozenset())]


def test_what_was_not_expected_may_have_every_cause():
    causes = happened(after_two_hits(), [0.08, -0.06])
    assert ((), frozenset({2})) in causes
    kinds = {(change.shift_sd, change.goal is None) for changes, _ in causes for change in changes}
    assert kinds == {(0.8, True), (0.0, True), (0.8, False)}


@pytest.mark.slow
@pytest.mark.parametrize("moved", [[0.1, 0.1], [-0.12, 0.05]])
def test_later_trials_tell_a_moved_table_from_a_moved_goal(moved):
    """Two throws at a goal are off alike; a throw at another goal is, or is not."""
    for all_moved in (True, False):
        adapter, seen = after_two_hits(), Reading.measured(moved, 0.002)
        for _ in range(2):
            adapter.observe(GOAL, GOAL, seen)
        adapter.observe(OTHER, OTHER, seen if all_moved else Reading.measured([0.0, 0.0], 0.002))
        (change,) = adapter._trials._histories[0].changes
        assert change.since == 2
        assert (change.goal is None) == all_moved


@pytest.mark.slow
def test_weights_of_histories_are_prior_times_evidence():
    adapter = after_two_hits()
    adapter.observe(GOAL, GOAL, Reading.measured([0.16, -0.12], 0.002))
    logs = [history.log_weight for history in adapter._trials._histories]
    assert logs == sorted(logs, reverse=True)
    for history in adapter._trials._histories:
        evidence = np.log(np.exp(history.posterior.log_evidence).sum(axis=0)).sum()
        assert history.log_weight == pytest.approx(history.log_prior + evidence)

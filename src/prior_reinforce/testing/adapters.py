"""What every condition adapter keeps to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.arrays import Point
from prior_reinforce.errors import InvalidFeedbackError, InvalidGoalError, NotFittedError
from prior_reinforce.readings import Reading
from prior_reinforce.testing.synthetic import synthetic_demonstrations

each_k = pytest.mark.parametrize("k", [1, 2, 3])


class AdapterContract:
    """Inherit it, and name the adapter: `make = staticmethod(RidgeAdapter)`."""

    make: Callable[[], Adapter]
    """Makes a fresh adapter with the settings to test."""

    @each_k
    def test_proposals_are_finite_vectors_and_the_same_every_time(self, k: int) -> None:
        goal = _goal(k)
        proposals: list[list[Point]] = []
        for _ in range(2):
            adapter = self._started(k)
            proposals.append([adapter.propose(goal)])
            for trial in _trials(k):
                adapter.observe(*trial)
                proposals[-1].append(adapter.propose(goal))
        assert np.shape(proposals[0]) == (5, k)
        assert np.all(np.isfinite(proposals[0]))
        np.testing.assert_array_equal(proposals[0], proposals[1])

    @each_k
    def test_proposing_changes_nothing_and_aliases_nothing(self, k: int) -> None:
        adapter = self._started(k)
        for condition, about, reading in _trials(k):
            given = condition.copy(), about.copy()
            adapter.observe(*given, reading)
            given[0][:], given[1][:] = 1e3, -1e3
        goal = _goal(k)
        kept = goal.copy()
        first = adapter.propose(goal)
        value = first.copy()
        first[:] = 1e3
        adapter.propose(2.0 * goal)  # another goal in between must leave no trace
        np.testing.assert_array_equal(adapter.propose(goal), value)
        np.testing.assert_array_equal(goal, kept)

        clean = self._started(k)
        for trial in _trials(k):
            clean.observe(*trial)
        np.testing.assert_array_equal(clean.propose(goal), value)

    @each_k
    def test_starting_again_forgets_every_trial(self, k: int) -> None:
        fresh, used = self._started(k), self.make()
        used.start(synthetic_demonstrations(8, k=k))
        for trial in _trials(k):
            used.observe(*trial)
        used.start(synthetic_demonstrations(k=k))
        np.testing.assert_array_equal(used.propose(_goal(k)), fresh.propose(_goal(k)))

    @each_k
    @pytest.mark.parametrize("n", [2, 3, 4, 5, 6, 8])
    def test_the_first_condition_is_the_goal_to_within_a_hundredth_of_the_region(
        self, n: int, k: int
    ) -> None:
        demonstrations = synthetic_demonstrations(n, k=k)
        adapter = self.make()
        adapter.start(demonstrations)
        outcomes = demonstrations.outcomes_seen
        for goal in (outcomes.mean(axis=0), 0.75 * outcomes[0] + 0.25 * outcomes[1]):
            off = np.abs(adapter.propose(goal) - goal)
            assert np.all(off < 0.01 * np.ptp(outcomes, axis=0))

    def test_demonstrations_that_look_the_same_by_eye_are_no_trouble(self) -> None:
        demonstrations = synthetic_demonstrations(6)
        outcomes = demonstrations.outcomes_seen.copy()
        outcomes[1] = outcomes[4]
        noise = np.full_like(outcomes, 0.02)
        adapter = self.make()
        adapter.start(replace(demonstrations, outcomes_seen=outcomes, outcome_noise=noise))
        goal, spread = outcomes.mean(axis=0), np.ptp(outcomes, axis=0)
        assert np.all(np.abs(adapter.propose(goal) - goal) < 0.01 * spread)
        adapter.observe(goal, goal, 0.1 * spread)
        assert np.all(np.abs(adapter.propose(goal) - goal) < spread)

    def test_before_start_it_says_what_to_call(self) -> None:
        with pytest.raises(NotFittedError, match=r"start\(demonstrations\)"):
            self.make().propose(np.zeros(2))
        with pytest.raises(NotFittedError, match=r"start\(demonstrations\)"):
            self.make().observe(np.zeros(2), np.zeros(2), np.zeros(2))

    @pytest.mark.parametrize("bad", [np.zeros(3), np.zeros((1, 2)), np.array([0.1, np.nan]), "far"])
    def test_bad_vectors_are_named_errors_and_leave_no_trace(self, bad: Any) -> None:
        adapter = self._started(2)
        good, goal = _trials(2)[0], _goal(2)
        adapter.observe(*good)
        before = adapter.propose(goal)
        with pytest.raises(InvalidGoalError, match="goal"):
            adapter.propose(bad)
        with pytest.raises(InvalidFeedbackError, match="condition"):
            adapter.observe(bad, *good[1:])
        with pytest.raises(InvalidFeedbackError, match="goal"):
            adapter.observe(good[0], bad, good[2])
        with pytest.raises(InvalidFeedbackError, match="error"):
            adapter.observe(*good[:2], bad)
        np.testing.assert_array_equal(adapter.propose(goal), before)

    def test_a_trial_repeated_to_the_last_bit_is_no_trouble(self) -> None:
        adapter = self._started(2)
        for _ in range(5):
            adapter.observe(*_trials(2)[0])
        assert np.all(np.isfinite(adapter.propose(_goal(2))))

    @each_k
    def test_intervals_open_ends_and_mere_hits_are_no_trouble(self, k: int) -> None:
        adapter = self._started(k)
        goal, spread = _goal(k), np.ptp(synthetic_demonstrations(k=k).outcomes_seen, axis=0)
        error, everywhere = 0.1 * spread, np.full(k, np.inf)
        for reading in (
            Reading(error, 0.5 * error, 2 * error, np.zeros(k)),
            Reading(error, 0.5 * error, everywhere, 0.1 * error),
            Reading.only(False, k),
            Reading.only(True, k),
        ):
            adapter.observe(goal, goal, reading)
            condition = adapter.propose(goal)
            assert np.all(np.isfinite(condition))
            assert np.all(np.abs(condition - goal) < spread)

    def test_a_miss_of_which_nothing_else_is_known_moves_nobody_who_wants_numbers(self) -> None:
        adapter = self._started(2)
        before = adapter.propose(_goal(2))
        adapter.observe(before, _goal(2), Reading.only(False, 2))
        np.testing.assert_allclose(adapter.propose(_goal(2)), before, rtol=0.05)

    def _started(self, k: int) -> Adapter:
        adapter = self.make()
        adapter.start(synthetic_demonstrations(k=k))
        return adapter


def _goal(k: int) -> Point:
    """Four tenths of the way through the demonstrated outcomes."""
    outcomes = synthetic_demonstrations(k=k).outcomes_seen
    return np.asarray(outcomes.min(axis=0) + 0.4 * np.ptp(outcomes, axis=0))


def _trials(k: int, n: int = 4) -> list[tuple[Point, Point, Point]]:
    """Conditions, the goal, and numbers that say they missed by a twentieth of the region."""
    rng = np.random.default_rng(50 + k)
    outcomes = synthetic_demonstrations(k=k).outcomes_seen
    low, high = outcomes.min(axis=0), outcomes.max(axis=0)
    conditions = rng.uniform(low, high, size=(n, k))
    missed = conditions + rng.normal(scale=0.05, size=(n, k)) * (high - low) - _goal(k)
    return [(c, _goal(k), error) for c, error in zip(conditions, missed, strict=True)]

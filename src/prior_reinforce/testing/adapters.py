"""What every condition adapter keeps to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from prior_reinforce.adapters.base import Adapter, Expectation, State, next_key
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
        assert np.shape(proposals[0]) == (5, k), f"propose returns a vector of k = {k} numbers"
        assert np.all(np.isfinite(proposals[0])), "every proposal is finite"
        assert np.array_equal(proposals[0], proposals[1]), (
            "the same trials lead to the same proposals, bit for bit"
        )

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
        again = adapter.propose(goal)
        assert np.array_equal(again, value), "propose changes nothing, and returns a fresh array"
        assert np.array_equal(goal, kept), "propose leaves the goal that it is given as it was"

        clean = self._started(k)
        for trial in _trials(k):
            clean.observe(*trial)
        assert np.array_equal(clean.propose(goal), value), "observe copies what it keeps"

    @each_k
    def test_what_is_expected_can_be_written_down(self, k: int) -> None:
        adapter, goal = self._started(k), _goal(k)
        expected = adapter.expect(adapter.propose(goal), goal, np.full(k, 0.05))
        again = msgspec.json.decode(msgspec.json.encode(expected), type=Expectation)
        assert again == expected, "expect returns an Expectation of plain numbers"

    @each_k
    def test_starting_again_forgets_every_trial(self, k: int) -> None:
        fresh, used = self._started(k), self.make()
        used.start(synthetic_demonstrations(8, k=k))
        for trial in _trials(k):
            used.observe(*trial)
        used.start(synthetic_demonstrations(k=k))
        same = np.array_equal(used.propose(_goal(k)), fresh.propose(_goal(k)))
        assert same, "start forgets the trials and demonstrations before it"

    @each_k
    def test_what_is_kept_in_a_file_goes_on_as_if_never_put_away(
        self, k: int, tmp_path: Path
    ) -> None:
        told, demonstrations = self._started(k), synthetic_demonstrations(k=k)
        before, after = _trials(k)[:3], _trials(k)[3:]
        key = told.first_key(demonstrations)
        for condition, about, reading in before:
            told.observe(condition, about, reading)
            seen = reading if isinstance(reading, Reading) else Reading.estimated(reading)
            key = next_key(key, "observe", condition, about, seen)
        assert key == told.key
        state = told.state()
        if state is None:
            return
        state.save(tmp_path / "state.npz")
        resumed = self.make()
        resumed.resume(demonstrations, State.load(tmp_path / "state.npz"))
        for trial in after:
            np.testing.assert_array_equal(resumed.propose(_goal(k)), told.propose(_goal(k)))
            for adapter in (told, resumed):
                adapter.observe(*trial)
        assert resumed.key == told.key
        np.testing.assert_array_equal(resumed.propose(_goal(k)), told.propose(_goal(k)))

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
            near = np.all(off < 0.01 * np.ptp(outcomes, axis=0))
            assert near, f"before any trial it proposes the goal to within 1 %; it is off by {off}"

    def test_demonstrations_that_look_the_same_by_eye_are_no_trouble(self) -> None:
        demonstrations = synthetic_demonstrations(6)
        outcomes = demonstrations.outcomes_seen.copy()
        outcomes[1] = outcomes[4]
        noise = np.full_like(outcomes, 0.02)
        adapter = self.make()
        adapter.start(replace(demonstrations, outcomes_seen=outcomes, outcome_noise=noise))
        goal, spread = outcomes.mean(axis=0), np.ptp(outcomes, axis=0)
        first = np.abs(adapter.propose(goal) - goal)
        assert np.all(first < 0.01 * spread), "two like outcomes leave the first proposal the goal"
        adapter.observe(goal, goal, 0.1 * spread)
        then = np.abs(adapter.propose(goal) - goal)
        assert np.all(then < spread), f"two like outcomes throw no proposal far off, as by {then}"

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
        same = np.array_equal(adapter.propose(goal), before)
        assert same, "a trial that is refused leaves no trace"

    def test_a_trial_repeated_to_the_last_bit_is_no_trouble(self) -> None:
        adapter = self._started(2)
        for _ in range(5):
            adapter.observe(*_trials(2)[0])
        assert np.all(np.isfinite(adapter.propose(_goal(2)))), "like trials keep proposals finite"

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
            said = f"after {reading}, it proposes {condition} for {goal}"
            assert np.all(np.isfinite(condition)), f"{said}; every proposal is finite"
            assert np.all(np.abs(condition - goal) < spread), f"{said}, farther than all outcomes"

    def test_a_miss_of_which_nothing_else_is_known_moves_nobody_who_wants_numbers(self) -> None:
        adapter = self._started(2)
        before = adapter.propose(_goal(2))
        adapter.observe(before, _goal(2), Reading.only(False, 2))
        after = adapter.propose(_goal(2))
        near = np.allclose(after, before, rtol=0.05, atol=0)
        assert near, f"a mere miss teaches no number, yet {before} became {after}"

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

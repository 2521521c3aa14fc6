"""What every perception keeps to."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout
from prior_reinforce.errors import PerceptionFailedError
from prior_reinforce.perception.base import Perception
from prior_reinforce.readings import Reading


class PerceptionContract:
    """Inherit it, and name the perception: `make = staticmethod(OverheadCamera)`.

    It may raise PerceptionFailedError now and then, in at most half of the looks. One that reads
    pictures overrides `rollout`, to give it a key frame.
    """

    make: Callable[[], Perception]
    """Makes a perception with the settings to test."""
    dims: ClassVar[tuple[int, ...]] = (1, 2, 3)
    """Every k that it can see."""

    def rollout(self, outcome: Point, *, valid: bool = True) -> Rollout:
        """Return what came of a trial; override it for a perception that needs a key frame."""
        return Rollout(outcome=outcome, valid=valid)

    def test_the_same_seed_sees_the_same_finite_error(self) -> None:
        for k in self.dims:
            trial, goal = self.rollout(np.linspace(0.9, 0.3, k)), np.full(k, 0.5)
            seen = []
            for _ in range(2):
                with self.make() as perception:
                    seen.append(_looks(perception, trial, goal, 5))
            assert [*seen[0]] == [*seen[1]], "it fails at the same seeds each time"
            for seed, reading in seen[0].items():
                assert _told(reading).shape == (4, k), f"a reading has k = {k} components"
                assert np.all(np.isfinite(reading.error_seen)), "the error that is seen is finite"
                same = np.array_equal(_told(reading), _told(seen[1][seed]))
                assert same, "the same seed sees the same; draw from the rng that is given"

    def test_it_returns_fresh_arrays_and_leaves_its_inputs(self) -> None:
        trial, goal = self.rollout(np.array([0.9, 0.1])), np.array([0.8, 0.3])
        with self.make() as perception:
            looks = _looks(perception, trial, goal, 5)
        for seen in looks.values():
            for part in (seen.error_seen, seen.low, seen.high, seen.sd):
                shared = np.shares_memory(part, trial.outcome) or np.shares_memory(part, goal)
                assert not shared, "a reading shares no memory with the outcome or the goal"
        kept = np.array_equal(trial.outcome, [0.9, 0.1]) and np.array_equal(goal, [0.8, 0.3])
        assert kept, "perceive leaves the outcome and the goal as they were"

    def test_a_large_error_is_seen_on_its_own_side(self) -> None:
        trial, goal = self.rollout(np.array([1.1, 0.0])), np.array([0.9, 0.3])
        with self.make() as perception:
            for seen in _looks(perception, trial, goal, 20).values():
                error = seen.error_seen
                right = error[0] > 0.1 and error[1] < -0.15
                assert right, f"the error is outcome minus goal: [0.2, -0.3] was seen as {error}"

    def test_the_true_error_lies_where_the_reading_says(self) -> None:
        for k in self.dims:
            trial, goal = self.rollout(np.linspace(0.9, 0.3, k)), np.full(k, 0.55)
            true, inside = trial.outcome - goal, 0
            with self.make() as perception:
                looks = _looks(perception, trial, goal, 40)
            for seen in looks.values():
                slack = 2.5 * seen.sd + 1e-9
                inside += bool(np.all((seen.low - slack <= true) & (true <= seen.high + slack)))
            assert inside >= 0.85 * len(looks), (
                f"the true error lies within low - 2.5 sd and high + 2.5 sd in {inside} of "
                f"{len(looks)} looks; say a larger sd"
            )

    def test_a_lost_object_is_seen_where_the_task_says_it_went_or_not_at_all(self) -> None:
        trial, goal = self.rollout(np.array([0.0, 0.0]), valid=False), np.array([0.9, 0.0])
        with self.make() as perception:
            try:
                seen = perception.perceive(trial, goal, np.random.default_rng(1)).error_seen
            except PerceptionFailedError:
                return  # it is out of the picture, and an operator is asked
        assert seen[0] < -0.5, f"a lost object 0.9 short of the goal was seen {seen} off it"


def _looks(perception: Perception, trial: Rollout, goal: Point, n: int) -> dict[int, Reading]:
    """What is seen of a trial with seeds 0 to n - 1; an operator is asked about the others."""
    seen = {}
    for seed in range(n):
        with suppress(PerceptionFailedError):
            seen[seed] = perception.perceive(trial, goal, np.random.default_rng(seed))
    assert len(seen) >= n / 2, f"it failed in {n - len(seen)} of {n} looks, more than half"
    return seen


def _told(reading: Reading) -> Float[np.ndarray, "4 k"]:
    return np.stack([reading.error_seen, reading.low, reading.high, reading.sd])

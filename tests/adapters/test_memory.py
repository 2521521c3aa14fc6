import numpy as np
import pytest

from prior_reinforce.adapters import memory
from prior_reinforce.adapters.memory import Memory, repeats_miss, untried_conditions
from prior_reinforce.readings import Reading
from tests.adapters.test_bayesian import CORNERS, started


def remembering(conditions) -> Memory:
    known = Memory.empty(2)
    for number, condition in enumerate(conditions):
        at = condition[None]
        known = known.append(Memory(at, np.array([number]), at, *np.zeros((4, 1, 2))))
    return known


def test_the_older_of_the_two_closest_together_is_forgotten_and_none_of_the_latest():
    places = np.random.default_rng(0).uniform(size=(memory._CAPACITY + 1, 2))
    places[7] = places[30] + 1e-3
    places[-2] = places[-1] + 1e-4
    assert np.flatnonzero(~remembering(places).kept()).tolist() == [7]
    assert remembering(places[:-1]).kept().all()


def test_two_hundred_trials_are_made_fewer_and_hardly_missed():
    """Trials at random places of a smooth field, seen to 1 cm."""
    adapter, rng = started(), np.random.default_rng(3)

    def moved(condition):
        return 0.03 * np.array([np.sin(9 * condition[1]), np.cos(9 * condition[0])])

    for condition in rng.uniform(CORNERS.min(axis=0), CORNERS.max(axis=0), size=(90, 2)):
        low = np.floor(100 * moved(condition)) / 100
        reading = Reading(moved(condition), low, low + 0.01, np.zeros(2))
        adapter.observe(condition, condition, reading)
    assert len(adapter._trials._memory.numbers) == memory._CAPACITY
    goals = rng.uniform([0.83, -0.17], [0.97, 0.17], size=(20, 2))
    off = [np.linalg.norm(c + moved(c) - goal) for goal in goals for c in [adapter.propose(goal)]]
    assert np.median(off) < 0.004


def test_a_bare_miss_is_one_of_the_latest_whose_reading_leaves_a_hit_possible():
    """Seen 2, or 0.5, of a tolerance off, or anywhere; the same told nine trials ago; and a hit."""
    at = np.zeros((12, 1))
    low = np.array([[-np.inf], *[[5.0]] * 7, [2.0], [0.5], [-np.inf], [0.0]])
    radius = np.ones((12, 1)) * (np.arange(12) < 11)[:, None]
    known = Memory(at, np.arange(12), at, low, np.where(np.isinf(low), np.inf, low), at, radius)
    assert known.bare_misses(known.to_goal).numbers.tolist() == [9, 10]


@pytest.mark.parametrize("k", [1, 2, 3])
def test_where_all_around_was_tried_it_is_looked_farther_off(k):
    """An hour of misses of which nothing was told but that: somewhere is always left."""
    at, reach = np.ones(k), np.full(k, 0.1)
    tried = np.empty((0, k))
    for _ in range(40):
        left = untried_conditions(at, reach, tried, np.full_like(tried, 0.1))
        assert not repeats_miss(left, tried, np.full_like(tried, 0.1)).any()
        tried = np.vstack([tried, left[np.argmin(np.linalg.norm(left - at, axis=1))]])
    assert np.linalg.norm(tried - at, axis=1).max() > 0.1

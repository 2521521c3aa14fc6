import numpy as np

from prior_reinforce.adapters import memory
from prior_reinforce.readings import Reading
from tests.adapters.test_bayesian import CORNERS, GOAL, started


def many(adapter, n):
    """Trials at random places of a smooth field, seen to 1 cm."""
    rng = np.random.default_rng(3)
    for condition in rng.uniform(CORNERS.min(axis=0), CORNERS.max(axis=0), size=(n, 2)):
        moved = 0.03 * np.array([np.sin(9 * condition[1]), np.cos(9 * condition[0])])
        low = np.floor(100 * moved) / 100
        reading = Reading(moved, low, low + 0.01, np.zeros(2))
        adapter.observe(condition, condition, reading)
    return adapter


def test_two_hundred_trials_are_merged_and_hardly_missed(monkeypatch):
    merged = many(started(), 200)
    assert len(merged._memory.changes) <= 24
    monkeypatch.setattr(memory, "_KEPT", 10**6)
    whole = many(started(), 60)
    goals = np.random.default_rng(0).uniform([0.83, -0.17], [0.97, 0.17], size=(20, 2))
    off, off_whole = (
        [np.linalg.norm(c + 0.03 * np.array([np.sin(9 * c[1]), np.cos(9 * c[0])]) - goal)
         for goal in goals for c in [adapter.propose(goal)]]
        for adapter in (merged, whole)
    )  # fmt: skip
    assert np.median(off) < 0.004
    assert np.median(off) < 2 * np.median(off_whole) + 0.001


def test_trials_that_cannot_be_merged_are_kept_apart():
    adapter = started()
    for _ in range(30):
        adapter.observe(GOAL, GOAL, Reading.measured([0.01, 0.0]))
        adapter.change_hardware()
    assert len(adapter._memory.changes) == 30


def test_trials_of_different_hardware_are_never_merged():
    adapter = many(started(), 20)
    adapter.change_hardware()
    many(adapter, 40)
    counts = np.bincount(adapter._memory.changes)
    assert np.all(counts > 0)
    assert len(counts) == 2

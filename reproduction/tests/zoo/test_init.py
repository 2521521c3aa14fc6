"""The zoo as a whole: its split, and that every kind of set can be made on every task."""

import numpy as np
import pytest

from prior_reinforce.simulation.tasks import make_task
from reproduction.zoo import DEVELOPED_ON, MEMBERS, REPORTED, SEVERAL_WAYS
from reproduction.zoo.human import COUNTS, KINDS


def test_each_task_is_either_developed_on_or_reported_or_of_several_ways():
    assert sorted((*DEVELOPED_ON, *REPORTED, *SEVERAL_WAYS)) == sorted(MEMBERS)
    assert abs(len(DEVELOPED_ON) - len(REPORTED)) <= 1


def test_both_halves_have_every_number_of_outcomes_and_poses_increments_and_clocks():
    for half in (DEVELOPED_ON, REPORTED):
        tasks = [make_task(name) for name in half]
        assert {task.outcome_format.outcome_dim for task in tasks} == {1, 2, 3}
        assert any("rx" in task.format.names for task in tasks)
        assert any("dx" in task.format.names for task in tasks)
        assert any("1" in task.format.units for task in tasks)
        assert any(task.release == "the clock" for task in tasks)


TASKS = (*DEVELOPED_ON, *REPORTED)
PAIRS = [(name, [*KINDS][i % len(KINDS)]) for i, name in enumerate(TASKS)]
"""Each task in one kind, each kind of a task: all pairs are 196, and sets are drawn alike."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), PAIRS)
def test_tasks_can_be_demonstrated_in_every_kind(name, kind):
    task = make_task(name)
    low, high = task.region
    count = COUNTS[1] if kind == "mixed" else COUNTS[0]
    made = task.demonstrations(f"{kind}-{count}-0")
    assert made.n == count
    assert np.all(np.ptp(made.outcomes_seen, axis=0) >= 0.85 * (high - low))
    np.testing.assert_array_equal(
        made.outcomes_seen, [rollout.outcome for rollout in task.rollout(made.plans, None)]
    )


def test_pairs_hold_every_task_and_kind():
    assert {name for name, _ in PAIRS} == set(TASKS)
    assert {kind for _, kind in PAIRS} == set(KINDS)


@pytest.mark.parametrize("name", [name for name in TASKS if make_task(name).symmetry is not None])
def test_what_a_symmetry_calls_exact_moves_outcomes_by_just_that(name):
    task = make_task(name)
    shown = task.demonstrations("clean-3-0")
    chart = shown.symmetry.chart
    for j in np.flatnonzero(task.symmetry.exact):
        w = 0.2 * np.eye(task.symmetry.k)[j]
        moved = np.stack([task.symmetry.move(plan, w) for plan in shown.plans])
        after = chart.to(np.array([rollout.outcome for rollout in task.rollout(moved, None)]))
        np.testing.assert_allclose(after - chart.to(shown.outcomes_seen), w + 0 * after, atol=1e-9)


def test_most_tasks_state_a_symmetry_in_both_halves():
    for half in (DEVELOPED_ON, REPORTED):
        assert sum(make_task(name).symmetry is not None for name in half) >= 5

"""Round the stone: by either side, clear of it, and through it half-way between."""

import numpy as np

from prior_reinforce.simulation.tasks import make_task
from prior_reinforce.simulation.tasks.curling import STONE_START
from reproduction.demonstrations import curling_round as making


def test_the_two_ways_are_mirror_images_that_begin_beyond_the_push_and_end_at_it():
    times = np.linspace(0.0, 1.2, 50)
    left, right = (making.way_round(times, side) for side in (1.0, -1.0))
    np.testing.assert_allclose(left, right * [1.0, -1.0])
    np.testing.assert_allclose(left[0], [making.BEYOND, 0.0])
    np.testing.assert_allclose(left[-1], [0.0, 0.0], atol=1e-12)
    assert left[:, 1].max() > 0.12  # half widths of bar and stone


def test_every_demonstration_pushes_the_stone_and_half_of_two_ways_does_not_get_there():
    task = make_task("curling-round")
    demos = task.demonstrations("B")
    assert np.all(demos.outcomes_seen[:, 0] > STONE_START[0] + 0.2)
    # Joint 1 turns right first, or left.
    early = demos.plans[:, : making.HORIZON // 3, 0]
    right = np.abs(early.min(axis=1)) > np.abs(early.max(axis=1))
    assert right.sum() == making.N // 2
    between = (demos.plans[right][:3] + demos.plans[~right][:3]) / 2
    goals = (demos.outcomes_seen[right][:3] + demos.outcomes_seen[~right][:3]) / 2
    landed = np.array([rollout.outcome for rollout in task.rollout(between, None)])
    assert np.all(np.linalg.norm(landed - goals, axis=1) > 5 * task.tolerance)

"""More plans than a batch: prepared ahead of the engine, and still drawn in order."""

import numpy as np
import pytest

from prior_reinforce.tasks import Curling


def final_states(rollouts):
    return np.array([rollout.key_frame.state for rollout in rollouts])


@pytest.mark.slow
def test_batches_draw_their_disturbances_one_after_another():
    task = Curling()
    plans = np.resize(task.demonstrations("A").plans[:, :2], (Curling.batch + 1, 2, 7))
    together = task.rollout(plans, np.random.default_rng(3))
    rng = np.random.default_rng(3)
    apart = [
        rollout
        for first in range(0, len(plans), Curling.batch)
        for rollout in task.rollout(plans[first : first + Curling.batch], rng)
    ]
    assert len(together) == len(plans)
    np.testing.assert_array_equal(final_states(together), final_states(apart))
    assert len(np.unique(final_states(together)[:, 0])) == len(plans)

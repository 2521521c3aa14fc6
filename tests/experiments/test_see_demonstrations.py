"""D_e of the paper's Stage 1: demonstrations executed once, their outcomes seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import InvalidDemonstrationsError, PerceptionFailedError
from prior_reinforce.experiments.evaluation import GOAL_SEED, Training
from prior_reinforce.experiments.protocol import see_demonstrations
from prior_reinforce.perception import Exact, Eye, Perception
from prior_reinforce.tasks import make_task

TASK = make_task("basketball-v1")
RECORDED = TASK.demonstrations("A")
MIDDLE = np.array([1.05, 0.0])


def seen(perception: Perception, seed: int = 0, **kwargs) -> np.ndarray:
    demonstrations = see_demonstrations(TASK, RECORDED, perception, seed=seed, **kwargs)
    np.testing.assert_array_equal(demonstrations.plans, RECORDED.plans)
    return demonstrations.outcomes_seen


def test_an_execution_of_its_own_is_seen():
    off = np.linalg.norm(seen(Exact()) - RECORDED.outcomes_seen, axis=1)
    assert off.min() > 0.0005
    assert off.max() < 0.03  # half a centimetre along each axis, disturbed
    np.testing.assert_array_equal(seen(Exact()), seen(Exact()))
    assert np.abs(seen(Exact()) - seen(Exact(), seed=1)).min() > 0


def test_outcomes_are_seen_from_the_middle_of_the_region():
    errors = seen(Eye()) - MIDDLE
    said = {0.0, 0.02, 0.05, 0.1, 0.2, 0.3}
    assert {round(float(abs(e)), 6) for e in errors.ravel()} <= said
    assert np.abs(seen(Eye()) - seen(Exact())).max() > 0.02  # as coarse as that from far off


def test_somebody_else_looks_where_perception_gives_up():
    class Blind(Perception):
        name = "blind"

        def perceive(self, rollout, goal, rng):
            raise PerceptionFailedError("too dark")

    np.testing.assert_array_equal(seen(Blind()), seen(Eye()))


def test_a_lost_demonstration_is_named():
    plans = RECORDED.plans.copy()
    plans[4] = plans[4, :1]  # the arm stands still, the ball stays in the spoon
    with pytest.raises(InvalidDemonstrationsError, match="demonstration 4 was lost on basketball"):
        see_demonstrations(TASK, replace(RECORDED, plans=plans), Exact(), seed=0)


def test_a_training_keeps_what_it_saw_beside_what_it_learned(tmp_path):
    training = Training("basketball-v1", "A", "nearest", 2, perception="eye")
    first, again = training.learned(tmp_path), training.learned(tmp_path)
    np.testing.assert_array_equal(first.prior.outcomes_seen, seen(Eye(), GOAL_SEED + 2))
    np.testing.assert_array_equal(again.prior.outcomes_seen, first.prior.outcomes_seen)
    np.testing.assert_allclose(  # it was learned from them
        again.generator.generate(first.prior.outcomes_seen), RECORDED.plans, atol=1e-6
    )
    exact = replace(training, perception=None).learned(tmp_path)
    np.testing.assert_array_equal(exact.prior.outcomes_seen, RECORDED.outcomes_seen)

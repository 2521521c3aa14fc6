"""D_e of the paper's Stage 1: demonstrations executed once, their outcomes seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import InvalidDemonstrationsError, PerceptionFailedError
from prior_reinforce.experiments.evaluation import GOAL_SEED, SeenDemonstrations, Training, Trials
from prior_reinforce.experiments.protocol import look_by_eye, see_demonstrations
from prior_reinforce.experiments.units import result_of
from prior_reinforce.perception.amplified import Amplified
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.exact import Exact
from prior_reinforce.perception.eye import Eye
from prior_reinforce.rollouts import Rollout
from prior_reinforce.tasks import make_task

TASK = make_task("basketball-v1")
RECORDED = TASK.demonstrations("A")
MIDDLE = np.array([1.05, 0.0])


class Blind(Perception):
    name = "blind"

    def perceive(self, rollout, goal, rng):
        raise PerceptionFailedError("too dark")


def refuse(failure, rollout, goal, rng):
    raise failure


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
    rng = np.random.default_rng(0)
    errors = [Eye().perceive(Rollout(true, True), MIDDLE, rng) for true in seen(Exact())]
    np.testing.assert_array_equal(seen(Eye()), MIDDLE + errors)
    assert np.abs(seen(Eye()) - seen(Exact())).max() > 0.02  # as coarse as that from far off


def test_noise_of_perception_is_drawn_anew_for_each_seed_and_demonstration():
    noise = [seen(Amplified(1.0, 1.0), seed) - seen(Exact(), seed) for seed in (0, 0, 1)]
    np.testing.assert_allclose(noise[0], noise[1])
    assert np.unique(np.round(np.concatenate(noise[1:]), 6)).size == 24


def test_somebody_else_looks_where_perception_gives_up():
    np.testing.assert_array_equal(seen(Blind(), on_failed_reading=look_by_eye), seen(Eye()))
    with pytest.raises(PerceptionFailedError, match="too dark"):
        seen(Blind(), on_failed_reading=refuse)


def test_a_lost_demonstration_is_named():
    plans = RECORDED.plans.copy()
    plans[4] = plans[4, :1]  # the arm stands still, the ball stays in the spoon
    with pytest.raises(InvalidDemonstrationsError, match="demonstration 4 was lost on basketball"):
        see_demonstrations(TASK, replace(RECORDED, plans=plans), Exact(), seed=0)


def test_outcomes_that_look_the_same_are_told_with_what_to_do():
    class Asleep(Perception):
        def perceive(self, rollout, goal, rng):
            return np.zeros(2)

    with pytest.raises(InvalidDemonstrationsError) as raised:
        seen(Asleep(), seed=7)
    for told in ("Asleep", "basketball-v1", "seed 7", "the same outcome", "choose another seed"):
        assert told in str(raised.value)


@pytest.mark.parametrize("name", ["basketball-v1", "curling", "fishing"])
@pytest.mark.parametrize("demonstrations", ["A", "B"])
def test_an_eye_tells_the_shipped_demonstrations_apart(name, demonstrations):
    task = make_task(name)
    for seed in range(3):
        recorded = task.demonstrations(demonstrations)
        see_demonstrations(task, recorded, Eye(), seed=GOAL_SEED + seed)


def test_a_training_learns_from_what_was_seen(tmp_path):
    training = Training("basketball-v1", "A", "nearest", 2, perception="eye")
    first, again = training.learned(tmp_path), training.learned(tmp_path)
    np.testing.assert_array_equal(first.prior.outcomes_seen, seen(Eye(), GOAL_SEED + 2))
    np.testing.assert_array_equal(again.prior.outcomes_seen, first.prior.outcomes_seen)
    np.testing.assert_allclose(
        again.generator.generate(first.prior.outcomes_seen), RECORDED.plans, atol=1e-6
    )
    recorded = replace(training, perception=None).learned(tmp_path)
    np.testing.assert_array_equal(recorded.prior.outcomes_seen, RECORDED.outcomes_seen)


def test_what_was_seen_is_seen_once_for_all_that_learn_from_it(tmp_path):
    Counted.looks = 0
    counted = Training("basketball-v1", "A", "nearest", 0, perception=f"{__name__}:Counted")
    priors = [
        replace(counted, generator=generator, aligned=aligned).learned(tmp_path)
        for generator, aligned in (("nearest", False), ("interpolation", True))
    ]
    assert Counted.looks == RECORDED.n
    np.testing.assert_array_equal(priors[0].prior.outcomes_seen, priors[1].prior.outcomes_seen)


class Counted(Eye):
    """An eye that counts how often it looks."""

    name = "counted"
    looks = 0

    def perceive(self, rollout, goal, rng):
        Counted.looks += 1
        return super().perceive(rollout, goal, rng)


def test_failed_readings_of_demonstrations_are_counted(tmp_path):
    result = result_of(tmp_path, SeenDemonstrations("basketball-v1", "A", f"{__name__}:Blind", 0))
    assert result["failed_readings"] == RECORDED.n
    np.testing.assert_allclose(result["outcomes_seen"], seen(Eye(), GOAL_SEED))


@pytest.mark.slow
def test_goals_do_not_depend_on_how_the_demonstrations_were_seen(tmp_path):
    training = Training("basketball-v1", "A", "nearest", 0)
    by_eye = replace(training, perception="eye")
    goals = [
        Trials(t, "basketball-v1", "frozen", "exact", 5, unseen=True, rounds=1).run(tmp_path)[
            "goals"
        ]
        for t in (training, by_eye)
    ]
    assert goals[0] == goals[1]

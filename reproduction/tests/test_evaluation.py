"""Units: what is learned from what was perceived, and trials through every perception."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import EndpointError, PerceptionFailedError
from prior_reinforce.perception import PERCEPTIONS
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.eye import Eye
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.registry import Member
from prior_reinforce.simulation.protocol import perceive_demonstrations
from prior_reinforce.simulation.tasks import make_task
from reproduction.evaluation import (
    GOAL_SEED,
    PerceivedDemonstrations,
    Training,
    Trials,
    ZeroShot,
)
from reproduction.units import result_of

TASK = make_task("basketball-v1")
RECORDED = TASK.demonstrations("A")
TRAINING = Training("basketball-v1", "A", "nearest", 0)


class Blind(Perception):
    def perceive(self, rollout, goal, rng):
        raise PerceptionFailedError("too dark")


def seen(seed):
    return perceive_demonstrations(TASK, RECORDED, Eye(), seed=seed).outcomes_seen


def test_a_training_learns_from_what_was_seen(tmp_path):
    training = Training("basketball-v1", "A", "nearest", 2, perception="eye")
    first, again = training.learned(tmp_path), training.learned(tmp_path)
    np.testing.assert_array_equal(first.prior.outcomes_seen, seen(GOAL_SEED + 2))
    np.testing.assert_array_equal(again.prior.outcomes_seen, first.prior.outcomes_seen)
    np.testing.assert_allclose(
        again.generator.generate(first.prior.outcomes_seen), RECORDED.plans, atol=1e-6
    )
    recorded = replace(training, perception=None).learned(tmp_path)
    np.testing.assert_array_equal(recorded.prior.outcomes_seen, RECORDED.outcomes_seen)


def test_what_was_seen_is_seen_once_for_all_that_learn_from_it(tmp_path, monkeypatch):
    monkeypatch.setitem(PERCEPTIONS.members, "counted", Member(Counted, "an eye"))
    Counted.looks = 0
    counted = Training("basketball-v1", "A", "nearest", 0, perception="counted")
    priors = [
        replace(counted, generator=generator).learned(tmp_path).prior
        for generator in ("nearest", "interpolation,timing=align")
    ]
    assert Counted.looks == RECORDED.n
    np.testing.assert_array_equal(priors[0].outcomes_seen, priors[1].outcomes_seen)


class Counted(Eye):
    """An eye that counts how often it looks."""

    name = "counted"
    looks = 0

    def perceive(self, rollout, goal, rng):
        Counted.looks += 1
        return super().perceive(rollout, goal, rng)


def test_failed_readings_of_demonstrations_are_counted(tmp_path, monkeypatch):
    monkeypatch.setitem(PERCEPTIONS.members, "blind", Member(Blind, "in the dark"))
    result = result_of(tmp_path, PerceivedDemonstrations("basketball-v1", "A", "blind", 0))
    assert result["failed_readings"] == RECORDED.n
    np.testing.assert_allclose(result["outcomes_seen"], seen(GOAL_SEED))


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


def test_a_generator_of_aligned_plans_is_thrown_beside_the_aligned_demonstrations(tmp_path):
    result = ZeroShot(replace(TRAINING, generator="nearest,timing=align"), 0.2).run(tmp_path)
    assert max(result["own_rms_rad"]) < 1e-6
    assert max(result["own_landing_from_demonstrated_m"]) < 1e-6


@pytest.mark.slow
def test_pictures_give_the_same_trials_again_and_share_the_eyes_goals(tmp_path):
    by_camera = Trials(TRAINING, "basketball-v1", "gp-two-term", "camera", 2, rounds=2)
    first, again = (by_camera.run(tmp_path / name) for name in ("first", "again"))
    assert first == again
    by_eye = Trials(TRAINING, "basketball-v1", "gp-two-term", "eye", 4, rounds=1).run(
        tmp_path / "first"
    )
    assert by_eye["goals"][:2] == first["goals"]


def test_an_endpoint_that_does_not_answer_is_no_eye(tmp_path):
    nobody = VisionLanguageModelConfig(base_url="http://127.0.0.1:9/v1", max_retries=0)
    unit = Trials(TRAINING, "basketball-v1", "gp-two-term", "vlm", 1, rounds=1, model=nobody)
    with pytest.raises(EndpointError, match="is the server running"):
        unit.run(tmp_path)


def test_what_was_perceived_is_kept_with_the_model(tmp_path):
    training = Training("basketball-v1", "A", "nearest", 0, perception="eye")
    prior = training.learned(tmp_path).prior
    assert prior.outcome_noise.any()
    assert prior.outcome_correction.any()
    again = training.learned(tmp_path).prior
    for name in ("outcomes_seen", "outcome_noise", "outcome_correction"):
        np.testing.assert_array_equal(getattr(again, name), getattr(prior, name))

"""People who err: by as much as is said, and not elsewhere."""

import numpy as np

from prior_reinforce.environment import Rollout
from prior_reinforce.perception import make_perception
from prior_reinforce.perception.eye import Eye
from reproduction.observers import (
    BiasedModel,
    ErringEye,
    MisreadingEye,
    ScatteredModel,
)

GOAL = np.array([1.0, 0.0])


def seen(perception, error, times):
    rng = np.random.default_rng(0)
    rollout = Rollout(GOAL + error, True)
    return np.array([perception.perceive(rollout, GOAL, rng).error_seen for _ in range(times)])


def test_an_erring_eye_is_a_fifth_off_and_five_degrees():
    # 4 m away, where rounding to 10 cm hides nothing.
    errors = seen(ErringEye(), np.array([4.0, 0.0]), 2000)
    assert abs(np.linalg.norm(errors, axis=1).std() / 4 - 0.2) < 0.02
    forwards = errors[errors[:, 0] > 0]
    assert abs(np.rad2deg(np.arctan2(*forwards.T[::-1])).std() - 5.0) < 0.5


def test_a_misreading_eye_takes_one_side_for_the_other_once_in_twenty():
    error = np.array([0.1, -0.2])
    errors = seen(MisreadingEye(), error, 2000)
    right = np.all(errors == Eye().perceive(Rollout(GOAL + error, True), GOAL, None).error_seen, 1)
    assert abs(np.mean(~right) - 0.05) < 0.015
    assert np.all(np.abs(errors) == [0.1, 0.2])


def test_a_biased_model_is_off_by_as_much_each_time_and_says_3_mm():
    error = np.array([0.1, -0.2])
    np.testing.assert_allclose(seen(BiasedModel(), error, 3), [[0.12, -0.215]] * 3)
    said = BiasedModel().perceive(Rollout(GOAL + error, True), GOAL, np.random.default_rng(0))
    assert np.all(said.sd == 0.003)


def test_a_scattered_model_is_right_in_the_mean_and_far_off_once_in_twenty():
    error = np.array([0.1, -0.2])
    errors = seen(ScatteredModel(), error, 4000) - error
    assert np.all(np.abs(np.median(errors, axis=0)) < 0.003)
    assert np.all(np.abs(np.quantile(np.abs(errors), 0.5, axis=0) / 0.6745 - 0.03) < 0.003)
    far = np.abs(errors).max(axis=1) > 0.12
    assert abs(np.mean(far) - 0.05 * (1 - 0.31**2)) < 0.01  # P(|n| < 0.4) = 0.31


def test_they_are_made_by_name():
    name = "reproduction.observers:ErringEye"
    assert isinstance(make_perception(name), ErringEye)

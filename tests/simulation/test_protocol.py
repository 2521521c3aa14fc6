"""Demonstrations executed once and seen (paper, Stage 1); goals tried alone and in sequences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.adapters.gaussian_process import GaussianProcessAdapter
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.errors import InvalidDemonstrationsError, PerceptionFailedError
from prior_reinforce.generators.base import Generator
from prior_reinforce.parsing import from_words
from prior_reinforce.perception.amplified import Amplified
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.exact import Exact
from prior_reinforce.perception.eye import Eye
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading
from prior_reinforce.simulation.protocol import (
    estimate_by_eye,
    perceive_demonstrations,
    run_goals,
    run_sequences,
    success_by_round,
    unseen_goals,
)
from prior_reinforce.simulation.tasks import make_task
from reproduction.evaluation import GOAL_SEED

TASK = make_task("basketball-v1")
RECORDED = TASK.demonstrations("A")
MIDDLE = np.array([1.05, 0.0])


class Blind(Perception):
    def perceive(self, rollout, goal, rng):
        raise PerceptionFailedError("too dark")


def refuse(failure, rollout, goal, rng):
    raise failure


def seen(perception: Perception, seed: int = 0, **kwargs) -> np.ndarray:
    demonstrations = perceive_demonstrations(TASK, RECORDED, perception, seed=seed, **kwargs)
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
    errors = [Eye().perceive(Rollout(true, True), MIDDLE, rng).error_seen for true in seen(Exact())]
    np.testing.assert_array_equal(seen(Eye()), MIDDLE + errors)
    assert np.abs(seen(Eye()) - seen(Exact())).max() > 0.02  # as coarse as that from far off


def test_a_word_by_eye_is_expected_in_the_middle_of_what_it_stands_for():
    by_eye = perceive_demonstrations(TASK, RECORDED, Eye(), seed=0)
    errors = by_eye.outcomes_seen - MIDDLE
    tens = np.isclose(np.abs(errors), 0.1)
    assert tens.any()  # from 7.5 to 15 cm
    np.testing.assert_allclose(by_eye.outcome_correction[tens], 0.0125 * np.sign(errors[tens]))
    off, off_expected = (
        np.square(by_eye.outcomes_seen + given - seen(Exact())).mean()
        for given in (0.0, by_eye.outcome_correction)
    )
    assert off_expected < off
    assert not perceive_demonstrations(TASK, RECORDED, Exact(), seed=0).outcome_correction.any()


def test_noise_of_perception_is_drawn_anew_for_each_seed_and_demonstration():
    noise = [seen(Amplified(1.0, 1.0), seed) - seen(Exact(), seed) for seed in (0, 0, 1)]
    np.testing.assert_allclose(noise[0], noise[1])
    assert np.unique(np.round(np.concatenate(noise[1:]), 6)).size == 24


def test_somebody_else_looks_where_perception_gives_up():
    np.testing.assert_array_equal(seen(Blind(), on_failed_reading=estimate_by_eye), seen(Eye()))
    with pytest.raises(PerceptionFailedError, match="too dark"):
        seen(Blind(), on_failed_reading=refuse)


def test_a_lost_demonstration_is_named():
    plans = RECORDED.plans.copy()
    plans[4] = plans[4, :1]  # the arm stands still, the ball stays in the spoon
    with pytest.raises(InvalidDemonstrationsError, match="demonstration 4 was lost on basketball"):
        perceive_demonstrations(TASK, replace(RECORDED, plans=plans), Exact(), seed=0)


def test_outcomes_that_look_the_same_are_told_with_what_to_do():
    class Asleep(Perception):
        def perceive(self, rollout, goal, rng):
            return Reading.measured(np.zeros(2))

    with pytest.raises(InvalidDemonstrationsError) as raised:
        seen(Asleep(), seed=7)
    for told in ("Asleep", "basketball-v1", "seed 7", "all outcomes agree", "choose another seed"):
        assert told in str(raised.value)


@pytest.mark.parametrize("name", ["basketball-v1", "curling", "fishing"])
@pytest.mark.parametrize("demonstrations", ["A", "B"])
def test_an_eye_tells_the_shipped_demonstrations_apart(name, demonstrations):
    task = make_task(name)
    recorded = task.demonstrations(demonstrations)
    for seed in range(3):
        told = perceive_demonstrations(task, recorded, Eye(), seed=GOAL_SEED + seed).outcomes_seen
        assert len(np.unique(told, axis=0)) == recorded.n


def test_unseen_goals_are_farther_from_all_that_is_known_than_random_ones():
    goals = unseen_goals(TASK, RECORDED, 5, np.random.default_rng(0))
    assert np.all((TASK.region[0] <= goals) & (goals <= TASK.region[1]))
    known = np.vstack([RECORDED.outcomes_seen, goals])
    apart = np.linalg.norm(known[:, None] - known, axis=-1) + 9 * np.eye(len(known))
    random = TASK.sample_goals(200, np.random.default_rng(1))
    nearest = np.linalg.norm(random[:, None] - RECORDED.outcomes_seen, axis=-1).min(axis=1)
    assert apart[RECORDED.n :].min() > np.median(nearest)
    assert unseen_goals(TASK, RECORDED, 0, np.random.default_rng(0)).shape == (0, 2)


FORMAT = PlanFormat(("x", "y"), ("m", "m"), 0.1)
OFF = np.array([0.05, -0.03])


class Straight(Generator):
    """Aims where it is told to."""

    name = "straight"

    def _fit(self, demonstrations, seed, progress):
        pass

    def _generate(self, conditions):
        return np.repeat(conditions[:, None], 2, axis=1)

    def state(self):
        return {}, {}

    @classmethod
    def from_state(cls, settings, tensors):
        return cls()


class Wind(Task):
    """Everything lands off by the same amount; the demonstrations were made without wind."""

    name = "wind"
    format = FORMAT
    tolerance = 0.02
    region = np.array([[0.0, 0.0], [1.0, 1.0]])

    def rollout(self, plans, rng):
        return [Rollout(plan[-1] + OFF, valid=True) for plan in plans]

    def demonstrations(self, name):
        outcomes = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
        return Demonstrations(np.repeat(outcomes[:, None], 2, axis=1), outcomes, FORMAT)

    def film(self, plan, goal, rng=None, **_):
        raise NotImplementedError


CALM = Wind().demonstrations("A")
WIND = Wind(), Straight().fit(CALM, seed=0), GaussianProcessAdapter, Exact(), CALM


@pytest.mark.parametrize("carry_over", [False, True])
def test_a_goal_beside_an_earlier_one_needs_no_trial_to_learn_the_wind(carry_over):
    goals = np.array([[0.5, 0.5], [0.52, 0.5], [0.5, 0.53]])
    sequences = np.stack([goals, goals[::-1]])
    done = run_sequences(*WIND, sequences, carry_over=carry_over, rounds=6, seed=0)
    np.testing.assert_array_equal([[r.goal for r in results] for results in done], sequences)
    needed = np.array([[result.solved_at for result in results] for results in done])
    assert np.all(needed[:, 0] > 1)
    assert np.all((needed[:, 1:] == 1) == carry_over)


def test_a_goal_counts_as_reached_from_the_round_that_reached_it():
    goals = np.array([[0.5, 0.5], [0.2, 0.7]])
    rounds = []
    results = run_goals(
        *WIND, goals, rounds=4, seed=0, on_round=lambda number, _: rounds.append(number)
    )
    solved_at = np.array([result.solved_at for result in results])
    assert rounds == list(range(1, solved_at.max() + 1))
    expected = [np.mean(solved_at <= number) for number in range(1, 5)]
    np.testing.assert_array_equal(success_by_round(results, 4), expected)
    np.testing.assert_allclose(results[0].errors[0], OFF, atol=1e-3)  # the goal is aimed at first


class RunningAway(Straight):
    """Its plans for goals to the right are of numbers that no arm has."""

    def _generate(self, conditions):
        return super()._generate(conditions) * np.where(conditions[:, :1, None] > 0.5, 1e7, 1.0)


def test_a_plan_that_ran_away_loses_its_object_and_nobody_elses():
    goals = np.array([[0.2, 0.5], [0.8, 0.5]])
    runaway = RunningAway().fit(CALM, seed=0)
    near, far = run_goals(WIND[0], runaway, *WIND[2:], goals, rounds=3, seed=0)
    assert near.solved_at is not None
    assert far.solved_at is None
    assert not far.rollouts[0].valid
    assert all(rollout.valid for rollout in near.rollouts)


def test_a_demonstration_of_which_only_the_direction_is_said_is_refused_in_one_line():
    def point(failure, rollout, goal, rng):
        words = from_words("long, left")
        return replace(words, error_seen=rng.normal(size=2))

    with pytest.raises(
        InvalidDemonstrationsError, match="demonstration 0 has a direction but no distance"
    ):
        seen(Blind(), on_failed_reading=point)

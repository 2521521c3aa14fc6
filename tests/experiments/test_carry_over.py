"""Carry-over on a world that is off by the same amount everywhere: one trial tells it all."""

import numpy as np
import pytest

from prior_reinforce.adapters import GaussianProcessAdapter
from prior_reinforce.experiments.carry_over import compare, trials_needed
from prior_reinforce.generators import Generator
from prior_reinforce.perception import Exact
from prior_reinforce.plans.motions import Demonstrations, PlanFormat
from prior_reinforce.rollouts import Rollout
from prior_reinforce.tasks import Task

FORMAT = PlanFormat(("x", "y"), ("m", "m"), 0.1)
OFF = np.array([0.05, -0.03])


class Straight(Generator):
    """Aims where it is told to."""

    name = "straight"

    def _fit(self, demonstrations, seed, progress): ...

    def _generate(self, conditions):
        return np.repeat(np.asarray(conditions)[:, None], 2, axis=1)

    generate = _generate  # also before it is fitted


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
        return Demonstrations(Straight().generate(outcomes), outcomes, FORMAT)

    def film(self, plan, goal, rng=None, **_):
        raise NotImplementedError


@pytest.mark.parametrize("memory", ["goal", "workspace"])
def test_a_goal_beside_an_earlier_one_needs_no_trial_to_learn_the_wind(memory):
    goals = np.array([[0.5, 0.5], [0.52, 0.5], [0.5, 0.53]])
    task = Wind()
    needed = trials_needed(
        task,
        Straight(),
        GaussianProcessAdapter,
        Exact(),
        task.demonstrations("A"),
        np.stack([goals, goals[::-1]]),
        memory=memory,
        rounds=6,
        seed=0,
    )
    assert needed.shape == (2, 3)
    assert np.all(needed[:, 0] > 1)
    if memory == "workspace":
        assert np.all(needed[:, 1:] == 1)
    else:
        assert np.all(needed[:, 1:] > 1)


def test_the_first_goal_does_not_count():
    without = np.array([[[9, 3, 3], [9, 2, 4]]])
    with_earlier = np.array([[[9, 1, 2], [1, 2, 3]]])
    result = compare(without, with_earlier)
    assert result.without.value == 3.0
    assert result.with_earlier.value == 2.0
    assert result.saved.value == 1.0

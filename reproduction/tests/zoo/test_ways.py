"""Tasks of two ways: each way reaches the goals, and half of each is neither."""

import math

import numpy as np
import pytest

from prior_reinforce.simulation.tasks import make_task
from reproduction.zoo import SEVERAL_WAYS
from reproduction.zoo.human import Manner
from reproduction.zoo.physics import GRAVITY, moving
from reproduction.zoo.ways import fastest


def led(task, style, aims):
    """What a person leads through in the middle of the frames."""
    d = len(task.format.names)
    manner = Manner(
        0.5, 0.0, 1.0, np.zeros(3), 0.0, np.zeros((2, d)), style, np.zeros((task.horizon, d))
    )
    return manner.path(task, np.array(aims))


def test_the_fastest_moment_of_a_swing_is_found_between_frames():
    times = np.arange(60) * 0.02
    place = np.sin(4.0 * (times - 0.611))[:, None] * np.array([1.0, 0.5, 0.0])
    assert fastest(moving(place, 0.02), 1.0) == pytest.approx(0.611, abs=1e-4)
    assert fastest(moving(0.1 * place, 0.02), 1.0) is None


def test_a_backhand_is_the_mirror_image_of_a_forehand():
    task = make_task("zoo-sidearm")
    forehand, backhand = (task.execute(led(task, style, (1.0, 0.6))) for style in (0, 1))
    np.testing.assert_allclose(backhand, forehand * [1.0, -1.0], atol=1e-9)


def test_over_the_shoulder_and_underhand_the_ball_goes_ahead():
    task = make_task("zoo-overarm")
    for style in (0, 1):
        (near, side), (far, _) = (task.execute(led(task, style, (s, 0.2))) for s in (1.4, 2.0))
        assert 0.5 < near < far
        assert side == pytest.approx(near * math.tan(0.2), abs=0.02)


def test_a_puck_stops_after_v_squared_over_two_mu_g_and_comes_off_the_cushion_more_slowly():
    task = make_task("zoo-bank")
    plan = led(task, 0, (0.3, 0.2))
    speed = 1.875 * 0.3 / 0.35  # a minimum-jerk stroke's peak
    way = speed**2 / (2 * 0.15 * GRAVITY)
    np.testing.assert_allclose(
        task.execute(plan), way * np.array([math.cos(0.2), math.sin(0.2)]), rtol=5e-3
    )
    x, y = task.execute(led(task, 1, (0.35, 0.0)))
    assert y < task.cushion
    free = math.hypot(x, 2 * task.cushion - y)  # where it were without a cushion
    assert free < task.execute(led(task, 0, (0.35, 0.0)))[0]


@pytest.mark.parametrize("name", SEVERAL_WAYS)
def test_both_ways_reach_the_region_and_half_of_each_does_not(name):
    task = make_task(name)
    made = task.demonstrations("ways-8-100")
    assert made.n == 8
    low, high = task.region
    assert np.all((made.outcomes_seen > low - 0.1) & (made.outcomes_seen < high + 0.1))
    turns = made.plans[:, :, 1 if name == "zoo-overarm" else 0]
    side = turns[np.arange(8), np.abs(turns - turns[:, :1]).argmax(axis=1)]
    one, other = np.argsort(side)[:4], np.argsort(side)[4:]
    between = [task.execute((made.plans[i] + made.plans[j]) / 2) for i in one for j in other]
    goals = [(made.outcomes_seen[i] + made.outcomes_seen[j]) / 2 for i in one for j in other]
    hits = [
        landed is not None and np.linalg.norm(landed - goal) < task.tolerance
        for landed, goal in zip(between, goals, strict=True)
    ]
    assert np.mean(hits) < 0.2

"""Known poses pour and swing where the formula says."""

import numpy as np

from reproduction.zoo.carried import Pour, Swing
from reproduction.zoo.physics import flight


def outcome(task, plan):
    (rollout,) = task.rollout(plan[None], None)
    assert rollout.valid
    return rollout.outcome


def test_a_marble_leaves_a_ladle_at_its_tilt_with_the_lips_velocity():
    task = Pour()
    task.bandwidth = None
    speed, pace = np.array([0.5, 0.2, 0.0]), 1.0
    times = np.arange(60) * task.format.dt - 0.6  # the tilt is reached at zero
    plan = np.zeros((60, 6))
    plan[:, :3] = [0.4, 0.0, 0.5] + times[:, None] * speed
    plan[:, 4] = task.tilt + pace * times
    cos, sin = np.cos(task.tilt), np.sin(task.tilt)
    lip = np.array([0.4, 0.0, 0.5]) + task.ladle * np.array([cos, 0.0, -sin])
    velocity = speed + task.ladle * pace * np.array([-sin, 0.0, -cos])
    velocity += task.roll * np.array([cos, 0.0, -sin])
    np.testing.assert_allclose(outcome(task, plan), flight(lip, velocity)[0][:2], atol=1e-4)


def test_a_ladle_that_is_held_level_keeps_the_marble():
    task = Pour()
    plan = np.tile([0.4, 0.0, 0.5, 0.0, 0.0, 0.0], (60, 1))
    plan[:, 0] += np.linspace(0, 0.3, 60)
    (rollout,) = task.rollout(plan[None], None)
    assert not rollout.valid


def test_pouring_does_not_depend_on_when_and_the_weights_release_does():
    for task, changes in ((Pour(), False), (Swing(), True)):
        plan = task.demonstrations("clean-6-0").plans[0]
        later = np.concatenate([np.repeat(plan[:1], 3, axis=0), plan[:-3]])
        moved = np.linalg.norm(outcome(task, later) - outcome(task, plan))
        assert (moved > 0.03) == changes
        assert changes or moved < 1e-3


def test_a_weight_on_a_rod_that_stands_falls_straight_down_at_the_clock():
    task = Swing()
    plan = np.tile([0.6, 0.1, 0.8, 0.0, 0.0, np.pi / 2], (90, 1))
    np.testing.assert_allclose(outcome(task, plan), [0.6, 0.1 + task.rod], atol=1e-9)


def test_a_plan_that_is_shorter_than_the_clock_lets_nothing_go():
    task = Swing()
    plan = task.demonstrations("clean-6-0").plans[:1, : task.clock]
    assert not task.rollout(plan, None)[0].valid


def test_turning_every_pose_to_the_left_turns_where_the_weight_lands():
    task = Swing()
    plan = task.demonstrations("clean-6-0").plans[1]
    plan = np.hstack([plan[:, :3], 0 * plan[:, 3:]])
    angle = 0.4
    cos, sin = np.cos(angle), np.sin(angle)
    turned = plan.copy()
    turned[:, 0], turned[:, 1] = plan[:, 0] * cos - plan[:, 1] * sin, plan @ [sin, cos, 0, 0, 0, 0]
    turned[:, 5] = angle
    x, y = outcome(task, plan)
    np.testing.assert_allclose(
        outcome(task, turned), [x * cos - y * sin, x * sin + y * cos], atol=1e-9
    )

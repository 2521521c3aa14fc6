"""The axis of a turn is found from where the hand goes."""

import itertools

import numpy as np
import pytest

import prior_reinforce as pr
from prior_reinforce.arm.robots.limits import match_joints
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.plans.kinematics import tool_tip
from prior_reinforce.plans.symmetry import (
    Polar,
    TurnPath,
    TurnPoses,
    find_axis,
    hand_paths,
    turn_and_scale,
)
from prior_reinforce.plans.symmetry.moves import about_vertical


def shown(name: str, which: str):
    demonstrations, arm = pr.make_task(name).demonstrations(which), robot_limits("panda")
    joints = list(match_joints(demonstrations.format, arm).values())
    symmetry = demonstrations.symmetry
    paths = hand_paths(symmetry, demonstrations.plans, arm.chain, joints)
    return paths, demonstrations.outcomes_seen, symmetry.chart


def turned(angles, axis):
    """One path, turned about an axis."""
    s = np.linspace(0, 1, 40)[:, None]
    path = np.array([0.3, 0.05]) + s * [0.4, 0.1] + 0.05 * np.sin(3 * s)
    turn = [about_vertical(angle) for angle in angles]
    paths = np.stack([(path - axis) @ each.T + axis for each in turn])
    return paths, np.stack([each @ ([1.2, 0.1] - axis) + axis for each in turn])


@pytest.mark.parametrize("axis", [(0.0, 0.0), (0.4, -0.1)])
def test_turned_paths_tell_what_they_were_turned_about(axis):
    found = find_axis(*turned([-0.4, 0.0, 0.3], np.array(axis)), Polar(axis))
    assert found.found == pytest.approx(axis, abs=0.02)
    assert found.residual < 1e-3
    assert not found.doubted


def test_one_bearing_tells_no_axis():
    paths, outcomes = turned([0.0, 0.02], np.zeros(2))
    assert find_axis(paths, outcomes, Polar()) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "which", "near", "wrong"),
    [
        ("basketball-v1", "A", 0.05, (0.43, 0.0)),
        ("basketball-v1", "B", 0.1, (0.43, 0.0)),
        ("curling", "A", 0.03, (0.0, 0.0)),
    ],
)
def test_a_wrong_axis_is_doubted_and_the_right_one_is_not(name, which, near, wrong):
    paths, outcomes, chart = shown(name, which)
    found = find_axis(paths, outcomes, chart)
    assert found.offset < near
    assert not found.doubted
    assert "WARNING" not in str(found)
    other = find_axis(paths, outcomes, Polar(wrong))
    assert other.doubted
    assert "is the axis right" in str(other)


@pytest.mark.slow
def test_few_demonstrations_raise_no_false_alarm():
    paths, outcomes, chart = shown("basketball-v1", "A")
    for pair in itertools.combinations(range(4), 2):
        found = find_axis(paths[list(pair)], outcomes[list(pair)], chart)
        assert found is None or not found.doubted


def test_the_hand_is_where_the_turned_arm_has_its_tip():
    chain, tip = robot_limits("panda").chain, (0.0, 0.1, 0.2)
    plans = np.random.default_rng(0).normal(size=(2, 5, 8))
    symmetry = turn_and_scale(TurnPath(chain, (0.4, 0.0), tuple(range(1, 8))), (0.4, 0.0))
    expected = tool_tip(chain, plans[:, :, 1:], tip)[..., :2]
    assert np.array_equal(hand_paths(symmetry, plans, tip=tip), expected)


def test_the_hand_is_where_poses_say():
    plans = np.random.default_rng(0).normal(size=(2, 5, 3))
    symmetry = turn_and_scale(TurnPoses((0.0, 0.0), (1, 2)))
    assert np.array_equal(hand_paths(symmetry, plans), plans[:, :, [1, 2]])
    assert hand_paths(turn_and_scale(pr.plans.symmetry.TurnJoint(0)), plans) is None

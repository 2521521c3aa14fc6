"""Flange poses to joint paths: poses are met, limits are kept, vectors round-trip."""

import mujoco
import numpy as np
import pytest

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.simulation.tasks import inverse_kinematics as ik
from reproduction.demonstrations.curling import to_rotation_vector

PANDA = robot_limits("panda")

DT = 0.02


def circle(speed: float = 1.0) -> np.ndarray:
    """A wavy pose path (60, 6) around (0.5, 0.1, 0.4)."""
    t = speed * np.arange(60) * DT
    place = np.array([0.5, 0.1, 0.4]) + 0.06 * np.stack([np.sin(t), np.cos(t), np.sin(2 * t)], 1)
    turn = 0.3 * np.stack([np.sin(t), np.cos(2 * t), np.sin(t)], 1)
    return np.hstack([place, turn])


def test_rotation_vectors_round_trip_and_zero_looks_down():
    vectors = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3))
    np.testing.assert_allclose(to_rotation_vector(ik.to_matrix(vectors)), vectors, atol=1e-12)
    np.testing.assert_array_equal(ik.to_matrix(np.zeros(3))[:, 2], [0, 0, -1])
    # +ry tips the tool's end backwards, +rz turns it to the left.
    assert ik.to_matrix(np.array([0, 0.1, 0]))[0, 2] < 0
    assert ik.to_matrix(np.array([0, 0, 0.1]))[1, 0] > 0


def test_joint_paths_meet_reachable_poses_to_micrometres():
    poses = circle()
    (joints,) = ik.joint_paths(poses[None], DT)
    arm = ik._arm()
    data = mujoco.MjData(arm)
    for q, pose in zip(joints, poses, strict=True):
        data.qpos[:] = q
        mujoco.mj_kinematics(arm, data)
        flange = data.site("flange")
        np.testing.assert_allclose(flange.xpos, pose[:3], atol=2e-5)
        attitude = flange.xmat.reshape(3, 3)
        np.testing.assert_allclose(to_rotation_vector(attitude), pose[3:], atol=5e-5)


@pytest.mark.slow
def test_limits_are_kept_where_poses_ask_for_too_much():
    far, fast = circle(), circle(speed=12.0)
    far[:, 0] += np.linspace(0.0, 0.8, 60)
    joints = ik.joint_paths(np.stack([far, fast]), DT)
    assert np.all(joints > PANDA.lower - 1e-6)
    assert np.all(joints < PANDA.upper + 1e-6)
    speed = np.abs(np.diff(joints, axis=1)) / DT
    assert np.all(speed < PANDA.velocity * (1 + 1e-6))
    assert np.any(speed > 0.99 * PANDA.velocity)


def test_a_plan_has_one_path_whatever_its_batch():
    one, two = circle(), circle(2.0)
    np.testing.assert_array_equal(
        ik.joint_paths(np.stack([one, two]), DT)[1], ik.joint_paths(two[None], DT)[0]
    )

"""Forward kinematics against poses worked by hand and against MuJoCo's model of the same arm."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import prior_reinforce.simulation.tasks
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import OutOfReachError
from prior_reinforce.plans.kinematics import (
    Chain,
    first_axis,
    flange_path,
    leaning,
    link_places,
    rotation,
    tool_tip,
    turned_path,
)

FRANKA = robot_limits("panda").chain
READY = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, np.pi / 4])


def test_stretched_arm_by_hand():
    # All joints 0: the flange points down, 0.088 m before the axis, 0.333 + 0.316 + 0.384 - 0.107.
    np.testing.assert_allclose(tool_tip(FRANKA, np.zeros(7)), [0.088, 0, 0.926], atol=1e-12)
    np.testing.assert_allclose(
        tool_tip(FRANKA, np.zeros(7), (0.0, 0.0, 0.1)), [0.088, 0, 0.826], atol=1e-12
    )


def test_turning_the_base_turns_the_tip():
    q = np.array([0.0, -0.3, 0.1, -2.0, 0.2, 1.7, 0.4])
    x, y, z = tool_tip(FRANKA, q, (0.05, 0.02, 0.1))
    q[0] = np.pi / 2
    np.testing.assert_allclose(tool_tip(FRANKA, q, (0.05, 0.02, 0.1)), [-y, x, z], atol=1e-12)


def test_agrees_with_the_simulated_arm():
    path = Path(prior_reinforce.simulation.tasks.__file__).with_name("panda.xml")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    base = model.body("link0").id
    flange = model.site("flange").id
    rng = np.random.default_rng(1)
    tip = np.array([0.03, -0.02, 0.15])
    # That model's site is turned by -45 degrees about the flange, as the maker mounts the hand.
    turn = np.array([[1, -1, 0], [1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
    for q in rng.uniform(-1.5, 1.5, size=(20, 7)):
        data.qpos[:7] = q
        mujoco.mj_kinematics(model, data)
        rotation = data.site_xmat[flange].reshape(3, 3)
        expected = data.site_xpos[flange] + rotation @ turn @ tip - data.xpos[base]
        np.testing.assert_allclose(tool_tip(FRANKA, q, tip), expected, atol=1e-12)


def test_shapes_broadcast():
    q = np.random.default_rng(2).normal(size=(4, 5, 7))
    tips = tool_tip(FRANKA, q)
    assert tips.shape == (4, 5, 3)
    np.testing.assert_allclose(tips[2, 3], tool_tip(FRANKA, q[2, 3]))


def test_both_tables_of_denavit_and_hartenberg_say_the_same_arm():
    # An elbow: two parallel axes 0.3 m apart, then 0.2 m to the flange along x.
    standard = Chain.standard([(0.3, 0.1, 0.0), (0.2, 0.0, 0.0)])
    craig = Chain.craig([(0.0, 0.1, 0.0), (0.3, 0.0, 0.0)], flange=0.0)
    q = np.random.default_rng(3).uniform(-3, 3, (9, 2))
    x = 0.3 * np.cos(q[:, 0]) + 0.2 * np.cos(q.sum(axis=1))
    y = 0.3 * np.sin(q[:, 0]) + 0.2 * np.sin(q.sum(axis=1))
    expected = np.column_stack([x, y, np.full(9, 0.1)])
    np.testing.assert_allclose(tool_tip(standard, q), expected, atol=1e-12)
    np.testing.assert_allclose(tool_tip(craig, q, (0.2, 0, 0)), expected, atol=1e-12)


def test_a_base_may_be_turned():
    turned = Chain.standard([(0.3, 0.1, 0.0)], yaw=np.pi)
    np.testing.assert_allclose(tool_tip(turned, np.zeros(1)), [-0.3, 0, 0.1], atol=1e-12)


def test_the_links_are_the_base_each_joint_and_the_flange():
    q = np.random.default_rng(4).uniform(-2, 2, (3, 5, 7))
    places = link_places(FRANKA, q)
    assert places.shape == (3, 5, 9, 3)
    np.testing.assert_array_equal(places[..., 0, :], 0.0)
    np.testing.assert_allclose(places[..., -1, :], tool_tip(FRANKA, q), atol=1e-12)
    for joint in range(1, 8):  # the flange of an arm that ends there
        short = Chain(FRANKA.origins[:joint], FRANKA.axes[:joint])
        np.testing.assert_allclose(
            places[..., joint, :], tool_tip(short, q[..., :joint]), atol=1e-12
        )


def test_the_jacobian_is_the_derivative_of_the_pose():
    q, step = np.random.default_rng(2).uniform(-1, 1, (4, 7)), 1e-6
    path = flange_path(FRANKA, q)
    np.testing.assert_allclose(path.places, tool_tip(FRANKA, q), atol=1e-12)
    for joint, along in enumerate(np.eye(7)):
        more, less = (flange_path(FRANKA, q + sign * step * along) for sign in (1, -1))
        speed = (more.places - less.places) / (2 * step)
        turned = more.attitudes @ np.swapaxes(less.attitudes, 1, 2)
        rate = Rotation.from_matrix(turned).as_rotvec() / (2 * step)
        np.testing.assert_allclose(path.jacobians[:, :3, joint], speed, atol=1e-8)
        np.testing.assert_allclose(path.jacobians[:, 3:, joint], rate, atol=1e-8)


def test_about_the_base_a_turned_path_is_the_first_joint_turned():
    q = READY + np.linspace(0, 0.3, 20)[:, None] * [0.5, 1.0, 0.0, 1.0, 0.2, 1.0, 0.5]
    expected = q + 0.4 * np.eye(7)[0]  # the only one, since joint 3 stays held
    np.testing.assert_allclose(turned_path(FRANKA, q, 0.4, (0.0, 0.0)), expected, atol=1e-5)


@pytest.mark.slow
def test_a_path_beyond_reach_is_refused_with_the_angle_and_the_error():
    q = np.tile([0.0, 0.9, 0.0, -0.6, 0.0, 1.5, 0.8], (10, 1))
    with pytest.raises(
        OutOfReachError, match=r"turned by 1.5 rad about \(0.2, 0.4\) m.*; demonstrate nearer"
    ):
        turned_path(FRANKA, q, 1.5, (0.2, 0.4))


def test_what_a_flange_misses_by_a_fraction_of_a_millimetre_is_in_reach():
    """Five joints on a mount that leans by 3 mrad do not reach the pose exactly."""
    ur = robot_limits("ur5e").chain
    mount = (0.0, 0.0, 0.1625, 0.003, 0.0, 0.0)
    chain = Chain((mount, *ur.origins[1:5]), ur.axes[:5], ur.flange)
    swing = np.linspace(0, 0.3, 20)[:, None] ** 2 * [0.5, 1.0, 1.0, 0.5, 0.2]
    q = np.array([0.2, -1.2, 1.6, -1.0, -1.4]) + swing
    turned = turned_path(chain, q, 0.5, (0.0, 0.0))
    before, after = flange_path(chain, q), flange_path(chain, turned)
    turn = rotation(0.0, 0.0, 0.5)
    left = Rotation.from_matrix(turn @ before.attitudes @ np.swapaxes(after.attitudes, 1, 2))
    off = np.abs(after.places - before.places @ turn.T).max(), left.magnitude().max()
    assert off[0] < 5e-4
    assert 1e-4 < off[1] < 2e-3
    rough = np.abs(np.diff(turned, n=2, axis=0)).max() / np.abs(np.diff(q, n=2, axis=0)).max()
    assert rough < 1.1


def test_where_the_first_axis_stands_and_leans():
    chain = Chain(((0.1, -0.2, 0.3, np.pi - 0.02, 0.0, 0.0),), ((0.0, 0.0, 1.0),))
    along, stands = first_axis(chain)
    assert stands == (0.1, -0.2)
    np.testing.assert_allclose(along, [0.0, -np.sin(0.02), -np.cos(0.02)], atol=1e-12)
    assert leaning(along) == pytest.approx(0.02)

"""A URDF gives the limits and kinematics that MuJoCo finds in it, and says what it lacks."""

import re

import mujoco
import numpy as np
import pytest

from prior_reinforce.bench.robots import robot_limits
from prior_reinforce.bench.robots.kinematics import tool_tip
from prior_reinforce.bench.robots.urdf import read_urdf
from prior_reinforce.errors import ConfigurationError, FileFormatError
from tests.bench.robots.arms import UR, limit, ur5e, write_urdf

TIP = (0.03, -0.02, 0.15)


def test_an_arms_limits_and_names(tmp_path):
    arm = read_urdf(write_urdf(tmp_path / "ur5e.urdf", ur5e()))
    assert arm.joint_names == UR
    np.testing.assert_allclose(arm.upper, np.pi * np.array([2, 2, 1, 2, 2, 2]))
    np.testing.assert_allclose(arm.lower, -arm.upper)
    np.testing.assert_allclose(arm.velocity, np.pi)
    assert arm.acceleration is None
    assert arm.jerk is None
    assert arm.source == "ur5e.urdf, from link0 to tool0"


def with_mujoco(path, tip, q):
    """Where the tip is by MuJoCo, which keeps no frames of links behind fixed joints."""
    text = re.sub("<visual>.*?</visual>", "", path.read_text())
    text = text.replace(
        '<robot name="arm">',
        '<robot name="arm"><mujoco><compiler fusestatic="false" discardvisual="false"/></mujoco>',
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    body = model.body(tip).id
    return data.xpos[body] + data.xmat[body].reshape(3, 3) @ TIP


@pytest.mark.parametrize("axis", ["0 0 1", "0 -1 0", "0.6 0 0.8"])
def test_kinematics_are_those_that_mujoco_finds(tmp_path, axis):
    path = write_urdf(tmp_path / "a.urdf", ur5e(), axis=axis)
    arm = read_urdf(path)
    rng = np.random.default_rng(0)
    for q in rng.uniform(-3, 3, size=(10, 6)):
        np.testing.assert_allclose(
            tool_tip(arm.chain, q, TIP), with_mujoco(path, "tool0", q), atol=1e-9
        )


def test_the_presets_kinematics_are_those_of_the_makers_urdf(tmp_path):
    arm = read_urdf(write_urdf(tmp_path / "ur5e.urdf", ur5e()))
    q = np.random.default_rng(1).uniform(-3, 3, size=(20, 6))
    preset = robot_limits("ur5e")
    np.testing.assert_allclose(
        tool_tip(preset.chain, q, TIP), tool_tip(arm.chain, q, TIP), atol=1e-9
    )
    np.testing.assert_allclose(preset.upper, arm.upper)
    np.testing.assert_allclose(preset.velocity, arm.velocity)


def test_the_flange_may_be_named_and_else_is_behind_the_last_turning_joint(tmp_path):
    joints = [
        ("a", "revolute", (0, 0, 1), (0, 0, 0), limit(-1, 1, 2)),
        ("b", "continuous", (0, 0, 1), (0, 0, 0), limit(0, 0, 2)),
        ("c", "fixed", (0, 0, 1), (0, 0, 0), ""),
        ("finger", "prismatic", (0, 0, 1), (0, 0, 0), limit(0, 0.04, 1)),
    ]
    path = write_urdf(tmp_path / "a.urdf", joints, last="tip")
    arm = read_urdf(path)
    np.testing.assert_allclose(tool_tip(arm.chain, np.zeros(2)), [0, 0, 2])
    np.testing.assert_allclose(arm.upper, [1, 4 * np.pi])
    np.testing.assert_allclose(tool_tip(read_urdf(path, "link3").chain, np.zeros(2)), [0, 0, 3])
    with pytest.raises(FileFormatError, match="finger is prismatic"):
        read_urdf(path, "tip")
    with pytest.raises(ConfigurationError, match="no link 'hand'; it has link0, link1"):
        read_urdf(path, "hand")


def test_two_arms_need_the_flange_to_be_named(tmp_path):
    one = [("a", "revolute", (0, 0, 1), (0, 0, 0), limit(-1, 1, 2))]
    other = (
        '<link name="other"/><joint name="b" type="revolute"><parent link="link0"/>'
        f'<child link="other"/><limit {limit(-2, 2, 2)}/></joint>'
    )
    path = write_urdf(tmp_path / "a.urdf", one, last="left", more=other)
    with pytest.raises(ConfigurationError, match="ends in left, other; say which link"):
        read_urdf(path)
    assert read_urdf(path, "other").upper.tolist() == [2]


@pytest.mark.parametrize(
    ("attributes", "says"),
    [
        ('lower="-1" upper="1" effort="1" velocity="0"', "joint a has no velocity limit"),
        ("", "joint a has no velocity limit"),
        ('lower="0" upper="0" effort="1" velocity="1"', "joint a has no range"),
    ],
)
def test_what_a_joint_lacks_is_named(tmp_path, attributes, says):
    joints = [("a", "revolute", (0, 0, 1), (0, 0, 0), attributes)]
    with pytest.raises(ConfigurationError, match=says):
        read_urdf(write_urdf(tmp_path / "a.urdf", joints))


@pytest.mark.parametrize("content", ["", "<robot", "<robot name='a'/>", "<a/>", "x\0y"])
def test_what_is_no_urdf_is_named(tmp_path, content):
    path = tmp_path / "a.urdf"
    path.write_text(content)
    with pytest.raises(FileFormatError, match=r"a\.urdf"):
        read_urdf(path)
    with pytest.raises(FileFormatError, match="no URDF at"):
        read_urdf(tmp_path / "b.urdf")
    (tmp_path / "c.urdf.xacro").write_text("<robot/>")
    with pytest.raises(FileFormatError, match="make a URDF of it: xacro"):
        read_urdf(tmp_path / "c.urdf.xacro")

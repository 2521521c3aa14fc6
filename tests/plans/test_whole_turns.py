"""Angles that nothing stops, attitudes found by their names, and the other numbers of a pose."""

import math

import numpy as np
import pytest

from prior_reinforce.plans.whole_turns import (
    attitudes,
    euler_angles,
    leap_alone,
    other_form,
    whole_circles,
)


def test_angles_that_nothing_stops_are_known_by_name_and_unit():
    names = ("yaw", "tool_roll", "scroll", "Gierwinkel", "heading", "joint1", "left_wrist_roll")
    names += ("wrist_roll.pos", "waist_yaw")
    units = ("rad", "deg", "rad", "deg", "m", *("rad",) * 4)
    assert whole_circles(names, units) == ("yaw", "tool_roll", "Gierwinkel")


def test_joints_of_a_limb_are_no_attitude():
    angles = ("roll", "pitch", "yaw")
    for of in ("left_shoulder_", "waist_", "r_upper_arm_"):
        assert euler_angles([of + angle for angle in angles], ("rad",) * 3) == ()


@pytest.mark.parametrize("of", ["", "tool_", "arm_eef_", "left_arm.tcp.", "xarm_", "wrist_pose_"])
def test_angles_of_what_an_arm_holds_are_an_attitude(of):
    names, units = tuple(of + angle for angle in ("roll", "pitch", "yaw")), ("rad",) * 3
    assert euler_angles(names, units) == (names,)
    assert whole_circles(names, units) == (names[0], names[2])


@pytest.mark.parametrize("of", ["wrist_", "arm_", "left_arm."])
def test_rx_ry_rz_are_an_attitude_of_any_limb(of):
    names = tuple(f"{of}r{axis}" for axis in "xyz")
    assert euler_angles(names, ("deg",) * 3) == (names,)


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (("x", "qx", "qy", "qz", "qw"), (("qx", "qy", "qz", "qw"),)),
        (("quat_w", "quat_x", "quat_y", "quat_z"), (("quat_w", "quat_x", "quat_y", "quat_z"),)),
        (("rx", "ry", "rz", "z"), (("rx", "ry", "rz"),)),
        (("qx", "qy", "qz"), ()),
        (("x", "y", "z"), ()),
    ],
)
def test_attitudes_are_whole_groups_of_names(names, found):
    assert attitudes(names) == found


def test_the_other_form_is_the_same_turn():
    quaternion = np.array([0.5, -0.5, 0.5, 0.5])
    np.testing.assert_array_equal(other_form(quaternion), -quaternion)
    vector = np.array([[0.0, 0.0, math.pi / 2], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(other_form(vector), [[0, 0, -3 * math.pi / 2], [0, 0, 0]])
    np.testing.assert_allclose(other_form(other_form(vector)), vector, atol=1e-12)


def test_one_angle_that_leaps_alone_is_no_rotation_vector():
    angles = np.array([[3.1, 0.1, 0.2], [3.13, 0.1, 0.2], [-3.123, 0.1, 0.2], [-3.09, 0.1, 0.2]])
    assert leap_alone([angles])
    assert not leap_alone([np.where(angles[:, :1] < 0, other_form(np.abs(angles)), angles)])
    assert not leap_alone([np.abs(angles)])

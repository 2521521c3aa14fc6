"""The position-dependent bound by hand, given limits, and joints matched by name."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.robots.limits import (
    RobotLimits,
    is_joint,
    joint_of,
    match_joints,
    missing_joints,
    other_quantities,
)
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import ConfigurationError, InvalidPlanError
from prior_reinforce.plans.plan_format import PlanFormat


def test_velocity_of_an_fr3_shrinks_towards_its_stop():
    limits = robot_limits("fr3", ">=5.9")
    q = np.zeros(7)
    q[0] = 2.5
    low, high = limits.velocity_bounds(q)
    # -0.6599 + sqrt(2 * 6 * (2.9007 - 2.5)) = 1.532906
    assert high[0] == pytest.approx(1.532906, abs=1e-6)
    assert low[0] == pytest.approx(-2.62)
    q[0] = -2.5
    low, high = limits.velocity_bounds(q)
    assert low[0] == pytest.approx(-1.532906, abs=1e-6)
    assert high[0] == pytest.approx(2.62)


def test_velocity_of_an_fr3_is_zero_at_and_beyond_its_stop():
    limits = robot_limits("fr3", ">=5.9")
    low, high = limits.velocity_bounds(np.array([limits.upper, limits.upper + 1, limits.lower - 1]))
    assert not high[:2].any()
    assert not low[2].any()
    assert np.all(low <= 0)
    assert np.all(high >= 0)


@pytest.mark.parametrize(
    "change",
    [
        {"lower": np.zeros(6)},
        {"velocity": np.zeros(7)},
        {"jerk": np.full(7, np.nan)},
        {"upper": np.full(7, -9.0)},
        {"joint_names": ("a",) * 7},
        {"acceleration": "fast"},
        {"chain": robot_limits("ur5e").chain},
    ],
)
def test_given_limits_are_checked(change):
    with pytest.raises(ConfigurationError, match="limit"):
        replace(robot_limits("panda"), **change)


def test_given_limits_of_another_arm():
    limits = RobotLimits(
        "arm", "1", "its manual", ("a", "b"), [-1, -1], [1, 1], [2, 2], [9, 9], [5, 5]
    )
    low, high = limits.velocity_bounds(np.zeros((3, 2)))
    np.testing.assert_array_equal(high, np.full((3, 2), 2.0))
    np.testing.assert_array_equal(low, -high)


PANDA = robot_limits("panda")


def matched(*names, units=None):
    return match_joints(PlanFormat(names, units or ("rad",) * len(names), 0.01), PANDA)


def test_joints_are_matched_by_name_and_never_guessed():
    assert matched("gripper", "panda_joint4", "joint2.pos", "Joint1", "j3") == {1: 2, 3: 1}
    # Which of the two moves joint 1 would be a guess, and the other would go unchecked.
    with pytest.raises(InvalidPlanError, match="all look like joint1 of panda"):
        matched("left_joint1", "joint1")
    with pytest.raises(InvalidPlanError, match="all look like joint1 of panda"):
        matched("left_joint1", "right_joint1")
    with pytest.raises(InvalidPlanError, match="joint1 is in 'deg'"):
        matched("joint1", units=("deg",))


def test_a_joint_whose_name_ends_anothers_is_itself():
    """Pitch and Wrist_Pitch of an SO-ARM100."""
    names = ("Pitch", "Wrist_Pitch")
    ends = np.array([1.0, 3.0])
    two = RobotLimits("so", "any", "made up", names, -ends, ends, np.array([2.0, 2.0]))
    form = PlanFormat(("Wrist_Pitch.pos", "Pitch"), ("rad", "rad"), 0.01)
    assert match_joints(form, two) == {0: 1, 1: 0}
    assert joint_of("left_Wrist_Pitch", names) == 1
    assert joint_of("Pitch", names[1:]) is None


def test_joints_without_a_column_are_missing_unless_left_out_on_purpose():
    columns = matched(*(f"joint{i}" for i in range(1, 6)))
    assert missing_joints(columns, PANDA, ()) == ("joint6", "joint7")
    assert missing_joints(columns, PANDA, ("joint7",)) == ("joint6",)
    for name, why in (("joint1", "the plan moves it"), ("elbow", "panda has no such joint")):
        with pytest.raises(ConfigurationError, match=f"absent_joints names '{name}', but {why}"):
            missing_joints(columns, PANDA, (name,))


def test_one_rule_says_which_column_is_which_joint():
    for name in ("joint4", "panda_joint4", "fr3/joint4", "joint4.pos", "arm.joint4"):
        assert is_joint(name, "joint4")
    for name in ("Joint4", "j4", "joint14", "joint41", "joint4_vel", "xjoint4"):
        assert not is_joint(name, "joint4")


@pytest.mark.parametrize(
    "name",
    [
        *("delta_joint4", "d_joint4", "dd_joint4", "dq.joint4", "qd/joint4", "vel_joint4"),
        *("torque_joint4", "increment_joint4", "tau.joint4", "effort/joint4", "acc_joint4"),
        *("panda/vel_joint4", "panda.delta.joint4", "jointVel_joint4", "JointTorques/joint4"),
        *("VELOCITY_joint4", "Delta_joint4", "D_joint4", "panda/d_joint4", "inc_joint4"),
        *("relative_joint4", "rel_joint4", "diff_joint4", "error_joint4", "offset_joint4"),
        *("v_joint4", "q_dot_joint4", "qdot.joint4", "motor_temp_joint4", "current_joint4"),
        *("Δ_joint4", "δ.joint4", "Geschwindigkeit_joint4", "Drehmoment/joint4"),
        *("vitesse_joint4", "velocità.joint4", "velocidad_joint4", "速度_joint4", "力矩/joint4"),
        *("vel_joint4.pos", "joint4_vel", "joint4.torque", "joint4_d", "joint4-velocity"),
        *("delta-joint4", "vel:joint4", "vel joint4", "torque[joint4]", "delta::joint4"),
        *("kp_joint4", "step_joint4"),
    ],
)
def test_other_quantities_of_a_joint_are_not_its_position(name):
    assert not is_joint(name, "joint4")
    form = PlanFormat((name, "gripper"), ("rad", "percent"), 0.01)
    assert match_joints(form, PANDA) == {}
    assert other_quantities(form, PANDA) == ((name,) if name != "joint4_d" else ())


@pytest.mark.parametrize(
    "name",
    [
        *("q_joint4", "pos_joint4", "position.joint4", "target/joint4", "action.joint4"),
        *("observation.state.joint4.pos", "left_joint4", "ur5e/joint4", "q_d_joint4"),
        *("measured_joint4", "commanded_joint4", "desired.joint4", "leader/joint4"),
        *("robot0_joint4", "arm_d/joint4", "trainer_joint4"),
    ],
)
def test_a_position_by_any_other_words_is_one(name):
    assert is_joint(name, "joint4")
    assert other_quantities(PlanFormat((name,), ("rad",), 0.01), PANDA) == ()


def test_a_joint_of_a_robot_may_be_called_anything():
    assert is_joint("torque_joint", "torque_joint")
    assert is_joint("arm/tool_joint", "tool_joint")


def test_a_grippers_joints_are_none_of_the_arms():
    for name in ("fr3_finger_joint4", "left/gripper.joint4", "arm_finger2_joint4.pos"):
        assert not is_joint(name, "joint4")
    assert is_joint("gripper_joint4", "gripper_joint4")
    assert matched("panda_joint1", "panda_finger_joint1", "panda_finger_joint2") == {0: 0}
    assert matched("panda_joint1", "thumb_joint1") == {0: 0}


@pytest.mark.parametrize(
    "arm", ["ur5e_robotiq/", "panda_hand/", "left_hand/", "iiwa_wsg50/", "ur5_suction_", "swivel_"]
)
def test_an_arm_that_is_called_by_its_tool_keeps_its_joints(arm):
    assert matched(*(f"{arm}joint{i}" for i in range(1, 8))) == {i: i for i in range(7)}

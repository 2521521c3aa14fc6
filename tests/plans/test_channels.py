"""Every channel is of one kind by its name and those beside it."""

import pytest

from prior_reinforce.plans.channels import (
    Kind,
    increments,
    is_coordinate,
    is_increment,
    is_of_base,
    is_of_finger,
    is_of_pose,
    is_of_tool,
    is_tool_state,
    kinds,
    one_for_all,
    says_no_position,
    zero_at_rest,
)


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        (
            Kind.ANGLE,
            "joint3 q[0] A1 baseYaw panda_joint4 Handgelenk axis_2 current_elbow upperarm",
        ),
        (Kind.ANGLE, "gripper_yaw Gripper/Roll index_finger_mcp linear_angle"),
        (Kind.TOOL, "gripper finger_joint1 robotiq_pos pressure 夹爪 linear_gripper Greiferweite"),
        (Kind.SLIDE, "E1 d3 scara_d3 axis_E1 rail ext_axis_1 linearAxis slider prismatic_joint"),
        (Kind.UNKNOWN, "foo crank spring x z level travel tau_d_1 velvet novelty_score marvel_x"),
        (Kind.UNKNOWN, "waterlevel movel_1 nivel gravel_2 velcro_1 laser_dot_x pivot robot"),
        (Kind.UNKNOWN, "ddq_d_0 swivel bevel_1 thumb_1 pumpkin tongue left_knuckle"),
        (Kind.ANGLE, "swivel_joint shovel_joint wrist_twist omega7_joint1 thumb_joint_0"),
        (Kind.ANGLE, "joint_d_1 theta_d_0 joint_e_1 arm_d_1 head_d_2 tau_J_d_0 wrist_d_1"),
        (Kind.SLIDE, "kuka_E1 d_1 scara_d_3 axis_e_1"),
        (Kind.PLACE, "tool.x tool.y"),
        (Kind.PLACE, "X_axis Y_axis Z_axis"),
        (Kind.PLACE, "gripper_tip_x gripper_tip_y gripper_tip_z"),
        (Kind.ROTATION, "rx ry rz"),
        (Kind.QUATERNION, "qx qy qz qw"),
        (Kind.LENGTH, "dx dy delta_x left_dz torso_lift_joint"),
        (Kind.VELOCITY, "vx x.vel tcp_speed belt_speed linear_vel rail.vel actual_TCP_speed_2"),
        (Kind.TURN_RATE, "wz dq0 joint1_vel theta.vel qd_3 joint_velocity_0"),
        (Kind.TURN_RATE, "actual_TCP_speed_3 tcp_angular_vel"),
        (Kind.ANGLE, "dyaw drx"),
        (Kind.TOOL, "gripper_vel magnet trigger pump drive_joint tool_do tongs suction"),
        (Kind.LENGTH, "dpos_x x_delta Δx inc_y world_vector_0 gripper_dx"),
        (
            Kind.VELOCITY,
            "velocity_x vel_y linear_velocity_z gripper_vx TCPSpeed cmd_vel/linear/x twist.linear.x"
            " velocity_linear_0 lin_vel_0 linvel_1 velx x_dot ydot tcp_z_dot",
        ),
        (
            Kind.TURN_RATE,
            "twist.angular.z cmd_vel/angular/z anglevel_1 angvel_z rotvel_x elbowvel qvel_0"
            " cmdvel_1 desvel1 actvel_0 slewvel swivelvel jointsvel_2 velj1 velact_0 theta_dot"
            " thetadot1 joint1_dot phiDot VelJ1 thumb_vel omega_1 vel_joint4 vitesse_joint4"
            " Gelenkgeschwindigkeit_1 速度_joint4 dq dQ",
        ),
        (
            Kind.TURN_RATE,
            "q_dot angular_velocity_z omega_x yaw_rate robot0_eef_vel_ang_2 dq_d_0 qdot1",
        ),
        (Kind.ANGLE, "dbearing delta_rot_x q_d_1 hand_3"),
        (Kind.PLACE, "robot0_eef_pos_0 robot0_eef_pos_1 robot0_eef_pos_2"),
        (Kind.PLACE, "observation.state.x observation.state.y"),
        (Kind.QUATERNION, "robot0_eef_quat_0 quat_3"),
        (Kind.ROTATION, "robot0_eef_rot_axis_angle_0"),
        (Kind.MATRIX, "rot6d_0 rot6d_1"),
        (Kind.MATRIX, "rot6d0 rot6d1"),
        (Kind.TOOL, "O_F_ext_hat_K_0 K_F_ext_hat_K_5 tau_ext_hat_filtered_0"),
        (Kind.MATRIX, "R11 R12 R13 R21 R22 R23 R31 R32 R33"),
    ],
)
def test_a_name_says_what_a_channel_is(kind, names):
    alone = kind not in (Kind.PLACE, Kind.ROTATION, Kind.QUATERNION, Kind.MATRIX)
    for group in ([name] for name in names.split()) if alone else [names.split()]:
        assert {*kinds(group)} == {kind}, group


@pytest.mark.parametrize(
    ("asks", "yes", "no"),
    [
        (
            is_increment,
            "dx dbearing dpos_x joint1_delta inc_joint4 Δx",
            "dq dQ d_q d1 delta_1 vx width",
        ),
        (is_coordinate, "x tool_dx x2 p2x hip_y x_delta", "qx rx rot_x angle_x euler_z vx pitch"),
        (is_of_pose, "x vx tool_yaw quat_w jaw_angle pose rot_3", "stiffness width aim"),
        (
            is_of_tool,
            "gripper_x fr3_hand hand_2 robotiq_85 left_knuckle",
            "joint4 hand_joint4 handle",
        ),
        (
            is_tool_state,
            "jaw_angle magnet finger_1 right_hand",
            "jaw_x gripper_yaw finger_quat_0",
        ),
        (
            says_no_position,
            "dyaw drx dx gripper_dyaw world_vector_0 joint4.torque ddq_1 tcp_pose left/d_joint1 dQ"
            " linacc_1 twist.linear.x cmdvel_1 O_F_ext_hat_K_0 qddot_1 theta_ddot xdot joint1.d dd3"
            " scara/d v1 joint_current present_load",
            "joint4 current_q joint_pos_current q_1 level_joint4 travelled dynamixel_1 gripper"
            " swivel_joint wrist_twist d3 D_1 scara/d3 d[3] q_d",
        ),
        (
            is_of_finger,
            "fr3_finger_ left/gripper. Gripper_ leftGripper_ thumb_ arm_finger2_",
            "ur5e_robotiq/ panda_hand/ iiwa_wsg50/ ur5_suction_ panda_with_claw/",
        ),
        (
            is_of_base,
            "base_pose /base_pose/pose/position/x odom base_heading swivel_base",
            "base_velocity base_twist base_force_x base_acc_x base_joint robotiq_base baseline",
        ),
    ],
)
def test_a_name_answers_each_question(asks, yes, no):
    assert [name for name in yes.split() if not asks(name)] == []
    assert [name for name in no.split() if asks(name)] == []


@pytest.mark.parametrize(
    ("names", "rates"),
    [
        ("x y theta dx dy dtheta", (Kind.VELOCITY, Kind.VELOCITY, Kind.TURN_RATE)),
        ("joint1 d_joint1", (Kind.TURN_RATE,)),
        ("X DX", (Kind.VELOCITY,)),
    ],
)
def test_what_is_called_like_an_increment_beside_its_own_is_a_rate(names, rates):
    names = names.split()
    own, units = len(names) - len(rates), [None] * len(names)
    assert kinds(names)[own:] == rates
    assert zero_at_rest(names, units) == [*range(own, len(names))]
    assert increments(names, ["m"] * len(names)) == ()
    assert increments(names[own:], ["m"] * len(rates)) == (*range(len(rates)),)


@pytest.mark.parametrize("names", ["a b A B", "x y z X Y Z", "q1 Q1", "d D"])
def test_names_that_differ_by_case_alone_are_no_rates(names):
    found = kinds(names.split())
    assert {Kind.VELOCITY, Kind.TURN_RATE}.isdisjoint(found)
    assert zero_at_rest(names.split(), [None] * len(found)) == []


def test_what_is_in_a_unit_of_angle_is_not_0_at_rest_whatever_its_name():
    names = ["slew_speed", "tilt_speed", "joint_vel", "dx"]
    assert zero_at_rest(names, ["rad", "deg", "rad/s", "m"]) == [2, 3]
    assert zero_at_rest(names, [None] * 4) == [0, 1, 2, 3]


def test_places_and_joints_are_told_apart_by_what_x_and_y_are_of():
    assert kinds(["x", "y", "z", "q1"]) == (Kind.PLACE,) * 3 + (Kind.ANGLE,)
    for joints in (["hip_x", "hip_y", "hip_z"], ["tool_rot_x", "tool_rot_y"], ["rx", "ry", "rz"]):
        assert Kind.PLACE not in kinds(joints)
    assert Kind.MATRIX not in kinds(["q_00", "q_01", "q_10", "q_11"])


@pytest.mark.parametrize(
    "attitude", ["qx qy qz qw", "rx ry rz", "roll pitch yaw", "tool_qw tool_qx tool_qy tool_qz"]
)
@pytest.mark.parametrize(
    "place", ["px py pz", "ee_px ee_py ee_pz", "PosX PosY PosZ", "x_tcp y_tcp z_tcp", "p_0 p_1 p_2"]
)
def test_three_numbers_beside_an_attitude_are_a_place(place, attitude):
    own, other = place.split(), attitude.split()
    joints = place[:2] == "p_" and attitude == "roll pitch yaw"  # as a wrist's are called
    for names in (own + other, other + own, ["gripper", *own, *other, "joint1"]):
        found = dict(zip(names, kinds(names), strict=True))
        assert {found[name] for name in own} == {Kind.UNKNOWN if joints else Kind.PLACE}
    assert Kind.PLACE not in kinds([*own, "dof", *other])
    assert Kind.PLACE not in kinds(["J1", "J2", "J3", *other])


def test_a_numbered_pose_is_a_place_and_an_attitude():
    for pose, after in ((range(6), Kind.ROTATION), (range(1, 8), Kind.QUATERNION)):
        one, two = ([f"{of}_TCP_pose_{i}" for i in pose] for of in ("actual", "target"))
        each = (Kind.PLACE,) * 3 + (after,) * (len(pose) - 3)
        assert kinds([*one, "q1", *two]) == (*each, Kind.ANGLE, *each)
    assert {*kinds([f"pose_{i}" for i in range(5)])} == {Kind.UNKNOWN}
    assert {*kinds([f"joint_pose_{i}" for i in range(6)])} == {Kind.ANGLE}


def test_the_usual_unit_is_that_of_the_kind():
    assert [kind.usual_unit(3.0) for kind in (Kind.ANGLE, Kind.PLACE, Kind.MATRIX)] == [
        "rad", "m", "1",
    ]  # fmt: skip
    assert [Kind.TOOL.usual_unit(most) for most in (0.8, 80.0)] == ["1", "rad"]


def test_speeds_and_ways_have_units_of_their_own():
    each = (Kind.LENGTH, Kind.VELOCITY, Kind.TURN_RATE)
    assert [kind.usual_unit(300.0) for kind in each] == ["m", "m/s", "rad/s"]
    assert one_for_all("deg", ["dx", "dq0", "dyaw"]) == [None, None, "deg"]
    assert one_for_all("deg", ["thumb_joint_0", "index_joint_0"]) == ["deg", "deg"]


def test_one_unit_is_of_all_that_can_be_in_it():
    names = ("j1", "gripper", "x", "y", "qx", "qy", "qz", "qw")
    assert one_for_all("deg", names) == ["deg", *[None] * 7]
    assert one_for_all("mm", names) == ["mm"] * 8
    assert one_for_all("mm", ("j1", "lift"), ("rad", "m")) == [None, "mm"]
    assert one_for_all("percent", ("j1", "lift"), ("rad", "m")) == ["percent"] * 2


def test_coordinates_called_like_the_attitude_beside_are_a_place_whatever_else_is_there():
    names = ("inp_mag", "tgt_x", "tgt_y", "tgt_z", "tgt_rx", "tgt_ry", "tgt_rz")
    assert kinds(names) == (Kind.UNKNOWN, *[Kind.PLACE] * 3, *[Kind.ROTATION] * 3)

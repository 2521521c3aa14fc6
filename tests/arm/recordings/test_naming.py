"""Recorded channels are found by the gate's rule, in both directions, and never guessed."""

import json

import numpy as np
import pytest

from prior_reinforce.arm.recordings.naming import (
    find_channels,
    joint_vectors,
    missing_channels,
    numbered_like,
    read_metadata,
    vectors,
    words,
)
from prior_reinforce.errors import InvalidDemonstrationsError
from tests.arm.recordings.recorded import UR


@pytest.mark.parametrize(
    ("wanted", "there"),
    [
        ("joint4", "panda_joint4"),
        ("joint4", "joint4.pos"),
        ("panda_joint4", "joint4"),
        ("joint4", "joint4_deg"),
        ("x", "x [cm]"),
        ("q0_deg", "q0"),
    ],
)
def test_a_joint_by_another_spelling_of_its_name(wanted, there):
    assert find_channels([wanted], ["other", there]) == [1]


@pytest.mark.parametrize("there", ["Joint4", "j4", "q3", "joint14", "fr3_joint4x"])
def test_a_guess_is_none(there):
    assert find_channels(["joint4"], [there]) is None
    assert missing_channels(["joint4", there], [there]) == ["joint4"]


def test_the_exact_name_wins_and_two_others_are_ambiguous():
    assert find_channels(["joint1"], ["left_joint1", "joint1"]) == [1]
    with pytest.raises(InvalidDemonstrationsError, match="left_joint1, right_joint1 all look like"):
        find_channels(["joint1"], ["left_joint1", "right_joint1"])


def test_numbered_columns_are_vectors():
    names = ["t", "q[1]", "q[0]", "actual_q_0", "actual_q_1", "x", "lone3"]
    assert vectors(names) == {"q": [2, 1], "actual_q": [3, 4]}


@pytest.mark.parametrize(
    ("there", "found"),
    [
        (["t", "q1", "q0", "x"], ("q0", "q1")),
        (["q[0]", "q[1]", "dq[0]", "dq[1]"], ("q[0]", "q[1]")),
        (["actual_q_0", "actual_q_1", "target_q_0", "target_q_1"], None),
        (["a0", "a1", "b0", "b1"], None),
        (["q0", "q1", "q2"], None),
        (["left", "right"], None),
        (["tau0", "tau1", "vel_q0", "vel_q1"], None),
        (["tau0", "tau1", "tcp_angle_0", "tcp_angle_1"], None),
        (["jointVelocity0", "jointVelocity1", "a0", "a1"], ("a0", "a1")),
        (["q_d[0]", "q_d[1]", "dq_d[0]", "dq_d[1]"], ("q_d[0]", "q_d[1]")),
        (["tool_q0", "tool_q1", "theta0", "theta1"], ("theta0", "theta1")),
    ],
)
def test_numbered_channels_that_are_as_many_look_like_the_joints(there, found):
    assert numbered_like(["joint1", "joint2"], there) == found


@pytest.mark.parametrize(
    "stem",
    [
        *("tau", "tauJ", "tau_ext", "dq", "dQ", "state.dq", "ddq", "qd", "actual_qd", "q_dot"),
        *(
            "current_",
            "joint_torque_",
            "jointtorque",
            "JointVelocities",
            "vel_q",
            "jointvel",
            "speed",
        ),
        *("effort", "joint_force", "accelerations", "acc", "motor_temp_", "TCP_pose_", "O_T_EE"),
    ],
)
def test_what_says_it_is_something_else_is_never_taken_for_positions(stem):
    there = [f"{stem}{i}" for i in range(6)]
    assert numbered_like([f"joint{i}" for i in range(1, 7)], there) is None
    assert joint_vectors(there, 6) == {}


@pytest.mark.parametrize("stem", ["a", "q", "actual_q_", "ch", "theta", "jointPos"])
def test_what_says_nothing_else_may_be_positions(stem):
    there = [f"{stem}{i}" for i in range(6)]
    assert numbered_like([f"joint{i}" for i in range(1, 7)], there) == tuple(there)
    assert list(joint_vectors(there, 6).values()) == [list(range(6))]
    assert joint_vectors(there, 7) == {}


NAMES = ("elbow", "pan", "lift")


@pytest.mark.parametrize(
    ("said", "place"),
    [
        ({"meta": {"robot": {"joint_names": [*NAMES]}}}, "meta.robot.joint_names"),
        ({"meta": json.dumps({"names": NAMES, "fps": 50})}, "meta.names"),
        ({"meta": np.array(json.dumps({"names": NAMES}))}, "meta.names"),
        ({"meta": np.array([json.dumps({"names": NAMES}).encode()])}, "meta.names"),
        ({"joints": json.dumps(NAMES)}, "joints"),
        ({"m": {"joints": [{"name": n, "unit": "rad"} for n in NAMES]}}, "m.joints.name"),
        ({"m": {"columns": {"pan": 1, "lift": 2, "elbow": 0}}}, "m.columns"),
        ({"m": {"inner": json.dumps({"order": "elbow pan lift"})}}, "m.inner.order"),
    ],
)
def test_names_are_found_in_what_a_file_says_however_deep(said, place):
    assert read_metadata(said)[0][place] == NAMES


def test_numbers_are_found_and_what_cannot_be_parsed_is_none():
    texts, numbers = read_metadata(
        {"meta": {"a": {"fps": 50}, "b": True}, "x": "{half", "y": "[" * 10**5}
    )
    assert numbers == {"meta.a.fps": 50, "meta.b": True}
    assert "x" not in texts


@pytest.mark.parametrize(
    ("there", "found"),
    [
        (("gripper_width", "gripper_force", "joint1"), [2, 0]),
        (("left_finger", "right_finger", "joint1"), None),
        (("gripper", "gripper_width", "joint1"), [2, 0]),
        (("gripper_effort", "joint1"), None),
        (("gripper_yaw", "joint1"), None),
        (("is_gripped", "gripper_id", "joint1"), None),
        (("gripper_width", "gripper_is_grasped", "joint1"), [2, 0]),
    ],
)
def test_the_only_opening_of_a_gripper_is_the_gripper(there, found):
    assert find_channels(("joint1", "gripper"), there) == found


@pytest.mark.parametrize(
    "said",
    [
        "['pan', 'lift', 'elbow']",
        '["pan", "lift", "elbow"]',
        "pan lift elbow",
        np.array(UR),
        np.array([b"pan", b"lift", b"elbow"], dtype=object),
    ],
)
def test_a_list_of_texts_in_any_form(said):
    assert words(said) == UR
    assert words(np.arange(3)) == ()


def test_a_channel_is_of_the_joint_whose_whole_name_it_has():
    there = ("Wrist_Pitch.pos", "Pitch.pos")
    assert find_channels(("Pitch", "Wrist_Pitch"), there) == [1, 0]
    assert find_channels(("Pitch",), there) == [1]


def test_two_columns_of_one_name_are_not_chosen_from():
    with pytest.raises(InvalidDemonstrationsError, match="joint1; rename"):
        find_channels(["joint1", "joint2"], ["joint0", "joint1", "joint1", "joint2"])


def test_of_what_was_measured_and_commanded_a_joint_is_what_was_measured():
    there = ("target_joint1", "target_joint2", "actual_joint1", "actual_joint2")
    assert find_channels(("joint1", "joint2"), there) == [2, 3]
    with pytest.raises(InvalidDemonstrationsError, match="--joints"):
        find_channels(("joint1",), ("left_joint1", "right_joint1"))

"""Channels are picked and lost frames left out; `test_preprocessing.py` has units and names."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import select
from prior_reinforce.arm.recordings.units import Ambiguity
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from tests.arm.recordings.recorded import JOINTS, sampled, takes

T = np.arange(100) * 0.01


def recording(*lost, columns=("actual_q_0", "actual_q_1")):
    q = np.column_stack([np.sin(T), np.cos(T)])
    for frame in lost:
        q[frame, 1] = np.nan
    return Recording("throw", T, q, columns=columns)


def test_frames_that_are_not_finite_are_left_out_as_lost_packets_are():
    selection = select([recording(10, 11, 12)])
    (kept,) = selection.recordings
    np.testing.assert_array_equal(kept.times, np.delete(T, [10, 11, 12]))
    assert kept.remarks == (
        "actual_q_1 is nan at frame 10; 3 frames are left out, as lost packets are",
    )


def test_an_episode_that_lost_more_is_refused_by_its_recorded_channel():
    select([recording(*range(10))])
    said = "episode throw: actual_q_1 is nan at frame 0, expected a finite number, and 11 of 100"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        select([recording(*range(11))])


@pytest.mark.parametrize("fill", [-999.0, 1e308, 32767.0])
def test_what_was_written_for_failed_reads_is_no_unit_and_no_turn(fill):
    (told,) = takes(("j1", "elbow", "magnet"), [0.3, 1.2, 0.4])
    q = told.positions.copy()
    q[40:43, 1] = fill
    with pytest.raises(InvalidDemonstrationsError, match=r"elbow is .* in 3 of .* write nan there"):
        select([replace(told, positions=q)])
    q[40:43, 1] = np.nan
    assert "3 frames are left out" in select([replace(told, positions=q)]).recordings[0].remarks[0]
    still = replace(told, positions=np.zeros((100, 3)))
    assert not select([still]).recordings[0].positions.any()
    ended = replace(told, positions=np.where(T[:, None] < 0.95, 0.01, [0.3, 1.2, 0.4]))
    assert select([ended]).recordings[0].positions.max() == pytest.approx(1.2)  # at its end
    q[:, 1:] = 0.0, 0.0
    q[40:43, 1] = q[60:63, 2] = 1.0  # a switch
    assert select([replace(told, positions=q)]).recordings[0].positions.max() == 1.0


@pytest.mark.parametrize(
    ("channel", "fill", "frames", "usual"),
    [
        ("elbow", -999.0, (0,), None),
        ("elbow", -999.0, (98, 99), None),
        ("elbow", 32767.0, (0, 1, 50), None),
        ("elbow", -999.0, (40, 41), 0.0),  # a locked joint
        ("gripper", -1.0, (40, 41), None),
    ],
)
def test_a_read_may_fail_in_the_first_frame_of_a_locked_joint_and_of_a_gripper(
    channel, fill, frames, usual
):
    names = ("j1", "elbow", "gripper")
    (told,) = takes(names, [0.3, 1.2, 0.04])
    q = told.positions.copy()
    if usual is not None:
        q[:, names.index(channel)] = usual
    q[list(frames), names.index(channel)] = fill
    with pytest.raises(InvalidDemonstrationsError, match=rf"{channel} is .* write nan there"):
        select([replace(told, positions=q)])


@pytest.mark.parametrize(("rate", "frames"), [(20, 1), (20, 6), (100, 3), (500, 1)])
def test_frames_of_nothing_but_0_amid_a_motion_were_not_read(rate, frames):
    t, q = sampled(1, rate)
    first = round(0.8 * rate)
    lost = q.copy()
    lost[first : first + frames] = 0.0
    said = rf"joint1 to joint7 are 0 in {frames} of .* first in {first}, .* write nan there"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        select([Recording("7", t, lost, JOINTS)])
    through_0 = select([Recording("7", t, q - q[first], JOINTS)])
    assert len(through_0.recordings[0].times) == len(t)


@pytest.mark.parametrize("each", [1, 20])
def test_key_frames_and_commands_that_stand_may_pass_through_0(each):
    q = np.repeat([[0.5, 1.0, 0.3], [0.0, 0.0, 0.0], [0.5, 1.2, 0.3]], each, axis=0)
    told = Recording("7", 0.1 * np.arange(len(q)), q, ("a", "b", "c"))
    np.testing.assert_array_equal(select([told]).recordings[0].positions, q)


@pytest.mark.parametrize(
    ("names", "value"),
    [
        (("dx", "dy"), 0.04),  # a strike at a few frames a second
        (("vx", "vy"), 0.8),
        (("j1", "elbow"), 0.3),  # a held joint that is moved for a moment, within what j1 moves
    ],
)
def test_a_motion_that_is_large_in_a_few_frames_is_no_failed_read(names, value):
    (told,) = takes(names, [0.3, 1.2])
    q = told.positions.copy()
    q[:, 1] = 0.001
    q[40:43, 1] = value
    picked = select([replace(told, positions=q)]).recordings[0].positions
    np.testing.assert_allclose(picked / picked.max(axis=0), q / q.max(axis=0))


def test_what_is_lost_in_a_channel_that_is_not_taken_does_not_count():
    q = np.column_stack([np.sin(T), np.full(100, np.nan)])
    selection = select([Recording("throw", T, q, ("a", "b"))], joints=["a"])
    assert len(selection.recordings[0].times) == 100
    assert selection.left_out == ""


def test_a_tools_pose_is_none_of_velocities():
    q = np.column_stack([np.sin(T), np.cos(T), T])
    takes = [Recording("throw", T, q, ("tcp_x", "tcp_y", "tcp_z"))]
    with pytest.raises(InvalidDemonstrationsError, match="--joints tcp_x tcp_y tcp_z") as refused:
        select(takes, ["x", "y", "z"], ["x", "y", "z"], plan_units=["m"] * 3)
    assert "velocities" not in str(refused.value)
    steps = [Recording("throw", T, q, ("d_x", "d_y", "d_z"))]
    assert select(steps, ["d_x", "d_y"], ["dx", "dy"], plan_units=["rad"] * 2).names == ("dx", "dy")


@pytest.mark.parametrize("zero", ["joint0", "rail0"])
def test_a_joint_before_the_first_that_moves_is_asked_about(zero):
    q = np.column_stack([np.sin(T), np.cos(T), np.sin(2 * T)])
    names = ["joint1", "joint2"]
    takes = [Recording("throw", T, q, (zero, *names))]
    asked = select(takes, names, names).ambiguities
    likely = ["--joints joint0 joint1"] * (zero[0] == "j")
    assert [one.option for one in asked if not one.guessed] == likely
    assert all("from 1, give --joints joint1 joint2" in one.what for one in asked)
    assert select(takes, [zero, "joint1"], names).ambiguities == ()
    still = [Recording("throw", T, q * [0, 1, 1], (zero, *names))]
    assert select(still, names, names).ambiguities == ()


def test_a_lost_frame_makes_no_angle_of_a_gripper_in_shares():
    q = np.column_stack([np.sin(T), 0.5 + 0.5 * np.sin(T)])
    q[10, 1] = np.nan
    assert select([Recording("throw", T, q, ("lift", "gripper"))]).units == ("rad", "1")


def test_episodes_are_dropped_by_name():
    two = [Recording(name, T, np.sin(T)[:, None]) for name in "ab"]
    assert select(two).without(["a"]).episodes == ("b",)


def test_joints_of_a_plan_in_radians_are_not_taken_as_they_are_by_saying_percent():
    names = ("pan", "lift", "gripper")
    q = np.column_stack([60 * np.sin(T), 40 * np.cos(T), 50 + 20 * np.sin(T)])
    selection = select(
        [Recording("throw", T, q, names)],
        units=["percent"],
        plan_units=("rad", "rad", "percent"),
    )
    (asked,) = selection.ambiguities
    assert "pan, lift in rad" in asked.what
    assert asked.option == "--units deg deg percent"


def test_a_place_is_not_taken_for_joints_of_a_robot():
    names = ("x", "y", "z", "rx", "ry", "rz")
    some = [Recording("throw", T, np.outer(np.sin(T), np.full(6, 0.3)), names)]
    with pytest.raises(ConfigurationError, match="x, y, z are a place, and not the joints"):
        select(some, names, [f"j{i}" for i in range(1, 7)], plan_units=["rad"] * 6)
    assert select(some).units == ("m",) * 3 + ("rad",) * 3
    with pytest.raises(InvalidDemonstrationsError, match="rz, a place and no joints: name what"):
        select(some, [f"j{i}" for i in range(1, 7)])


def test_columns_without_names_are_no_joint_whatever_the_plans_are_called():
    """An arm of joint1 and joint2 behind a gripper, or beside another arm."""
    q = np.column_stack([np.full(100, 0.08), np.sin(T), np.cos(T)])
    joints = ("joint1", "joint2")
    with pytest.raises(InvalidDemonstrationsError, match="3 columns without names, and the plan 2"):
        select([Recording("throw", T, q)], names=joints, joints=joints)
    for said in (
        ["gripper", "joint1", "joint2"],
        ["gripper", "arm_joint1", "arm_joint2"],
        ["column2", "column3"],
    ):
        (taken,) = select([Recording("throw", T, q)], said, joints).recordings
        np.testing.assert_array_equal(taken.positions, q[:, 1:])
    several = ["mm", "deg", "rad"]
    found = select([Recording("throw", T, q)], ["gripper", "joint2", "joint1"], joints, several)
    assert found.recorded_units == ("rad", "deg")
    np.testing.assert_array_equal(found.recordings[0].positions[:, 0], q[:, 2])


def test_velocities_are_not_taken_for_positions():
    t = np.arange(20) * 0.02
    q, own = np.outer(t, [1.0, 2.0]), ("dq_0", "dq_1")
    recordings, joints = [Recording("0", t, q, own)], ("joint1", "joint2")
    with pytest.raises(InvalidDemonstrationsError, match=r"dq_0 to dq_1 .*positions are missing"):
        select(recordings, joints, joints)
    with pytest.raises(ConfigurationError, match="dq_0 to dq_1 look like velocities"):
        select(recordings, own, joints, plan_units=("rad", "rad"))


def test_a_recording_is_to_be_left_out_only_where_another_has_the_joints():
    two, clear = ("left_elbow", "right_elbow"), ("wrist", "elbow")
    unclear = [Recording(f"t{i}", T, recording().positions, two) for i in range(2)]
    with pytest.raises(InvalidDemonstrationsError, match=r"--joints$"):
        select(unclear, ["elbow"])
    one = Recording("t2", T, recording().positions, clear)
    with pytest.raises(InvalidDemonstrationsError, match=r"--joints; .*--leave-out t0$"):
        select([*unclear, one], ["elbow"])


@pytest.mark.parametrize(
    ("option", "guessed", "asked"),
    [
        ("--joints j1", False, 0),
        ("--key q", False, 0),
        ("--time-unit ms", False, 1),
        ("--joints j1 j2", True, 1),
    ],
)
def test_units_are_asked_about_once_it_is_settled_which_columns_are_the_motion(
    option, guessed, asked
):
    (one,) = takes(("j1", "j2"), (90, 80))
    assert len(select([one]).ambiguities) == 1
    unclear = replace(one, ambiguities=(Ambiguity("", option, guessed),))
    assert len(select([unclear]).ambiguities) == asked

"""Bags of ROS 1 and ROS 2, and MCAP files, written by rosbags."""

import contextlib
import sqlite3
import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from prior_reinforce.arm.recordings import import_demonstrations, read_recordings
from prior_reinforce.arm.recordings.beside import moving_beside
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.ros import read_trajectory
from prior_reinforce.errors import FileFormatError
from tests.arm.recordings.recorded import (
    AS_IS,
    JOINTS,
    check_motions,
    sampled,
    write_bag,
    write_bags,
    write_outcomes,
)

KINDS = ["ros1", "sqlite", "mcap"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_ros_joint_states_in_any_order_with_fingers(tmp_path, kind):
    write_bags(tmp_path, kind=kind, shuffled=True, fingers=True)
    write_outcomes(tmp_path)
    result = import_demonstrations(tmp_path, joints=JOINTS, preprocessing=AS_IS)
    check_motions(result, 100, tolerance=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_ros_trajectories(tmp_path, kind):
    write_bags(tmp_path, kind=kind, trajectory=True, names=[f"panda_{j}" for j in JOINTS])
    write_outcomes(tmp_path)
    result = import_demonstrations(
        tmp_path, joints=[f"panda_{j}" for j in JOINTS], names=JOINTS, preprocessing=AS_IS
    )
    check_motions(result, 100, tolerance=1e-9)
    assert result.demonstrations.format.names == JOINTS


@pytest.mark.slow
def test_a_bare_mcap_file(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="mcap")
    (file,) = bag.glob("*.mcap")
    (recording,) = read_recordings(file)
    np.testing.assert_allclose(recording.positions, sampled(0, 100)[1])


@pytest.mark.slow
def test_a_gripper_that_publishes_on_the_same_topic(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="sqlite", gripper_apart=True)
    (recording,) = read_recordings(bag, joints=JOINTS)
    np.testing.assert_allclose(recording.positions[:, :7], sampled(0, 100)[1])
    assert recording.names[:7] == JOINTS
    assert len(recording.names) > 7  # the gripper's, by name
    assert "171 messages without all joints skipped" in recording.remarks[0]


def test_bags_without_stamps_use_the_recorders_times(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="mcap", stamped=False)
    (recording,) = read_recordings(bag)
    np.testing.assert_allclose(recording.times, sampled(0, 100)[0], atol=1e-6)
    assert "those of the recorder" in recording.remarks[0]


def test_a_bag_without_the_joint_names_those_it_has(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="mcap", fingers=True)
    with pytest.raises(
        FileFormatError, match=r"joints in it are finger_left, joint1 to joint7, fin"
    ):
        read_recordings(bag, joints=["shoulder"])


@pytest.mark.slow
def test_joints_of_a_bag_are_found_by_the_same_rule_as_the_gates(tmp_path):
    names = [f"panda_joint{i}" for i in range(1, 8)]
    bag = write_bag(tmp_path / "throw0", 0, kind="mcap", names=names, fingers=True)
    (recording,) = read_recordings(bag, joints=JOINTS)
    assert set(names) < set(recording.names)


def test_an_unknown_topic_lists_the_usable_ones(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="sqlite")
    with pytest.raises(FileFormatError, match=r"/joint_states \(sensor_msgs/msg/JointState\)"):
        read_recordings(bag, key="/joints")


@pytest.mark.slow
def test_a_damaged_bag_that_was_not_asked_for_does_not_matter(tmp_path):
    write_bags(tmp_path, kind="ros1", count=3)
    (tmp_path / "throw1.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(FileFormatError, match=r"throw1\.bag as a ROS bag"):
        read_recordings(tmp_path)
    found = read_recordings(tmp_path, episodes=["throw2", "throw0"])
    assert [recording.episode for recording in found] == ["throw2", "throw0"]


def test_a_link_out_of_a_bag_is_not_read(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="mcap", rate=20)
    (file,) = bag.glob("*.mcap")
    file.rename(tmp_path / "secret.mcap")
    file.symlink_to(tmp_path / "secret.mcap")
    with pytest.raises(FileFormatError, match="is a link out of"):
        read_recordings(bag)


def test_a_bag_that_claims_more_messages_than_a_day_has_is_not_read(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="sqlite", rate=20)
    claims = (
        (bag / "metadata.yaml").read_text().replace("message_count: 35", f"message_count: {10**12}")
    )
    (bag / "metadata.yaml").write_text(claims)
    with pytest.raises(FileFormatError, match="1e\\+12 numbers; that is no recording"):
        read_recordings(bag)


def test_a_topic_without_messages_is_named_with_a_remedy(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="sqlite", rate=20)
    (file,) = bag.glob("*.db3")
    with contextlib.closing(sqlite3.connect(file)) as data, data:
        data.execute("DELETE FROM messages")
    with pytest.raises(FileFormatError, match=r"topic /\w+ has no messages; drop .*--leave-out"):
        read_recordings(bag)


def publishing(path, kind, more):
    """A bag of a throw, each message followed by one of what `more(positions)` says.

    A number is one of a gripper, in a topic of its own.
    """
    t, q = sampled(0, 20)
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    name = "sensor_msgs/msg/JointState"
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]

    def write(writer, serialize, **second):
        own = other = writer.add_connection("/joint_states", name, typestore=store)
        if second:
            other = writer.add_connection("/joint_states", name, typestore=store, **second)
        grip = "std_msgs/msg/UInt8"
        if isinstance(more(q[0]), int):
            other = writer.add_connection("/robotiq/position", grip, typestore=store)
        for seconds, row in zip(t, q, strict=True):
            stamp = time(sec=7 + int(seconds), nanosec=round(seconds % 1 * 1e9))
            seq = {"seq": 0} if kind == "ros1" else {}
            for connection, late, said in ((own, 0, (JOINTS, row)), (other, 1000, more(row))):
                at = 7 * 10**9 + round(seconds * 1e9) + late
                if isinstance(said, int):
                    writer.write(other, at, serialize(store.types[grip](data=said), grip))
                    continue
                joints, values = said
                message = store.types[name](
                    header=header(stamp=stamp, frame_id="", **seq), name=list(joints),
                    position=np.array(values, float), velocity=np.zeros(0), effort=np.zeros(0),
                )  # fmt: skip
                writer.write(connection, at, serialize(message, name))

    if kind == "ros1":  # a connection for each publisher, where ROS 2 has one for the topic
        with Writer1(path) as writer:
            write(writer, store.serialize_ros1, callerid="/other")
    else:
        with Writer2(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
            write(writer, store.serialize_cdr)
    return path


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
@pytest.mark.parametrize("case", ["still", "moves", "without positions", "more joints"])
def test_a_topic_with_two_publishers(tmp_path, kind, case):
    more = {
        "still": lambda q: (JOINTS, np.zeros(7)),
        "moves": lambda q: (JOINTS, q + 1.0),
        "without positions": lambda q: (JOINTS, []),
        "more joints": lambda q: ((*JOINTS, "finger"), [*np.zeros(7), 0.0]),
    }[case]
    bag = publishing(tmp_path / ("throw.bag" if kind == "ros1" else "throw"), kind, more)
    if case == "moves" or (kind == "mcap" and case == "still"):
        with pytest.raises(FileFormatError, match=r"several publishers .*; record one of them al"):
            read_recordings(bag)
        return
    (recording,) = read_recordings(bag, joints=JOINTS)
    np.testing.assert_allclose(recording.positions[:, :7], sampled(0, 20)[1])
    assert any("messages" in remark for remark in recording.remarks)


TYPES = {
    "example_interfaces/msg/Float64": "float64 data",
    "lift_msgs/msg/State": "std_msgs/Header header\nfloat64 position\nfloat64 max_effort",
    "lift_msgs/msg/Both": "float64 position\nfloat64 other",
    "lift_msgs/msg/Speed": "float64 speed",
    "geometry_msgs/msg/Point": None,
}


def with_lift(path, kind, say):
    """A bag of a throw, and a topic of another type that says how high a lift is."""
    t, q = sampled(0, 20)
    store = get_typestore(Stores.ROS2_HUMBLE)
    if TYPES[kind] is not None:
        store.register(get_types_from_msg(TYPES[kind], kind))
    name = "sensor_msgs/msg/JointState"
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    with Writer2(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        joints = writer.add_connection("/joint_states", name, typestore=store)
        lift = writer.add_connection("/lift/height", kind, typestore=store)
        for seconds, row in zip(t, q, strict=True):
            at = 7 * 10**9 + round(seconds * 1e9)
            stamp = time(sec=7 + int(seconds), nanosec=round(seconds % 1 * 1e9))
            top = header(stamp=stamp, frame_id="")
            message = store.types[name](
                header=top, name=list(JOINTS), position=row, velocity=np.zeros(0),
                effort=np.zeros(0),
            )  # fmt: skip
            writer.write(joints, at, store.serialize_cdr(message, name))
            said = say(row[1])
            said |= {"header": top} if "Header" in (TYPES[kind] or "") else {}
            writer.write(lift, at + 9, store.serialize_cdr(store.types[kind](**said), kind))
    return path


@pytest.mark.parametrize(
    ("kind", "say", "named"),
    [
        ("example_interfaces/msg/Float64", lambda q: {"data": q}, "/lift/height"),
        (
            "lift_msgs/msg/State",
            lambda q: {"position": q, "max_effort": 40.0},
            "/lift/height/position",
        ),
        ("lift_msgs/msg/Both", lambda q: {"position": q, "other": 2 * q}, None),
        ("lift_msgs/msg/Speed", lambda q: {"speed": q}, None),
        ("geometry_msgs/msg/Point", lambda q: {"x": q, "y": 0.0, "z": 0.0}, None),
    ],
)
def test_a_lift_in_messages_of_any_type_is_named_and_can_be_taken(tmp_path, kind, say, named):
    bag = with_lift(tmp_path / "throw", kind, say)
    (recording,) = read_recordings(bag)
    assert [*moving_beside([recording])] == ([named] if named else [])
    assert not recording.remarks
    if named:
        (both,) = read_recordings(bag, key=["/joint_states", "/lift/height"])
        np.testing.assert_allclose(
            both.positions[:, both.names.index(named)], both.positions[:, 1], atol=1e-6
        )


def test_a_topic_whose_type_the_bag_does_not_describe_is_named(tmp_path):
    bag = with_lift(
        tmp_path / "throw", "lift_msgs/msg/State", lambda q: {"position": q, "max_effort": 40.0}
    )
    (file,) = bag.glob("*.mcap")
    content = file.read_bytes()
    file.write_bytes(content.replace(b"lift_msgs/msg/State", b"lift_msgs/msg/Stale"))
    (recording,) = read_recordings(bag)
    assert "not read: topics /lift/height (lift_msgs/msg/" in recording.remarks[0]


def test_an_mcap_of_json_is_not_called_damaged(tmp_path):
    header = struct.pack("<BQ", 1, 8) + bytes(8)  # neither profile nor library
    (tmp_path / "throw.mcap").write_bytes(b"\x89MCAP0\r\n" + header)
    with pytest.raises(FileFormatError, match=r"its messages are not of ROS .* as NPZ or CSV"):
        read_recordings(tmp_path)


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_a_gripper_of_plain_numbers_is_named_and_can_be_taken(tmp_path, kind):
    def gripper(q):
        return int(200 * (q[1] > -0.2))

    bag = publishing(tmp_path / ("throw.bag" if kind == "ros1" else "throw"), kind, gripper)
    (recording,) = read_recordings(bag)
    assert moving_beside([recording]) == {"/robotiq/position": (0.0, 200.0)}
    (both,) = read_recordings(bag, key=["/joint_states", "/robotiq/position"])
    assert both.names == (*JOINTS, "/robotiq/position")
    assert np.ptp(both.positions[:, 7]) == 200
    assert not moving_beside([both])
    with pytest.raises(FileFormatError, match="no joint topic /robotiq/position"):
        read_recordings(bag, key="/robotiq/position")


def test_a_base_that_drives_is_named_whatever_its_message(tmp_path):
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    t, q = sampled(0, 50)
    state, pose = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"
    with Writer2(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = [
            bag.add_connection(topic, kind, typestore=store)
            for topic, kind in (("/joints", state), ("/base_pose", pose), ("/tcp_pose", pose))
        ]
        for at, row in zip(t, q, strict=True):
            stamp = types["builtin_interfaces/msg/Time"](int(at), round(at % 1 * 1e9))
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
            empty = np.zeros(0)
            joints = types[state](header, list(JOINTS), row, empty, empty)
            place = types["geometry_msgs/msg/Point"](x=0.3 * at, y=0.0, z=0.0)
            turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
            there = types[pose](header, types["geometry_msgs/msg/Pose"](place, turn))
            for topic, message, kind in zip(
                topics, (joints, there, there), (state, pose, pose), strict=True
            ):
                bag.write(topic, round(at * 1e9), store.serialize_cdr(message, kind))
    (read,) = read_recordings(tmp_path / "bag")
    driven = {"/base_pose/pose/position/x": (0.0, pytest.approx(0.3 * t[-1]))}
    assert moving_beside([read]) == driven


def test_hidden_files_beside_bags_are_none(tmp_path):
    (tmp_path / "._throw0.mcap").write_bytes(b"\0\5\26\7")
    write_bag(tmp_path / "throw0", 0, kind="mcap")
    assert [read.episode for read in read_recordings(tmp_path)] == ["throw0"]


def test_a_bag_without_joints_is_told_by_what_it_has(tmp_path):
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = "std_msgs/msg/Float64"
    with Writer2(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.MCAP) as bag:
        topic = bag.add_connection("/force", kind, typestore=store)
        message = store.types[kind](data=1.0)
        bag.write(topic, 1, store.serialize_cdr(message, kind))
    with pytest.raises(FileFormatError, match=r"it has /force \(std_msgs/msg/Float64\): write"):
        read_recordings(tmp_path / "bag")


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
@pytest.mark.parametrize("lost", [None, 40])
def test_joints_that_come_in_two_messages_in_turn_are_put_together(tmp_path, kind, lost):
    bag = write_bag(
        tmp_path / ("a.bag" if kind == "ros1" else "a"), 0, kind=kind, halves=True, lost=lost
    )
    (read,) = read_recordings(bag, joints=JOINTS)
    columns = [read.names.index(joint) for joint in JOINTS]
    q = sampled(0, 100)[1]
    tolerance = 1e-9 if lost is None else 0.01 * np.ptp(q, axis=0).max()
    kept = len(read.positions)
    assert kept >= len(q) - 1
    np.testing.assert_allclose(read.positions[:, columns][:40], q[:40], atol=tolerance)
    np.testing.assert_allclose(read.positions[:, columns][-40:], q[-40:], atol=tolerance)
    assert "interpolated by header stamps" in read.remarks[0]


def test_a_stream_of_trajectories_of_one_point_is_one_motion(tmp_path):
    store, (t, q) = get_typestore(Stores.ROS2_HUMBLE), sampled(0, 50)
    types, kind, none = store.types, "trajectory_msgs/msg/JointTrajectory", np.zeros(0)
    with Writer2(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.MCAP) as bag:
        topic = bag.add_connection("/servo", kind, typestore=store)
        for at, row in zip(t, q, strict=True):
            stamp = types["builtin_interfaces/msg/Time"](9 + int(at), round(at % 1 * 1e9))
            wait = types["builtin_interfaces/msg/Duration"](0, 20_000_000)
            point = types["trajectory_msgs/msg/JointTrajectoryPoint"](row, none, none, none, wait)
            header = types["std_msgs/msg/Header"](stamp, "")
            message = types[kind](header, list(JOINTS), [point])
            bag.write(topic, round((9 + at) * 1e9), store.serialize_cdr(message, kind))
    (read,) = read_recordings(tmp_path / "bag", joints=JOINTS)
    np.testing.assert_allclose(read.positions, q)
    np.testing.assert_allclose(read.times, t, atol=1e-6)
    assert any("one point each" in remark for remark in read.remarks)


def trajectory(times, *derivatives):
    """Points with positions and what else is given of them, a polynomial a joint."""
    names = ("positions", "velocities", "accelerations")
    points = [
        SimpleNamespace(
            time_from_start=SimpleNamespace(sec=int(t), nanosec=round(t % 1 * 1e9)),
            **dict.fromkeys(names, ()) | {
                name: np.array([p(t) for p in of])
                for name, of in zip(names, derivatives, strict=False)
            },
        )
        for t in times
    ]  # fmt: skip
    return SimpleNamespace(points=points, joint_names=["a", "b"])


def read_one(told):
    return read_trajectory(Path("plan.mcap"), "plan", told, ReadOptions())


POLYNOMIALS = {
    3: [np.poly1d([0.4, -1.0, 0.2, 0.3]), np.poly1d([-0.2, 0.5, 0.1])],
    5: [np.poly1d([0.3, -0.5, 0.4, -1.0, 0.2, 0.3]), np.poly1d([-0.2, 0.5, 0.1])],
}


@pytest.mark.parametrize("degree", [3, 5])
def test_between_via_points_is_the_motion_that_their_derivatives_state(degree):
    of = POLYNOMIALS[degree]
    derivatives = [[p.deriv(m) for p in of] for m in range((degree + 1) // 2)]
    recording = read_one(trajectory([0.0, 0.3, 0.8, 1.2], *derivatives))
    assert len(recording.times) == 121
    expected = np.column_stack([p(recording.times) for p in of])
    np.testing.assert_allclose(recording.positions, expected, atol=1e-9)
    assert recording.remarks[0].startswith("4 via points joined by")


def test_points_of_a_controllers_rate_and_points_without_velocities_are_the_frames():
    of = POLYNOMIALS[3]
    velocities = [p.deriv() for p in of]
    close, bare = np.arange(0, 1, 0.01), [0.0, 0.5, 1.0]
    assert len(read_one(trajectory(close, of, velocities)).times) == 100
    assert len(read_one(trajectory(bare, of)).times) == 3
    nothing = [lambda t: np.nan] * 2
    assert len(read_one(trajectory(bare, of, nothing)).times) == 3
    even = read_one(trajectory([0.0, 0.03, 0.07], of, velocities)).times
    np.testing.assert_allclose(np.diff(even), 0.01)


def test_a_trajectory_that_lasts_for_ever_is_refused():
    of = POLYNOMIALS[3]
    with pytest.raises(FileFormatError, match="plan"):
        read_one(trajectory([0.0, 1e9], of, [p.deriv() for p in of]))

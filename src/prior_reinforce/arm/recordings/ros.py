"""ROS 1 bags, ROS 2 sqlite bags and MCAP, read with rosbags (no ROS needed).

A sensor_msgs/JointState topic gives one episode a bag; a trajectory_msgs/JointTrajectory topic one
a message, or one a bag if each message has a single point.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.beside import columns_beside, may_move
from prior_reinforce.arm.recordings.bounds import check_numbers
from prior_reinforce.arm.recordings.clock import clock_of
from prior_reinforce.arm.recordings.messages import Message, read_messages
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import (
    Beside,
    Episodes,
    Recording,
    has_suffix,
    is_hidden,
    named_damage,
    natural_order,
    recorded,
    unread,
)
from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import require_inside
from prior_reinforce.plans.channels import is_of_base, says_no_position

_SUFFIXES = (".bag", ".mcap", ".db3")
_BAG = "a ROS bag, complete once its recorder ended (else: mcap recover, or ros2 bag reindex)"
_STATE, _TRAJECTORY = "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"
_OF_NO_JOINT = re.compile(
    r"(rcl_interfaces|rosgraph_msgs|diagnostic_msgs|tf2?_msgs|\w*geometry_msgs|nav_msgs|shape_msgs"
    r"|lifecycle_msgs|rosbag_msgs)/|/(Image|CompressedImage|CameraInfo|LaserScan|PointCloud2?|Imu"
    r"|MagneticField|NavSatFix|Joy|BatteryState|Temperature)$"
)
"""Types of messages that no lift or gripper sends: ROS's own, poses, sensors."""
_MAGIC, _HEAD = b"\x89MCAP0\r\n", struct.Struct("<8sBQI")
"""How an MCAP begins: these bytes, a record's kind and length, and the length of its first text."""
_TIME = re.compile(r"builtin_interfaces/msg/(Time|Duration)|std_msgs/msg/Header")
_MOST_BYTES = 2_000
"""Bytes of a message of a lift's or gripper's position at most. Ours: others are pictures."""

_PERIOD = 0.01
"""Between frames of a motion that is made of via points, in [s]; points that lie closer are its
frames. Ours: controllers run at 100 Hz and more."""


def recognises(source: Path) -> bool:
    """Whether a path looks like a bag, or a folder that holds one."""
    return bool(_bags_at(source))


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read a bag, or every bag of a folder."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    bags = _bags_at(source)
    if not bags:
        raise FileFormatError(
            f"{source} is no bag and holds none; expected .bag, .mcap, .db3 or a ROS 2 bag's folder"
        )
    for bag in bags:
        name = bag.name if bag.is_dir() else bag.stem
        wanted = options.episodes or (name,)
        if name in (options.leave_out or ()) or not any(
            e == name or e.startswith(f"{name}-") for e in wanted
        ):
            yield name, unread
            continue
        # A link inside could name any file of this machine.
        for path in bag.iterdir() if bag.is_dir() else ():
            require_inside(path, bag)
        files = _files_of(bag)
        if len(files) > 1:
            raise FileFormatError(
                f"{bag} holds {len(files)} files of a bag and no metadata.yaml, as a recorder that "
                f"was killed leaves it; write it anew: ros2 bag reindex {bag}"
            )
        _refuse_other_messages(files[0])
        with named_damage(bag, _BAG):
            # Bags from before ROS 2 Iron carry no definitions; these two messages never changed.
            definitions = get_typestore(Stores.LATEST)
            with AnyReader(files, default_typestore=definitions) as reader:
                check_numbers(bag, "all topics", (reader.message_count,))
                keys = options.key or (None,)
                topics = [_topic(bag, reader, key, beside=i > 0) for i, key in enumerate(keys)]
                each = [_messages(reader, own) for own, _ in topics]
                messages, *beside = each
                (connections, kind), *_ = topics
                taken = {own[0].topic for own, _ in topics}
                rest = {c.topic: c for c in reader.connections if c.topic not in taken}
                joint_topics = sorted(n for n, c in rest.items() if c.msgtype == _STATE)
                elsewhere: dict[str, Beside] = {}
                unknown = []
                for c in rest.values():
                    if c.msgtype not in reader.typestore.fielddefs:
                        unknown.append(f"{c.topic} ({c.msgtype})")
                    elif c.msgtype not in (_STATE, _TRAJECTORY):
                        elsewhere |= _beside(c.topic, _messages(reader, [c]))
        notes = [f"not read: topics {', '.join(joint_topics)} (--key given again takes one)"]
        notes = notes * bool(joint_topics)
        if unknown:
            what = f"not read: topics {', '.join(sorted(unknown))}, whose messages the bag does not"
            notes.append(f"{what} describe; if one is a lift's or a gripper's, write it as CSV")
        for (own, _), said in zip(topics[1:], beside, strict=True):
            if not any(getattr(m.content, "name", ()) for m in said):
                raise FileFormatError(
                    f"{bag}: topic {own[0].topic} ({own[0].msgtype}) has no numbers that could be "
                    "positions; drop that --key, or write them as CSV"
                )
        if not messages:
            raise FileFormatError(
                f"{bag}: topic {connections[0].topic} has no messages; drop that bag, or leave it "
                "out with --leave-out"
            )
        if all(hasattr(m.content, "name") for m in messages):
            if kind == _TRAJECTORY:
                notes.append(f"{len(messages)} trajectories of one point each, read as one motion")
            whole = partial(read_messages, bag, name, each, options, notes, elsewhere)
            yield name, named_damage(bag, _BAG)(whole)
            continue
        for index, message in enumerate(messages):
            episode = name if len(messages) == 1 else f"{name}-{index}"
            read_one = partial(read_trajectory, bag, episode, message.content, options)
            yield episode, named_damage(bag, _BAG)(read_one)


def _bags_at(source: Path) -> list[Path]:
    """The bags a path stands for: itself, or those of its folder; empty if there are none."""
    if not source.is_dir() or (source / "metadata.yaml").is_file():
        return [source] if _files_of(source) else []
    seen = [path for path in source.iterdir() if not is_hidden(path)]
    return sorted(filter(_files_of, seen), key=natural_order)


def _files_of(bag: Path) -> list[Path]:
    """What to open of a bag: itself, or the files of a folder whose recorder was killed."""
    if bag.is_file() or (bag / "metadata.yaml").is_file():
        return [bag] if bag.is_dir() or has_suffix(bag, _SUFFIXES) else []
    within = bag.iterdir() if bag.is_dir() else ()
    return [path for path in within if path.is_file() and has_suffix(path, _SUFFIXES)]


def _refuse_other_messages(path: Path) -> None:
    """Refuse an MCAP whose first record does not say `ros1` or `ros2` (mcap.dev/spec)."""
    if has_suffix(path, (".mcap",)) and path.is_file():
        with path.open("rb") as file:
            magic, opcode, _, size = _HEAD.unpack(file.read(_HEAD.size).ljust(_HEAD.size))
            profile = file.read(min(size, _HEAD.size)).decode(errors="replace")
        if magic == _MAGIC and opcode == 1 and not profile.startswith("ros"):
            raise FileFormatError(
                f"{path}: its messages are not of ROS (JSON, for instance), and those alone are "
                "read; save their times, joint names and positions as NPZ or CSV"
            )


def _numbers(topic: str, message: Any) -> Any:
    """Turn a message of numbers into one of joints named by its topic; leave one of joints."""
    if message.__msgtype__ in (_STATE, _TRAJECTORY):
        return message
    fields = {
        f"{topic}{'' if path == '/data' else path}": np.ravel(np.asarray(values, dtype=float))
        for path, values in _fields(message)
    }
    other = says_no_position(topic.rpartition("/")[2]) and not is_of_base(topic)
    fields = {n: own for n, own in fields.items() if may_move(n, len(own)) and not other}
    names = [
        name if len(own) == 1 else f"{name}_{i}"
        for name, own in fields.items()
        for i in range(len(own))
    ]
    position = np.concatenate([*fields.values(), []])
    return SimpleNamespace(name=names, position=position, header=getattr(message, "header", None))


def _fields(message: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the numbers and arrays in a message with their paths, without times and headers."""
    for name, value in vars(message).items():
        kind = getattr(value, "__msgtype__", None)
        if isinstance(value, (bool, int, float)) or (
            isinstance(value, np.ndarray) and value.dtype.kind in "biuf"
        ):
            yield f"{path}/{name}", value
        elif kind is not None and not _TIME.fullmatch(kind):
            yield from _fields(value, f"{path}/{name}")


def _beside(topic: str, messages: Sequence[Message]) -> dict[str, Beside]:
    """Return the numbers of a topic; they count as moving if a single one, or one list, moves.

    Several in a message are mostly a pose, or a driver's; those of a mobile base all count.
    """
    names = messages[0].content.name if messages else []
    rows = [m.content.position for m in messages]
    if len(rows) < 2 or not names or len({len(row) for row in rows}) > 1:
        return {}
    times = np.array([m.came - messages[0].came for m in messages]) * 1e-9
    found = columns_beside(names, np.array(rows), (), times)
    moving = {own.moving for own in found.values()} - {""}
    if is_of_base(topic):
        moving = {*filter(is_of_base, moving)}
    elif len(moving) > 1:
        moving = set()
    return {n: b if b.moving in moving else b._replace(moving="") for n, b in found.items()}


def _messages(reader: Any, connections: Sequence[Any]) -> list[Message]:
    """Return a topic's messages, none of one that no joint, lift or gripper sends.

    Trajectories of one point each are a stream of set points.
    """
    found = []
    for c, stamp, raw in reader.messages(connections=connections):
        joints = c.msgtype in (_STATE, _TRAJECTORY)
        other = _OF_NO_JOINT.search(c.msgtype) and not is_of_base(c.topic)
        if not joints and (len(raw) > _MOST_BYTES or other):
            return []
        content = _numbers(c.topic, reader.deserialize(raw, c.msgtype))
        found.append(Message(stamp, c.id, content))
    points = [getattr(m.content, "points", ()) for m in found]
    if len(points) > 1 and all(len(own) == 1 for own in points):
        found = [m._replace(content=_set_point(m.content)) for m in found]
    return found


def _set_point(trajectory: Any) -> Any:
    """Turn a trajectory of one point into a message of joints, when it is to be reached."""
    (point,) = trajectory.points
    stamp, wait = trajectory.header.stamp, point.time_from_start
    when = SimpleNamespace(sec=stamp.sec + wait.sec, nanosec=stamp.nanosec + wait.nanosec)
    header = SimpleNamespace(stamp=when, frame_id=trajectory.header.frame_id)
    return SimpleNamespace(
        header=header, name=list(trajectory.joint_names), position=point.positions
    )


def read_trajectory(path: Path, episode: str, message: Any, options: ReadOptions) -> Recording:
    """Return an episode of one JointTrajectory, with the motion that a controller makes of it.

    ros2_control's joint_trajectory_controller joins via points by cubics through stated velocities,
    by quintics through accelerations too, else by straight lines.
    """
    points, joints = message.points, tuple(message.joint_names)
    times = np.array([p.time_from_start.sec + p.time_from_start.nanosec * 1e-9 for p in points])
    positions = np.array([p.positions for p in points], dtype=float).reshape(len(times), -1)
    stated = [positions]
    for derivative in ("velocities", "accelerations"):
        rows = [getattr(point, derivative) for point in points]
        if any(len(row) != len(joints) for row in rows) or not np.all(np.isfinite(rows)):
            break
        stated.append(np.array(rows, dtype=float))
    remarks = []
    steps = np.diff(times)
    if len(stated) > 1 and len(steps) and steps.min() > 0 and np.median(steps) > 2.01 * _PERIOD:
        from scipy.interpolate import BPoly

        frames = math.ceil((times[-1] - times[0]) / _PERIOD - 1e-6) + 1
        check_numbers(path, episode, (frames, len(joints)))
        curve = BPoly.from_derivatives(times, np.stack(stated, axis=1))
        degree = "cubics through their velocities" if len(stated) == 2 else "quintics"
        remarks.append(f"{len(times)} via points joined by {degree}, as a controller joins them")
        times = np.linspace(times[0], times[-1], frames)
        positions = curve(times)
    clock = clock_of(episode, len(times), options, stamps=times, name="time_from_start", unit="s")
    return recorded(episode, clock, positions, joints, remarks=remarks)


def _topic(bag: Path, reader: Any, key: str | None, *, beside: bool) -> tuple[list[Any], str]:
    """Return the connections and the type of a topic of joints; of numbers too, with `beside`."""
    kinds = {c.topic: c.msgtype for c in reader.connections}
    usable = {topic: kind for topic, kind in kinds.items() if kind in (_STATE, _TRAJECTORY)}
    if key is None and len(usable) == 1:
        key = next(iter(usable))
    number = beside and key in kinds and not _OF_NO_JOINT.search(kinds[str(key)])
    if key is None or not (key in usable or number):
        if not usable:
            raise FileFormatError(
                f"{bag} has no topic of JointState or JointTrajectory, and of other messages none "
                f"is read as the motion; it has {_listed(kinds)}: write its positions, or its "
                "poses, as CSV, a row a message with the time and a column a number"
            )
        raise FileFormatError(
            f"{bag}: {'no joint topic ' + key if key else f'{len(usable)} joint topics'}; topics "
            f"of JointState or JointTrajectory are {_listed(usable)}: say which with --key"
        )
    return [c for c in reader.connections if c.topic == key], kinds[key]


def _listed(kinds: Mapping[str, str]) -> str:
    return ", ".join(f"{topic} ({kind})" for topic, kind in sorted(kinds.items())) or "none"

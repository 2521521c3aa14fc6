"""ROS 1 bags, ROS 2 sqlite bags and MCAP, read with rosbags (no ROS needed).

A sensor_msgs/JointState topic gives one episode a bag; a trajectory_msgs/JointTrajectory topic one
a message. Joints are matched by name in every message, because nothing fixes their order.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.beside import columns_beside, is_of_base, may_move
from prior_reinforce.arm.recordings.bounds import check_names, check_numbers
from prior_reinforce.arm.recordings.naming import find_channels
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import (
    Beside,
    Episodes,
    Positions,
    Recording,
    has_suffix,
    is_hidden,
    named_damage,
    natural_order,
    recorded,
    unread,
)
from prior_reinforce.arm.recordings.time_finder import Times
from prior_reinforce.arm.recordings.trajectories import read_trajectory
from prior_reinforce.arm.recordings.units import say_names
from prior_reinforce.arm.robots.limits import says_no_position
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.files import require_inside

_SUFFIXES = (".bag", ".mcap", ".db3")
_BAG = "a ROS bag, complete once its recorder ended (else: mcap recover, or ros2 bag reindex)"
_HEADER, _RECORDER = "header", "recorder"
_JUMP, _DRIFT = 1e8, 0.05
"""By how much the two clocks of a bag may part within a message, in [ns], and drift apart as a
share. Ours: queues hold messages for some 10 ms."""
_MOVES, _LEAP, _OFTEN = 0.02, 0.5, 0.05
"""Range in [rad] or [m] that is a motion; part of it that is a leap; share of frames in which no
joint leaps, but two publishers do in turn. Ours."""
_STATE, _TRAJECTORY = "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"
_OF_NO_JOINT = re.compile(
    r"(rcl_interfaces|rosgraph_msgs|diagnostic_msgs|tf2?_msgs|\w*geometry_msgs|nav_msgs|shape_msgs"
    r"|lifecycle_msgs|rosbag_msgs)/|/(Image|CompressedImage|CameraInfo|LaserScan|PointCloud2?|Imu"
    r"|MagneticField|NavSatFix|Joy|BatteryState|Temperature)$"
)
"""Types of messages that no lift or gripper sends: of ROS itself, places, cameras and the like."""
_MAGIC, _HEAD = b"\x89MCAP0\r\n", struct.Struct("<8sBQI")
"""How an MCAP begins: these bytes, a record's kind and length, and the length of its first text."""
_TIME = re.compile(r"builtin_interfaces/msg/(Time|Duration)|std_msgs/msg/Header")
_MOST_BYTES = 2_000
"""Bytes of a message of a lift's or gripper's position at most. Ours: others are pictures."""


class Message(NamedTuple):
    """A message of a topic."""

    stamp: int
    """When the recorder got it, in [ns]."""
    publisher: int
    """Number of its connection."""
    content: Any

    @property
    def positions(self) -> dict[str, float]:
        """Position by joint."""
        return dict(zip(self.content.name, self.content.position, strict=True))


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
                messages, *beside = (_messages(reader, own) for own, _ in topics)
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
            if not any(m.content.name for m in said):
                raise FileFormatError(
                    f"{bag}: topic {own[0].topic} ({own[0].msgtype}) has no numbers that could be "
                    "positions; drop that --key, or write them as CSV"
                )
        if not messages:
            raise FileFormatError(
                f"{bag}: topic {connections[0].topic} has no messages; drop that bag, or leave it "
                "out with --leave-out"
            )
        if kind == _STATE:
            there = (beside, notes, elsewhere)
            yield name, partial(_states, bag, name, messages, options, *there)
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
    """A message as one of joints that are called by its topic; those of joints as they are."""
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
    return SimpleNamespace(name=names, position=np.concatenate([*fields.values(), []]))


def _fields(message: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every number or array of numbers in a message, by its path; none of times and headers."""
    for name, value in vars(message).items():
        kind = getattr(value, "__msgtype__", None)
        if isinstance(value, (bool, int, float)) or (
            isinstance(value, np.ndarray) and value.dtype.kind in "biuf"
        ):
            yield f"{path}/{name}", value
        elif kind is not None and not _TIME.fullmatch(kind):
            yield from _fields(value, f"{path}/{name}")


def _beside(topic: str, messages: Sequence[Message]) -> dict[str, Beside]:
    """The numbers of a topic; what moves is the only one, or only list of numbers, that does.

    Several in one message are mostly a pose, or of a driver; but where a base stands is named.
    """
    names = messages[0].content.name if messages else []
    rows = [m.content.position for m in messages]
    if len(rows) < 2 or not names or len({len(row) for row in rows}) > 1:
        return {}
    times = np.array([m.stamp - messages[0].stamp for m in messages]) * 1e-9
    found = columns_beside(names, np.array(rows), (), times)
    moving = {own.moving for own in found.values()} - {""}
    if is_of_base(topic):
        moving = {*filter(is_of_base, moving)}
    elif len(moving) > 1:
        moving = set()
    return {n: b if b.moving in moving else b._replace(moving="") for n, b in found.items()}


def _messages(reader: Any, connections: Sequence[Any]) -> list[Message]:
    """The messages of a topic; of one that no joint, lift or gripper sends, none."""
    found = []
    for c, stamp, raw in reader.messages(connections=connections):
        joints = c.msgtype in (_STATE, _TRAJECTORY)
        other = _OF_NO_JOINT.search(c.msgtype) and not is_of_base(c.topic)
        if not joints and (len(raw) > _MOST_BYTES or other):
            return []
        content = _numbers(c.topic, reader.deserialize(raw, c.msgtype))
        found.append(Message(stamp, c.id, content))
    return found


def _topic(bag: Path, reader: Any, key: str | None, *, beside: bool) -> tuple[list[Any], str]:
    """The connections and the type of a topic of joints; beside another, also of numbers."""
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


def _states(
    bag: Path,
    name: str,
    messages: list[Message],
    options: ReadOptions,
    beside: Sequence[list[Message]],
    notes: Sequence[str],
    elsewhere: Mapping[str, Beside],
) -> Recording:
    """One publisher's JointStates, with the joints of other messages and topics at their times."""
    every = list(dict.fromkeys(joint for m in messages for joint in m.content.name))
    check_names(bag, every)
    if not any(every):
        raise FileFormatError(
            f"{bag}: its messages name no joint, so nothing says which number is which; record "
            "again with names (the driver's or the bridge's setting), or write the positions as CSV"
        )
    # Messages are matched by recorded names only.
    found = None if options.joints is None else find_channels(options.joints, every)
    wanted = options.joints if found is None else tuple(every[i] for i in found)
    if wanted is None:
        wanted = Counter(tuple(sorted(m.content.name)) for m in messages).most_common(1)[0][0]
    kept = [m for m in messages if set(wanted) <= set(m.content.name)]
    skipped = "without all joints skipped"
    if not kept and (kept := _first_in_turn(messages, wanted)):
        wanted = tuple(joint for joint in wanted if joint in kept[0].content.name)
        skipped = "have the other joints, which are taken at the first ones' times"
    if not kept:
        raise FileFormatError(
            f"{bag}: no message holds all of {list(wanted)}; joints in it are {say_names(every)}: "
            "name those, or if messages hold some each, publish all in one (joint_state_publisher)"
        )
    kept, remarks = _of_one_publisher(bag, [m for m in kept if len(m.content.position)], wanted)
    if len(kept) < len(messages):
        remarks.append(f"{len(messages) - len(kept)} messages {skipped}")
    remarks += notes
    # Other channels of these messages, such as fingers, stay available by name.
    names = tuple(n for n in kept[0].content.name if all(n in m.content.name for m in kept))
    with named_damage(bag, _BAG):
        positions = _positions(kept, names)
        came = [m.stamp for m in kept]
        others = [m for m in messages if not set(wanted) <= set(m.content.name)]
        for of_topic in (others, *beside):
            own = [m for m in of_topic if len(m.content.position)]
            for joint in dict.fromkeys(n for m in own for n in m.content.name if n not in names):
                at, values = zip(
                    *((m.stamp, m.positions[joint]) for m in own if joint in m.positions),
                    strict=True,
                )
                names = (*names, joint)
                positions = np.column_stack([positions, np.interp(came, at, values)])
    header = [m.content.header.stamp for m in kept]
    sent = [stamp.sec * 10**9 + stamp.nanosec for stamp in header]
    times, source, said = _clock_of(bag, sent, came, options.time_column)
    clock = options.clock(name, len(kept), stamps=times, name=source, unit="ns")
    return recorded(name, clock, positions, names, remarks=(*remarks, *said), beside=elsewhere)


def _first_in_turn(messages: list[Message], wanted: Sequence[str]) -> list[Message]:
    """The first of messages that come in turn, each with its own joints; none if one is lost."""
    some = [m for m in messages if {*wanted} & {*m.content.name} and len(m.content.position)]
    said = [frozenset(m.content.name) for m in some]
    n = len({*said})
    in_turn = len({*said[:n]}) == n and said[n:] == said[:-n]
    return some[::n] if in_turn and {*wanted} <= frozenset().union(*said) else []


def _of_one_publisher(
    bag: Path, messages: list[Message], wanted: Sequence[str]
) -> tuple[list[Message], list[str]]:
    """The messages of the only publisher whose joints move, and what is said of others.

    Publishers of one topic are told apart by connection (ROS 1), frame, and which joints they name.
    FileFormatError if none has positions, or several move.
    """
    if not messages:
        raise FileFormatError(
            f"{bag}: its messages hold no positions (velocities or efforts alone); record the "
            "topic that has positions, or say it with --key"
        )
    groups: dict[Hashable, list[Message]] = {}
    for m in messages:
        key = m.publisher, m.content.header.frame_id, frozenset(m.content.name)
        groups.setdefault(key, []).append(m)
    spans = [(own[0].stamp, own[-1].stamp) for own in groups.values()]
    each = [messages]  # of one that came again, one after the other
    if any(start <= end for (_, end), (start, _) in pairwise(sorted(spans))):
        each = [
            own for own in groups.values() if np.ptp(_positions(own, wanted), axis=0).max() > _MOVES
        ]
    if len(each) != 1 or _leaps(each[0], wanted):
        counts = " and ".join(str(len(own)) for own in groups.values())
        raise FileFormatError(
            f"{bag}: its messages ({counts}) are of several publishers that disagree about the "
            "same joints; record one of them alone (`ros2 topic info -v TOPIC` names them), or "
            "write its positions as CSV"
        )
    rest = len(messages) - len(each[0])
    return each[0], [f"{rest} messages of another publisher, whose joints hold still"] * (rest > 0)


def _positions(messages: list[Message], joints: Sequence[str]) -> Positions:
    rows = [[at[joint] for joint in joints] for at in (m.positions for m in messages)]
    return np.array(rows, dtype=float)


def _leaps(messages: list[Message], joints: Sequence[str]) -> bool:
    """Whether a joint leaps time and again, as two publishers in turn make it do."""
    q = _positions(messages, joints)
    ranges = np.maximum(np.ptp(q, axis=0), _MOVES)
    steps = np.diff(q, axis=0) / ranges
    there, back = (np.mean(sign * steps > _LEAP, axis=0) for sign in (1, -1))
    return bool(np.any(np.minimum(there, back) > _OFTEN))


def _clock_of(
    bag: Path, header: list[int], recorder: list[int], asked: str | None
) -> tuple[Times, str, list[str]]:
    """The times of messages: as they were stamped, unless that clock is unusable or jumps.

    The recorder's clock holds them in a queue, and so is late and uneven; but where the header's
    jumps and the recorder's does not, the header's was set meanwhile.
    """
    # Since the first stamp; since 1970, nanoseconds would be 256 ns coarse as floats.
    sent, came = (
        np.array([stamp - stamps[0] for stamp in stamps], dtype=np.float64)
        for stamps in (header, recorder)
    )
    names = {_HEADER: (sent, "header stamps"), _RECORDER: (came, "the recorder's stamps")}
    if asked not in (None, *names):
        raise ConfigurationError(
            f"--time-column {asked} is no clock of a bag; give {_HEADER} or {_RECORDER}"
        )
    if asked is not None:
        return *names[asked], []
    if header[0] <= 0 or np.any(np.diff(sent) < 0) or sent[-1] == 0:
        why = "header stamps unusable, times are those of the recorder"
        return *names[_RECORDER], [why]
    period = float(np.median(np.diff(sent)))
    apart = np.diff(sent - came)
    frame = int(np.argmax(np.abs(apart)))
    jump, rest = apart[frame], float(np.sum(apart) - apart[frame])
    if abs(jump) > max(_JUMP, 3 * period) and abs(rest) < abs(jump) / 2:
        if np.diff(came)[frame] <= 3 * max(period, float(np.median(np.diff(came)))):
            why = (
                f"header stamps jump by {jump * 1e-9:+.3f} s at {came[frame] * 1e-9:.2f} s, the "
                "recorder's do not: times are those of the recorder"
            )
            return *names[_RECORDER], [why]
    elif abs(sent[-1] - came[-1]) > max(_JUMP, _DRIFT * came[-1]) and came[-1] > 0:
        raise FileFormatError(
            f"{bag}: header stamps last {sent[-1] * 1e-9:.3g} s, the recorder's "
            f"{came[-1] * 1e-9:.3g} s; say which are right: --time-column {_HEADER}, or {_RECORDER}"
        )
    return *names[_HEADER], []

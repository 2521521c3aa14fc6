"""ROS 1 bags, ROS 2 sqlite bags and MCAP, read with rosbags (no ROS needed).

A sensor_msgs/JointState topic gives one episode a bag; a trajectory_msgs/JointTrajectory topic one
a message. Joints are matched by name in every message, because nothing fixes their order.
"""

from __future__ import annotations

from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.bench.importing.bounds import check_names, check_numbers
from prior_reinforce.bench.importing.clock import Times
from prior_reinforce.bench.importing.naming import find_channels
from prior_reinforce.bench.importing.options import ReadOptions
from prior_reinforce.bench.importing.recording import (
    Episodes,
    Recording,
    has_suffix,
    named_damage,
    natural_order,
    recorded,
    unread,
)
from prior_reinforce.bench.importing.units import say_names
from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import require_inside

_SUFFIXES = (".bag", ".mcap", ".db3")
_STATE, _TRAJECTORY = "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"


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
        with named_damage(bag, "a ROS bag"):
            # Bags from before ROS 2 Iron carry no definitions; these two messages never changed.
            definitions = get_typestore(Stores.LATEST)
            with AnyReader([bag], default_typestore=definitions) as reader:
                connections, kind = _topic(bag, reader, options.key)
                check_numbers(bag, connections[0].topic, (reader.message_count,))
                messages = [
                    (stamp, reader.deserialize(raw, connection.msgtype))
                    for connection, stamp, raw in reader.messages(connections=connections)
                ]
        if not messages:
            raise FileFormatError(
                f"{bag}: topic {connections[0].topic} has no messages; drop that bag, or leave it "
                "out with --leave-out"
            )
        if kind == _STATE:
            yield name, partial(_states, bag, name, messages, options)
            continue
        for index, (_, message) in enumerate(messages):
            episode = name if len(messages) == 1 else f"{name}-{index}"
            yield episode, partial(_trajectory, bag, episode, message, options)


def _bags_at(source: Path) -> list[Path]:
    """The bags a path stands for: itself, or those of its folder; empty if there are none."""
    if _is_bag(source):
        return [source]
    found = source.iterdir() if source.is_dir() else ()
    return sorted(filter(_is_bag, found), key=natural_order)


def _is_bag(path: Path) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    return path.is_file() and has_suffix(path, _SUFFIXES)


def _topic(bag: Path, reader: Any, key: str | None) -> tuple[list[Any], str]:
    usable = {c.topic: c.msgtype for c in reader.connections if c.msgtype in (_STATE, _TRAJECTORY)}
    if key is None and len(usable) == 1:
        key = next(iter(usable))
    if key not in usable:
        listed = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(usable.items()))
        raise FileFormatError(
            f"{bag}: {'no joint topic ' + key if key else f'{len(usable)} joint topics'}; topics "
            f"of JointState or JointTrajectory are {listed or 'none'}: say which with the key"
        )
    return [c for c in reader.connections if c.topic == key], usable[key]


def _states(
    bag: Path, name: str, messages: list[tuple[int, Any]], options: ReadOptions
) -> Recording:
    """One episode of JointStates; messages that lack a wanted joint are from other publishers."""
    check_names(bag, {joint for _, message in messages for joint in message.name})
    every = list(dict.fromkeys(joint for _, message in messages for joint in message.name))
    # Messages are matched by recorded names only.
    found = None if options.joints is None else find_channels(options.joints, every)
    wanted = options.joints if found is None else tuple(every[i] for i in found)
    if wanted is None:
        wanted = Counter(tuple(sorted(m.name)) for _, m in messages).most_common(1)[0][0]
    kept = [(stamp, m) for stamp, m in messages if set(wanted) <= set(m.name)]
    if not kept:
        raise FileFormatError(
            f"{bag}: no message holds all of {list(wanted)}; joints in it are {say_names(every)}: "
            "name those"
        )
    remarks = []
    if len(kept) < len(messages):
        remarks.append(f"{len(messages) - len(kept)} messages without all joints skipped")
    # Other channels of these messages, such as fingers, stay available by name.
    names = tuple(n for n in kept[0][1].name if all(n in m.name for _, m in kept))
    with named_damage(bag, "a ROS bag"):
        rows = [[dict(zip(m.name, m.position, strict=True))[n] for n in names] for _, m in kept]
        positions = np.array(rows, dtype=np.float64)
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for _, m in kept]
    if stamps[0] > 0 and stamps[-1] > stamps[0] and sorted(stamps) == stamps:
        times, source = _since_first(stamps), "header stamps"
    else:
        times, source = _since_first([stamp for stamp, _ in kept]), "the recorder's stamps"
        remarks.append("header stamps unusable, times are those of the recorder")
    clock = options.clock(name, len(kept), stamps=times, name=source, unit="ns")
    return recorded(name, clock, positions, names, remarks=tuple(remarks))


def _since_first(stamps: list[int]) -> Times:
    """Nanoseconds since the first stamp; since 1970 they would be 256 ns coarse as floats."""
    return np.array([stamp - stamps[0] for stamp in stamps], dtype=np.float64)


def _trajectory(bag: Path, episode: str, message: Any, options: ReadOptions) -> Recording:
    with named_damage(bag, "a ROS bag"):
        times = [p.time_from_start.sec + p.time_from_start.nanosec * 1e-9 for p in message.points]
        positions = np.array([p.positions for p in message.points], dtype=np.float64)
        positions = positions.reshape(len(times), -1)
        stamps, name = np.array(times), "time_from_start"
        clock = options.clock(episode, len(times), stamps=stamps, name=name, unit="s")
        return recorded(episode, clock, positions, tuple(message.joint_names))

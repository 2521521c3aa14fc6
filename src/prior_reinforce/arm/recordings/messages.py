"""One episode from the messages of a bag: their publisher, their clock, and their joints.

Joints may come in several messages or topics, in any order, so each is a series of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.bounds import check_names
from prior_reinforce.arm.recordings.clock import clock_of
from prior_reinforce.arm.recordings.naming import find_channels, missing_channels
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import Beside, Positions, Recording, recorded
from prior_reinforce.arm.recordings.time_finder import SHIFT, Times, is_set_back, is_set_on
from prior_reinforce.arm.recordings.units import say_names
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.units import NS_PER_S

_CLOCKS = {"header": "header stamps", "recorder": "the recorder's stamps"}
_HEADER, _RECORDER = _CLOCKS
_DRIFT = 0.05
"""Share by which the two clocks of a bag may drift apart. Ours."""
_LATE = 2e8
"""By how much longer a joint's messages may be on their way than others, in [ns]. Ours: more than
queues hold them, less than clocks nobody synchronised mostly differ by."""
_MOVES, _LEAP, _OFTEN = 0.02, 0.5, 0.05
"""Range in [rad] or [m] of a motion; part of it that is a leap; share of frames with leaps beyond
which two publishers are mixed. Ours."""
_ONCE = 2
"""Leaps there and back that a gripper told seldom may make, as it closes and opens. Ours."""
_HELD = 1e-3
"""Range in [rad] or [m] of a joint that is held, so that no rate tells more of it. Ours."""
_ON_ITS_WAY, _SELDOM, _LOST = 0.05, 0.25, 2.5
"""Part of its greatest speed above which a motion is under way; part of its range that it may go
between two messages of another joint, where a straight line errs by 1 %; frames that may always lie
between these. Ours."""


class Message(NamedTuple):
    """A message of a topic."""

    came: int
    """When the recorder got it, in [ns]."""
    publisher: int
    """Number of its connection."""
    content: Any
    """Its `name`, `position` and `header`, as in a sensor_msgs/JointState; the header may be
    None."""

    @property
    def positions(self) -> dict[str, float]:
        """Position by joint."""
        return dict(zip(self.content.name, self.content.position, strict=True))

    @property
    def sent(self) -> int:
        """When its sender stamped it, in [ns]; 0 if it did not."""
        stamp = getattr(self.content.header, "stamp", None)
        return 0 if stamp is None else stamp.sec * NS_PER_S + stamp.nanosec

    def at(self, clock: str) -> int:
        """Time by one of the two clocks, in [ns]."""
        return self.sent if clock == _HEADER else self.came


def read_messages(
    path: Path,
    name: str,
    topics: Sequence[list[Message]],
    options: ReadOptions,
    notes: Sequence[str],
    elsewhere: Mapping[str, Beside],
) -> Recording:
    """Return one episode, whose frames are the messages that hold most of the wanted joints.

    Other joints are interpolated at their times, each from the first topic that names it; frames
    before the first or after the last message of such a joint are left out. A joint that keeps one
    value is taken to keep it in every frame; FileFormatError if one that moves comes too seldom.
    """
    bag = _Bag(path, topics, options, notes)
    most, messages = bag.frames()
    kept, remarks = _of_one_publisher(path, messages, most)
    kept, clock, of_clock = _by_clock(path, kept, most, options.time_column)
    # Other channels of these messages, such as fingers, stay available by name.
    names = tuple(n for n in kept[0].content.name if all(n in m.content.name for m in kept))
    beside, of_others = bag.others(names)
    joined, inside, of_joints = bag.joined(kept, most, clock, beside)
    remarks += [*of_others, *of_joints]
    skipped = len(topics[bag.topic_of[most[0]]]) - len(kept)
    if skipped and {*joined}.isdisjoint(bag.wanted):
        remarks.append(f"{skipped} messages without all joints skipped")
    # Since the first stamp; since 1970, nanoseconds would be 256 ns coarse as floats.
    stamps = np.array([m.at(clock) - kept[0].at(clock) for m in kept], dtype=np.float64)[inside]
    times = clock_of(name, len(stamps), options, stamps=stamps, name=_CLOCKS[clock], unit="ns")
    positions = np.column_stack([_positions(kept, names), *joined.values()])[inside]
    remarks += [*notes, *of_clock]
    names += tuple(joined)
    return recorded(name, times, positions, names, remarks=tuple(remarks), beside=elsewhere)


@dataclass(frozen=True, eq=False)
class _Bag:
    """Messages of joints, topic by topic; each joint counts in the first topic that names it."""

    path: Path
    topics: Sequence[list[Message]]
    options: ReadOptions
    notes: Sequence[str]
    """What is said of the bag's other topics."""

    @cached_property
    def topic_of(self) -> dict[str, int]:
        """Index of the topic that tells each joint."""
        found: dict[str, int] = {}
        for topic, messages in enumerate(self.topics):
            for joint in (joint for m in messages for joint in m.content.name):
                found.setdefault(joint, topic)
        return found

    @cached_property
    def wanted(self) -> tuple[str, ...]:
        """Recorded names of the joints to read.

        If the user names none: those that most messages of the first topic hold, and all of others.
        """
        every, joints = list(self.topic_of), self.options.joints
        check_names(self.path, every)
        if not any(every):
            raise FileFormatError(
                f"{self.path}: its messages name no joint, so nothing says which number is which; "
                "record again with names (the driver's or the bridge's setting), or write the "
                "positions as CSV"
            )
        if joints is None:
            held = Counter(tuple(sorted(m.content.name)) for m in self.topics[0])
            return (*held.most_common(1)[0][0], *(j for j in every if self.topic_of[j] > 0))
        found = find_channels(joints, every)
        if found is None:
            missing = say_names(missing_channels(joints, every))
            raise FileFormatError(
                f"{self.path}: no message holds {missing}; joints in it are {say_names(every)}: "
                f"name those with --joints{''.join(f'; {note}' for note in self.notes)}"
            )
        return tuple(every[i] for i in found)

    def frames(self) -> tuple[tuple[str, ...], list[Message]]:
        """Return the wanted joints that messages hold together most often, and these messages."""
        holding: dict[tuple[str, ...], list[Message]] = {(): []}
        for topic, messages in enumerate(self.topics):
            for m in messages:
                own = (j for j in self.wanted if self.topic_of[j] == topic and j in m.content.name)
                if (joints := tuple(own)) and len(m.content.position):
                    holding.setdefault(joints, []).append(m)
        return max(holding.items(), key=lambda item: len(item[0]) * len(item[1]))

    def others(self, names: Sequence[str]) -> tuple[list[tuple[str, list[Message]]], list[str]]:
        """Return each joint beside `names` with its only publisher's messages, and remarks.

        FileFormatError if publishers of a wanted joint disagree; other joints are left out then.
        """
        together: dict[tuple[int, ...], list[str]] = {}  # joints by topic and index of its messages
        for joint in (joint for joint in self.topic_of if joint not in names):
            messages = enumerate(self.topics[self.topic_of[joint]])
            held_by = (
                i for i, m in messages if joint in m.content.name and len(m.content.position)
            )
            together.setdefault((self.topic_of[joint], *held_by), []).append(joint)
        each, remarks = list[tuple[str, list[Message]]](), list[str]()
        for (topic, *indices), joints in together.items():
            series = [self.topics[topic][i] for i in indices]
            asked = [joint for joint in joints if joint in self.wanted]
            if series:
                try:
                    series, said = _of_one_publisher(self.path, series, asked or joints)
                except FileFormatError:
                    if asked:
                        raise
                    remarks.append(f"not read: {say_names(joints)}, of publishers that disagree")
                    continue
                remarks += said
            each += [(joint, series) for joint in joints]
        return each, remarks

    def joined(
        self,
        kept: list[Message],
        most: Sequence[str],
        clock: str,
        beside: Sequence[tuple[str, list[Message]]],
    ) -> tuple[dict[str, Times], np.ndarray, list[str]]:
        """Return joints of other messages at the times of those that are kept, and remarks.

        Also which of these times lie within all wanted joints' messages. FileFormatError if a
        wanted joint comes too seldom for the motion; others are left out then.
        """
        found: dict[str, Times] = {}
        by_clock: dict[str, list[str]] = {}
        held: list[str] = []
        seldom: list[str] = []
        inside, motion = np.ones(len(kept), dtype=bool), _positions(kept, most)
        for joint, series in beside:
            is_wanted = joint in self.wanted
            by = clock if all(m.sent > 0 for m in series) else _RECORDER
            times, at, values = _series(kept, series, joint, by)
            if len(values) and np.ptp(values) <= _HELD:  # no rate tells more of it
                often = "once" if len(values) == 1 else f"{len(values)} times"
                last = f"last at {at[-1]:.3g} s"
                held += [f"{joint} told {often}, {last}, held at {values[0]:.3g}"] * is_wanted
                found[joint] = np.interp(times, at, values)
                continue
            if is_wanted and series and by == _HEADER != self.options.time_column:
                _refuse_late(self.path, joint, series, kept)
            gap, longest = _gap(at, times, motion)
            if gap > longest and not is_wanted:
                seldom.append(joint)
                continue
            if gap > longest:
                raise FileFormatError(
                    f"{self.path}: nothing tells {joint} for {gap:.3g} s of a motion that is too "
                    f"fast for more than {longest:.3g} s of it; record {joint} more often, or "
                    "leave it out of --joints"
                )
            if is_wanted:
                inside &= (times >= at[0]) & (times <= at[-1])
                by_clock.setdefault(by, []).append(joint)
            found[joint] = np.interp(times, at, values)
        outside = f"; {np.sum(~inside)} frames that not all span left out" * (not all(inside))
        at_times = f"at the times of {say_names(most)}{outside}"
        remarks = [
            f"{say_names(joints)} interpolated by {_CLOCKS[by]} {at_times}"
            for by, joints in by_clock.items()
        ]
        if seldom and self.options.key:
            held.append(f"not read: {say_names(seldom)}, told too seldom for the motion")
        return found, inside, remarks + held


def _series(
    frames: list[Message], messages: list[Message], joint: str, clock: str
) -> tuple[Times, np.ndarray, np.ndarray]:
    """Times of the frames, times at which a joint is told, and its values then."""
    start = frames[0].at(clock)
    times = np.array([m.at(clock) - start for m in frames]) * 1e-9
    told = sorted((m.at(clock) - start, m.positions[joint]) for m in messages)
    at, values = np.array([own for own in told if np.isfinite(own[1])]).reshape(-1, 2).T
    return times, at * 1e-9, values


def _gap(at: np.ndarray, times: Times, motion: Positions) -> tuple[float, float]:
    """For how long of a motion a joint is not told, and for how long it may be, in [s]."""
    if len(at) < 2 or len(times) < 2:
        return np.inf, 0.0
    period = float(np.median(np.diff(times)))
    steps = np.nanmax(np.abs(_steps(motion)), axis=1, initial=0)
    speeds = steps / np.maximum(np.diff(times), period)
    way = np.flatnonzero(speeds > _ON_ITS_WAY * speeds.max())
    if not len(way):
        return 0.0, np.inf
    start, end = times[way[0]], times[way[-1] + 1]
    gap = np.diff([start, *at[(start < at) & (at < end)], end]).max()
    return float(gap), max(_SELDOM / float(speeds.max()), _LOST * period)


def _refuse_late(bag: Path, joint: str, messages: list[Message], frames: list[Message]) -> None:
    """Refuse to join by header stamps of clocks that differ."""
    own, other = (np.median([m.came - m.sent for m in each]) for each in (messages, frames))
    if abs(own - other) > _LATE:
        raise FileFormatError(
            f"{bag}: by header stamps {joint} is on its way {abs(own - other) * 1e-9:.3g} s "
            f"{'longer' if own > other else 'less'} than other joints, as where clocks differ; "
            f"say which stamps are right: --time-column {_HEADER}, or {_RECORDER}"
        )


def _of_one_publisher(
    bag: Path, messages: list[Message], wanted: Sequence[str]
) -> tuple[list[Message], list[str]]:
    """Return the messages of the only publisher whose joints move, and a remark on others.

    Publishers differ in connection (ROS 1), frame, or the joints they name. FileFormatError if none
    has positions, or several move.
    """
    if not messages:
        raise FileFormatError(
            f"{bag}: its messages hold no positions (velocities or efforts alone); record the "
            "topic that has positions, or say it with --key"
        )
    groups: dict[Hashable, list[Message]] = {}
    for m in messages:
        frame = getattr(m.content.header, "frame_id", "")
        key = m.publisher, frame, frozenset(m.content.name)
        groups.setdefault(key, []).append(m)
    spans = [(own[0].came, own[-1].came) for own in groups.values()]
    each = [messages]  # of one that came again, one after the other
    if any(start <= end for (_, end), (start, _) in pairwise(sorted(spans))):
        each = [
            own for own in groups.values() if np.ptp(_positions(own, wanted), axis=0).max() > _MOVES
        ]
        if not each and np.ptp(_positions(messages, wanted), axis=0).max() <= _HELD:
            each = [messages]
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


def _steps(positions: Positions) -> np.ndarray:
    """How far each joint goes from frame to frame, as a part of its range."""
    return np.diff(positions, axis=0) / np.maximum(np.ptp(positions, axis=0), _MOVES)


def _leaps(messages: list[Message], joints: Sequence[str]) -> bool:
    """Whether a joint leaps time and again, as two publishers in turn make it do."""
    steps = _steps(_positions(messages, joints))
    there, back = (np.sum(sign * steps > _LEAP, axis=0) for sign in (1, -1))
    return bool(np.any(np.minimum(there, back) > max(_ONCE, _OFTEN * len(steps))))


def _by_clock(
    bag: Path, messages: list[Message], joints: Sequence[str], asked: str | None
) -> tuple[list[Message], str, list[str]]:
    """Return the messages in the order of a clock, that clock, and remarks.

    It is the header's, unless that is unusable, or jumps where the recorder's does not. The
    recorder's is uneven, since messages wait in a queue.
    """
    if asked not in (None, *_CLOCKS):
        raise ConfigurationError(
            f"--time-column {asked} is no clock of a bag; give {_HEADER} or {_RECORDER}"
        )
    unstamped = sum(m.sent <= 0 for m in messages)
    if asked == _HEADER and unstamped:
        raise FileFormatError(
            f"{bag}: header stamps are 0, or missing, in {unstamped} of {len(messages)} messages "
            f"of {say_names(joints)}; give --time-column {_RECORDER}"
        )
    sent, came = (
        np.array([m.at(clock) - messages[0].at(clock) for m in messages]) * 1e-9
        for clock in _CLOCKS
    )
    in_order = [messages[i] for i in np.argsort(sent, kind="stable")]
    late = int(np.sum(sent < np.maximum.accumulate(sent)))
    went_back = late > 0 and np.diff(sent).min() < -SHIFT
    went_back = went_back or is_set_back(sent, _positions(messages, joints), _MOVES)
    if asked == _RECORDER or (asked == _HEADER and went_back):
        return messages, asked, []
    if asked is None and (unstamped or went_back or np.ptp(sent) == 0):
        return messages, _RECORDER, ["header stamps unusable, times are those of the recorder"]
    said = [f"{late} messages came late, and are put in order by their header stamps"] * (late > 0)
    if asked == _HEADER:
        return in_order, _HEADER, said
    period = float(np.median(np.diff(sent)))
    apart = np.diff(sent - came)
    frame = int(np.argmax(np.abs(apart)))
    jump, rest = apart[frame], float(np.sum(apart) - apart[frame])
    if is_set_on(np.abs(apart), period)[frame] and abs(rest) < abs(jump) / 2:
        if np.diff(came)[frame] <= 3 * max(period, float(np.median(np.diff(came)))):
            why = (
                f"header stamps jump by {jump:+.3f} s at {came[frame]:.2f} s, the recorder's do "
                "not: times are those of the recorder"
            )
            return messages, _RECORDER, [why]
    elif abs(sent[-1] - came[-1]) > max(SHIFT, _DRIFT * came[-1]) and came[-1] > 0:
        raise FileFormatError(
            f"{bag}: header stamps last {sent[-1]:.3g} s, the recorder's {came[-1]:.3g} s; say "
            f"which are right: --time-column {_HEADER}, or {_RECORDER}"
        )
    return in_order, _HEADER, said

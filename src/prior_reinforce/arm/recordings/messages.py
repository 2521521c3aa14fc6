"""One episode from the messages of a bag: whose they are, when they were sent, and which joints.

Each joint is a series of its own, because joints may come in several messages or topics, in any
order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
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
"""Range in [rad] or [m] that is a motion; part of it that is a leap; share of frames in which no
joint leaps, but two publishers do in turn. Ours."""
_ONCE = 2
"""Leaps there and back that a gripper told seldom may make, as it closes and opens. Ours."""
_HELD = 1e-3
"""Range in [rad] or [m] of a joint that is held, so that no rate tells more of it. Ours."""
_ON_ITS_WAY, _SELDOM, _LOST = 0.05, 0.25, 2.5
"""Part of its greatest speed at which a motion is on its way; part of its range that its fastest
joint may go between two messages of another joint, an eighth of a smooth motion, where a straight
line errs by 1 %; frames that may always lie between them. Ours."""


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
    bag: Path,
    name: str,
    topics: Sequence[list[Message]],
    options: ReadOptions,
    notes: Sequence[str],
    elsewhere: Mapping[str, Beside],
) -> Recording:
    """Return one episode, whose frames are the messages that tell the most of the wanted joints.

    Other joints are interpolated at their times, each from the first topic that names it; frames
    before or after such a joint is told are left out. One that holds a value all along is taken to
    hold it in every frame; FileFormatError if one that moves is told too seldom.
    """
    owner: dict[str, int] = {}
    for topic, of_topic in enumerate(topics):
        for joint in (joint for m in of_topic for joint in m.content.name):
            owner.setdefault(joint, topic)
    wanted = _wanted(bag, topics, owner, options.joints, notes)
    most, messages = _most_telling(topics, owner, wanted)
    kept, remarks = _of_one_publisher(bag, messages, most)
    kept, clock, said = _by_clock(bag, kept, most, options.time_column)
    # Other channels of these messages, such as fingers, stay available by name.
    names = tuple(n for n in kept[0].content.name if all(n in m.content.name for m in kept))
    beside = _series_beside(bag, topics, owner, names, wanted, remarks)
    joined, inside, of_joints = _joined(bag, kept, most, clock, beside, wanted, options)
    remarks += of_joints
    if (skipped := len(topics[owner[most[0]]]) - len(kept)) and {*joined}.isdisjoint(wanted):
        remarks.append(f"{skipped} messages without all joints skipped")
    # Since the first stamp; since 1970, nanoseconds would be 256 ns coarse as floats.
    stamps = np.array([m.at(clock) - kept[0].at(clock) for m in kept], dtype=np.float64)[inside]
    frames = clock_of(name, len(stamps), options, stamps=stamps, name=_CLOCKS[clock], unit="ns")
    positions = np.column_stack([_positions(kept, names), *joined.values()])[inside]
    remarks += [*notes, *said]
    names += tuple(joined)
    return recorded(name, frames, positions, names, remarks=tuple(remarks), beside=elsewhere)


def _most_telling(
    topics: Sequence[list[Message]], owner: Mapping[str, int], wanted: Sequence[str]
) -> tuple[tuple[str, ...], list[Message]]:
    """The wanted joints of which messages tell most, and these messages; none where none do."""
    told: dict[tuple[str, ...], list[Message]] = {(): []}
    for topic, messages in enumerate(topics):
        for m in messages:
            own = tuple(j for j in wanted if owner[j] == topic and j in m.content.name)
            if own and len(m.content.position):
                told.setdefault(own, []).append(m)
    return max(told.items(), key=lambda item: len(item[0]) * len(item[1]))


def _joined(
    bag: Path,
    kept: list[Message],
    most: Sequence[str],
    clock: str,
    beside: Sequence[tuple[str, list[Message]]],
    wanted: Sequence[str],
    options: ReadOptions,
) -> tuple[dict[str, Times], np.ndarray, list[str]]:
    """Joints that other messages tell, at the times of those that are kept.

    Returns which of these all wanted ones span, and remarks. FileFormatError if a wanted one is
    told too seldom for the motion; others are left out then.
    """
    found: dict[str, Times] = {}
    by_clock: dict[str, list[str]] = {}
    held: list[str] = []
    seldom: list[str] = []
    inside, motion = np.ones(len(kept), dtype=bool), _positions(kept, most)
    for joint, series in beside:
        by = clock if all(m.sent > 0 for m in series) else _RECORDER
        times, at, values = _series(kept, series, joint, by)
        if len(values) and np.ptp(values) <= _HELD:  # no rate tells more of it
            often = "once" if len(values) == 1 else f"{len(values)} times"
            last = f"last at {at[-1]:.3g} s"
            held += [f"{joint} told {often}, {last}, held at {values[0]:.3g}"] * (joint in wanted)
        else:
            if joint in wanted and series and by == _HEADER != options.time_column:
                _refuse_late(bag, joint, series, kept)
            gap, longest = _gap(at, times, motion)
            if gap > longest and joint not in wanted:
                seldom.append(joint)
                continue
            if gap > longest:
                raise FileFormatError(
                    f"{bag}: nothing tells {joint} for {gap:.3g} s of a motion that is too fast "
                    f"for more than {longest:.3g} s of it; record {joint} more often, or leave it "
                    "out of --joints"
                )
            if joint in wanted:
                inside &= (times >= at[0]) & (times <= at[-1])
                by_clock.setdefault(by, []).append(joint)
        found[joint] = np.interp(times, at, values)
    outside = f"; {np.sum(~inside)} frames that not all span left out" * (not all(inside))
    at_times = f"at the times of {say_names(most)}{outside}"
    remarks = [
        f"{say_names(those)} interpolated by {_CLOCKS[by]} {at_times}"
        for by, those in by_clock.items()
    ]
    if seldom and options.key:
        held.append(f"not read: {say_names(seldom)}, told too seldom for the motion")
    return found, inside, remarks + held


def _wanted(
    bag: Path,
    topics: Sequence[list[Message]],
    owner: Mapping[str, int],
    joints: Sequence[str] | None,
    notes: Sequence[str],
) -> tuple[str, ...]:
    """Recorded names of the joints to read.

    Without `joints` they are those that most messages of the first topic hold, and all of others.
    """
    every = list(owner)
    check_names(bag, every)
    if not any(every):
        raise FileFormatError(
            f"{bag}: its messages name no joint, so nothing says which number is which; record "
            "again with names (the driver's or the bridge's setting), or write the positions as CSV"
        )
    if joints is None:
        common = Counter(tuple(sorted(m.content.name)) for m in topics[0]).most_common(1)[0][0]
        return (*common, *(joint for joint in every if owner[joint] > 0))
    found = find_channels(joints, every)
    if found is None:
        missing = say_names(missing_channels(joints, every))
        raise FileFormatError(
            f"{bag}: no message holds {missing}; joints in it are {say_names(every)}: name those "
            f"with --joints{''.join(f'; {note}' for note in notes)}"
        )
    return tuple(every[i] for i in found)


def _series_beside(
    bag: Path,
    topics: Sequence[list[Message]],
    owner: Mapping[str, int],
    names: Sequence[str],
    wanted: Sequence[str],
    remarks: list[str],
) -> list[tuple[str, list[Message]]]:
    """Every joint beside `names` with the messages of its only publisher that tell it.

    What is said of other publishers is added to the remarks. FileFormatError if those of a wanted
    joint disagree; others are left out then.
    """
    together: dict[tuple[int, ...], list[str]] = {}  # joints by topic and index of its messages
    for joint in (joint for joint in owner if joint not in names):
        messages = enumerate(topics[owner[joint]])
        told_by = (i for i, m in messages if joint in m.content.name and len(m.content.position))
        together.setdefault((owner[joint], *told_by), []).append(joint)
    each = []
    for (topic, *which), joints in together.items():
        series = [topics[topic][i] for i in which]
        asked = [joint for joint in joints if joint in wanted]
        if series:
            try:
                series, said = _of_one_publisher(bag, series, asked or joints)
            except FileFormatError:
                if asked:
                    raise
                remarks.append(f"not read: {say_names(joints)}, of publishers that disagree")
                continue
            remarks += said
        each += [(joint, series) for joint in joints]
    return each


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
    """The messages in order of a clock, which clock, and what is said of it.

    It is the header's, unless that is unusable or jumps. The recorder's clock holds messages in a
    queue, and so is late and uneven; but where the header's jumps and the recorder's does not, the
    header's was set meanwhile.
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

"""Messages of joint positions: joined across topics and rates, in order of their stamps."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from prior_reinforce.arm.recordings.messages import Message, read_messages
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError

ARM, GRIPPER = ("shoulder", "elbow"), ("gripper",)
START = 1_700_000_000 * 10**9


def motion(t):
    """Of two joints and a gripper, in [rad] and [m]."""
    s = np.clip((np.asarray(t) - 0.4) / 1.2, 0, 1)
    s = 10 * s**3 - 15 * s**4 + 6 * s**5
    return {"shoulder": 0.8 * s, "elbow": 1 - 0.5 * s, "gripper": 0.04 * np.sin(3 * t) ** 2}


def told(joints, times, *, late=0.0, stamped=True, clock=0.0):
    """A message at each time, received `late` and stamped by a clock that is `clock` ahead."""
    q = motion(times)
    messages = []
    for i, t in enumerate(times):
        stamp = START + round((t + np.broadcast_to(clock, len(times))[i]) * 1e9)
        stamp = SimpleNamespace(sec=stamp // 10**9, nanosec=stamp % 10**9)
        content = SimpleNamespace(
            name=list(joints),
            position=np.array([q[joint][i] for joint in joints]),
            header=SimpleNamespace(stamp=stamp, frame_id="") if stamped else None,
        )
        came = START + round((t + np.broadcast_to(late, len(times))[i]) * 1e9)
        messages.append(Message(came, 0, content))
    return sorted(messages, key=lambda m: m.came)


def at(rate, start=0.0, end=2.0):
    return np.arange(start, end, 1 / rate)


def read(*topics, joints=(*ARM, *GRIPPER), **options):
    asked = ReadOptions(joints=joints, **options)
    return read_messages(Path("bag"), "throw", topics, asked, [], {})


def check(recording, tolerance=1e-3):
    for joint, expected in motion(recording.times).items():
        column = recording.positions[:, recording.names.index(joint)]
        np.testing.assert_allclose(column, expected, atol=tolerance)


@pytest.mark.parametrize("late", [0.0, 0.15])
@pytest.mark.parametrize("same_topic", [True, False])
@pytest.mark.parametrize("first", [0, 1])
def test_a_gripper_at_a_rate_of_its_own_is_read_by_header_stamps(late, same_topic, first):
    topics = [told(ARM, at(100)), told(GRIPPER, at(30), late=late)]
    if same_topic:
        topics = [sorted((m for topic in topics for m in topic), key=lambda m: m.came)]
    elif first:
        topics = topics[::-1]
    recording = read(*topics)
    check(recording)
    assert recording.period == pytest.approx(0.01)
    assert recording.times[-1] == pytest.approx(at(30)[-1], abs=0.011)  # their common span
    (remark,) = recording.remarks
    assert "gripper" in remark
    assert "header stamps" in remark


def test_halves_of_an_arm_at_two_rates_are_put_together():
    halves = [*told(ARM[:1], at(100)), *told((*ARM[1:], *GRIPPER), at(60))]
    check(read(sorted(halves, key=lambda m: m.came)))


def test_without_joints_every_joint_of_a_topic_beside_is_taken():
    assert set(read(told(ARM, at(100)), told(GRIPPER, at(50)), joints=None).names) == {
        *ARM,
        *GRIPPER,
    }


@pytest.mark.parametrize("stamped", [0, 150])
def test_header_stamps_that_are_missing_are_named_where_they_are_asked_for(stamped):
    arm = [*told(ARM, at(100))[:stamped], *told(ARM, at(100), stamped=False)[stamped:]]
    topics = arm, told(GRIPPER, at(50))
    missing = rf"{200 - stamped} of 200 .*shoulder, elbow.*--time-column recorder"
    with pytest.raises(FileFormatError, match=missing):
        read(*topics, time_column="header")
    check(read(*topics, time_column="recorder"))


def test_messages_without_stamps_are_joined_by_the_recorders_and_it_is_said():
    recording = read(told(ARM, at(100)), told(GRIPPER, at(50), stamped=False))
    check(recording)
    assert "recorder's stamps" in recording.remarks[0]
    assert recording.clock == "header stamps in ns"


@pytest.mark.parametrize(
    "times", [at(4), at(100, end=0.8), at(100, start=1.2), [*at(50, end=0.8), *at(50, 1.2)]]
)
def test_a_joint_that_is_told_too_seldom_is_refused_by_name(times):
    gripper = told(GRIPPER, np.array(times))
    with pytest.raises(FileFormatError, match=r"gripper .*record .* more often, .*--joints"):
        read(told(ARM, at(100)), gripper)
    assert read(told(ARM, at(100)), gripper, joints=ARM).names == ARM


@pytest.mark.parametrize(
    ("times", "often"), [(at(5), "10 times"), (at(50, end=0.8), "40 times"), ([0.5], "once")]
)
@pytest.mark.parametrize("clock", [0.0, -600.0])  # a latched message is as old as its publisher
def test_a_gripper_that_holds_its_value_needs_no_rate(times, often, clock):
    gripper = told(GRIPPER, np.array(times), clock=clock)
    for m in gripper:
        m.content.position = np.array([0.04])
    recording = read(told(ARM, at(100)), gripper)
    np.testing.assert_allclose(recording.times, at(100))
    np.testing.assert_allclose(recording.positions[:, 2], 0.04)
    (remark,) = recording.remarks
    assert f"gripper told {often}, last at {times[-1] + clock:.3g} s, held at 0.04" in remark


@pytest.mark.parametrize("key", [("/arm", "/gripper"), None])
def test_a_joint_told_too_seldom_whose_topic_was_asked_for_is_named(key):
    recording = read(told(ARM, at(100)), told(GRIPPER, at(4)), joints=ARM, key=key)
    assert recording.names == ARM
    assert ["gripper" in remark for remark in recording.remarks] == [True] * (key is not None)


def test_a_joint_without_positions_is_refused_by_name():
    empty = told(GRIPPER, at(50))
    for m in empty:
        m.content.position = np.zeros(0)
    with pytest.raises(FileFormatError, match="record gripper more often"):
        read(told(ARM, at(100)), empty)


@pytest.mark.parametrize("clock", [30.0, 0.6, 0.3, -0.3])
def test_header_stamps_of_clocks_that_differ_are_asked_about(clock):
    topics = told(ARM, at(100)), told(GRIPPER, at(50), clock=clock)
    with pytest.raises(FileFormatError, match=r"gripper .*--time-column header, or recorder"):
        read(*topics)
    check(read(*topics, time_column="recorder"))


def of_another(messages, value):
    """The same messages of another publisher, who says one value."""
    for m in messages:
        m.content.position = np.full(len(m.content.name), value)
    return [m._replace(publisher=7) for m in messages]


@pytest.mark.parametrize("same_topic", [True, False])
@pytest.mark.parametrize("moves", [True, False])
def test_two_publishers_of_a_gripper_are_told_apart(same_topic, moves):
    arm, gripper = told(ARM, at(100)), told(GRIPPER, at(50))
    other = of_another(told(GRIPPER, at(50) + 0.005), 0.0)
    if moves:
        for i, m in enumerate(other):
            m.content.position = m.content.position + 0.001 * i
    both = sorted(gripper + other, key=lambda m: m.came)
    topics = [sorted(arm + both, key=lambda m: m.came)] if same_topic else [arm, both]
    if moves:
        with pytest.raises(FileFormatError, match=r"several publishers .*; record one of them al"):
            read(*topics)
        recording = read(*topics, joints=ARM)
        assert recording.names == ARM
        assert "not read: gripper, of publishers that disagree" in recording.remarks
        return
    recording = read(*topics)
    check(recording)
    assert any(f"{len(other)} messages of another" in remark for remark in recording.remarks)


def test_two_publishers_of_a_gripper_in_one_connection_are_asked_about():
    other = [m._replace(publisher=0) for m in of_another(told(GRIPPER, at(50) + 0.005), 0.0)]
    both = sorted(told(GRIPPER, at(50)) + other, key=lambda m: m.came)
    with pytest.raises(FileFormatError, match=r"several publishers .*; record one of them al"):
        read(told(ARM, at(100)), both)


def test_two_publishers_that_agree_on_a_held_gripper_are_joined():
    held = of_another(told(GRIPPER, at(50)), 0.04)
    both = [*held, *(m._replace(publisher=8, came=m.came + 1000) for m in held)]
    recording = read(told(ARM, at(100)), sorted(both, key=lambda m: m.came))
    np.testing.assert_allclose(recording.positions[:, 2], 0.04)


def test_a_gripper_told_seldom_that_closes_and_opens_is_of_one_publisher():
    gripper = told(GRIPPER, at(10))
    for m, value in zip(gripper, np.repeat([0.0, 1.0, 0.0], [4, 12, 4]), strict=True):
        m.content.position = np.array([value])
    assert np.ptp(read(told(ARM, at(100)), gripper).positions[:, 2]) == 1.0


def test_a_joint_that_no_topic_holds_is_named_beside_those_there():
    with pytest.raises(FileFormatError, match=r"holds gripper; .* shoulder, elbow: name those"):
        read(told(ARM, at(100)))


@pytest.mark.parametrize("swapped", [[0], [90], [198], [*range(3, 198, 2)]])
def test_messages_that_came_out_of_order_are_sorted_by_their_stamps(swapped):
    t = at(100)
    late = np.zeros(len(t))
    late[swapped] = 0.0109
    recording = read(told((*ARM, *GRIPPER), t, late=late))
    np.testing.assert_allclose(recording.times, t, atol=1e-9)
    check(recording, 1e-9)
    assert f"{len(swapped)} messages came late" in recording.remarks[0]


@pytest.mark.parametrize("back", [0.035, 0.5])
def test_a_clock_that_was_set_back_is_no_message_out_of_order(back):
    t = at(100)
    messages = told((*ARM, *GRIPPER), t, clock=np.where(t < 1.0, 0.0, -back))
    recording = read(messages)
    np.testing.assert_allclose(recording.times, t, atol=1e-9)
    assert "those of the recorder" in recording.remarks[0]
    with pytest.raises(InvalidDemonstrationsError, match="time does not increase"):
        read(messages, time_column="header")

"""Attitudes and turns in the forms in which makers' controllers write them."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import select
from prior_reinforce.arm.recordings.turns import aligned
from prior_reinforce.arm.robots.limits import RobotLimits
from prior_reinforce.errors import InvalidDemonstrationsError

T = np.arange(100) / 100
S = 10 * T**3 - 15 * T**4 + 6 * T**5
N = 4


def brought_together(names, unit, motions):
    """Positions once aligned, in the recorded unit, and the remarks."""
    recordings = [
        Recording(str(i), T, np.asarray(m), tuple(names), units=(unit,) * len(names))
        for i, m in enumerate(motions)
    ]
    selection, _ = aligned(select(recordings), None)
    scale = 1.0 if unit is None else np.rad2deg(1.0)
    return [scale * r.positions for r in selection.recordings], " / ".join(selection.remarks)


def test_joints_of_the_robot_are_no_attitude_whatever_they_are_called():
    """A wrist's roll, pitch and yaw that start in the other angles of one attitude stay there."""
    names, ones = ("roll", "pitch", "yaw"), np.ones(3)
    limits = RobotLimits("wrist", "any", "made up", names, -3.5 * ones, 3.5 * ones, 9 * ones)
    own = [np.deg2rad(attitude(i)) for i in range(N)]
    own[1] = np.array([-np.pi, np.pi, -np.pi]) + own[1] * [1, -1, 1]
    recordings = [Recording(str(i), T, m, names, units=("rad",) * 3) for i, m in enumerate(own)]
    selection, _ = aligned(select(recordings), limits)
    for recording, motion in zip(selection.recordings, own, strict=True):
        np.testing.assert_allclose(recording.positions, motion)


def wrapped(angle):
    return np.mod(angle + 180, 360) - 180


def attitude(i, first=10.0, middle=5.0, last=20.0, way=(3.0, 30.0, 4.0)):
    """Three angles in degrees that move a little further in each throw."""
    return np.array([first, middle, last]) + S[:, None] * np.array(way) * (1 + 0.05 * i)


def other(angles, *, proper):
    half = np.array([180.0, 0.0 if proper else 180.0, 180.0])
    return wrapped(half + angles * [1, -1, 1])


@pytest.mark.parametrize("names", [("rx", "ry", "rz"), ("tool_rx", "tool_ry", "tool_rz")])
@pytest.mark.parametrize("within", [True, False])
def test_rx_ry_rz_in_degrees_are_angles_that_pass_half_a_turn_each(names, within):
    """A rotation vector that stands at half a turn has another form; of an angle none is made."""
    start = 178.0 if within else 182.0
    true = [
        attitude(i, start if i == 1 else 178.0, 5.0, 30.0, (5.0 * within, 0, 30)) for i in range(N)
    ]
    read, said = brought_together(names, "deg", map(wrapped, true))
    np.testing.assert_allclose(read, true, atol=1e-9)
    assert "rx passes the end" in said if within else "rx is taken 1 turn higher" in said


@pytest.mark.parametrize(
    ("names", "middle", "proper", "within"),
    [
        (("a", "b", "c"), 178.0, True, True),  # Doosan: ZYZ
        (("a", "b", "c"), 178.0, True, False),
        (("a", "b", "c"), 88.0, False, True),  # KUKA: ZYX
        (("a", "b", "c"), 88.0, False, False),
        (("O", "A", "T"), 178.0, True, True),
        (("w", "p", "r"), 88.0, False, False),
        (("alpha", "beta", "gamma"), 88.0, False, True),
        (("psi", "theta", "phi"), -2.0, True, False),
        (("e1", "e2", "e3"), 88.0, False, True),
    ],
)
def test_other_angles_of_the_same_attitude_are_continued(names, middle, proper, within):
    true = [attitude(i, middle=middle, way=(0, 30, 3)) for i in range(N)]
    read = []
    for i, each in enumerate(true):
        beyond = each[:, 1] > middle + 2 if within else np.full(len(S), i in (1, 3))
        read.append(np.where(beyond[:, None], other(each, proper=proper), each))
    read, said = brought_together(names, "deg", read)
    np.testing.assert_allclose(read, true, atol=1e-9)
    assert "the same attitude" in said


@pytest.mark.parametrize("names", [("a", "b", "c"), ("rx", "ry", "rz"), ("e1", "e2", "e3")])
def test_an_attitude_that_keeps_its_form_stays(names):
    true = [attitude(i, way=(40, 60, -30)) for i in range(N)]
    read, said = brought_together(names, "deg", true)
    np.testing.assert_allclose(read, true, atol=1e-9)
    assert said == ""


def radians(course):
    """Two joints of throws whose third channel is that course."""
    return [
        np.column_stack([0.1 + 0.5 * S * (1 + 0.1 * i), 0.2 - 0.8 * S, course(i)]) for i in range(N)
    ]


@pytest.mark.parametrize("names", [["ax", "ay", "az"], [f"p[{i}]" for i in range(2, 6)]])
def test_a_rotation_vector_whatever_its_name_changes_its_form_within(names):
    """Also behind a place whose last number is small, as if it were the vector's first."""
    true = [np.array([2.9, 0.4, 0.1]) + S[:, None] * [0.6, 0.2, 0.1] for _ in range(N)]
    angle = [np.linalg.norm(motion, axis=1, keepdims=True) for motion in true]
    own = [
        np.where(a > np.pi, v * (1 - 2 * np.pi / a), v) for v, a in zip(true, angle, strict=True)
    ]
    assert max(np.abs(np.diff(motion, axis=0)).max() for motion in own) > 2
    height = np.full((len(T), len(names) - 3), 0.02)
    found, said = brought_together(names, None, [np.hstack([height, motion]) for motion in own])
    assert "change their sign within the motion" in said
    for motion, each in zip(found, true, strict=True):
        np.testing.assert_allclose(motion, np.hstack([height, each]))


@pytest.mark.parametrize("name", ["gripper_yaw", "Gripper Roll", "hand/gripper_rotation"])
def test_how_a_gripper_is_turned_is_an_angle(name):
    true = radians(lambda i: 3.1 + 0.3 * S)
    read = [np.where([0, 0, 1], np.mod(q + np.pi, 2 * np.pi) - np.pi, q) for q in true]
    read[1][:, 2] = true[1][:, 2] - 2 * np.pi
    positions, said = brought_together(("j1", "j2", name), None, read)
    np.testing.assert_allclose(positions, true, atol=1e-9)
    assert f"{name} passes the end" in said


@pytest.mark.parametrize("name", ["magnet", "spring", "preload"])
@pytest.mark.parametrize(
    "course",
    [
        lambda i: np.where(T < 0.8, 6.2, 0.0),
        lambda i: np.where(T < 0.8, 6.2 * (i % 2), 6.2 * (1 - i % 2)),
        lambda i: np.full(len(T), (0.2, 2.6, 3.9, 6.3)[i]),
    ],
)
def test_a_number_without_unit_that_is_no_angle_stays(name, course):
    true = radians(course)
    positions, said = brought_together(("j1", "j2", name), None, true)
    np.testing.assert_array_equal(positions, true)
    assert said == ""


@pytest.mark.parametrize("name", ["j3", "wrist", "q[2]", "c2", "crank"])
def test_an_angle_without_unit_is_continued(name):
    true = radians(lambda i: 2.9 + 0.6 * S)
    read = [np.where([0, 0, 1], np.mod(q + np.pi, 2 * np.pi) - np.pi, q) for q in true]
    positions, _ = brought_together(("j1", "j2", name), None, read)
    np.testing.assert_allclose(positions, true, atol=1e-9)


def test_a_quaternion_in_counts_is_refused_by_its_length():
    half = 0.3 + 0.2 * T
    counts = 16384 * np.column_stack([np.cos(half), np.sin(half), 0 * T, 0 * T])
    with pytest.raises(InvalidDemonstrationsError, match="have length 16384, and a quaternion"):
        brought_together(("qw", "qx", "qy", "qz"), None, [counts])


def test_a_joint_that_may_have_stops_stays_in_the_turn_in_which_it_is_recorded():
    for name, stays in (("left_wrist_roll", True), ("forearm_roll", True), ("tool_yaw", False)):
        own = [(start + way * S)[:, None] for start, way in ((170.0, 25.0), (-170.0, -20.0))]
        read, _ = brought_together((name,), "deg", own)
        assert (np.ptp([motion[0, 0] for motion in read]) > 300) == stays


def test_a_gripper_beside_increments_is_no_part_of_a_quaternion():
    closed = np.where(T < 0.5, -1.0, 1.0)
    own = [np.column_stack([0 * T, 0 * T, (0.01 + 0.001 * i) * S, closed]) for i in range(N)]
    read, said = brought_together(("drx", "dry", "drz", "gripper"), None, own)
    assert np.ptp(read[0][:, 3]) == np.ptp(closed), said
    assert said == ""


def test_a_numbered_joint_of_a_limb_starts_in_one_turn():
    starts = (2.5, -3.1, 2.6, 3.0)
    own = [(start + 0.2 * S)[:, None] for start in starts]
    read, said = brought_together(("wrist_3_joint",), "rad", own)
    np.testing.assert_allclose(
        [np.deg2rad(m[0, 0]) for m in read], [2.5, 3.183, 2.6, 3.0], atol=1e-3
    )
    assert "taken 1 turn higher" in said


def test_a_wrist_that_counts_a_turn_a_throw_is_brought_to_one_turn():
    spins = [(0.1 + 0.5 * T + 2 * np.pi * k)[:, None] for k in (0, 1, 1, 1, 1, 5)]
    read, said = brought_together(("joint1",), "rad", spins)
    assert np.ptp([motion[0, 0] for motion in read]) < 1e-9, said


def test_joints_that_count_from_0_to_360_are_named_where_they_may_be_a_turn_too_high():
    """A UR keeps within two turns, so that its limits do not tell."""
    way = np.array([30.0, 60.0, -50.0, 10.0])
    motions = [np.mod(np.array([20, 250, 90, 265.0]) + i + S[:, None] * way, 360) for i in range(3)]
    names = ("pan", "lift", "elbow", "wrist")
    _, said = brought_together(names, "deg", motions)
    assert "lift 4.36 rad, wrist 4.63 rad may be a turn too high" in said
    assert brought_together(names, "deg", [m - [40, 0, 0, 0] for m in motions])[1] == ""


@pytest.mark.parametrize("names", [("rx", "ry", "rz"), ("act_rx", "act_ry", "act_rz")])
@pytest.mark.parametrize("within", [True, False])
def test_rx_ry_rz_in_radians_are_angles_where_one_leaps_alone(names, within):
    """A rotation vector's three numbers change their sign together."""
    true = [
        np.array([3.1, 0.002, 0.025 if within else 0.3])
        + S[:, None] * np.array([0.09 * within, 0, 0.2])
        for i in range(N)
    ]
    for i, motion in enumerate(true):
        motion[:, 0] += 0.06 * (i == 1) * (not within)
    recorded = [m.copy() for m in true]
    for motion in recorded:
        motion[:, 0] = np.deg2rad(wrapped(np.rad2deg(motion[:, 0])))
    read, said = brought_together(names, "rad", recorded)
    np.testing.assert_allclose(np.deg2rad(read), true, atol=1e-9)
    assert f"{names[0]} passes the end" in said if within else "is taken 1 turn higher" in said


@pytest.mark.parametrize("others", [(0.002, 0.025), (1e-4, 0.0), (0.8, 0.3)])
def test_rx_ry_rz_that_change_their_sign_together_are_a_rotation_vector(others):
    """As UR's poses of a tool that looks down do, whatever small numbers are beside."""
    way = np.array([3.1, *others])
    true = way * (1 + 0.02 * S[:, None])
    true += 1e-5 * np.random.default_rng(0).standard_normal(true.shape)
    size = np.linalg.norm(true, axis=1, keepdims=True)
    recorded = np.where(size > np.pi, true - 2 * np.pi * true / size, true)
    read, _ = brought_together(("rx", "ry", "rz"), "rad", [recorded] * N)
    same = np.linalg.norm(np.deg2rad(read[0]), axis=1)
    assert np.abs(np.diff(np.deg2rad(read[0]), axis=0)).max() < 0.01
    np.testing.assert_allclose(
        np.minimum(same, 2 * np.pi - same), np.minimum(size[:, 0], 2 * np.pi - size[:, 0])
    )

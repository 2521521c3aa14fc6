"""Transforms of plans: nothing at 0, adding up, rest that stays rest, and values by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.plans.kinematics import tool_tip
from prior_reinforce.plans.symmetry.moves import (
    Amplitude,
    Delay,
    Shift,
    Tempo,
    TurnIncrements,
    TurnJoint,
    TurnPath,
    TurnPoses,
    middle,
)

CHAIN = robot_limits("panda").chain
READY = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, np.pi / 4])
MOVES = {
    "tempo": Tempo(),
    "tempo of a clock": Tempo(about=30.0, keep_horizon=True),
    "tempo of increments": Tempo(increments=(0, 1), steps=(6,)),
    "amplitude": Amplitude(steps=(6,)),
    "delay": Delay(frames=20.0),
    "shift": Shift(0),
    "shift of increments": Shift(0, lead=5),
    "turn of a joint": TurnJoint(0, gain=-1.0),
    "turn of a joint, from a given start": TurnJoint(0, ramp=10),
    "turn of poses": TurnPoses((0.2, 0.1), vector=(3, 4, 5), yaw=6),
    "turn of increments": TurnIncrements((-0.05, 0.0), (0.1, 0.0), yaw=2),
    "turn of a path": TurnPath(CHAIN, (0.43, 0.0), tuple(range(7))),
}
GROUPS = [name for name in MOVES if name.startswith(("turn", "shift")) and "path" not in name]


def swing(horizon=60, rest=8):
    """Joints of the Panda that swing from rest to rest; joint 3 is held."""
    s = np.clip((np.arange(horizon) - rest) / (horizon - 1 - 2 * rest), 0, 1)
    s = s**3 * (10 - 15 * s + 6 * s**2)
    return READY + s[:, None] * np.array([0.2, 0.4, 0.0, 0.5, 0.05, 0.3, 0.1])


@pytest.mark.parametrize("name", MOVES)
def test_nothing_moves_a_plan_by_nothing(name):
    plan = swing()
    moved = MOVES[name](plan, 0.0)
    assert moved is not plan
    np.testing.assert_array_equal(moved, plan)
    assert max(MOVES[name].columns_of(), default=0) < 7


@pytest.mark.parametrize("name", MOVES)
def test_a_plan_is_not_changed_in_place(name):
    plan = swing()
    plan.flags.writeable = False
    assert np.all(np.isfinite(MOVES[name](plan, 0.1)))


@pytest.mark.parametrize("name", GROUPS)
def test_moves_of_a_group_add_up(name):
    move, plan = MOVES[name], swing()
    np.testing.assert_allclose(move(move(plan, 0.3), -0.5), move(plan, -0.2), atol=1e-12)


@pytest.mark.parametrize("name", sorted(set(MOVES) - {"tempo of increments", "delay"}))
def test_rest_stays_rest(name):
    move = MOVES[name]
    if move.increments_of() or getattr(move, "ramp", 0):
        pytest.skip("it begins with the way to the moved start")
    for amount in (-0.3, 0.3):
        moved = move(swing(), amount)
        for end in (moved[:3], moved[-3:]):
            assert np.abs(np.diff(end, axis=0)).max() < 1e-3
        at_ends = moved[[0, -1]] - moved[[1, -2]]
        np.testing.assert_allclose(at_ends, 0.0, atol=1e-6)


@pytest.mark.parametrize("speed", [0.6, 0.9, 1.3])
def test_tempo_scales_time_around_the_middle_and_nothing_is_cut_off(speed):
    plan = swing()
    played = Tempo(exponent=1.0)(plan, np.log(speed))
    np.testing.assert_allclose(played[[0, -1]], plan[[0, -1]], atol=1e-9)
    fastest = [np.abs(np.diff(each[:, 3])).max() for each in (plan, played)]
    assert fastest[1] / fastest[0] == pytest.approx(speed, rel=0.01)
    assert len(played) >= len(plan)
    if speed > 1:
        assert len(played) == len(plan)
        assert middle(played) == pytest.approx(middle(plan), abs=0.1)


def test_a_clock_releases_where_the_motion_was_at_its_frame():
    plan = swing()
    for amount in (-0.4, 0.4):
        played = Tempo(about=30.0, keep_horizon=True)(plan, amount)
        assert len(played) == len(plan)
        np.testing.assert_allclose(played[30], plan[30], atol=1e-9)


def test_a_plan_cut_in_mid_swing_goes_on():
    plan = np.arange(20.0)[:, None] * [0.1, 0.0]
    faster = Tempo(exponent=1.0)(plan, np.log(2.0))
    np.testing.assert_allclose(np.diff(faster[:, 0]), 0.2, atol=1e-9)


def test_a_gripper_opens_at_its_phase_of_the_motion_without_ringing():
    plan = np.column_stack([swing()[:, 3], np.where(np.arange(60) < 35, 1.0, 0.0)])
    slower = Tempo(exponent=1.0, steps=(1,))(plan, np.log(0.7))
    assert set(np.sign(np.diff(slower[:, 1]))) <= {-1.0, 0.0}
    assert slower[:, 1].max() == 1.0
    assert slower[:, 1].min() == 0.0
    opens = [int(np.argmax(each[:, 1] < 0.5)) for each in (plan, slower)]
    assert slower[opens[1], 0] == pytest.approx(plan[opens[0], 0], abs=0.03)


def test_tempo_of_increments_plays_the_path_that_they_add_up_to():
    path = swing()[:, 3]
    plan = np.column_stack([np.diff(path, prepend=path[0]), np.ones(60)])
    slower = Tempo(exponent=1.0, increments=(0,))(plan, np.log(0.8))
    assert slower[:, 0].sum() == pytest.approx(plan[:, 0].sum())
    assert slower[:, 0].max() == pytest.approx(0.8 * plan[:, 0].max(), rel=0.01)
    np.testing.assert_allclose(slower[:, 1], 1.0)


def test_amplitude_is_about_the_first_frame():
    plan = swing()
    larger = Amplitude(exponent=1.0)(plan, np.log(1.5))
    np.testing.assert_allclose(larger, plan[0] + 1.5 * (plan - plan[0]))


def test_a_delayed_column_is_what_it_was_frames_before():
    plan = swing()
    later = Delay(frames=10.0, columns=(3,))(plan, 0.5)
    np.testing.assert_allclose(later[5:, 3], plan[:-5, 3])
    np.testing.assert_array_equal(np.delete(later, 3, axis=1), np.delete(plan, 3, axis=1))


def test_poses_turn_about_a_point_with_their_attitudes():
    rng = np.random.default_rng(0)
    quaternions = Rotation.random(20, rng=rng).as_quat()[:, [3, 0, 1, 2]]
    vectors = Rotation.from_quat(np.roll(quaternions, -1, axis=1)).as_rotvec()
    plan = np.column_stack([rng.normal(size=(20, 3)), vectors, quaternions])
    move = TurnPoses((0.5, -0.2), vector=(3, 4, 5), quaternion=(6, 7, 8, 9))
    moved = move(plan, 0.7)
    turn = Rotation.from_rotvec([0, 0, 0.7])
    about = np.array([0.5, -0.2, 0.0])
    np.testing.assert_allclose(moved[:, :3], turn.apply(plan[:, :3] - about) + about)
    expected = (turn * Rotation.from_rotvec(vectors)).as_matrix()
    np.testing.assert_allclose(Rotation.from_rotvec(moved[:, 3:6]).as_matrix(), expected)
    of_quaternions = Rotation.from_quat(np.roll(moved[:, 6:], -1, axis=1)).as_matrix()
    np.testing.assert_allclose(of_quaternions, expected)


def test_a_rotation_vector_does_not_jump_where_its_angle_passes_half_a_turn():
    angles = np.linspace(2.5, 3.5, 30)
    plan = np.column_stack([np.zeros((30, 3)), np.zeros((30, 2)), angles])
    moved = TurnPoses(vector=(3, 4, 5))(plan, 0.3)
    np.testing.assert_allclose(moved[:, 5], angles + 0.3)


def test_increments_lead_to_the_turned_start_and_then_turn():
    plan = np.zeros((30, 2))
    plan[10:, 0] = 0.01
    move = TurnIncrements(start=(-0.1, 0.0), centre=(0.0, 0.0), lead=5)
    moved = move(plan, np.pi / 2)
    start = np.array([-0.1, 0.0])
    np.testing.assert_allclose(start + moved[:5].sum(axis=0), [0.0, -0.1], atol=1e-12)
    np.testing.assert_allclose(moved[10:], np.tile([0.0, 0.01], (20, 1)), atol=1e-12)


def test_a_path_turns_about_a_point_and_held_joints_stay_held():
    plan = swing()
    moved = TurnPath(CHAIN, (0.43, 0.0), tuple(range(7)))(plan, 0.3)
    turn = Rotation.from_rotvec([0, 0, 0.3])
    for tip in ((0.0, 0.0, 0.0), (0.1, 0.0, 0.05)):  # the flange's attitude, too
        about = np.array([0.43, 0.0, 0.0])
        expected = turn.apply(tool_tip(CHAIN, plan, tip) - about) + about
        np.testing.assert_allclose(tool_tip(CHAIN, moved, tip), expected, atol=1e-5)
    np.testing.assert_array_equal(moved[:, 2], plan[:, 2])
    assert np.abs(np.diff(moved - plan, axis=0)).max() < 0.02


@pytest.mark.parametrize(
    ("ends", "start", "amount", "ends_at"),
    [
        ((0.01, 5.84), 1.2, -2.5, 1.2 - 2.5 + 2 * np.pi),  # the youBot's: not centred
        ((-2.9, 2.9), 1.2, 2.6, 1.2 + 2.6 - 2 * np.pi),
        ((-2.9, 2.9), 1.2, 1.0, 2.2),  # as it is
        ((-6.3, 6.3), 6.0, 1.0, 7.0 - 2 * np.pi),  # nearest of several: not two turns
        ((-1.0, 2.9), 1.2, 2.6, 3.8),  # neither way: the gate says by how much
    ],
)
@pytest.mark.parametrize("gain", [1.0, -1.0])
def test_a_turn_goes_the_other_way_round_where_that_alone_is_within_the_joints_range(
    ends, start, amount, ends_at, gain
):
    plan = np.zeros((5, 2))
    plan[:, 1] = start + np.linspace(0, 0.2, 5) - 0.1
    move = TurnJoint(1, gain, range=(ends[0] - 0.1, ends[1] + 0.1))
    moved = move(plan, gain * amount)
    np.testing.assert_allclose(moved[:, 1] - plan[:, 1], ends_at - start, atol=1e-12)
    np.testing.assert_allclose(np.diff(move.endless(plan, gain * amount)[0]), start + amount - 0.1)
    np.testing.assert_array_equal(moved[:, 0], 0.0)
    assert (move.ranged_of(), move.endless.ranged_of()) == ((1,), ())


def test_joints_of_a_turned_path_are_brought_into_their_ranges_by_whole_turns():
    plan = swing()
    plain = TurnPath(CHAIN, (0.43, 0.0), tuple(range(7)))
    free = plain(plan, 0.3)
    ends = [(low - 0.1, high + 0.1) for low, high in zip(free.min(0), free.max(0), strict=True)]
    ends[0] = (ends[0][0] + 2 * np.pi, ends[0][1] + 2 * np.pi)
    move = TurnPath(CHAIN, (0.43, 0.0), tuple(range(7)), tuple(ends))
    np.testing.assert_allclose(move(plan, 0.3), free + 2 * np.pi * np.eye(7)[0])
    assert move.endless == plain

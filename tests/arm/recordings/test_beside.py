"""What moves beside the motion is told by what it does, whatever it is called."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings import read_recordings
from prior_reinforce.arm.recordings.beside import (
    arrays_beside,
    columns_beside,
    moving_beside,
    twin_vectors,
)
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import select
from prior_reinforce.errors import UnclearUnitsError
from tests.arm.recordings.recorded import UR, Q, S, T, sampled


def moving(beside):
    """What moves, by what it is called."""
    return {own.moving for own in beside.values()} - {""}


LATE = Q[np.maximum(np.arange(101) - 4, 0)]
"""As a command that the motion follows 80 ms later."""


@pytest.mark.parametrize(
    ("name", "values", "moves"),
    [
        ("q_cmd", LATE + 0.01, False),
        ("q_deg", np.rad2deg(Q), False),
        ("motor", Q[np.minimum(np.arange(101) + 4, 100)], False),
        ("q_left", 0.5 * Q[:, ::-1], True),
        ("hand", 0.2 + S[:, None] * np.linspace(0.1, 0.9, 16), True),
        ("lidar", S[:, None] * np.ones(500), False),
        ("still", 0.3 + 1e-4 * np.random.default_rng(0).normal(size=(101, 3)), False),
        ("grip", np.where(np.arange(101) % 5 == 0, 80 - 70 * S, np.nan), True),
        ("grip", S > 0.5, True),
        ("robot_state/gripper_position", S, True),
        ("obs/gripper_states", np.column_stack([S, -S]), True),
        ("rail", 0.1 + 0.25 * T, True),
        ("chrono", 7 + 1000 * T, False),
        ("ticks", np.arange(101) + 40, False),
        ("seq", 10 * np.arange(101), False),
        ("actions", S[:, None] * np.ones(3), False),
        ("next.done", S > 0.9, False),
        ("obs/joint_vel", Q * 3, False),
    ],
)
def test_what_moves_beside_is_told_by_its_numbers(name, values, moves):
    assert (moving(arrays_beside(Q, {name: values}, T)) == {name}) == moves


SWUNG = Q[0] + 0.9 * (Q - Q[0])
"""As another arm that moves in parallel, from the same pose."""


@pytest.mark.parametrize(
    ("motion", "name", "values", "moves"),
    [
        ("q_left", "q_right", SWUNG, True),
        ("q_left", "q_right", Q, True),
        ("qLeft", "qRight", SWUNG, True),
        ("q_l", "q_r", SWUNG, True),
        ("q_izquierda", "q_derecha", SWUNG, True),
        ("robot0_joint_pos", "robot1_joint_pos", SWUNG, True),
        ("q", "right/q", SWUNG, True),
        ("q", "other", SWUNG + np.array([-0.4, 0, 0]), True),
        ("q_left", "q_left_cmd", LATE, False),
        ("q_left", "target", LATE, False),
        ("q", "q_r", LATE, False),
        ("follower_1", "leader_1", LATE, False),
        ("q", "brightness", LATE, False),
        ("robot0_joint_pos", "robot0_target", np.rad2deg(LATE), False),
    ],
)
def test_another_arm_in_parallel_is_no_command(motion, name, values, moves):
    assert bool(moving(arrays_beside(Q, {name: values}, T, [motion]))) == moves


@pytest.mark.parametrize(
    ("others", "moves"),
    [
        ({"gripper": 80 - 70 * S[::3], "t_gripper": T[::3]}, True),
        ({"gripper": 80 - 70 * S[::8], "t_gripper": T[::8]}, True),
        ({"gripper": 80 - 70 * S[::3]}, True),
        ({"grip": S[::3] > 0.5}, True),
        ({"q_cmd": LATE[::3]}, False),
        ({"chrono": 7 + T[::3], "n": np.arange(34), "t_gripper": T[::3]}, False),
        ({"home": Q[0], "limits": np.array([[-1.0, 1.0]] * 3), "gains": 1 + S[::8]}, False),
        ({"points": np.random.default_rng(0).normal(size=(60, 3))}, False),
    ],
)
def test_what_moves_at_a_rate_of_its_own_is_named(others, moves):
    found = moving(arrays_beside(Q, others, T))
    assert bool(found) == moves
    assert not moves or all(f"({len(next(iter(others.values())))} frames" in name for name in found)


def test_numbered_columns_beside_are_one_group():
    names = [*UR, *(f"{stem}_{i}" for stem in ("left", "target") for i in range(3))]
    values = np.column_stack([Q, -Q, Q + 0.001])
    assert moving(columns_beside(names, values, range(3), T)) == {"left_0 to left_2"}


def test_a_command_beside_what_was_measured_is_asked_about(tmp_path):
    t, q = sampled(0, 50)
    late = np.vstack([q[:1], q[:1], q[:-2]])
    table = np.column_stack([t, q, late])
    names = [f"q_{of}_{i}" for of in ("des", "act") for i in range(1, 8)]
    np.savetxt(
        tmp_path / "a.csv", table, delimiter=",", header=",".join(["t", *names]), comments=""
    )
    with pytest.raises(UnclearUnitsError, match="q_act repeats q_des") as asked:
        read_recordings(tmp_path / "a.csv")
    assert asked.value.options == "--key q_act"
    (read,) = read_recordings(tmp_path / "a.csv", key=("q_act",))
    np.testing.assert_allclose(read.positions, late)


@pytest.mark.parametrize(
    ("names", "option"),
    [
        (("q", "action"), "--key q"),
        (("cmd", "q"), "--key q"),
        (("q_ref", "q"), "--key q"),
        (("leader", "follower"), "--key follower"),
        (("one", "other"), "--key WHICH"),
        (("target_q", "actual_q"), "--key actual_q"),
        (("state.q_d", "state.q"), "--key state.q"),
        (("planned_q", "q"), "--key q"),
        (("goal_position", "present_position"), "--key present_position"),
    ],
)
def test_what_was_measured_is_told_by_words_of_commands_and_measurements(names, option):
    both = np.hstack([Q, np.vstack([Q[:1], Q[:1], Q[:-2]])])
    columns = [f"{name}_{i}" for name in names for i in range(3)]
    columns += [*(f"velocity_{i}" for i in range(3)), "width"]  # other vectors are no single column
    (asked,) = twin_vectors(columns, np.column_stack([both, np.gradient(Q, axis=0), S]))
    assert asked.option == f"{option} --key width"
    assert not asked.guessed


def test_a_base_that_moves_is_named_though_it_is_called_a_pose():
    others = {
        "base_pose": np.column_stack([0.3 * S, S, S]),
        "base_T": np.tile(np.eye(4), (len(S), 1, 1)) + S[:, None, None],
        "tcp_pose": np.column_stack([0.3 * S, S, S]),
        "base_velocity": np.gradient(S),
        "base_camera": np.tile(S[:, None], 100),
    }
    named = {f"base_pose[{i}]" for i in range(3)} | {f"base_T[{i}]" for i in range(16)}
    found = arrays_beside(Q, others, T)
    assert moving(found) == named
    assert found["base_pose[0]"][:2] == (0.0, pytest.approx(0.3))


def test_a_base_of_many_numbers_hides_no_gripper():
    others = {"base_T": np.tile(np.eye(4), (len(S), 1, 1)) + S[:, None, None], "grip": S}
    recording = Recording("a", T, Q, UR, beside=arrays_beside(Q, others, T))
    assert [*moving_beside([recording])][:2] == ["grip", "base_T[0]"]
    assert select([recording]).left_out.startswith("grip, 0 to 1; base_T[0], 1 to 2; base_T[1], 0")


def test_only_a_measured_position_makes_a_command_one_of_its_own():
    for names in (["velocity", "target_velocity"], ["elbow_target", "elbow_current"]):
        assert [*twin_vectors(["pan", *names], Q)] == []
    assert [*twin_vectors(["pan", "state", "goal"], Q)] == []
    (asked,) = twin_vectors(["tcp_x", "tcp_x_cmd", "pan"], Q)
    assert asked.option == "--joints tcp_x pan"


def test_commands_of_single_names_are_asked_about_beside_what_was_measured():
    columns = ["shoulder", "elbow", "grip", "target_elbow", "shoulder_cmd", "goal_x"]
    values = np.column_stack([Q, Q[:, :2] + 0.1, S])
    (asked,) = twin_vectors(columns, values)
    assert asked.option == "--joints shoulder elbow grip goal_x"
    assert not asked.guessed
    assert [*twin_vectors(["cmd_elbow", "cmd_pan", "wrist"], Q)] == []


def test_a_number_that_stands_still_is_proposed_for_no_motion():
    names = [*(f"q_{i}" for i in range(Q.shape[1])), *(f"tq_{i}" for i in range(Q.shape[1]))]
    values = np.column_stack([Q, Q + 0.001, np.full(len(Q), 7.0), S])
    (asked,) = twin_vectors([*names, "robot_mode", "grip"], values)
    assert asked.option == "--key WHICH --key grip"

"""Names, units, lengths and further motion are told by what they hold, whatever they are called."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings import read_recordings
from prior_reinforce.arm.recordings.beside import (
    columns_beside,
    frames_said,
    is_clock,
    moves_beside,
    names_said,
    units_said,
    with_rate,
)
from prior_reinforce.arm.recordings.naming import words
from prior_reinforce.errors import FileFormatError, UnclearUnitsError
from tests.arm.recordings.recorded import sampled

T = np.arange(101) / 50
S = np.clip((T - 0.3) / 1.2, 0, 1)
S = 10 * S**3 - 15 * S**4 + 6 * S**5
Q = np.array([0.1, -0.6, 0.2]) + S[:, None] * [0.3, 0.4, -0.2]
UR = ("pan", "lift", "elbow")


@pytest.mark.parametrize(
    ("texts", "joints", "found"),
    [
        ({"dof_names": ("elbow", "pan", "lift")}, UR, ("elbow", "pan", "lift")),
        ({"order": ("elbow", "pan", "lift")}, UR, ("elbow", "pan", "lift")),
        ({"order": ("elbow", "pan", "lift")}, None, ()),
        ({"labels": ("a", "b", "c")}, None, ("a", "b", "c")),
        ({"labels": ("a", "b", "c"), "order": ("lift", "pan", "x")}, UR, ("lift", "pan", "x")),
        ({"joint_names": UR, "names": UR}, None, UR),
        ({"camera_names": ("a", "b", "c"), "kinds": ("q", "q", "q")}, None, ()),
        ({"joint_units": ("deg", "m", "rad")}, None, ()),
        ({"joint_names": ("a", "b")}, None, ()),
    ],
)
def test_texts_that_are_as_many_as_the_columns_are_their_names(texts, joints, found):
    assert names_said("a.npz", texts, 3, joints) == found


def test_texts_that_contradict_each_other_are_refused():
    texts = {"joint_names": UR, "dof_names": UR[::-1]}
    with pytest.raises(FileFormatError, match="joint_names says pan, lift, elbow; dof_names says"):
        names_said("a.npz", texts, 3, UR)


@pytest.mark.parametrize(
    ("stated", "given", "rate"),
    [
        ({"meta.fps": 50}, None, {"fps": 50}),
        ({"meta.frame_rate": 50}, None, {"frame_rate": 50}),
        ({"meta.timing.dt_ms": 20.0}, None, {"dt_ms": 20.0}),
        ({"meta.fps": 50, "rate": np.array(50.0)}, None, {"rate": 50.0}),
        ({"meta.fps": 50, "meta.camera.fps": 30}, None, {"fps": 50}),
        ({"meta.fps": 50, "meta.robot.hz": 100}, 50.0, {"fps": 50}),
        ({"meta.version": 2}, None, {}),
    ],
)
def test_a_rate_deep_in_what_a_file_says_is_its_rate(stated, given, rate):
    assert {k: v for k, v in with_rate("a.npz", stated, given).items() if "." not in k} == rate


def test_two_rates_that_contradict_each_other_are_refused():
    stated = {"meta.fps": 50, "meta.robot.dt": 0.01}
    with pytest.raises(
        FileFormatError, match=r"meta\.fps says 50 .*, but meta\.robot\.dt 100; .*-r"
    ):
        with_rate("a.npz", stated)
    with pytest.raises(FileFormatError, match=r"rate says 20 .*, but meta\.fps 50"):
        with_rate("a.npz", {"rate": np.array(20), "meta.fps": 50})


@pytest.mark.parametrize(
    ("texts", "units"),
    [
        ({"units": ("deg", "deg", "mm")}, ("deg", "deg", "mm")),
        ({"q_unit": ("°",)}, ("deg", "deg", None)),
        ({"time_unit": ("ms",)}, (None,) * 3),
        ({"meta.units": ("deg",)}, ("deg", "deg", None)),
        ({"meta.outcome_units": ("m",), "meta.object.unit": ("m",)}, (None,) * 3),
        ({"units": ("deg", "deg", "counts")}, ("deg", "deg", None)),
    ],
)
def test_units_in_words_are_of_the_columns(texts, units):
    assert units_said(texts, ("pan", "lift", "gripper")) == units


def test_an_angles_unit_in_words_is_not_of_places():
    assert units_said({"unit": ("deg",)}, ("x", "y", "pan")) == (None, None, "deg")


@pytest.mark.parametrize(
    "said",
    [
        "['pan', 'lift', 'elbow']",
        '["pan", "lift", "elbow"]',
        "pan lift elbow",
        np.array(UR),
        np.array([b"pan", b"lift", b"elbow"], dtype=object),
    ],
)
def test_a_list_of_texts_in_any_form(said):
    assert words(said) == UR
    assert words(np.arange(3)) == ()


@pytest.mark.parametrize(
    ("stated", "kept"),
    [
        ({"lengths": np.int64(80)}, 80),
        ({"is_pad": np.arange(101) >= 80}, 80),
        ({"mask": (np.arange(101) < 80).astype(float)}, 80),
        ({"length": np.int64(101)}, 101),
        ({"length": 0.8}, 101),
        ({"episode_length": np.int64(500)}, 101),
        ({"mask": np.arange(101) % 20 < 10}, 101),
        ({"contact": np.arange(101) >= 80}, 101),
    ],
)
def test_a_number_of_frames_or_a_mask_says_what_is_padding(stated, kept):
    q = np.where(np.arange(101)[:, None] < 80, Q, 0.0)
    found, said = frames_said("a", "q", {"q": q, **stated}, 101)
    assert (found, len(said)) == (kept, int(kept < 101))


def test_frames_beyond_the_number_that_move_are_no_padding():
    with pytest.raises(FileFormatError, match="declares 40 samples by length but q holds 101"):
        frames_said("a", "q", {"q": Q, "length": np.int64(40)}, 101)


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
    assert ([*moves_beside(Q, {name: values}, T)] == [name]) == moves


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
    assert bool(moves_beside(Q, {name: values}, T, [motion])) == moves


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
    found = moves_beside(Q, others, T)
    assert bool(found) == moves
    assert not moves or all(f"({len(next(iter(others.values())))} frames" in name for name in found)


def test_numbered_columns_beside_are_one_group():
    names = [*UR, *(f"{stem}_{i}" for stem in ("left", "target") for i in range(3))]
    values = np.column_stack([Q, -Q, Q + 0.001])
    assert [*columns_beside(names, values, range(3), T)] == ["left_0 to left_2"]


@pytest.mark.parametrize(
    ("name", "values", "clock"),
    [
        ("x", 5 + T, True),
        ("x", 1e9 * T, True),
        ("x", 1.1 * T, False),
        ("x", T**2, False),
        ("x", np.arange(101.0), True),
        ("frame", np.cumsum(1.0 + np.arange(101) % 3), True),
        ("x", 2.0 * np.arange(101), False),
    ],
)
def test_a_clock_runs_with_the_times_and_a_rail_does_not(name, values, clock):
    assert is_clock(name, values, T) == clock


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

"""Names, units, rates and lengths are told by what they hold, whatever they are called."""

from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.stated import (
    failures,
    motion_keys,
    recorded_frames,
    recording_of_arrays,
    stated_names,
    stated_units,
    without_invalid,
)
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError
from tests.arm.recordings.recorded import UR, Q


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
    assert stated_names("a.npz", texts, 3, joints) == found


def test_texts_that_contradict_each_other_are_refused():
    texts = {"joint_names": UR, "dof_names": UR[::-1]}
    with pytest.raises(FileFormatError, match="joint_names says pan, lift, elbow; dof_names says"):
        stated_names("a.npz", texts, 3, UR)


@pytest.mark.parametrize(
    ("texts", "units"),
    [
        ({"units": ("deg", "deg", "mm")}, ("deg", "deg", "mm")),
        ({"q_unit": ("°",)}, ("deg", "deg", None)),
        ({"time_unit": ("ms",)}, (None,) * 3),
        ({"meta.units": ("deg",)}, ("deg", "deg", None)),
        ({"meta.outcome_units": ("m",), "meta.object.unit": ("m",)}, (None,) * 3),
        ({"units": ("deg", "deg", "counts")}, ("deg", "deg", None)),
        (
            {
                "meta.units.lift": ("deg",),
                "meta.units.pan": ("rad",),
                "meta.units.gripper": ("mm",),
            },
            ("rad", "deg", "mm"),
        ),
        ({"units.lift": ("deg",), "units.pan": ("rad",)}, ("rad", "deg", None)),
    ],
)
def test_units_in_words_are_of_the_columns(texts, units):
    assert stated_units(texts, ("pan", "lift", "gripper")) == units


def test_an_angles_unit_in_words_is_not_of_places():
    assert stated_units({"unit": ("deg",)}, ("x", "y", "pan")) == (None, None, "deg")


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
    found, said = recorded_frames("a", "q", {"q": q, **stated}, 101)
    assert (found, len(said)) == (kept, int(kept < 101))


@pytest.mark.parametrize("called", ["valid", "observations/is_valid", "tracked"])
def test_frames_that_were_not_measured_by_a_flag_are_lost(called):
    flag = np.ones(101)
    flag[[0, 1, 50]] = 0
    found = recording_of_arrays(
        Path("a.npz"), "0", ("q",), {"q": Q, "t": np.arange(101) / 50, called: flag}, ReadOptions(),
        texts={}, names=UR,
    )  # fmt: skip
    assert np.flatnonzero(np.isnan(found.positions).all(axis=1)).tolist() == [0, 1, 50]
    assert any(called in remark for remark in found.remarks)
    others = {called: flag * 2, "valid": np.ones(3), "invalid": flag, "ball/tracked": flag}
    whole, said = without_invalid("0", Q, others)
    np.testing.assert_array_equal(whole, Q)
    assert said == ()


def test_a_flag_that_calls_most_frames_unmeasured_is_named_for_it_may_be_of_something_else():
    with pytest.raises(InvalidDemonstrationsError, match=r"tracked.*rename.*--leave-out"):
        without_invalid("0", Q, {"tracked": np.arange(101) < 60})


def test_nan_to_the_end_of_every_joint_is_padding_and_within_is_not():
    q = Q.copy()
    q[80:] = np.nan
    for one, kept in ((q, 80), (np.where(np.arange(101)[:, None] == 90, Q, q), 91)):
        assert recorded_frames("a", "q", {"q": one}, 101)[0] == kept
    q[80:, 0] = 0.1
    assert recorded_frames("a", "q", {"q": q}, 101)[0] == 101


def test_frames_beyond_the_number_that_move_are_no_padding():
    with pytest.raises(FileFormatError, match="declares 40 samples by length but q holds 101"):
        recorded_frames("a", "q", {"q": Q, "length": np.int64(40)}, 101)


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("joint_angles", ("joint_angles",)),
        ("dq", None),
        ("obs/outcomes", None),
        ("landing", None),
    ],
)
def test_the_only_array_that_may_be_the_motion_is_it(name, keys):
    shapes = {name: np.zeros((20, 6)), "t": np.zeros(20)}
    if keys is None:
        with pytest.raises(FileFormatError, match="--key"):
            motion_keys("a.npz", ReadOptions(), shapes, ("q",))
    else:
        assert motion_keys("a.npz", ReadOptions(), shapes, ("q",)) == keys


@pytest.mark.parametrize(
    "key", ["joint_torques", "obs/ddq", "q_error", "observation.effort", "load"]
)
def test_torques_that_are_named_as_the_motion_are_no_joints(key):
    arrays = {key: Q, "t": np.arange(101) / 50}
    with pytest.raises(FileFormatError, match=r"no positions: record those.*--key"):
        motion_keys("a.npz", ReadOptions(), {key.split(".")[-1]: Q}, ("q",))
    for texts in ({}, {"joint_names": UR}):  # whether or not the file names its columns
        options = ReadOptions(key=(key,), joints=UR)
        with pytest.raises(FileFormatError, match=f"{key} looks like .*torques.*--key"):
            recording_of_arrays(Path("a.h5"), "a", (key,), arrays, options, texts=texts)
    plain = ReadOptions(key=(key,), joints=("tau1", "tau2", "tau3"))
    assert (
        recording_of_arrays(Path("a.h5"), "a", (key,), arrays, plain, texts={}).positions.shape[1]
        == 3
    )


def test_torques_beside_joints_are_none_and_positions_of_now_are(tmp_path):
    arrays = {"q": Q[:, :1], "tau": Q[:, :1], "gripper_current": Q[:, 0], "t": np.arange(101) / 50}
    arrays |= {"current_joint_pos": Q, "joint_position_current": Q}

    def read(*keys):
        options = ReadOptions(key=keys, joints=UR[: len(keys)] if len(keys) > 1 else UR)
        return recording_of_arrays(Path("a.h5"), "a", keys, arrays, options, texts={}).positions

    with pytest.raises(FileFormatError, match=r"tau looks like .*torques"):
        read("q", "tau")
    assert read("q", "gripper_current").shape == (101, 2)
    for key in ("current_joint_pos", "joint_position_current"):
        np.testing.assert_array_equal(read(key), Q)


@pytest.mark.parametrize("q", [np.zeros(20), np.zeros((20, 6), dtype=bool), np.array(["a"])])
def test_an_array_that_holds_no_motion_is_named_with_its_shape_and_type(q):
    with pytest.raises(FileFormatError) as refused:
        motion_keys("a.npz", ReadOptions(), {"q": q}, ("q",))
    assert f"q of shape {q.shape} and type {q.dtype}" in str(refused.value)
    with pytest.raises(FileFormatError, match="no array q"):
        motion_keys("a.npz", ReadOptions(), {}, ("q",))


def test_one_joint_is_a_motion_if_it_is_asked_for_by_name():
    arrays = {"a": np.zeros(20), "b": np.zeros(20)}
    assert motion_keys("a.h5", ReadOptions(key=("b",)), arrays, ("q",)) == ("b",)
    assert motion_keys("a.h5", ReadOptions(joints=("a",)), arrays, ("q",)) == ("a",)


def test_truth_values_are_no_motion():
    arrays = {"q": np.zeros((20, 6)), "gripper": np.zeros(20, dtype=bool)}
    with pytest.raises(FileFormatError, match=r"gripper of shape .* bool"):
        motion_keys("a.npz", ReadOptions(key=("q", "gripper")), arrays, ("q",))


def test_an_only_array_that_is_called_an_outcome_is_named_as_what_may_be_the_motion():
    with pytest.raises(FileFormatError, match=r"\['landing_q'\].*--key"):
        motion_keys("a.npz", ReadOptions(), {"landing_q": Q}, ("q",))


def read_beside(motion, said, options=None):
    arrays = {"q": motion, "t": np.arange(len(motion)) / 50}
    options = options or ReadOptions()
    return recording_of_arrays(
        Path("a.npz"), "0", ("q",), arrays, options, texts={}, stated=said, names=UR
    )


def test_a_motion_far_from_its_own_statistics_is_normalised():
    motion = Q + np.array([2.0, -2.0, 1.0])
    mean, std = motion.mean(axis=0), motion.std(axis=0)
    normalised = (motion - mean) / std
    ends = {"q_min": motion.min(axis=0), "q_max": motion.max(axis=0)}
    for said in ({"mean": mean, "std": std}, ends, {"stats/q.mean": mean, "stats/q.std": std}):
        read_beside(motion, said)
        with pytest.raises(FileFormatError, match="before it was normalised"):
            read_beside(normalised, said)
        read_beside(normalised, said, ReadOptions(units=["rad"]))


@pytest.mark.parametrize(
    "names",
    ["action_min action_max", "tau_min tau_max", "dq_mean dq_std", "q_delta_mean q_delta_std"],
)
def test_statistics_of_other_columns_say_nothing_of_the_motion(names):
    low, high = names.split()
    said = {low: np.full(3, -0.1), high: np.full(3, 0.1)}
    np.testing.assert_array_equal(read_beside(Q + 2.0, said).positions, Q + 2.0)


def test_bounds_of_what_a_controller_takes_are_none_of_the_motion():
    read_beside(Q + 2.0, {"min": -np.ones(3), "max": np.ones(3)})


@pytest.mark.parametrize(
    "flag",
    [
        {"success": False},
        {"is_success": np.zeros(5, dtype=bool)},
        {"next.success": np.zeros((5, 1))},
        {"meta/success": np.float64(0)},
        {"meta.task_success": ("False",)},
        {"failed": 1},
        {"aborted": np.array([0, 0, 1])},
        {"failure": "yes"},
    ],
)
def test_what_calls_an_episode_failed_is_named(flag):
    (said,) = failures(flag)
    assert next(iter(flag)) in said
    assert "--leave-out" in said


@pytest.mark.parametrize(
    "flag",
    [
        {"success": np.array([0, 0, 1])},
        {"success": ("True",)},
        {"failed": np.zeros(5)},
        {"success_rate": 0.0},
        {"control_command_success_rate": np.zeros(5)},
        {"success": 0.5},
        {"success": np.full(3, np.nan)},
        {"success": ("unknown",)},
    ],
)
def test_other_flags_call_nothing_failed(flag):
    assert [*failures(flag)] == []


@pytest.mark.parametrize("key", ["actions", "Action"])
@pytest.mark.parametrize(
    ("actions", "measured"),
    [
        (np.clip(3 * Q, -1, 1), {}),  # clipped
        (Q - Q.mean(axis=0), {"states": 2 * Q + 3}),
        (np.gradient(Q, axis=0), {"states": Q, "dq": Q}),
    ],
)
def test_actions_that_a_controller_scales_are_no_positions(key, actions, measured):
    arrays = {key: actions, **measured}

    def read(**how):
        options = ReadOptions(rate=50, joints=UR, **how)
        return recording_of_arrays(Path("a.npz"), "a", [key], arrays, options, texts={})

    by_key = "--key states" if measured else "--key;"
    with pytest.raises(FileFormatError, match=rf"{by_key}.*--units rad"):
        read()
    np.testing.assert_array_equal(read(units=["rad"]).positions, actions)


@pytest.mark.parametrize(
    ("scale", "others"),
    [
        (1, {}),
        (1, {"states": Q + 0.01}),
        (2, {"states": -Q}),
        (1, {"dq": -Q}),
        (1, {"ft": -9 * Q, "ball": -Q}),
    ],
)
def test_actions_that_are_positions_are_read(scale, others):
    arrays = {"actions": scale * Q, **others}
    options = ReadOptions(rate=50, joints=UR)
    read = recording_of_arrays(Path("a.npz"), "a", ["actions"], arrays, options, texts={})
    np.testing.assert_array_equal(read.positions, scale * Q)

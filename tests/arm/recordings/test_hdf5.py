"""robomimic data sets, and what ALOHA and ManiSkill write."""

import json

import h5py
import numpy as np
import pytest

from prior_reinforce.arm.recordings import import_demonstrations, read_recordings
from prior_reinforce.arm.recordings.beside import moving_beside
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    UnclearUnitsError,
)
from tests.arm.recordings.recorded import (
    AS_IS,
    JOINTS,
    check_motions,
    sampled,
    write_outcomes,
    write_robomimic,
)


@pytest.mark.slow
def test_robomimic(tmp_path):
    path = write_robomimic(tmp_path)
    write_outcomes(tmp_path)
    result = import_demonstrations(path, joints=JOINTS, preprocessing=AS_IS)
    check_motions(result, 20, tolerance=0)
    other = import_demonstrations(path, key="obs/other_joints", preprocessing=AS_IS)
    np.testing.assert_allclose(other.demonstrations.plans, result.demonstrations.plans + 1)
    with pytest.raises(FileFormatError, match=r"'actions', 'obs/other_joints', 'obs/robot0_jo"):
        read_recordings(path, key="obs/joints")


@pytest.mark.slow
def test_robomimic_without_a_rate_asks_for_it(tmp_path):
    path = write_robomimic(tmp_path, rate=None)
    write_outcomes(tmp_path)
    with pytest.raises(FileFormatError, match="give the rate"):
        import_demonstrations(path)
    check_motions(import_demonstrations(path, rate=20, preprocessing=AS_IS), 20, tolerance=0)


def test_robomimic_with_frames_missing(tmp_path):
    path = write_robomimic(tmp_path)
    with h5py.File(path, "a") as file:
        file["data/demo_2"].attrs["num_samples"] = 99
    with pytest.raises(FileFormatError, match="demo_2 declares 99 samples"):
        read_recordings(path)


@pytest.mark.parametrize("shape", [(-1,), (-1, 1), (1, -1)])
@pytest.mark.parametrize(("name", "guessed"), [("time", False), ("stamps", True)])
def test_times_count_in_every_shape_and_under_every_name(tmp_path, shape, name, guessed):
    q = sampled(0, 50)[1]
    with h5py.File(tmp_path / "0.h5", "w") as file:
        file["q"], file["cycle"] = q, np.arange(len(q))
        file[name] = (5 + 0.011 * np.arange(len(q))).reshape(shape)
    if guessed:
        with pytest.raises(
            UnclearUnitsError, match=r"stamps looks like the .*--time-column stamps"
        ):
            read_recordings(tmp_path, key="q")
    (read,) = read_recordings(tmp_path, key="q", time_column="stamps" if guessed else None)
    assert read.period == pytest.approx(0.011)
    with pytest.raises(ConfigurationError, match=rf"--rate 100, but {name} in s says 90\.91 Hz"):
        read_recordings(tmp_path, key="q", rate=100)


def test_a_joint_that_rises_steadily_is_no_time(tmp_path):
    with h5py.File(tmp_path / "0.h5", "w") as file:
        file["lift"], file["turn"] = np.linspace(0, 1, 99), np.sin(np.arange(99))
    with pytest.raises(FileFormatError, match="neither times nor a rate"):
        read_recordings(tmp_path, key=("turn", "lift"))


def test_rows_and_columns_that_are_exchanged_are_named_before_a_time_is_missed(tmp_path):
    with h5py.File(tmp_path / "0.h5", "w") as file:
        file["q"], file["time"] = sampled(0, 50)[1].T, np.arange(61) / 50
    with pytest.raises(InvalidDemonstrationsError, match="rows and columns are exchanged"):
        read_recordings(tmp_path, key="q")


@pytest.mark.parametrize("form", ["ALOHA", "ManiSkill"])
def test_other_layouts_of_hdf5(tmp_path, form):
    q = [sampled(i, 20)[1] for i in range(3)]
    if form == "ALOHA":
        source, names = tmp_path, ("episode_0", "episode_1", "episode_2")
        for name, motion in zip(names, q, strict=True):
            with h5py.File(tmp_path / f"{name}.hdf5", "w") as file:
                file["observations/qpos"], file["action"] = motion, motion + 1
    else:
        source, names = tmp_path / "trajectory.h5", ("traj_0", "traj_1", "traj_2")
        with h5py.File(source, "w") as file:
            for name, motion in zip(names, q, strict=True):
                file[f"{name}/obs/agent/qpos"], file[f"{name}/actions"] = motion, motion[:-1]
    recordings = read_recordings(source, rate=20)
    assert tuple(r.episode for r in recordings) == names
    for recording, motion in zip(recordings, q, strict=True):
        np.testing.assert_allclose(recording.positions, motion)


KEY = "data/demo_0/obs/robot0_joint_pos"


def foreign(tmp_path, how):
    """A robomimic file whose first episode stands in another file."""
    path, other = write_robomimic(tmp_path), tmp_path / "other.h5"
    with h5py.File(path, "a") as file:
        numbers = np.array(file[KEY])
        with h5py.File(other, "w") as secret:
            secret["numbers"] = numbers
        numbers.tofile(tmp_path / "raw")
        del file[KEY]
        if how == "external link":
            file[KEY] = h5py.ExternalLink(str(other), "/numbers")
        elif how == "soft link to an external link":
            file["aside"] = h5py.ExternalLink(str(other), "/numbers")
            file[KEY] = h5py.SoftLink("/aside")
        elif how == "external episode":
            file["moved"] = file["data/demo_0"]
            del file["data/demo_0"]
            file["data/demo_0"] = h5py.ExternalLink(str(other), "/")
        elif how == "external storage":
            where = [(str(tmp_path / "raw"), 0, numbers.nbytes)]
            file.create_dataset(KEY, numbers.shape, numbers.dtype, external=where)
        elif how == "virtual data set":
            layout = h5py.VirtualLayout(numbers.shape, numbers.dtype)
            layout[:] = h5py.VirtualSource(str(other), "numbers", numbers.shape)
            file.create_virtual_dataset(KEY, layout)
        else:
            file["aside"] = h5py.SoftLink("/round")
            file["round"] = h5py.SoftLink("/aside")
            file[KEY] = h5py.SoftLink("/aside")
    return path


@pytest.mark.parametrize(
    "how",
    [
        "external link",
        "soft link to an external link",
        "external episode",
        "external storage",
        "virtual data set",
        "links in a circle",
    ],
)
def test_numbers_of_another_file_are_not_read(tmp_path, how):
    path = foreign(tmp_path, how)
    with pytest.raises(FileFormatError, match=r"another file.*not read"):
        read_recordings(path)


def test_a_link_within_the_file_is_followed(tmp_path):
    path = write_robomimic(tmp_path)
    expected = read_recordings(path)[0].positions
    with h5py.File(path, "a") as file:
        file.move(KEY, "aside")
        file[KEY] = h5py.SoftLink("/aside")
    np.testing.assert_array_equal(read_recordings(path)[0].positions, expected)


@pytest.mark.parametrize("place", ["/", "data/demo_0", KEY])
def test_a_rate_in_the_attributes_is_read(tmp_path, place):
    path = write_robomimic(tmp_path, rate=None)
    with h5py.File(path, "a") as file:
        file[place].attrs["fps"] = 25
        file[place].attrs["note"] = "slow"
        assert KEY.startswith("data/demo_0")
    assert read_recordings(path, episodes=["demo_0"])[0].period == pytest.approx(0.04)


def test_a_header_that_claims_too_much_is_not_read(tmp_path):
    path = write_robomimic(tmp_path)
    with h5py.File(path, "a") as file:
        del file[KEY], file["data/demo_0"].attrs["num_samples"]
        file.create_dataset(KEY, (10**12, 7), "f8", chunks=(1000, 7))
    with pytest.raises(FileFormatError, match="no recording of throws"):
        read_recordings(path)


def one(tmp_path, arrays, attrs):
    """A file an episode; `at@name` is an attribute of what stands at `at`."""
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        for name, array in arrays.items():
            file[name] = array
        for where, value in attrs.items():
            at, _, name = where.partition("@")
            (file[at] if at else file).attrs[name] = value
    return tmp_path / "a.hdf5"


T, Q = sampled(0, 20)
QPOS = "observations/qpos"


@pytest.mark.parametrize("at", ["", "observations", QPOS])
def test_attributes_name_the_joints_and_give_units_and_the_rate(tmp_path, at):
    path = one(
        tmp_path, {QPOS: Q}, {f"{at}@joints": JOINTS[::-1], "@fps": 20, f"{QPOS}@units": "deg"}
    )
    (recording,) = read_recordings(path, joints=JOINTS)
    assert recording.names == JOINTS[::-1]
    assert recording.units == ("deg",) * 7
    np.testing.assert_allclose(recording.times, T)


def test_names_may_stand_in_an_array_of_texts(tmp_path):
    path = one(tmp_path, {QPOS: Q, "joint_names": [name.encode() for name in JOINTS]}, {})
    assert read_recordings(path, rate=20)[0].names == JOINTS


@pytest.mark.parametrize("said", ["length", "is_pad", "nothing"])
def test_frames_of_zeros_that_fill_up_an_episode_are_no_motion(tmp_path, said):
    filled = np.concatenate([Q, np.zeros((9, 7))])
    arrays = {"is_pad": np.arange(len(filled)) >= len(Q)} if said == "is_pad" else {}
    path = one(tmp_path, {QPOS: filled, **arrays}, {"@length": len(Q)} if said == "length" else {})
    (recording,) = read_recordings(path, rate=20)
    np.testing.assert_array_equal(recording.positions, Q)
    assert "9 frames at the end left out" in recording.remarks[0]


def test_what_moves_is_named_by_what_it_is_and_not_by_a_word_in_its_path(tmp_path):
    grip = Q[:, 1] - Q[0, 1]
    arrays = {
        "observation/robot_state/joint_positions": Q,
        "observation/robot_state/gripper_position": grip,
        "obs/gripper_states": np.column_stack([grip, -grip]),
        "actions": np.column_stack([grip] * 7),
        "action/joint_position": Q,
        "next_obs/gripper": grip,
        "dones": grip > 0.3,
    }
    path = one(tmp_path, arrays, {})
    (recording,) = read_recordings(path, key="observation/robot_state/joint_positions", rate=20)
    named = {"obs/gripper_states", "observation/robot_state/gripper_position"}
    assert {*moving_beside([recording])} == named


def test_a_json_in_an_attribute_names_the_joints_and_the_rate(tmp_path):
    with h5py.File(tmp_path / "throw.hdf5", "w") as file:
        file["observations/qpos"] = sampled(0, 50)[1][:, ::-1]
        file.attrs["metadata"] = json.dumps({"joint_names": JOINTS[::-1], "fps": 50, "by": "kim"})
    (recording,) = read_recordings(tmp_path / "throw.hdf5", joints=JOINTS)
    assert (recording.names, recording.clock) == (JOINTS[::-1], "fps in the file")
    assert not recording.ambiguities


def test_what_moves_at_a_rate_of_its_own_is_named(tmp_path):
    with h5py.File(tmp_path / "throw.hdf5", "w") as file:
        _, file["observations/qpos"] = sampled(0, 50)
        file["gripper/width"] = 80 + 100 * sampled(0, 20)[1][:, 1]
        file["home"] = sampled(0, 50)[1][0]
    (recording,) = read_recordings(tmp_path / "throw.hdf5", rate=50)
    assert [*moving_beside([recording])] == ["gripper/width (35 frames, beside 86)"]


def test_an_array_a_joint_is_found_by_its_path(tmp_path):
    t, q = sampled(0, 50)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"] = t
        for k, joint in reversed([*enumerate(JOINTS)]):
            file[f"joints/{joint}/position"] = q[:, k]
            file[f"joints/{joint}/velocity"] = np.gradient(q[:, k], t)
    (read,) = read_recordings(tmp_path / "a.h5", joints=JOINTS)
    np.testing.assert_allclose(read.positions, q)
    np.testing.assert_allclose(read.times, t)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("frame", 2 * np.arange(61)),
        ("sim_step", 25 * np.arange(61)),
        ("progress", np.linspace(0, 1, 61)),
        ("opening", np.linspace(0, 0.04, 61)),
        ("travelled", 0.7 * np.linspace(0, 3, 61)),
    ],
)
def test_what_rises_and_is_no_clock_contradicts_no_rate(tmp_path, name, values):
    with h5py.File(tmp_path / "0.h5", "w") as file:
        file["q"], file[name] = np.sin(np.arange(61)[:, None] / [9, 8]), values
    (read,) = read_recordings(tmp_path, key="q", rate=20)
    assert (len(read.times), read.period) == (61, pytest.approx(0.05))


def test_no_time_is_guessed_where_two_may_be_it(tmp_path):
    with h5py.File(tmp_path / "0.h5", "w") as file:
        file["q"] = np.sin(np.arange(61)[:, None] / [9, 8])
        file["progress"] = np.linspace(0, 1, 61)
        file["stamps"] = 0.05 * np.arange(61)
    with pytest.raises(FileFormatError, match="neither times nor a rate"):
        read_recordings(tmp_path, key="q")


def test_one_frame_is_no_motion_on_its_side(tmp_path):
    with h5py.File(tmp_path / "0.h5", "w") as file:
        file["q"] = np.ones((1, 7))
    with pytest.raises(InvalidDemonstrationsError, match="T >= 2"):
        read_recordings(tmp_path, key="q", rate=20)


def test_a_declared_rate_of_zero_is_named_also_beside_what_rises(tmp_path):
    with h5py.File(tmp_path / "0.h5", "w") as file:
        file["q"], file["stamps"] = np.sin(np.arange(61)[:, None] / [9, 8]), 0.05 * np.arange(61)
        file["q"].attrs["fps"] = 0.0
    with pytest.raises(FileFormatError, match="fps says 0 frames a second; mend it"):
        read_recordings(tmp_path, key="q")


def test_packed_numbers_are_unpacked(tmp_path):
    t, q = sampled(0, 50)
    with h5py.File(tmp_path / "0.h5", "w") as file:
        file["time"], file["q"] = t, np.round((q - 0.5) / 1e-4).astype(np.int16)
        file["q"].attrs.update({"scale_factor": 1e-4, "add_offset": np.array([0.5])})
    (read,) = read_recordings(tmp_path, key="q")
    np.testing.assert_allclose(read.positions, q, atol=6e-5)
    with h5py.File(tmp_path / "0.h5", "a") as file:
        file["q"].attrs["_FillValue"] = file["q"][3, 0]
    (read,) = read_recordings(tmp_path, key="q")
    assert np.isnan(read.positions[3, 0])
    assert np.isfinite(read.positions).any()
    with h5py.File(tmp_path / "0.h5", "a") as file:
        file["q"].attrs["scale_factor"] = "1e-4"
    with pytest.raises(FileFormatError, match=r"q \(int16\) says scale_factor = 1e-4, .*unpacked"):
        read_recordings(tmp_path, key="q")
    with h5py.File(tmp_path / "0.h5", "a") as file:
        del file["q"]
        file["q"] = q
        file["q"].attrs["scale_factor"] = 1e-4  # applied already, or not?
    with pytest.raises(FileFormatError, match=r"q \(float64\) says scale_factor = 0\.0001"):
        read_recordings(tmp_path, key="q")


def test_fields_of_records_are_read_as_arrays_are(tmp_path):
    t, q = sampled(0, 50)
    fields = [("t", float), *((name, float) for name in JOINTS)]
    records = np.rec.fromarrays([t, *np.rad2deg(q).T], dtype=fields)
    with h5py.File(tmp_path / "all.h5", "w") as file:
        file["data/demo_0/log"] = records
        file["data/demo_0/log"].attrs["units"] = "deg"
    (read,) = read_recordings(tmp_path, joints=JOINTS)
    np.testing.assert_allclose(read.positions, np.rad2deg(q))
    np.testing.assert_allclose(read.times, t)
    assert read.units == ("deg",) * len(JOINTS)
    with h5py.File(tmp_path / "all.h5", "a") as file:
        file["data/demo_0/other"] = records
    (read,) = read_recordings(tmp_path, key=tuple(f"log.{name}" for name in JOINTS), rate=50)
    np.testing.assert_allclose(read.positions, np.rad2deg(q))


def test_only_a_demonstration_declares_its_own_samples(tmp_path):
    path = write_robomimic(tmp_path)
    with h5py.File(path, "a") as file:
        file["data"].attrs["num_samples"] = 10_000  # of all of them
    assert len(read_recordings(path)) == 6


def test_a_record_beside_the_motion_may_be_of_any_size(tmp_path):
    with h5py.File(tmp_path / "0.h5", "w") as file:
        rows = [(t, tuple(q)) for t, q in zip(T, Q, strict=True)]
        file["log"] = np.array(rows, dtype=[("time", "f8"), ("position", "f8", (7,))])
        points = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("rgb", "u4")]
        file.create_dataset("points", (30_000_000,), points, chunks=(1000,))
        picture = [("picture", "u1", (480, 640, 3)), ("exposure", "f8")]
        file.create_dataset("camera", (len(T),), picture, chunks=(1,))
    (read,) = read_recordings(tmp_path, key="position")
    np.testing.assert_array_equal(read.positions, Q)
    np.testing.assert_allclose(read.times, T)


def test_a_record_that_is_the_motion_is_held_to_the_largest_size(tmp_path):
    with h5py.File(tmp_path / "0.h5", "w") as file:
        kind = [("time", "f8"), ("position", "f8", (7,))]
        file.create_dataset("log", (30_000_000,), kind, chunks=(1000,))
    with pytest.raises(FileFormatError, match="no recording of throws"):
        read_recordings(tmp_path, key="position")


@pytest.mark.parametrize("as_array", [True, False])
def test_an_episode_that_is_flagged_as_failed_is_said(tmp_path, as_array):
    with h5py.File(tmp_path / "demos.h5", "w") as file:
        for i in range(2):
            group = file.create_group(f"traj_{i}")
            group["obs/agent/qpos"] = sampled(i, 20)[1]
            if as_array:  # of the frames but the last, as ManiSkill has them
                group["success"] = np.arange(len(sampled(i, 20)[1]) - 1) > 20 + 99 * i
            else:
                group.attrs["success"] = i == 0
    good, bad = read_recordings(tmp_path / "demos.h5", rate=20)
    assert not any("success" in remark for remark in good.remarks)
    assert any("success" in remark and "--leave-out" in remark for remark in bad.remarks)

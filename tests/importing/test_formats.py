"""Every format, written by its own library, comes back as the motion that was written."""

import builtins
import importlib
import shutil

import h5py
import numpy as np
import pytest
import zarr
from recorded import (
    AFTER,
    BEFORE,
    JOINTS,
    OUTCOMES,
    N,
    duration,
    sampled,
    throw,
    write_bag,
    write_bags,
    write_csv,
    write_droid,
    write_lerobot,
    write_npz,
    write_outcomes,
    write_robomimic,
    write_zarr,
)

from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    MissingExtraError,
)
from prior_reinforce.importing import (
    Preprocessing,
    import_demonstrations,
    read_recordings,
)
from prior_reinforce.plans.files import write_plan
from prior_reinforce.plans.motions import Plan

AS_IS = Preprocessing(trim=False)


def check_motions(result, rate, *, tolerance):
    """Plans are the throws that were written, untrimmed, each holding its last pose."""
    demos = result.demonstrations
    t = np.arange(demos.horizon) / rate
    assert demos.format.dt == pytest.approx(1 / rate, rel=1e-9)
    assert demos.horizon == round((BEFORE + 1.2 + AFTER) * rate) + 1
    for i in range(N):
        np.testing.assert_allclose(demos.plans[i], throw(i, t), atol=tolerance)
    np.testing.assert_allclose(demos.outcomes_seen, list(OUTCOMES.values()))
    assert demos.outcome_names == ("x", "y")


def test_npz(tmp_path):
    write_outcomes(write_npz(tmp_path))
    result = import_demonstrations(tmp_path, preprocessing=AS_IS)
    check_motions(result, 100, tolerance=0)
    assert result.demonstrations.format.names == JOINTS
    assert result.episodes == tuple(f"throw_{i}" for i in range(N))


def test_npz_of_one_array_with_its_own_outcomes(tmp_path):
    t = np.arange(171) / 100
    plans = np.stack([throw(i, t) for i in range(N)])
    np.savez(tmp_path / "all.npz", q=plans, dt=0.01, outcomes=np.array(list(OUTCOMES.values())))
    result = import_demonstrations(tmp_path / "all.npz", preprocessing=AS_IS)
    np.testing.assert_array_equal(result.demonstrations.plans, plans)
    assert result.episodes == tuple(OUTCOMES)


def test_our_own_demonstrations_and_plans_come_back(tmp_path):
    write_outcomes(write_npz(tmp_path))
    demos = import_demonstrations(tmp_path, preprocessing=AS_IS).demonstrations
    demos.save(tmp_path / "saved.npz")
    again = import_demonstrations(
        tmp_path / "saved.npz",
        outcomes={str(i): OUTCOMES[str(i)] for i in range(N)},
        preprocessing=AS_IS,
    ).demonstrations
    np.testing.assert_array_equal(again.plans, demos.plans)
    assert again.format == demos.format
    write_plan(Plan(demos.plans[2], demos.format), tmp_path / "plan.npz")
    (recording,) = read_recordings(tmp_path / "plan.npz")
    np.testing.assert_array_equal(recording.positions, demos.plans[2])
    assert recording.names == JOINTS


def test_csv(tmp_path):
    write_outcomes(write_csv(tmp_path))
    check_motions(import_demonstrations(tmp_path, preprocessing=AS_IS), 100, tolerance=0)


def test_csv_with_a_column_of_episodes_and_text_beside(tmp_path):
    lines = ["episode,time,joint2,phase,joint1"]
    for episode in ("b10", "b9"):
        lines += [f"{episode},{k / 10},{k + len(episode)},swing,{-k}" for k in range(5)]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    recordings = read_recordings(tmp_path / "log.csv", joints=["joint1", "joint2"])
    assert [r.episode for r in recordings] == ["b9", "b10"]
    np.testing.assert_array_equal(recordings[0].positions[:, 0], -np.arange(5))
    np.testing.assert_array_equal(recordings[1].positions[:, 1], np.arange(5) + 3)
    with pytest.raises(FileFormatError, match="line 7: phase is 'swing'"):
        read_recordings(tmp_path / "log.csv")


@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
@pytest.mark.parametrize("stale", [False, True])
def test_lerobot(tmp_path, version, stale):
    folder = write_lerobot(tmp_path / "set", version=version, stale=stale)
    write_outcomes(tmp_path)
    result = import_demonstrations(folder, joints=JOINTS, preprocessing=AS_IS)
    check_motions(result, 100, tolerance=1e-6)
    assert any("observation.state (measured)" in remark for remark in result.preview.remarks)
    commanded = import_demonstrations(folder, key="action", joints=JOINTS, preprocessing=AS_IS)
    np.testing.assert_allclose(
        commanded.demonstrations.plans, result.demonstrations.plans + 1, atol=1e-6
    )


@pytest.mark.parametrize("nesting", [{"motors": [*JOINTS, "gripper"]}, ["only", "two"]])
def test_lerobot_names_may_be_nested_or_useless(tmp_path, nesting):
    folder = write_lerobot(tmp_path / "set", names=nesting)
    write_outcomes(tmp_path)
    result = import_demonstrations(folder, joints=[*JOINTS, "gripper"], preprocessing=AS_IS)
    np.testing.assert_allclose(result.demonstrations.plans[..., 7], 0.04, atol=1e-7)


def test_lerobot_with_a_missing_episode(tmp_path):
    folder = write_lerobot(tmp_path / "set", skip=[3])
    write_outcomes(tmp_path)
    with pytest.raises(FileFormatError, match="episode 3 has 0 of 171 listed frames"):
        import_demonstrations(folder, joints=JOINTS)
    rest = [str(i) for i in range(N) if i != 3]
    result = import_demonstrations(folder, joints=JOINTS, episodes=rest)
    assert result.episodes == tuple(rest)
    np.testing.assert_allclose(result.demonstrations.outcomes_seen[3], OUTCOMES["4"])


def test_robomimic(tmp_path):
    path = write_robomimic(tmp_path)
    write_outcomes(tmp_path)
    result = import_demonstrations(path, joints=JOINTS, preprocessing=AS_IS)
    check_motions(result, 20, tolerance=0)
    other = import_demonstrations(path, key="obs/other_joints", preprocessing=AS_IS)
    np.testing.assert_allclose(other.demonstrations.plans, result.demonstrations.plans + 1)
    with pytest.raises(FileFormatError, match=r"'actions', 'obs/other_joints', 'obs/robot0_jo"):
        read_recordings(path, key="obs/joints")


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


def test_droid_at_another_rate(tmp_path):
    folder = write_droid(tmp_path / "droid")
    write_outcomes(tmp_path)
    result = import_demonstrations(folder, preprocessing=Preprocessing(dt=0.01, trim=False))
    demos = result.demonstrations
    # 15 Hz resampled to 100 Hz; times are whole milliseconds, worth 2 mrad at 2 rad/s.
    t = np.arange(demos.horizon) * 0.01
    for i in range(N):
        inside = t <= sampled(i, 15)[0][-1]
        np.testing.assert_allclose(demos.plans[i][inside], throw(i, t[inside]), atol=3e-3)
    assert result.episodes == tuple(f"episode_{i}" for i in range(N))


@pytest.mark.parametrize("zipped", [False, True])
def test_zarr_replay_buffers(tmp_path, zipped):
    path = write_zarr(tmp_path)
    if zipped:
        shutil.make_archive(str(path), "zip", path)
        path = path.with_suffix(".zarr.zip")
    write_outcomes(tmp_path)
    result = import_demonstrations(
        path, key="joint_pos", rate=50, joints=JOINTS, preprocessing=AS_IS
    )
    check_motions(result, 50, tolerance=0)
    with pytest.raises(FileFormatError, match=r"'action', 'joint_pos'\]: say which"):
        read_recordings(path, rate=50)
    with pytest.raises(FileFormatError, match="give the rate"):
        read_recordings(path, key="action")


def test_a_replay_buffer_whose_episodes_end_elsewhere(tmp_path):
    path = write_zarr(tmp_path)
    zarr.open_group(str(path), mode="r+")["meta/episode_ends"][1] = 5
    with pytest.raises(FileFormatError, match="episodes end at"):
        read_recordings(path, key="action", rate=50)


KINDS = ["ros1", "sqlite", "mcap"]


@pytest.mark.parametrize("kind", KINDS)
def test_ros_joint_states_in_any_order_with_fingers(tmp_path, kind):
    write_bags(tmp_path, kind=kind, shuffled=True, fingers=True)
    write_outcomes(tmp_path)
    result = import_demonstrations(tmp_path, joints=JOINTS, preprocessing=AS_IS)
    check_motions(result, 100, tolerance=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_ros_trajectories(tmp_path, kind):
    write_bags(tmp_path, kind=kind, trajectory=True, names=[f"panda_{j}" for j in JOINTS])
    write_outcomes(tmp_path)
    result = import_demonstrations(
        tmp_path, joints=[f"panda_{j}" for j in JOINTS], names=JOINTS, preprocessing=AS_IS
    )
    check_motions(result, 100, tolerance=1e-9)
    assert result.demonstrations.format.names == JOINTS


def test_a_bare_mcap_file(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="mcap")
    (file,) = bag.glob("*.mcap")
    (recording,) = read_recordings(file)
    np.testing.assert_allclose(recording.positions, sampled(0, 100)[1])


def test_a_gripper_that_publishes_on_the_same_topic(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="sqlite", gripper_apart=True)
    (recording,) = read_recordings(bag, joints=JOINTS)
    np.testing.assert_allclose(recording.positions, sampled(0, 100)[1])
    assert "171 messages without all joints skipped" in recording.remarks[0]


def test_bags_without_stamps_use_the_recorders_times(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="mcap", stamped=False)
    (recording,) = read_recordings(bag)
    np.testing.assert_allclose(recording.times, sampled(0, 100)[0], atol=1e-6)
    assert "those of the recorder" in recording.remarks[0]


def test_a_bag_without_the_joint_names_those_it_has(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="mcap", fingers=True)
    with pytest.raises(FileFormatError, match=r"joints in it are .*'finger_left'.*'joint1'"):
        read_recordings(bag, joints=["panda_joint1"])


def test_an_unknown_topic_lists_the_usable_ones(tmp_path):
    bag = write_bag(tmp_path / "throw0", 0, kind="sqlite")
    with pytest.raises(FileFormatError, match=r"/joint_states \(sensor_msgs/msg/JointState\)"):
        read_recordings(bag, key="/joints")


@pytest.mark.parametrize(
    ("module", "extra", "write"),
    [
        ("pyarrow", "lerobot", lambda folder: write_lerobot(folder / "set")),
        ("h5py", "hdf5", write_robomimic),
        ("zarr", "zarr", write_zarr),
        ("rosbags", "ros", lambda folder: write_bag(folder / "throw0", 0, kind="mcap")),
    ],
)
def test_a_missing_library_names_its_extra(tmp_path, monkeypatch, module, extra, write):
    source = write(tmp_path)
    real = importlib.import_module

    def without(name, package=None):
        if name.split(".")[0] == module:
            raise ModuleNotFoundError(f"No module named {name!r}")
        return real(name, package)

    monkeypatch.setattr(importlib, "import_module", without)
    with pytest.raises(MissingExtraError, match=rf'pip install "prior-reinforce\[{extra}\]"'):
        read_recordings(source)


def test_the_core_formats_need_no_optional_library(tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **options):
        if name.split(".")[0] in ("pyarrow", "h5py", "rosbags", "zarr"):
            raise ModuleNotFoundError(f"No module named {name!r}")
        return real(name, *arguments, **options)

    write_outcomes(write_csv(tmp_path))
    monkeypatch.setattr(builtins, "__import__", without)
    assert import_demonstrations(tmp_path).demonstrations.n == N


def test_episodes_are_chosen_by_name_and_order(tmp_path):
    write_outcomes(write_csv(tmp_path))
    result = import_demonstrations(tmp_path, episodes=["4", "0", "1"])
    assert result.episodes == ("4", "0", "1")
    np.testing.assert_allclose(
        result.demonstrations.outcomes_seen, [OUTCOMES["4"], OUTCOMES["0"], OUTCOMES["1"]]
    )
    with pytest.raises(InvalidDemonstrationsError, match=r"no episode 9 in .*0, 1, 2, 3, 4, 5"):
        import_demonstrations(tmp_path, episodes=["9"])


@pytest.mark.parametrize("name", ["nothing.npz", "nothing", "text.txt"])
def test_no_recording(tmp_path, name):
    (tmp_path / "text.txt").write_text("hello")
    with pytest.raises(FileFormatError, match=r"no recording at|no format that can be read"):
        read_recordings(tmp_path / name)


def test_a_folder_of_two_formats_asks_which(tmp_path):
    write_npz(write_csv(tmp_path))
    with pytest.raises(FileFormatError, match="npz and csv; say its format"):
        read_recordings(tmp_path)
    assert len(read_recordings(tmp_path, format="csv")) == N
    with pytest.raises(ConfigurationError, match="unknown format 'pickle'"):
        read_recordings(tmp_path, format="pickle")


def test_durations_are_those_written(tmp_path):
    for i, recording in enumerate(read_recordings(write_npz(tmp_path))):
        assert recording.duration == pytest.approx(BEFORE + duration(i) + AFTER)


def test_a_damaged_bag_that_was_not_asked_for_does_not_matter(tmp_path):
    write_bags(tmp_path, kind="ros1", count=3)
    (tmp_path / "throw1.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(FileFormatError, match=r"throw1\.bag as a ROS bag"):
        read_recordings(tmp_path)
    found = read_recordings(tmp_path, episodes=["throw2", "throw0"])
    assert [recording.episode for recording in found] == ["throw2", "throw0"]


def test_two_episodes_of_one_name(tmp_path):
    (tmp_path / "log.csv").write_text("episode,t,a\nthrow,0,1\nthrow,1,2\n")
    (tmp_path / "throw.csv").write_text("t,a\n0,1\n1,2\n")
    with pytest.raises(InvalidDemonstrationsError, match="more than one episode named throw"):
        read_recordings(tmp_path)

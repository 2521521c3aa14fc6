"""LeRobot data sets in the layouts of both versions."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest

from prior_reinforce.arm.recordings import import_demonstrations, read_recordings
from prior_reinforce.errors import ConfigurationError, FileFormatError
from tests.arm.recordings.recorded import (
    AS_IS,
    JOINTS,
    OUTCOMES,
    N,
    check_motions,
    lerobot_set,
    sampled,
    write_lerobot,
    write_outcomes,
)


@pytest.mark.slow
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


def test_lerobot_without_a_list_of_episodes_is_read_by_its_frames(tmp_path):
    folder = write_lerobot(tmp_path / "set", version="v2.1")
    (folder / "meta" / "episodes.jsonl").unlink()
    assert len(read_recordings(folder)) == N


@pytest.mark.slow
@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
def test_tasks_of_a_data_set_that_holds_several_are_told(tmp_path, version):
    folder = write_lerobot(tmp_path / "set", version=version)
    assert not any("task" in one for r in read_recordings(folder) for one in r.remarks)
    tasks = ["throw" if i < 4 else "reset the table" for i in range(N)]
    if version == "v3.0":  # a list of each, as LeRobot writes them; and plain, as some writers do
        tasks = [[task] for task in tasks]
    if version == "v3.0":
        (path,) = folder.glob("meta/episodes/**/*.parquet")
        table = parquet.read_table(path).drop_columns("tasks")
        parquet.write_table(table.append_column("tasks", pa.array(tasks)), path)
    else:
        path = folder / "meta" / "episodes.jsonl"
        rows = [json.loads(line) for line in path.read_text().splitlines()]
        path.write_text(
            "\n".join(json.dumps(r | {"tasks": t}) for r, t in zip(rows, tasks, strict=True))
        )
    read = read_recordings(folder)
    assert "its task is 'throw'" in read[0].remarks
    assert "its task is 'reset the table'" in read[5].remarks


def test_lerobot_whose_recorder_was_not_finalized(tmp_path):
    folder = write_lerobot(tmp_path / "set")
    path = folder / "data" / "chunk-000" / "file-000.parquet"
    path.write_bytes(path.read_bytes()[:-5000])  # its footer was never written
    with pytest.raises(FileFormatError, match=r"file-000\.parquet .* called finalize\(\)"):
        import_demonstrations(folder, joints=JOINTS)


def test_other_times_of_lerobot_are_held_against_the_rate(tmp_path):
    folder = write_lerobot(tmp_path / "set", version="v2.1")
    info = folder / "meta" / "info.json"
    said = json.loads(info.read_text())
    said["features"]["observation.timestamp"] = {"dtype": "float64", "shape": [1], "names": None}
    info.write_text(json.dumps(said))
    for path in folder.glob("data/**/*.parquet"):
        table = parquet.read_table(path)
        taken = pa.array(1.7e9 + table["frame_index"].to_numpy() / 50)  # written at 100 a second
        parquet.write_table(table.append_column("observation.timestamp", taken), path)
    with pytest.raises(
        FileFormatError, match=r"timestamp says 100 frames .* observation.timestamp"
    ):
        read_recordings(folder)
    recording = read_recordings(folder, time_column="observation.timestamp")[0]
    assert recording.period == pytest.approx(0.02)
    assert read_recordings(folder, time_column="timestamp")[0].period == pytest.approx(0.01)
    for rate in (50, 20):
        with pytest.raises(ConfigurationError, match=rf"--rate {rate}, but fps .* 100 .*none"):
            read_recordings(folder, rate=rate)
        alone = read_recordings(folder, rate=rate, time_column="none")[0]
        assert alone.period == pytest.approx(1 / rate)
    with pytest.raises(FileFormatError, match=r"observation\.timestamp steps by 0\.02"):
        read_recordings(folder, rate=100)


@pytest.mark.parametrize("table", [True, False])
def test_the_folder_above_a_data_set_names_it(tmp_path, table):
    above = tmp_path / "above"
    write_lerobot(above / "throws")
    if table:  # which alone looks like a folder of CSV
        write_outcomes(above)
    with pytest.raises(FileFormatError) as refused:
        import_demonstrations(above)
    assert "say its format" not in str(refused.value)
    assert f"name {above / 'throws'}, which looks like lerobot" in str(refused.value)


@pytest.mark.parametrize("joints", [JOINTS, None])
def test_lerobot_whose_action_alone_has_names(tmp_path, joints):
    folder = lerobot_set(tmp_path / "set", 30, [sampled(0, 30)[1]], [*JOINTS[::-1]])
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    info["features"]["observation.state"]["names"] = None
    path.write_text(json.dumps(info))
    assert read_recordings(folder, joints=joints)[0].names == JOINTS[::-1]


def test_features_of_one_joint_each_are_named(tmp_path):
    folder = lerobot_set(tmp_path / "set", 30, [sampled(0, 30)[1]], [*JOINTS])
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    one = {"dtype": "float32", "shape": [1], "names": None}
    own = {name: said for name, said in info["features"].items() if said["shape"] == [1]}
    info["features"] = own | {"observation.pan.pos": one, "observation.lift.pos": one}
    path.write_text(json.dumps(info))
    there = r"\['observation.pan.pos', 'observation.lift.pos'\]: say which with --key"
    with pytest.raises(FileFormatError, match=there):
        read_recordings(folder)


def test_lerobot_whose_state_is_a_place_says_where_the_joints_are(tmp_path):
    """As converters of Franka and UR write it: names of the state, none of the joints."""
    folder = tmp_path / "set"
    place = np.column_stack([0.1 * sampled(0, 50)[1][:, :3], sampled(0, 50)[1][:, :3]])
    lerobot_set(folder, 50, [place], ["x", "y", "z", "rx", "ry", "rz"])
    info = json.loads((folder / "meta" / "info.json").read_text())
    single = {"dtype": "float32", "shape": [6], "names": None}
    info["features"] |= {"observation.joint_position": single, "observation.joint_vel": single}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    path = folder / "data" / "chunk-000" / "file-000.parquet"
    rows = sampled(0, 50)[1][:, :6]
    frames = parquet.read_table(path)
    for name in ("observation.joint_position", "observation.joint_vel"):
        frames = frames.append_column(name, pa.array(rows.tolist()))
    parquet.write_table(frames, path)
    joints = [f"joint{i}" for i in range(1, 7)]
    with pytest.raises(FileFormatError, match=r"--key observation.joint_position$"):
        read_recordings(folder, joints=joints)
    (one,) = read_recordings(folder, joints=joints, key="observation.joint_position")
    np.testing.assert_allclose(one.positions, rows, atol=1e-6)
    assert read_recordings(folder)[0].names[:3] == ("x", "y", "z")


@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
@pytest.mark.parametrize("of_frames", [True, False])
def test_an_episode_that_is_flagged_as_failed_is_said(tmp_path, version, of_frames):
    motions = [sampled(i, 50)[1] for i in range(2)]
    folder = lerobot_set(tmp_path / "set", 50, motions, [*JOINTS], version)
    meta = folder / "meta"
    if of_frames:
        info = json.loads((meta / "info.json").read_text())
        info["features"]["next.success"] = {"dtype": "bool", "shape": [1], "names": None}
        (meta / "info.json").write_text(json.dumps(info))
        for path in folder.glob("data/**/*.parquet"):
            table = parquet.read_table(path)
            flags = [episode == 0 for episode in table["episode_index"].to_pylist()]
            parquet.write_table(table.append_column("next.success", pa.array(flags)), path)
    elif version == "v2.1":
        rows = map(json.loads, (meta / "episodes.jsonl").read_text().splitlines())
        text = [json.dumps(row | {"success": i == 0}) for i, row in enumerate(rows)]
        (meta / "episodes.jsonl").write_text("\n".join(text))
    else:
        (path,) = meta.glob("episodes/**/*.parquet")
        table = parquet.read_table(path).append_column("success", pa.array([True, False]))
        parquet.write_table(table, path)
    good, bad = read_recordings(folder)
    said = [any("success" in remark for remark in one.remarks) for one in (good, bad)]
    assert said == [False, True]

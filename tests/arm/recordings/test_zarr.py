"""Replay buffers, as folders and zipped."""

import json
import pickle
import shutil

import numpy as np
import pytest
import zarr

from prior_reinforce.arm.recordings import import_demonstrations, read_recordings
from prior_reinforce.arm.recordings.beside import moving_beside
from prior_reinforce.errors import ConfigurationError, FileFormatError
from tests.arm.recordings.recorded import AS_IS, JOINTS, check_motions, write_outcomes, write_zarr


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


@pytest.mark.parametrize("shape", [(-1,), (-1, 1)])
def test_a_replay_buffers_own_times_are_used(tmp_path, shape):
    """As UMI writes them: seconds of a running clock in `data/timestamp`."""
    path = write_zarr(tmp_path)
    root = zarr.open_group(str(path), mode="r+")
    count = root["data/joint_pos"].shape[0]
    root["data"].create_array("timestamp", data=(7.5 + np.arange(count) / 50).reshape(shape))
    (first, *_) = read_recordings(path, key="joint_pos")
    assert first.clock == "timestamp in s"
    assert first.period == pytest.approx(0.02)
    with pytest.raises(ConfigurationError, match="timestamp in s says 50 Hz; drop --rate"):
        read_recordings(path, key="joint_pos", rate=100)
    given = read_recordings(path, key="joint_pos", rate=100, time_column="none")
    assert given[0].period == pytest.approx(0.01)
    with pytest.raises(FileFormatError, match="no array stamp; it holds"):
        read_recordings(path, key="joint_pos", time_column="stamp")


class Runs:
    """Unpickled, it runs code."""

    def __reduce__(self):
        return exec, ("raise SystemExit('code ran')",)


@pytest.mark.parametrize(
    "changes",
    [
        {"dtype": "|O", "filters": [{"id": "pickle", "protocol": 4}], "compressor": None},
        {"filters": [{"id": "pickle", "protocol": 4}], "compressor": None},
        {"compressor": {"id": "some_codec"}},
        {"dtype": [["x", "<f8"]]},
    ],
)
@pytest.mark.parametrize("array", ["data/joint_pos", "meta/episode_ends"])
def test_arrays_that_could_run_code_are_never_opened(tmp_path, changes, array):
    path = write_zarr(tmp_path)
    meta = path / array / ".zarray"
    meta.write_text(json.dumps(json.loads(meta.read_text()) | changes))
    for chunk in (path / array).glob("[0-9]*"):
        chunk.write_bytes(pickle.dumps(np.array([Runs()], dtype=object)))
    with pytest.raises(
        FileFormatError, match=r"no array joint_pos \(expected numbers|no numbers at meta"
    ):
        read_recordings(path, key="joint_pos", rate=50)


def test_a_chunk_that_is_a_link_out_of_the_store_is_not_read(tmp_path):
    path = write_zarr(tmp_path)
    chunk = next((path / "data/joint_pos").glob("[0-9]*"))
    (tmp_path / "secret").write_bytes(chunk.read_bytes())
    chunk.unlink()
    chunk.symlink_to(tmp_path / "secret")
    with pytest.raises(FileFormatError, match="is a link out of"):
        read_recordings(path, key="joint_pos", rate=50)


def test_a_store_that_claims_too_much_is_not_read(tmp_path):
    path = write_zarr(tmp_path)
    meta = path / "data/joint_pos/.zarray"
    meta.write_text(json.dumps(json.loads(meta.read_text()) | {"shape": [10**12, 7]}))
    with pytest.raises(FileFormatError, match="no recording of throws"):
        read_recordings(path, key="joint_pos", rate=50)


def test_consolidated_metadata_says_nothing(tmp_path):
    """What is checked is what is read: metadata that says all a second time could say otherwise."""
    path = write_zarr(tmp_path)
    good = read_recordings(path, key="joint_pos", rate=50)
    zarr.consolidate_metadata(str(path))
    whole = path / ".zmetadata"
    whole.write_text(whole.read_text().replace("<f8", "<i8"))
    again = read_recordings(path, key="joint_pos", rate=50)
    np.testing.assert_array_equal(again[0].positions, good[0].positions)


def test_attributes_name_the_joints_and_a_gripper_is_named(tmp_path):
    path = write_zarr(tmp_path)
    root = zarr.open_group(str(path), mode="r+")
    root["data/joint_pos"].attrs["names"] = [*JOINTS[::-1]]
    root["data"].create_array("grip", data=np.array(root["data/joint_pos"][:, 1:2]) ** 2)
    (first, *_) = read_recordings(path, key="joint_pos", rate=50, joints=JOINTS)
    assert first.names == JOINTS[::-1]
    assert [*moving_beside([first])] == ["grip"]


def test_attributes_name_the_joints_and_the_rate_however_deep(tmp_path):
    path = write_zarr(tmp_path)
    root = zarr.open_group(str(path), mode="r+")
    root.attrs["info"] = {"robot": {"joint_names": [*JOINTS[::-1]]}, "fps": 50, "length": 9}
    (first, *_) = read_recordings(path, key="joint_pos", joints=JOINTS)
    assert (first.names, first.clock) == (JOINTS[::-1], "fps in the file")
    root.attrs["more"] = {"joint_names": [*JOINTS]}
    with pytest.raises(
        FileFormatError, match=r"info\.robot\.joint_names says .* more\.joint_names"
    ):
        read_recordings(path, key="joint_pos", joints=JOINTS)


def test_what_moves_at_a_rate_of_its_own_is_named(tmp_path):
    path = write_zarr(tmp_path)
    root = zarr.open_group(str(path), mode="r+")
    root["data"].create_array("gripper", data=80 + 100 * root["data/joint_pos"][::2, 1])
    (first, *_) = read_recordings(path, key="joint_pos", rate=50)
    assert [name.split(" (")[0] for name in moving_beside([first])] == ["gripper"]


def test_an_episode_that_is_flagged_as_failed_is_said(tmp_path):
    path = write_zarr(tmp_path)
    group = zarr.open_group(str(path), mode="a", zarr_format=2)
    group["meta"].create_array("success", data=np.arange(6) != 2)
    read = read_recordings(path, key="joint_pos", rate=50)
    said = [one.episode for one in read if any("success" in remark for remark in one.remarks)]
    assert said == ["2"]

"""Replay buffers, as folders and zipped."""

import shutil

import numpy as np
import pytest
import zarr

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.importing import import_demonstrations, read_recordings
from tests.importing.recorded import AS_IS, JOINTS, check_motions, write_outcomes, write_zarr


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


def test_a_replay_buffers_own_times_are_used(tmp_path):
    """As UMI writes them: seconds of a running clock in `data/timestamp`."""
    path = write_zarr(tmp_path)
    root = zarr.open_group(str(path), mode="r+")
    count = root["data/joint_pos"].shape[0]
    root["data"].create_array("timestamp", data=7.5 + np.arange(count) / 50)
    (first, *_) = read_recordings(path, key="joint_pos")
    assert first.clock == "timestamp in s"
    assert first.period == pytest.approx(0.02)
    with pytest.raises(ConfigurationError, match="timestamp in s says 50 Hz; drop --rate"):
        read_recordings(path, key="joint_pos", rate=100)
    given = read_recordings(path, key="joint_pos", rate=100, time_column="none")
    assert given[0].period == pytest.approx(0.01)
    with pytest.raises(FileFormatError, match="no array stamp in data/; it has"):
        read_recordings(path, key="joint_pos", time_column="stamp")

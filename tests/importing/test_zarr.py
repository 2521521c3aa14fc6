"""Replay buffers, as folders and zipped."""

import shutil

import pytest
import zarr

from prior_reinforce.errors import FileFormatError
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

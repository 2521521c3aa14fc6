"""robomimic data sets and DROID trajectories."""

import h5py
import numpy as np
import pytest

from prior_reinforce.errors import FileFormatError
from prior_reinforce.importing import Preprocessing, import_demonstrations, read_recordings
from tests.importing.recorded import (
    AS_IS,
    JOINTS,
    N,
    check_motions,
    sampled,
    throw,
    write_droid,
    write_outcomes,
    write_robomimic,
)


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

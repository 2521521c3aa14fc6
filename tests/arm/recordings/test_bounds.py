"""Small files that claim or unpack to floods are refused before anything is allocated."""

import json
import resource
import subprocess
import sys
import zipfile

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zarr

from prior_reinforce.arm.recordings import read_recordings
from prior_reinforce.arm.recordings.bounds import (
    check_chunks,
    check_names,
    check_numbers,
    check_rows,
)
from prior_reinforce.errors import FileFormatError

ADDRESS_SPACE = 4_000_000_000
"""Bytes a refusal may take, with all libraries: what they map, not what they use."""


def comma_csv(folder):
    (folder / "a.csv").write_text("," * 3_000_000)


def wide_csv(folder):
    row = ",".join(["1"] * 100_000)
    (folder / "a.csv").write_text(f"{row}\n{row}\n{row}\n")


def npz_bomb(folder):
    head = {"descr": "<f8", "fortran_order": False, "shape": (60_000_000, 1)}
    with (
        zipfile.ZipFile(folder / "a.npz", "w", zipfile.ZIP_DEFLATED) as packed,
        packed.open("q.npy", "w", force_zip64=True) as file,
    ):
        np.lib.format.write_array_header_1_0(file, head)
        for _ in range(480):
            file.write(bytes(1_000_000))


def npy_claim(folder):
    with (folder / "a.npy").open("wb") as file:
        head = {"descr": "<f8", "fortran_order": False, "shape": (10**12, 7)}
        np.lib.format.write_array_header_1_0(file, head)


def hdf5_zeros(folder):
    with h5py.File(folder / "a.hdf5", "w") as file:
        file.create_dataset(
            "data/demo_0/obs/robot0_joint_pos", (1_000_000_000, 1), "u1", compression="gzip"
        )


def hdf5_chunk(folder):
    with h5py.File(folder / "a.hdf5", "w") as file:
        file.create_dataset(
            "data/demo_0/obs/robot0_joint_pos",
            (10, 7),
            "f8",
            maxshape=(None, 7),
            chunks=(60_000_000, 1),
        )


def parquet_rows(folder):
    (folder / "meta").mkdir()
    (folder / "data").mkdir()
    state = {"dtype": "float32", "shape": [2], "names": None}
    info = {"fps": 100, "features": {"observation.state": state}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    n = 26_000_000
    zeros = pa.array(np.zeros(n, dtype=np.int8))
    flat = pa.array(np.zeros(2 * n, dtype=np.float32))
    rows = pa.FixedSizeListArray.from_arrays(flat, 2)
    table = pa.table({"episode_index": zeros, "frame_index": zeros, "observation.state": rows})
    pq.write_table(table, folder / "data" / "a.parquet")


def zarr_store(folder, shape, chunks, claimed=None):
    root = zarr.open_group(str(folder / "a.zarr"), mode="w", zarr_format=2)
    root.create_group("meta").create_array("episode_ends", data=np.array([shape[0]]))
    data = root.create_group("data")
    data.create_array("q", shape=shape, chunks=chunks, dtype="f8")
    if claimed:
        data["q"][:] = 1.0
        path = folder / "a.zarr" / "data" / "q" / ".zarray"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"chunks": claimed}))
    return folder / "a.zarr"


def zarr_chunk(folder):
    zarr_store(folder, (10, 7), (60_000_000, 1))


def zarr_tiny_chunks(folder):
    zarr_store(folder, (20_000, 7), (1, 1))


FLOODS = (
    comma_csv, wide_csv, npz_bomb, hdf5_zeros, hdf5_chunk, parquet_rows, zarr_chunk,
    zarr_tiny_chunks,
)  # fmt: skip


def refused(source):
    """What a process of its own says that may not even map what a flood would take."""
    code = (
        "import sys\n"
        "from prior_reinforce.arm.recordings import read\n"
        "from prior_reinforce.arm.recordings.options import ReadOptions\n"
        "from prior_reinforce.errors import FileFormatError\n"
        "try:\n    read(sys.argv[1], ReadOptions(rate=100.0))\n"
        "except FileFormatError as error:\n    print(error)\n"
    )
    limits = (ADDRESS_SPACE, ADDRESS_SPACE)
    done = subprocess.run(
        [sys.executable, "-c", code, source],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, limits),
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == 1
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("write", FLOODS, ids=lambda write: write.__name__)
def test_floods_are_refused_before_they_are_allocated(tmp_path, write):
    write(tmp_path)
    source = tmp_path / "a.zarr" if (tmp_path / "a.zarr").exists() else tmp_path
    said = refused(source)
    assert "at most" in said or "that is no recording of throws" in said


def test_a_file_that_holds_less_than_it_claims_is_one_line(tmp_path):
    npy_claim(tmp_path)
    with pytest.raises(FileFormatError, match="NPY with plain numbers"):
        read_recordings(tmp_path / "a.npy", rate=50)


@pytest.mark.slow
def test_chunks_of_another_size_than_claimed_are_one_line(tmp_path):
    assert "replay buffer" in refused(zarr_store(tmp_path, (600, 7), (1, 7), [1, 1]))


NAMES = ["a" * 100_000, "a_" * 50_000, "[" * 100_000, "a [" * 30_000, "x(" * 50_000]


@pytest.mark.parametrize("name", NAMES, ids=lambda name: name[:3])
def test_long_names_meet_no_pattern(tmp_path, name):
    np.savez(tmp_path / "a.npz", q=np.zeros((3, 2)), rate=20.0, joint_names=[name, "b"])
    with pytest.raises(FileFormatError, match=r"has a name of \d+ characters"):
        read_recordings(tmp_path / "a.npz")
    (tmp_path / "a.csv").write_text(f"t,{name}\n0,1\n1,2\n")
    with pytest.raises(FileFormatError, match=r"has a name of \d+ characters"):
        read_recordings(tmp_path / "a.csv")


def test_an_episode_of_many_digits_is_named_and_not_counted(tmp_path):
    (tmp_path / "a.csv").write_text(
        "episode,t,q\n" + "".join(f"{'9' * 5000},{t},1\n" for t in "012")
    )
    with pytest.raises(FileFormatError, match="a name of 5000 characters"):
        read_recordings(tmp_path / "a.csv")


@pytest.mark.parametrize("shape", [None, ["2"], 5, {}, [None]])
def test_shapes_of_lerobot_that_are_none(tmp_path, shape):
    (tmp_path / "meta").mkdir()
    state = {"dtype": "float32", "shape": shape}
    info = {"fps": 100, "features": {"observation.state": state}}
    (tmp_path / "meta" / "info.json").write_text(json.dumps(info))
    with pytest.raises(FileFormatError):
        read_recordings(tmp_path)


def test_a_time_step_of_nothing_is_refused(tmp_path):
    np.savez(tmp_path / "a.npz", q=np.zeros((3, 2)), dt=1e-300)
    with pytest.raises(FileFormatError, match="frames a second"):
        read_recordings(tmp_path / "a.npz")


def test_the_bounds_themselves(tmp_path):
    check_numbers(tmp_path, "q", (10_000_000,))
    with pytest.raises(FileFormatError, match=r"q has shape \(7, 1440000\)"):
        check_numbers(tmp_path, "q", (7, 1_440_000))
    check_chunks(tmp_path, "q", (10_000, 7), (1, 7))
    with pytest.raises(FileFormatError, match="10001 chunks"):
        check_chunks(tmp_path, "q", (10_001, 7), (1, 7))
    check_names("a file", ["a" * 200])
    with pytest.raises(FileFormatError, match="a file has a name of 201 characters"):
        check_names("a file", ["a" * 201])
    check_rows("a file", [(1, ["t", "q", ""]), (2, ["0"]), (3, ["1", "2"])])
    with pytest.raises(FileFormatError, match="3 names in line 2, and 2 cells"):
        check_rows("a file", [(2, ["t", "q1", "q2"]), (3, ["1", "2"]), (4, ["1"])])

"""Damaged recordings: truncated, bit-flipped, NaN. Never a traceback, always a named error."""

import shutil
import warnings

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recorded import (
    JOINTS,
    OUTCOMES,
    N,
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
    FileFormatError,
    InvalidDemonstrationsError,
    PriorReinforceError,
)
from prior_reinforce.importing import import_demonstrations, read_recordings

WRITERS = {
    "npz": lambda folder: write_npz(folder, rate=50),
    "csv": lambda folder: write_csv(folder, rate=50),
    "lerobot": lambda folder: write_lerobot(folder / "set", rate=50),
    "robomimic": write_robomimic,
    "droid": write_droid,
    "zarr": write_zarr,
    "ros1": lambda folder: write_bags(folder, kind="ros1", rate=20, count=2),
    "sqlite": lambda folder: write_bags(folder, kind="sqlite", rate=20, count=2),
    "mcap": lambda folder: write_bags(folder, kind="mcap", rate=20, count=2),
}


FEWER = dict.fromkeys(("ros1", "sqlite", "mcap"), 2)
OPTIONS = {"zarr": {"key": "joint_pos", "rate": 50}}


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    """One good recording of each format, with its outcomes."""
    folders = {}
    for name, write in WRITERS.items():
        folder = tmp_path_factory.mktemp(name) / "recording"
        folder.mkdir()
        write(folder)
        few = {key: OUTCOMES[key] for key in list(OUTCOMES)[: FEWER.get(name, N)]}
        write_outcomes(folder, few)
        folders[name] = folder
    return folders


def source_of(folder, name):
    return {
        "lerobot": folder / "set",
        "robomimic": folder / "demos.hdf5",
        "zarr": folder / "replay_buffer.zarr",
    }.get(name, folder)


@pytest.mark.parametrize("name", WRITERS)
def test_the_originals_are_good(originals, name):
    result = import_demonstrations(
        source_of(originals[name], name), joints=JOINTS, **OPTIONS.get(name, {})
    )
    assert result.demonstrations.n == FEWER.get(name, N)


damage = given(
    cut=st.booleans(),
    file=st.floats(0, 1, exclude_max=True),
    where=st.floats(0, 1, exclude_max=True),
    bit=st.integers(0, 7),
)


def tries(n):
    """So many examples; each damages a fresh copy, so sharing the folder between them is safe."""
    unsafe = [HealthCheck.function_scoped_fixture]
    return settings(max_examples=n, deadline=None, suppress_health_check=unsafe)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["npz", "csv", "robomimic"])
@tries(100)
@damage
def test_damaged_bytes(originals, tmp_path, name, cut, file, where, bit):
    import_damaged(originals[name], tmp_path, name, cut, file, where, bit)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lerobot", "droid", "zarr", "ros1", "sqlite", "mcap"])
@tries(25)
@damage
def test_damaged_bytes_of_slower_formats(originals, tmp_path, name, cut, file, where, bit):
    import_damaged(originals[name], tmp_path, name, cut, file, where, bit)


def import_damaged(original, tmp_path, name, cut, file, where, bit):
    """Import a copy with one file cut short or one bit flipped; only named errors may come."""
    folder = tmp_path / "damaged"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(original, folder)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    path = files[int(file * len(files))]
    content = bytearray(path.read_bytes())
    position = int(where * len(content))
    if cut:
        content = content[:position]
    else:
        content[position] ^= 1 << bit
    path.write_bytes(bytes(content))
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    with warnings.catch_warnings():
        # A flipped bit may make an angle that looks like degrees; that is a warning's business.
        warnings.simplefilter("ignore", UserWarning)
        try:
            result = import_demonstrations(
                source_of(folder, name), joints=JOINTS, **OPTIONS.get(name, {})
            )
        except PriorReinforceError as error:
            message = str(error)
        else:
            message = "a flipped bit that no format protects"
            assert np.all(np.isfinite(result.demonstrations.plans))
    assert message
    assert "\n" not in message
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("name", ["npz", "csv", "robomimic"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_named_with_its_episode_and_frame(
    originals, tmp_path, name, value
):
    folder = tmp_path / "recording"
    shutil.copytree(originals[name], folder)
    if name == "npz":
        with np.load(folder / "throw_2.npz") as archive:
            content = {key: np.array(archive[key]) for key in archive.files}
        content["q"][7, 3] = value
        np.savez(folder / "throw_2.npz", **content)
    elif name == "csv":
        lines = (folder / "2.csv").read_text().splitlines()
        cells = lines[8].split(",")
        lines[8] = ",".join([*cells[:4], str(value), *cells[5:]])
        (folder / "2.csv").write_text("\n".join(lines))
    else:
        with h5py.File(folder / "demos.hdf5", "a") as file:
            file["data/demo_2/obs/robot0_joint_pos"][7, 3] = value
    with pytest.raises(InvalidDemonstrationsError, match=r"2: joint4 is (nan|inf) at frame 7"):
        import_demonstrations(source_of(folder, name))


def test_pickled_objects_are_never_loaded(tmp_path):
    np.savez(tmp_path / "bad.npz", q=np.array([{"a": 1}, None], dtype=object), dt=0.01)
    with pytest.raises(FileFormatError, match="plain number arrays"):
        read_recordings(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"q": np.zeros((5, 2))}, "give the rate"),
        ({"angles": np.zeros((5, 2)), "dt": 0.01}, r"no array q .* it holds \['angles', 'dt'\]"),
        ({"q": np.zeros(5), "dt": 0.01}, r"expected numbers of shape \(T, D\)"),
        ({"q": np.zeros((5, 2)), "t": np.zeros(4)}, "has times"),
        ({"q": np.zeros((5, 2)), "t": np.zeros(5)}, "time does not increase at frame 1"),
        ({"q": np.zeros((5, 2)), "t": np.full(5, np.nan)}, "time is nan at frame 0"),
        ({"q": np.zeros((5, 2)), "dt": np.zeros(3)}, "times t, or dt, or rate"),
        ({"q": np.zeros((5, 2)), "dt": 0.01, "names": np.array(["a", "a"])}, "repeats a channel"),
        ({"q": np.zeros((5, 2)), "dt": 0.01, "names": np.array(["a"])}, "for 1 channels"),
        ({"q": np.array([["a", "b"]] * 5), "dt": 0.01}, "expected numbers"),
        ({"q": np.zeros((2, 5, 2)), "dt": 0.01, "outcomes": np.zeros(3)}, "outcomes have shape"),
    ],
)
def test_npz_of_other_content(tmp_path, arrays, says):
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(PriorReinforceError, match=says):
        read_recordings(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has 0 lines"),
        ("t,a\n0,1\n", "has 2 lines"),
        ("t,a\n0,1\n0.1\n", "line 3: 1 cells for 2 columns"),
        ("t,a\n0,1\n0.1,x\n", "line 3: a is 'x'"),
        ("a,b\n0,1\n1,2\n", "give the rate"),
        ("t,a\n0.1,1\n0.0,2\n", "time does not increase"),
        ("t,a,a\n0,1,1\n0.1,2,2\n", "repeats a channel name"),
        ('t,a\n0,"1\n0.1,2\n', "as CSV in UTF-8"),
        ("t\n0\n1\n", "for 0 channels"),
    ],
)
def test_csv_of_other_content(tmp_path, text, says):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(PriorReinforceError, match=says):
        read_recordings(tmp_path / "bad.csv")


@pytest.mark.parametrize("rate", [0.0, -5.0, float("nan")])
def test_the_rate_is_checked(originals, rate):
    with pytest.raises(PriorReinforceError, match="positive number of frames a second"):
        read_recordings(originals["npz"], rate=rate)

"""320 damaged or odd recordings: taken in, or refused in one line with nothing changed.

Seeded: the same each time.
"""

import contextlib
import hashlib
import io
import re
import shutil
import warnings

import h5py
import numpy as np
import pandas as pd
import pytest
import zarr

from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.cli import main
from tests.bench.importing import recorded
from tests.bench.workspace.planar import demonstrations, manifest

EACH = 20
REMEDY = re.compile(
    r"give|say|write|mend|name|drop|add|export|copy|expected|record|choose|correct|measure|leave "
    r"out|rename|need|want|demonstrate",
    re.IGNORECASE,
)
T = np.arange(24) * 0.02
PLANS = demonstrations().plans


def frames(i):
    return pd.DataFrame({"t": T, "joint1": PLANS[i][:, 0], "joint2": PLANS[i][:, 1]})


def csv(folder):
    for i in range(4):
        frames(i).to_csv(folder / f"{i}.csv", index=False)
    return folder


def semicolons(folder):
    for i in range(4):
        frames(i).to_csv(folder / f"{i}.csv", sep=";", decimal=",")
    return folder


def headless(folder):
    for i in range(4):
        frames(i).to_csv(folder / f"{i}.csv", index=False, header=False)
    return folder


def together(folder):
    parts = [frames(i).assign(episode=i) for i in range(4)]
    pd.concat(parts).to_csv(folder / "all.csv", index=False)
    return folder


def degrees(folder):
    for i in range(4):
        frame = frames(i)
        frame["t"] *= 1000
        frame[["joint1", "joint2"]] = np.rad2deg(frame[["joint1", "joint2"]])
        frame.to_csv(folder / f"{i}.csv", index=False)
    return folder


def workbook(folder):
    for i in range(4):
        frames(i).to_excel(folder / f"{i}.xlsx", index=False)
    return folder


def npz(folder):
    for i in range(4):
        np.savez(folder / f"{i}.npz", t=T, q=PLANS[i], joint_names=["joint1", "joint2"])
    return folder


def npy(folder):
    np.save(folder / "all.npy", PLANS)
    return folder


def robomimic(folder):
    with h5py.File(folder / "demos.hdf5", "w") as file:
        file.create_group("data").attrs["env_args"] = '{"env_kwargs": {"control_freq": 50}}'
        for i in range(4):
            file[f"data/demo_{i}/obs/robot0_joint_pos"] = PLANS[i]
    return folder / "demos.hdf5"


def droid(folder):
    for i in range(4):
        (folder / str(i)).mkdir()
        with h5py.File(folder / str(i) / "trajectory.h5", "w") as file:
            file["observation/robot_state/joint_positions"] = PLANS[i]
            file["observation/timestamp/control/step_start"] = np.round(1000 * T).astype(int)
    return folder


def replay_buffer(folder):
    root = zarr.open_group(str(folder / "all.zarr"), mode="w", zarr_format=2)
    root.create_group("data").create_array("joint_pos", data=np.concatenate(PLANS))
    root["data"].create_array("timestamp", data=np.tile(T, 4))
    root.create_group("meta").create_array("episode_ends", data=24 * np.arange(1, 5))
    return folder / "all.zarr"


def blanks(folder):
    for i in range(4):
        rows = frames(i)
        header = " ".join(rows.columns)
        np.savetxt(folder / f"{i}.csv", rows, header=header)
    return folder


def lerobot(folder):
    return recorded.write_lerobot(folder / "set", 20)


def bags(folder, kind):
    return recorded.write_bags(folder, kind=kind, count=4, rate=20, names=("joint1", "joint2"))


def ros1(folder):
    return bags(folder, "ros1")


def sqlite(folder):
    return bags(folder, "sqlite")


def mcap(folder):
    return bags(folder, "mcap")


KINDS = (
    csv, semicolons, headless, together, degrees, workbook, npz, npy, robomimic, droid,
    replay_buffer, blanks, lerobot, ros1, sqlite, mcap,
)  # fmt: skip
ODD = (
    b"", b"nan", b"1e400", b"-inf", b"\xff\xfe", b"\0", b'"', b";", b",", b"\t", b"\n", b"abc",
    b"2026-13-45", b"99999999999999999999", b"1.234,5", b"=SUM(A1)", "µ°".encode(), b"--", b"../x",
)  # fmt: skip


def damage(content, rng):
    """One odd thing done to the bytes of a file."""
    content = bytearray(content)
    at = int(rng.integers(max(len(content), 1)))
    match int(rng.integers(7)):
        case 0:
            del content[at:]
        case 1 if content:
            content[at] ^= 1 << int(rng.integers(8))
        case 2:
            odd = ODD[int(rng.integers(len(ODD)))]
            content[at : at + len(odd)] = odd
        case 3:
            content = content[:at] + content[at // 2 :]
        case 4:
            lines = bytes(content).split(b"\n")
            rng.shuffle(lines)
            content = bytearray(b"\n".join(lines))
        case 5:
            lines = bytes(content).split(b"\n")
            lines[int(rng.integers(len(lines)))] = ODD[int(rng.integers(len(ODD)))]
            content = bytearray(b"\n".join(lines))
        case _:
            content = bytearray(content * 2)
    return bytes(content)


def fingerprint(folder):
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.endswith(("-wal", "-shm"))
    }


@pytest.mark.slow
@pytest.mark.parametrize("write", KINDS, ids=lambda write: write.__name__)
def test_odd_recordings_are_refused_in_one_line_and_change_nothing(tmp_path, write):
    original = tmp_path / "original"
    original.mkdir()
    inside = write(original).relative_to(original)
    outcomes = list(recorded.OUTCOMES.items())[: 6 if write is lerobot else 4]
    recorded.write_outcomes(original, dict(outcomes))
    with Workspace.create(tmp_path / "hoop", manifest()):
        pass
    rng = np.random.default_rng(KINDS.index(write))
    statuses = []
    for _ in range(EACH):
        folder = tmp_path / "odd"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(original, folder)
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        path = files[int(rng.integers(len(files)))]
        path.write_bytes(damage(path.read_bytes(), rng))
        shutil.copytree(tmp_path / "hoop", tmp_path / "copy")
        before = fingerprint(folder), fingerprint(tmp_path / "copy")
        said = io.StringIO()
        command = ["import", str(tmp_path / "copy"), str(folder / inside)]
        with (
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(said),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore", UserWarning)
            statuses.append(main(command))
        assert statuses[-1] in (0, 2)
        assert fingerprint(folder) == before[0]
        if statuses[-1] == 2:
            lines = said.getvalue().strip().splitlines()
            assert len(lines) == 1, lines
            assert REMEDY.search(lines[0]), lines[0]
            assert len(lines[0]) < 1200, lines[0]
            assert fingerprint(tmp_path / "copy") == before[1]
        shutil.rmtree(tmp_path / "copy")
    assert 2 in statuses

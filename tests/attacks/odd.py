"""Recordings as people have them beside the formats' own libraries, small and of two joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import zarr

from tests.arm.workspace.planar import demonstrations

T = np.arange(24) * 0.02
PLANS = demonstrations().plans


def frames(i: int) -> pd.DataFrame:
    return pd.DataFrame({"t": T, "joint1": PLANS[i][:, 0], "joint2": PLANS[i][:, 1]})


def csv(folder: Path) -> Path:
    for i in range(4):
        frames(i).to_csv(folder / f"{i}.csv", index=False)
    return folder


def semicolons(folder: Path) -> Path:
    for i in range(4):
        frames(i).to_csv(folder / f"{i}.csv", sep=";", decimal=",")
    return folder


def headless(folder: Path) -> Path:
    for i in range(4):
        frames(i).to_csv(folder / f"{i}.csv", index=False, header=False)
    return folder


def together(folder: Path) -> Path:
    parts = [frames(i).assign(episode=i) for i in range(4)]
    pd.concat(parts).to_csv(folder / "all.csv", index=False)
    return folder


def degrees(folder: Path) -> Path:
    for i in range(4):
        frame = frames(i)
        frame["t"] *= 1000
        frame[["joint1", "joint2"]] = np.rad2deg(frame[["joint1", "joint2"]])
        frame.to_csv(folder / f"{i}.csv", index=False)
    return folder


def npz(folder: Path) -> Path:
    for i in range(4):
        np.savez(folder / f"{i}.npz", t=T, q=PLANS[i], joint_names=["joint1", "joint2"])
    return folder


def npy(folder: Path) -> Path:
    np.save(folder / "all.npy", PLANS)
    return folder


def robomimic(folder: Path) -> Path:
    with h5py.File(folder / "demos.hdf5", "w") as file:
        file.create_group("data").attrs["env_args"] = '{"env_kwargs": {"control_freq": 50}}'
        for i in range(4):
            file[f"data/demo_{i}/obs/robot0_joint_pos"] = PLANS[i]
    return folder / "demos.hdf5"


def replay_buffer(folder: Path) -> Path:
    root = zarr.open_group(str(folder / "all.zarr"), mode="w", zarr_format=2)
    root.create_group("data").create_array("joint_pos", data=np.concatenate(PLANS))
    root["data"].create_array("timestamp", data=np.tile(T, 4))
    root.create_group("meta").create_array("episode_ends", data=24 * np.arange(1, 5))
    return folder / "all.zarr"


def blanks(folder: Path) -> Path:
    for i in range(4):
        rows = frames(i)
        header = " ".join(rows.columns)
        np.savetxt(folder / f"{i}.csv", rows, header=header)
    return folder


_ALL = (
    *(csv, semicolons, headless, together, degrees, npz, npy, robomimic),
    *(replay_buffer, blanks),
)
WRITERS: dict[str, Callable[[Path], Path]] = {write.__name__: write for write in _ALL}
"""By name; each returns what is imported: the folder, or a file in it."""

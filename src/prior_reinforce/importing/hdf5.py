"""Recordings in HDF5: robomimic data sets and DROID trajectories.

robomimic (0.3, scripts/dataset_states_to_obs.py): `data/demo_k/...` with the rate in the JSON
attribute `env_args` of `data` where robosuite made it. DROID: one `trajectory.h5` an episode.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.errors import FileFormatError
from prior_reinforce.importing.files import load_extra, named_damage, natural_order
from prior_reinforce.importing.recording import Reading, Recording, evenly, made_up_names

_ROBOMIMIC_KEY = "obs/robot0_joint_pos"
"""robosuite's name of the first arm's joint positions; `actions` are mostly pose increments."""
_DROID_KEY = "observation/robot_state/joint_positions"
_DROID_TIMES_MS = (
    "observation/timestamp/robot_state/read_start",
    "observation/timestamp/control/step_start",
)
SUFFIXES = (".h5", ".hdf5")


def read_robomimic(source: Path, reading: Reading) -> list[Recording]:
    """Read every `data/demo_k` of a robomimic file."""
    h5py = load_extra("h5py", "hdf5")
    path = _only_file(source)
    key = reading.key or _ROBOMIMIC_KEY
    with named_damage(path, "robomimic HDF5"), h5py.File(path, "r") as file:
        if "data" not in file:
            raise FileFormatError(
                f"{path} has no group `data` but {sorted(file)}; expected a robomimic file: say "
                "its format"
            )
        data = file["data"]
        rate = reading.rate or _control_rate(data)
        recordings = []
        for episode in sorted(data, key=natural_order):
            if not reading.wants(episode):
                continue
            positions = _array(path, data[episode], key, f"data/{episode}")
            declared = data[episode].attrs.get("num_samples")
            if declared is not None and int(declared) != positions.shape[0]:
                raise FileFormatError(
                    f"{path}: {episode} declares {int(declared)} samples but {key} holds "
                    f"{positions.shape[0]}; copy the file again, or leave that episode out"
                )
            times = evenly(positions.shape[0], rate, episode)
            recordings.append(_unnamed(episode, times, positions))
    return recordings


def read_droid(source: Path, reading: Reading) -> list[Recording]:
    """Read a `trajectory.h5`, or every one below a folder; an episode is named by its folder."""
    h5py = load_extra("h5py", "hdf5")
    if source.is_dir():
        paths = sorted(source.rglob("trajectory.h5"), key=lambda path: natural_order(str(path)))
    else:
        paths = [source]
    key = reading.key or _DROID_KEY
    recordings = []
    for path in paths:
        episode = path.parent.name if path.name == "trajectory.h5" else path.stem
        if not reading.wants(episode):
            continue
        with named_damage(path, "DROID HDF5"), h5py.File(path, "r") as file:
            positions = _array(path, file, key, "the file")
            stamps = next((name for name in _DROID_TIMES_MS if name in file), None)
            if reading.rate is None and stamps is not None:
                times = np.asarray(file[stamps][()], dtype=np.float64) / 1000.0
            else:
                times = evenly(positions.shape[0], reading.rate, episode)
            recordings.append(_unnamed(episode, times, positions))
    return recordings


def _unnamed(episode: str, times: np.ndarray, positions: np.ndarray) -> Recording:
    names = made_up_names(positions.shape[1])
    return Recording(episode, times, positions, names, named=False)


def _array(path: Path, group: Any, key: str, where: str) -> np.ndarray:
    """The motion under a key, or an error that lists what could be meant."""
    candidates: list[str] = []

    def collect(name: str, item: Any) -> None:
        shape = getattr(item, "shape", None)
        if shape is not None and len(shape) == 2 and item.dtype.kind in "fiu":
            candidates.append(name)

    if key not in group or len(getattr(group[key], "shape", ())) != 2:
        group.visititems(collect)
        raise FileFormatError(
            f"{path} has no array (T, D) at {key} in {where}; arrays of that shape are "
            f"{sorted(candidates) or 'none'}: say which with the key"
        )
    if group[key].dtype.kind not in "fiu":
        raise FileFormatError(f"{path}: {key} holds {group[key].dtype}, expected numbers")
    return np.asarray(group[key][()], dtype=np.float64)


def _control_rate(data: Any) -> float | None:
    """Control frequency of robosuite, where the file has it."""
    text = data.attrs.get("env_args")
    if text is None:
        return None
    rate = json.loads(text).get("env_kwargs", {}).get("control_freq")
    return float(rate) if rate else None


def _only_file(source: Path) -> Path:
    if not source.is_dir():
        return source
    found = [path for path in sorted(source.iterdir()) if path.suffix.lower() in SUFFIXES]
    if len(found) != 1:
        raise FileFormatError(
            f"{source} holds {len(found)} HDF5 files, expected one; give the path of the file"
        )
    return found[0]

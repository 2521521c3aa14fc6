"""Recordings in HDF5: robomimic data sets and DROID trajectories.

robomimic (0.3, scripts/dataset_states_to_obs.py): `data/demo_k/...` with the rate in the JSON
attribute `env_args` of `data` where robosuite made it. DROID: one `trajectory.h5` an episode.
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.bench.importing.bounds import check_numbers
from prior_reinforce.bench.importing.clock import Stamps
from prior_reinforce.bench.importing.options import ReadOptions
from prior_reinforce.bench.importing.recording import (
    Episodes,
    Positions,
    Recording,
    files_at,
    has_files,
    named_damage,
    natural_order,
    recorded,
)
from prior_reinforce.errors import FileFormatError

_SUFFIXES = (".h5", ".hdf5")
_TRAJECTORY = "trajectory.h5"
_ROBOMIMIC_KEY = "obs/robot0_joint_pos"
"""robosuite's name of the first arm's joint positions; `actions` are mostly pose increments."""
_DROID_KEY = "observation/robot_state/joint_positions"
_DROID_TIMES_MS = (
    "observation/timestamp/robot_state/read_start",
    "observation/timestamp/control/step_start",
)


def is_droid(source: Path) -> bool:
    """Whether a path looks like DROID."""
    if source.is_dir():
        return next(source.rglob(_TRAJECTORY), None) is not None
    return source.name == _TRAJECTORY


def is_robomimic(source: Path) -> bool:
    """Whether a path looks like robomimic."""
    return has_files(source, _SUFFIXES) and not is_droid(source)


def read_robomimic(source: Path, options: ReadOptions) -> Episodes:
    """Read every `data/demo_k` of a robomimic file."""
    import h5py

    paths = files_at(source, _SUFFIXES)
    if len(paths) != 1:
        raise FileFormatError(
            f"{source} holds {len(paths)} HDF5 files, expected one; give the path of the file"
        )
    (path,) = paths
    with named_damage(path, "robomimic HDF5"), h5py.File(path, "r") as file:
        if "data" not in file:
            raise FileFormatError(
                f"{path} has no group `data` but {sorted(file)}; expected a robomimic file: say "
                "its format"
            )
        data = _own(path, file, "data")
        made_by = json.loads(data.attrs.get("env_args", "{}"))
        rate = made_by.get("env_kwargs", {}).get("control_freq")
        for episode in sorted(data, key=natural_order):
            yield episode, partial(_demo, path, data, episode, rate, options)


def _demo(
    path: Path, data: Any, episode: str, rate: float | None, options: ReadOptions
) -> Recording:
    key = options.key or _ROBOMIMIC_KEY
    with named_damage(path, "robomimic HDF5"):
        group = _own(path, data, episode)
        positions = _motion(path, group, key, f"data/{episode}")
        declared = int(group.attrs.get("num_samples", len(positions)))
        rate = float(rate) if rate else None
    if declared != len(positions):
        raise FileFormatError(
            f"{path}: {episode} declares {declared} samples but {key} holds {len(positions)}; "
            "copy the file again, or leave that episode out"
        )
    clock = options.clock(episode, len(positions), name="control_freq", own_rate=rate)
    return recorded(episode, clock, positions)


def read_droid(source: Path, options: ReadOptions) -> Episodes:
    """Read a `trajectory.h5`, or every one below a folder; an episode is named by its folder."""
    paths = [source]
    if source.is_dir():
        paths = sorted(source.rglob(_TRAJECTORY), key=natural_order)
    for path in paths:
        episode = path.parent.name if path.name == _TRAJECTORY else path.stem
        yield episode, partial(_trajectory, path, episode, options)


def _trajectory(path: Path, episode: str, options: ReadOptions) -> Recording:
    import h5py

    with named_damage(path, "DROID HDF5"), h5py.File(path, "r") as file:
        positions = _motion(path, file, options.key or _DROID_KEY, "the file")
        name = next((name for name in _DROID_TIMES_MS if name in file), "")
        stamps = _numbers(path, name, _own(path, file, name)) if name else None
        clock = options.clock(episode, len(positions), stamps=stamps, name=name, unit="ms")
        return recorded(episode, clock, positions)


def _motion(path: Path, group: Any, key: str, where: str) -> Positions:
    """The motion under a key, or an error that lists the candidates."""
    candidates: list[str] = []

    def collect(name: str, item: Any) -> None:
        if len(getattr(item, "shape", None) or ()) == 2 and item.dtype.kind in "fiu":
            candidates.append(name)

    found = _own(path, group, key)
    if len(getattr(found, "shape", ())) != 2:
        group.visititems(collect)
        raise FileFormatError(
            f"{path} has no array (T, D) at {key} in {where}; arrays of that shape are "
            f"{sorted(candidates) or 'none'}: say which with the key"
        )
    if found.dtype.kind not in "fiu":
        raise FileFormatError(f"{path}: {key} holds {found.dtype}, expected numbers")
    return np.asarray(_numbers(path, key, found), dtype=np.float64)


def _numbers(path: Path, name: str, found: Any) -> Stamps:
    """The numbers of an array, unless its header claims more than a recording has."""
    for what, shape in ((name, found.shape), (f"a chunk of {name}", found.chunks or ())):
        check_numbers(path, what, shape, found.dtype.itemsize)
    return np.asarray(found[()])


def _own(path: Path, group: Any, key: str, depth: int = 8) -> Any:
    """The item under a key, None if there is none; never anything of another file.

    A file can refer to others (external links, external storage, virtual data sets), and reading
    it would copy whatever they hold into the workspace.
    """
    import h5py

    for part in filter(None, key.split("/")):
        link = group.get(part, getlink=True) if isinstance(group, h5py.Group) else None
        if isinstance(link, h5py.ExternalLink) or (link is not None and depth == 0):
            raise FileFormatError(
                f"{path}: {key} leads to another file ({getattr(link, 'filename', 'a circle')}), "
                "which is not read; copy the data into one file"
            )
        if isinstance(link, h5py.SoftLink):
            start = group.file if link.path.startswith("/") else group
            group = _own(path, start, link.path, depth - 1)
        else:
            group = None if link is None else group[part]
    if isinstance(group, h5py.Dataset) and (group.external or group.is_virtual):
        raise FileFormatError(
            f"{path}: the numbers of {key} are in another file, which is not read; copy the data "
            "into one file"
        )
    return group

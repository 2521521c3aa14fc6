"""Recordings in HDF5, as robomimic, ManiSkill and ALOHA lay them out.

robomimic (0.3, scripts/dataset_states_to_obs.py): `data/demo_k/...` with the rate in the JSON
attribute `env_args` of `data` where robosuite made it. ManiSkill: `traj_k/...` at the top. ALOHA:
one episode a file, with `observations/qpos`.
"""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.bounds import check_numbers
from prior_reinforce.arm.recordings.clock import Stamps
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import (
    Episodes,
    Positions,
    Recording,
    files_at,
    has_files,
    joined,
    moves_beside,
    named_damage,
    natural_order,
    recorded,
)
from prior_reinforce.errors import FileFormatError

_SUFFIXES = (".h5", ".hdf5")
_KEYS = ("obs/robot0_joint_pos", "obs/agent/qpos", "observations/qpos")
"""Measured positions of the first arm; `actions` are mostly pose increments or targets."""
_EPISODE = re.compile(r"(demo|traj|episode)_?\d+")
_NO_MOTION = re.compile(r"reward|done|success|terminal|action|state|discount", re.IGNORECASE)


def recognises(source: Path) -> bool:
    """Whether a path looks like HDF5."""
    return has_files(source, _SUFFIXES)


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read every episode of a file, or of each file of a folder."""
    import h5py

    paths = files_at(source, _SUFFIXES)
    for path in paths:
        with named_damage(path, "HDF5"), h5py.File(path, "r") as file:
            data = _own(path, file, "data")
            top = data if isinstance(data, h5py.Group) else file
            made_by = json.loads(top.attrs.get("env_args", "{}"))
            said = dict(file.attrs) | dict(top.attrs) | made_by.get("env_kwargs", {})
            episodes = [name for name in top if top is not file or _EPISODE.fullmatch(name)]
            for within in sorted(episodes, key=natural_order) or [""]:
                of_file = [path.stem] if len(paths) > 1 or not within else []
                name = "-".join(filter(None, [*of_file, within]))
                yield name, partial(_demo, path, top, within, said, options, name)


def _demo(
    path: Path, top: Any, within: str, said: dict[str, Any], options: ReadOptions, episode: str
) -> Recording:
    with named_damage(path, "HDF5"):
        group = _own(path, top, within)
        keys = options.key or tuple(k for k in _KEYS if _own(path, group, k) is not None)[:1]
        keys = keys or _KEYS[:1]
        key = keys[0]
        arrays = {name: _motion(path, group, name) for name in keys}
        positions, names = joined(keys, arrays)
        there = _narrow(path, group, positions.shape) | arrays
        declared = int(group.attrs.get("num_samples", len(positions)))
        said = said | dict(group.attrs) | dict(_own(path, group, key).attrs)
        said = {
            n: v for n, v in said.items() if np.size(v) == 1 and np.asarray(v).dtype.kind in "fiu"
        }
    if declared != len(positions):
        raise FileFormatError(
            f"{path}: {episode} declares {declared} samples but {key} holds {len(positions)}; "
            "copy the file again, or leave that episode out"
        )
    clock = options.clock_among(path, episode, len(positions), there, said)
    return recorded(episode, clock, positions, names, left_out=moves_beside(keys, there))


def _shapes(group: Any) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays of numbers in an episode, by their path in it."""
    found: dict[str, tuple[int, ...]] = {}

    def collect(name: str, item: Any) -> None:
        if getattr(item, "shape", None) and item.dtype.kind in "fiu":
            found[name] = item.shape

    group.visititems(collect)
    return found


def _narrow(path: Path, group: Any, shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Arrays of as many frames and fewer columns."""
    return {
        name: _numbers(path, name, _own(path, group, name))
        for name, own in _shapes(group).items()
        if own[:1] == shape[:1] and len(own) <= 2 and (own[1:] or (1,)) < shape[1:]
        if not _NO_MOTION.search(name)
    }


def _motion(path: Path, group: Any, key: str) -> Positions:
    """The motion under a key, or an error that lists the candidates."""
    found = _own(path, group, key)
    if len(getattr(found, "shape", ())) not in (1, 2):
        candidates = sorted(name for name, shape in _shapes(group).items() if len(shape) == 2)
        raise FileFormatError(
            f"{path} has no array (T, D) at {key} in {group.name}; arrays of that shape are "
            f"{candidates or 'none'}: say which with the key"
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

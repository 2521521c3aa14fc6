"""Recordings in HDF5, as robomimic, ManiSkill and ALOHA lay them out.

robomimic (0.3, scripts/dataset_states_to_obs.py): `data/demo_k/...` with the rate in the JSON
attribute `env_args` of `data` where robosuite made it. ManiSkill: `traj_k/...` at the top. ALOHA:
one episode a file, with `observations/qpos`. An array a joint is taken by its path, `joints/elbow`.
"""

from __future__ import annotations

import contextlib
import math
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.bounds import MOST_COLUMNS, check_numbers
from prior_reinforce.arm.recordings.naming import read_metadata
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import (
    Episodes,
    Recording,
    files_at,
    named_damage,
    natural_order,
)
from prior_reinforce.arm.recordings.stated import (
    by_field,
    motion_keys,
    other_count,
    recording_of_arrays,
    worth_reading,
)
from prior_reinforce.arm.recordings.time_finder import Stamps
from prior_reinforce.errors import FileFormatError

SUFFIXES = (".h5", ".hdf5")
_KEYS = ("obs/robot0_joint_pos", "obs/agent/qpos", "observations/qpos")
"""Measured positions of the first arm; `actions` are mostly pose increments or targets."""
_MOST_BESIDE, _MOST_BYTES_OF_NAMES = 64, 100_000
"""Members of a group that is looked through for names, and bytes of these."""
_PACKING = ("scale_factor", "add_offset")
"""Attributes by which netCDF packs numbers: a value is number * scale_factor + add_offset."""
_FILL = ("_FillValue", "missing_value")
"""Its attributes for the number that stands for no value."""
_EPISODE = re.compile(r"(demo|traj|episode)_?\d+")


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read every episode of a file, or of each file of a folder."""
    import h5py

    paths = files_at(source, SUFFIXES)
    for path in paths:
        with named_damage(path, "HDF5"), h5py.File(path, "r") as file:
            data = _own(path, file, "data")
            top = data if isinstance(data, h5py.Group) else file
            episodes = [name for name in top if top is not file or _EPISODE.fullmatch(name)]
            for within in sorted(episodes, key=natural_order) or [""]:
                of_file = [path.stem] if len(paths) > 1 or not within else []
                name = "-".join(filter(None, [*of_file, within]))
                yield name, partial(_demo, path, top, within, options, name)


class _Field:
    """A field of a record, read by itself: a record beside the motion may be of any size."""

    def __init__(self, record: Any, name: str) -> None:
        field = record.dtype[name]
        self.record, self.name, self.attrs = record, name, record.attrs
        self.dtype, self.shape = field.base, (*record.shape, *field.shape)
        # A chunk is of the whole record.
        each = math.ceil(record.dtype.itemsize / field.base.itemsize)
        self.chunks = (*record.chunks, each) if record.chunks else None

    def __getitem__(self, at: Any) -> Any:
        return self.record.fields(self.name)[at]


def _demo(path: Path, top: Any, within: str, options: ReadOptions, episode: str) -> Recording:
    with named_damage(path, "HDF5"):
        group, items = _own(path, top, within), dict[str, Any]()
        group.visititems(lambda name, item: items.update({name: item}))
        items |= {key: _own(path, group, key) for key in options.key or _KEYS}  # may be links
        arrays = {n: a for n, a in items.items() if _is_own(a) and a.shape is not None}
        found = by_field(arrays, _Field)
        keys = motion_keys(f"{path}: {group.name}", options, found, _KEYS)
        key, count = keys[0], found[keys[0]].shape[0]
        shapes = {name: own.shape for name, own in found.items() if own.dtype.kind in "biuf"}
        there = {name: _numbers(path, name, found[name]) for name in worth_reading(shapes, keys)}
        motion = found[key].record if isinstance(found[key], _Field) else found[key]
        texts, stated = _metadata(top, group, motion)
        # By robomimic the frames of this very demonstration; elsewhere it may be a total.
        declared = stated.get("num_samples", count)
        if "num_samples" in group.attrs and np.any(declared > count):
            raise other_count(
                f"{path}: {episode}", f"{declared} samples by num_samples", key, count
            )
    return recording_of_arrays(path, episode, keys, there, options, texts=texts, stated=stated)


def _metadata(
    top: Any, group: Any, own: Any
) -> tuple[dict[str, tuple[str, ...]], dict[str, np.ndarray]]:
    """Return texts and numbers in attributes and small arrays, the nearest to the motion first.

    A single unit counts only at the motion itself.
    """
    texts: dict[str, tuple[str, ...]] = {}
    stated: dict[str, np.ndarray] = {}
    for node in dict.fromkeys((own, own.parent, group, top, top.file)):
        found = {name: (node.attrs.get_id, node.attrs) for name in node.attrs}
        if node != own and len(node) <= _MOST_BESIDE:
            found |= {name: (node.__getitem__, node) for name in node if _is_small(node, name)}
        values = dict[str, np.ndarray]()
        for name, (kind, within) in found.items():
            # What h5py has no type for is no name.
            with contextlib.suppress(TypeError, ValueError, OSError):
                if np.prod(kind(name).shape) <= MOST_COLUMNS:
                    values[name] = np.asarray(within[name])
        numbers = {name: value for name, value in values.items() if value.dtype.kind in "biuf"}
        nested, more = read_metadata({n: value for n, value in values.items() if n not in numbers})
        stated = numbers | {n: np.asarray(number) for n, number in more.items()} | stated
        own_texts = {n: text for n, text in nested.items() if len(text) > 1 or node == own}
        texts |= {n: text for n, text in own_texts.items() if n not in texts}
    return texts, stated


def _is_small(group: Any, name: str) -> bool:
    """Whether a name is of a data set of this very file, small enough to hold names."""
    import h5py

    hard = isinstance(group.get(name, getlink=True), h5py.HardLink)
    found: Any = group[name] if hard else None
    small = _is_own(found) and found.shape is not None
    return small and found.size * found.dtype.itemsize < _MOST_BYTES_OF_NAMES


def _is_own(found: Any) -> bool:
    """Whether an item is a data set whose numbers are in this very file."""
    import h5py

    return isinstance(found, h5py.Dataset) and not (found.external or found.is_virtual)


def _numbers(path: Path, name: str, found: Any) -> Stamps:
    """Return the numbers of an array, unpacked; FileFormatError if its header claims too many."""
    for what, shape in ((name, found.shape), (f"a chunk of {name}", found.chunks or ())):
        check_numbers(path, what, shape, found.dtype.itemsize)
    numbers = np.asarray(found[()])
    packed = {n: np.asarray(found.attrs[n]) for n in (*_PACKING, *_FILL) if n in found.attrs}
    if not any(n in packed for n in _PACKING):
        return numbers
    plain = all(own.size == 1 and own.dtype.kind in "fiu" for own in packed.values())
    if not plain or numbers.dtype.kind not in "iu":
        said = ", ".join(f"{n} = {own.tolist()}" for n, own in packed.items())
        raise FileFormatError(
            f"{path}: {name} ({numbers.dtype}) says {said}, expected whole numbers and two numbers "
            "to unpack them by: write it unpacked, without these attributes"
        )
    filled = np.isin(numbers, [packed[n] for n in _FILL if n in packed])
    unpacked = numbers * packed.get(_PACKING[0], 1.0) + packed.get(_PACKING[1], 0.0)
    return np.asarray(np.where(filled, np.nan, unpacked))


def _own(path: Path, group: Any, key: str, depth: int = 8) -> Any:
    """Return the item under a key, None if there is none; FileFormatError if it is elsewhere.

    Reading external links, external storage or virtual data sets would copy any file of this
    machine into the workspace.
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
    if isinstance(group, h5py.Dataset) and not _is_own(group):
        raise FileFormatError(
            f"{path}: the numbers of {key} are in another file, which is not read; copy the data "
            "into one file"
        )
    return group

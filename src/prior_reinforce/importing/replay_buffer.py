"""Diffusion Policy's replay buffers: zarr stores (format 2), as folders or zipped.

Layout (real-stanford/diffusion_policy, common/replay_buffer.py): `data/<key>` holds all episodes
one after the other, `meta/episode_ends` where each ends. It stores neither a rate nor names.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.errors import FileFormatError
from prior_reinforce.importing.files import load_extra, named_damage
from prior_reinforce.importing.recording import Reading, Recording, evenly, made_up_names

_ENDS = "meta/episode_ends"


def is_replay_buffer(source: Path) -> bool:
    """Whether a path looks like one, from its name or its layout."""
    if source.is_dir():
        return (source / _ENDS).is_dir() and (source / "data").is_dir()
    return source.name.lower().endswith((".zarr.zip", ".zarr"))


def read_replay_buffer(source: Path, reading: Reading) -> list[Recording]:
    """Read every episode of a store."""
    zarr = load_extra("zarr", "zarr")
    with named_damage(source, "a zarr replay buffer"):
        if source.is_dir():
            ends, positions = _arrays(source, zarr.open_group(str(source), mode="r"), reading.key)
        else:
            with zarr.storage.ZipStore(str(source), mode="r") as store:
                ends, positions = _arrays(source, zarr.open_group(store, mode="r"), reading.key)
    starts = np.concatenate([[0], ends[:-1]]).astype(int)
    if np.any(ends <= starts) or ends[-1] != len(positions):
        raise FileFormatError(
            f"{source}: episodes end at {ends[:8].tolist()} but there are {len(positions)} frames; "
            "copy the store again"
        )
    recordings = []
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        episode = str(index)
        if reading.wants(episode):
            times = evenly(int(end - start), reading.rate, episode)
            names = made_up_names(positions.shape[1])
            recordings.append(Recording(episode, times, positions[start:end], names, named=False))
    return recordings


def _arrays(source: Path, group: Any, key: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Where episodes end, shape (N,), and all positions, shape (sum of T, D)."""
    data = group["data"]
    vectors = sorted(name for name in data if len(data[name].shape) == 2)
    if key is None and len(vectors) == 1:
        key = vectors[0]
    if key not in vectors:
        raise FileFormatError(
            f"{source} has no array (T, D) {key or 'that is the only one'} in data/; there are "
            f"{vectors}: say which with the key"
        )
    ends = np.asarray(group[_ENDS][:], dtype=np.int64).ravel()
    if ends.size == 0:
        raise FileFormatError(f"{source} holds no episode; copy the store again")
    return ends, np.asarray(data[key][:], dtype=np.float64)

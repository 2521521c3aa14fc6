"""Diffusion Policy's replay buffers: zarr stores (format 2), as folders or zipped.

Layout (real-stanford/diffusion_policy, common/replay_buffer.py): `data/<key>` holds all episodes
one after the other, `meta/episode_ends` where each ends. It has no names, and times only where its
writer adds `data/timestamp`, as UMI's does.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.errors import FileFormatError
from prior_reinforce.importing.clock import Stamps
from prior_reinforce.importing.recording import NO_COLUMN, ReadOptions, Recording, named_damage

_ENDS, _TIMES = "meta/episode_ends", "timestamp"


def recognises(source: Path) -> bool:
    """Whether a path looks like a replay buffer, from its name or its layout."""
    if source.is_dir():
        return (source / _ENDS).is_dir() and (source / "data").is_dir()
    return source.name.lower().endswith((".zarr.zip", ".zarr"))


def read(source: Path, options: ReadOptions) -> list[Recording]:
    """Read every episode of a store."""
    import zarr

    with named_damage(source, "a zarr replay buffer"), ExitStack() as stack:
        store: Any = str(source)
        if not source.is_dir():
            store = stack.enter_context(zarr.storage.ZipStore(store, mode="r"))
        group: Any = zarr.open_group(store, mode="r")
        data = group["data"]
        vectors = sorted(name for name in data if len(data[name].shape) == 2)
        key = vectors[0] if options.key is None and len(vectors) == 1 else options.key
        if key not in vectors:
            raise FileFormatError(
                f"{source} has no array (T, D) {key or 'that is the only one'} in data/; there are "
                f"{vectors}: say which with the key"
            )
        ends = np.asarray(group[_ENDS][:], dtype=np.int64).ravel()
        if ends.size == 0:
            raise FileFormatError(f"{source} holds no episode; copy the store again")
        positions = np.asarray(data[key][:], dtype=np.float64)
        stamps = _stamps(source, data, options)
    starts = np.concatenate([[0], ends[:-1]])
    if np.any(ends <= starts) or ends[-1] != len(positions):
        raise FileFormatError(
            f"{source}: episodes end at {ends[:8].tolist()} but there are {len(positions)} frames; "
            "copy the store again"
        )
    recordings = []
    for episode, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        if options.wants(str(episode)):
            own = None if stamps is None else stamps[start:end]
            clock = options.clock(
                str(episode), end - start, stamps=own, name=options.time_column or _TIMES
            )
            recordings.append(
                Recording(
                    str(episode),
                    clock.times,
                    positions[start:end],
                    clock=clock.source,
                    doubts=clock.doubts,
                )
            )
    return recordings


def _stamps(source: Path, data: Any, options: ReadOptions) -> Stamps | None:
    """Times of all frames, where the store has them."""
    name = options.time_column or (_TIMES if _TIMES in data else NO_COLUMN)
    if name == NO_COLUMN:
        return None
    if name not in data:
        raise FileFormatError(f"{source} has no array {name} in data/; it has {sorted(data)}")
    return np.asarray(data[name][:]).ravel()

"""Diffusion Policy's replay buffers: zarr stores (format 2), as folders or zipped.

Layout (real-stanford/diffusion_policy, common/replay_buffer.py): `data/<key>` holds all episodes
one after the other, `meta/episode_ends` their ends. No names; times only in UMI's `data/timestamp`.
"""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.bounds import check_bytes, check_chunks, check_numbers
from prior_reinforce.arm.recordings.naming import read_metadata
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import Episodes, named_damage
from prior_reinforce.arm.recordings.stated import (
    motion_keys,
    recording_of_arrays,
    says_success,
    worth_reading,
)
from prior_reinforce.arm.recordings.time_finder import Stamps
from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import require_inside

Arrays = Mapping[str, tuple[tuple[int, ...], tuple[int, ...]]]
"""Shape and chunks of each array of numbers, by its name in the store."""
_ENDS = "meta/episode_ends"
_NUMBERS = re.compile(r"([<>|][biuf]\d+)|(bool|u?int\d+|float\d+)")
_CODECS = frozenset(
    {"blosc", "bytes", "bz2", "crc32c", "delta", "gzip", "lz4", "lzma"}
    | {"shuffle", "transpose", "zlib", "zstd"}
)
"""Codecs that turn bytes into bytes; others (pickle, json2, msgpack2) make objects of them."""


def recognises(source: Path) -> bool:
    """Whether a path looks like a replay buffer, from its name or its layout."""
    if source.is_dir():
        return (source / _ENDS).is_dir() and (source / "data").is_dir()
    return source.name.lower().endswith((".zarr.zip", ".zarr"))


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read every episode of a store."""
    import zarr

    with named_damage(source, "a zarr replay buffer"), ExitStack() as stack:
        store: Any = str(source)
        if not source.is_dir():
            store = stack.enter_context(zarr.storage.ZipStore(store, mode="r"))
        arrays = _plain_arrays(source)
        newer = int(zarr.__version__.split(".")[0]) >= 3
        # Consolidated metadata would say it all a second time, and could say something else.
        how: Any = {"use_consolidated": False} if newer else {}
        group: Any = zarr.open_group(store, mode="r", **how)
        there = sorted(name.removeprefix("data/") for name in arrays if name.startswith("data/"))
        shapes = {name: arrays[f"data/{name}"][0] for name in there}
        keys = motion_keys(source, options, {name: group[f"data/{name}"] for name in there}, ())
        if _ENDS not in arrays:
            raise FileFormatError(f"{source} has no numbers at {_ENDS}; copy the store again")
        ends = np.asarray(_numbers(source, group, arrays, _ENDS), dtype=np.int64).ravel()
        count, needed = shapes[keys[0]][0], worth_reading(shapes, keys)
        numbers = {name: _numbers(source, group, arrays, f"data/{name}") for name in needed}
        of_each = {
            name: _numbers(source, group, arrays, name)
            for name, (shape, _) in arrays.items()
            if name.startswith("meta/") and says_success(name) and shape == ends.shape
        }
        nodes = (group[f"data/{keys[0]}"], group["data"], group)
        texts, stated = read_metadata({n: v for node in nodes[::-1] for n, v in node.attrs.items()})
        stated = {f".{name}": number for name, number in stated.items()}  # of all episodes: a rate
    if ends.size == 0:
        raise FileFormatError(f"{source} holds no episode; copy the store again")
    starts = np.concatenate([[0], ends[:-1]])
    if np.any(ends <= starts) or ends[-1] != count:
        raise FileFormatError(
            f"{source}: episodes end at {ends[:8].tolist()} but there are {count} frames; "
            "copy the store again"
        )
    for i, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        own = {
            name: array[start * len(array) // count : end * len(array) // count]
            for name, array in numbers.items()
        }
        also = {name: array[i] for name, array in of_each.items()}
        of_file: dict[str, Any] = {"texts": texts, "stated": stated | also}
        yield str(i), partial(recording_of_arrays, source, str(i), keys, own, options, **of_file)


def _numbers(source: Path, group: Any, arrays: Arrays, name: str) -> Stamps:
    """The numbers of an array, unless its metadata claims more than a recording has."""
    shape, chunks = arrays[name]
    check_numbers(source, name, shape)
    check_chunks(source, name, shape, chunks)
    array = group[name]
    # One chunk first: damage is then reported once, not by all reading threads.
    np.asarray(array[(slice(0, 1),) * len(shape)])
    return np.asarray(array[:])


def _plain_arrays(source: Path) -> Arrays:
    """Return shapes and chunks of the arrays of plain numbers, by name, from metadata alone.

    Arrays of objects, and codecs that make objects, could run code when read, and are never opened.
    FileFormatError if a link leads out of the store.
    """
    plain: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {}
    for name, text in _metadata(source):
        array, _, file = name.rpartition("/")
        found = json.loads(text)
        if file == ".zarray":
            stages = [found.get("compressor"), *(found.get("filters") or ())]
            codecs = [stage["id"] for stage in stages if stage is not None]
            numbers = found["dtype"]
        elif found.get("node_type") == "array":
            codecs, numbers = [stage["name"] for stage in found["codecs"]], found["data_type"]
        else:
            continue
        if isinstance(numbers, str) and _NUMBERS.fullmatch(numbers) and _CODECS.issuperset(codecs):
            chunks = found.get("chunks") or found["chunk_grid"]["configuration"]["chunk_shape"]
            plain[array] = tuple(map(int, found["shape"])), tuple(map(int, chunks))
    return plain


def _metadata(source: Path) -> Iterator[tuple[str, bytes]]:
    """Name within the store, and content, of every file that describes an array."""
    names = (".zarray", "zarr.json")
    if not source.is_dir():
        with zipfile.ZipFile(source) as packed:
            unpacked = sum(member.file_size for member in packed.infolist())
            check_bytes(source, unpacked, "unpacks to")
            for member in packed.namelist():
                if member.endswith(names):
                    yield member, packed.read(member)
        return
    for path in sorted(source.rglob("*")):
        if path.is_symlink():
            require_inside(path, source)
        if path.name in names:
            yield path.relative_to(source).as_posix(), path.read_bytes()

"""LeRobot data sets on disk, version 3.0 and 2.1, read with pyarrow alone.

Layout (lerobot 0.6.1, datasets/utils.py): `meta/info.json`, episodes listed in
`meta/episodes/**.parquet` (2.1: `meta/episodes.jsonl`), frames in `data/**.parquet`. Frames are
collected by their own `episode_index`: the listed file pointers can be stale in converted data
(huggingface/lerobot issue 2401), a file may hold several episodes, an episode several files. A file
of a recorder (0.4.4) that ended without `finalize()` has no footer, and cannot be read.
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped

from prior_reinforce.bench.importing.bounds import check_bytes, check_numbers
from prior_reinforce.bench.importing.options import ReadOptions
from prior_reinforce.bench.importing.recording import (
    Episodes,
    Positions,
    Recording,
    named_damage,
)
from prior_reinforce.errors import FileFormatError

FrameNumbers = Shaped[np.ndarray, " T"]
_MEASURED, _COMMANDED = "observation.state", "action"


def recognises(source: Path) -> bool:
    """Whether a path looks like this format."""
    return (source / "meta" / "info.json").is_file()


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read every episode of a data set's folder."""
    info_path = source / "meta" / "info.json"
    with named_damage(info_path, "LeRobot's meta/info.json"):
        check_bytes(info_path, info_path.stat().st_size)
        info = json.loads(info_path.read_text(encoding="utf-8"))
        features = dict(info["features"])
        rate = float(info["fps"])
        key = _column(source, features, options.key)
    remarks: tuple[str, ...] = ()
    if options.key is None and key == _MEASURED and _COMMANDED in features:
        remarks = (f"motion is {_MEASURED} (measured); key {_COMMANDED} has the commanded one",)
    lengths, frames = _listed_lengths(source), _frames(source, key)

    def episode_of(number: int) -> Recording:
        index, positions = frames.get(number, (np.zeros(0), np.zeros((0, 0))))
        listed = lengths.get(number, len(index))
        if len(index) != listed or listed == 0:
            raise FileFormatError(
                f"{source}: episode {number} has {len(index)} of {listed} listed frames under "
                "data/; copy the data set again, or name only the other episodes"
            )
        names = _names(features[key], positions.shape[1])
        clock = options.clock(str(number), len(index), name="fps", own_rate=rate)
        times = index * clock.period  # by their own numbers, since frames may be missing
        return Recording(str(number), times, positions, names, None, remarks, clock=clock.source)

    for number in sorted(lengths.keys() | frames.keys()):
        yield str(number), partial(episode_of, number)


def _column(source: Path, features: dict[str, Any], key: str | None) -> str:
    vectors = [
        name
        for name, feature in features.items()
        if isinstance(feature, dict)
        and str(feature.get("dtype", "")).startswith("float")
        and isinstance(shape := feature.get("shape"), list)
        and len(shape) == 1
        and int(shape[0]) > 1
    ]
    if key is None and _MEASURED in vectors:
        return _MEASURED
    if key is None and len(vectors) == 1:
        return vectors[0]
    if key is None or key not in features:
        raise FileFormatError(
            f"{source} has no feature {key or _MEASURED}; features of numbers are {vectors}: say "
            "which with the key"
        )
    return key


def _listed_lengths(source: Path) -> dict[int, int]:
    """Frames of each episode according to the metadata; empty where it lists none."""
    lengths: dict[int, int] = {}
    for path in sorted((source / "meta" / "episodes").glob("**/*.parquet")):
        with named_damage(path, "LeRobot's list of episodes"):
            table = _table(path, ["episode_index", "length"]).to_pydict()
            pairs = zip(table["episode_index"], table["length"], strict=True)
            lengths.update({int(episode): int(length) for episode, length in pairs})
    path = source / "meta" / "episodes.jsonl"
    if path.is_file():
        with named_damage(path, "LeRobot's list of episodes"):
            rows = map(json.loads, path.read_text(encoding="utf-8").splitlines())
            lengths.update({int(row["episode_index"]): int(row["length"]) for row in rows})
    return lengths


def _frames(source: Path, key: str) -> dict[int, tuple[FrameNumbers, Positions]]:
    """Frame numbers and positions of each episode, in time order."""
    paths = sorted((source / "data").glob("**/*.parquet"))
    if not paths:
        raise FileFormatError(
            f"{source} has no data/**.parquet; copy the whole data set, not only meta/"
        )
    parts = []
    for path in paths:
        with named_damage(path, "LeRobot frames, complete once its recorder called finalize()"):
            table = _table(path, ["episode_index", "frame_index", key])
            episode = table["episode_index"].to_numpy().astype(np.int64)
            index = table["frame_index"].to_numpy().astype(np.int64)
            if len(episode) > 0:
                parts.append((episode, index, _rows(table[key])))
    if not parts:
        return {}
    with named_damage(source, f"LeRobot data with one width of {key}"):
        episode, index, positions = map(np.concatenate, zip(*parts, strict=True))
    order = np.argsort(index, kind="stable")
    own = {number: order[episode[order] == number] for number in np.unique(episode).tolist()}
    return {number: (index[rows], positions[rows]) for number, rows in own.items()}


def _table(path: Path, columns: list[str]) -> Any:
    """Columns of a Parquet file, unless its footer claims more than a recording has."""
    import pyarrow.parquet as parquet

    file = parquet.ParquetFile(path)
    groups = [file.metadata.row_group(i) for i in range(file.metadata.num_row_groups)]
    parts = [group.column(j) for group in groups for j in range(group.num_columns)]
    read = [part for part in parts if part.path_in_schema.split(".")[0] in {*columns}]
    check_numbers(path, "its columns", [sum(part.num_values for part in read)])
    check_bytes(path, sum(part.total_uncompressed_size for part in read), "unpacks to")
    return file.read(columns=columns)


def _rows(column: Any) -> Positions:
    """A column of lists of one length as rows, of numbers as a single channel."""
    import pyarrow as pa
    import pyarrow.compute as compute

    kind = column.type
    if not (pa.types.is_list(kind) or pa.types.is_large_list(kind) or hasattr(kind, "list_size")):
        return np.asarray(column.to_numpy(), dtype=np.float64)[:, None]
    widths = compute.list_value_length(column).unique().to_pylist()
    if len(widths) != 1 or not widths[0]:
        raise ValueError(f"rows of {widths} numbers")
    flat = compute.list_flatten(column).to_numpy()
    return np.asarray(flat, dtype=np.float64).reshape(-1, widths[0])


def _names(feature: dict[str, Any], count: int) -> tuple[str, ...]:
    """Channel names; some writers nest them as {"motors": [...]}, some give none that fit."""
    names = feature.get("names")
    if isinstance(names, dict) and len(names) == 1:
        names = next(iter(names.values()))
    if not isinstance(names, list) or len(names) != count:
        return ()
    return tuple(map(str, names))

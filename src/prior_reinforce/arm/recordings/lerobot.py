"""LeRobot data sets on disk, version 3.0 and 2.1, read with pyarrow alone.

Layout (lerobot 0.6.1, datasets/utils.py): `meta/info.json`, episodes in `meta/episodes/**.parquet`
(2.1: `meta/episodes.jsonl`), frames in `data/**.parquet`. Frames are collected by their own
`episode_index`, as listed file pointers can be stale (huggingface/lerobot issue 2401). A file whose
recorder (0.4.4) ended without `finalize()` has no footer, and cannot be read.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped

from prior_reinforce.arm.recordings.beside import may_move
from prior_reinforce.arm.recordings.bounds import check_bytes, check_numbers
from prior_reinforce.arm.recordings.clock import (
    clock_from_arrays,
    clock_of,
    refuse_clocks_that_differ,
)
from prior_reinforce.arm.recordings.naming import missing_channels, read_metadata
from prior_reinforce.arm.recordings.options import NO_COLUMN, ReadOptions
from prior_reinforce.arm.recordings.recording import Episodes, Positions, Recording, named_damage
from prior_reinforce.arm.recordings.stated import recording_of_arrays, says_success
from prior_reinforce.arm.recordings.time_finder import (
    Clock,
    DeclaredRate,
    Times,
    looks_like_time,
    says_time,
)
from prior_reinforce.arm.recordings.units import say_names
from prior_reinforce.errors import FileFormatError
from prior_reinforce.plans.channels import Kind, kinds, says_no_position

FrameNumbers = Shaped[np.ndarray, " T"]
Frames = tuple[FrameNumbers, dict[str, Positions]]
"""Numbers and features of an episode's frames."""
_MEASURED, _COMMANDED, _STAMPS, _TASKS = "observation.state", "action", "timestamp", "tasks"
_OWN = (_STAMPS, "frame_index", "episode_index", "index", "task_index")
"""Features that every data set has."""
_LATE = 0.5
"""Periods by which a frame may be stamped late and still count as even. Ours."""


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
        widths = _widths(features)
        floats = [n for n in widths if features[n]["dtype"].startswith("float") and n not in _OWN]
        vectors = [name for name in floats if widths[name] > 1]
        usual = _MEASURED if _MEASURED in vectors else vectors[0] if len(vectors) == 1 else ""
        keys = options.key or (usual,)
        wrong = [key for key in keys if key not in features]
        if wrong:
            raise FileFormatError(
                f"{source} has no feature {wrong[0] or _MEASURED}; features of numbers are "
                f"{vectors or floats}: say which with --key{', once a joint' * (not vectors)}"
            )
        key = keys[0]
        if not options.key:
            _point_to_joints(source, key, features, options.joints or ())
        widths = {n: w for n, w in widths.items() if n not in _OWN}
        beside = [
            n
            for n, w in widths.items()
            if n not in keys and (may_move(n, w) or says_time(n) or says_success(n))
        ]
        texts = {
            f"{name} names": _names(features[name]) for name in {**dict.fromkeys(keys), **widths}
        }
    remarks: tuple[str, ...] = ()
    if not options.key and key == _MEASURED and _COMMANDED in features:
        remarks = (f"motion is {_MEASURED} (measured); key {_COMMANDED} has the commanded one",)
    columns = dict.fromkeys((*keys, *beside, _STAMPS))
    listed, frames = _listed(source), _frames(source, tuple(columns))
    tasks = {number: _task(row) for number, row in listed.items()}

    def episode_of(number: int) -> Recording:
        index, arrays = frames.get(number, (np.zeros(0), {}))
        row = listed.get(number, {})
        count = row.get("length", len(index))
        if len(index) != count or count == 0:
            raise FileFormatError(
                f"{source}: episode {number} has {len(index)} of {count} listed frames under "
                "data/; copy the data set again, or name only the other episodes"
            )
        names = texts[f"{key} names"]
        of_key = {"names": names} if len(names) == arrays[key].shape[1] else texts
        clocks = {n: a.ravel() for n, a in arrays.items() if a.size == len(a) and n not in keys}
        clock = _clock(source, str(number), index, clocks, rate, options)
        arrays = {n: a for n, a in arrays.items() if n != _STAMPS or n in keys}
        of_tasks = (f"its task is {tasks.get(number)!r}",) * (len({*tasks.values()}) > 1)
        also: dict[str, Any] = {"clock": clock, "remarks": (*remarks, *of_tasks)}
        also["stated"] = {name: value for name, value in row.items() if says_success(name)}
        return recording_of_arrays(source, str(number), keys, arrays, options, texts=of_key, **also)

    for number in sorted(listed.keys() | frames.keys()):
        yield str(number), partial(episode_of, number)


def _point_to_joints(
    source: Path, key: str, features: dict[str, Any], joints: tuple[str, ...]
) -> None:
    """Raise FileFormatError naming the features of the joints, where the usual one has a place."""
    own, widths = _names(features[key]), _widths(features)
    missing = missing_channels(joints, own) if len(own) == widths[key] else []
    if not missing or Kind.PLACE not in kinds(own):
        return
    counts = {len(joints), sum(kind is not Kind.TOOL for kind in kinds(joints))}
    others = [
        name
        for name, width in widths.items()
        if name not in (key, _COMMANDED)
        and not says_no_position(name)
        and (width in counts if not _names(features[name]) else True)
        and len(missing_channels(joints, _names(features[name]) or joints)) < len(missing)
    ]
    where = " or ".join(f"--key {name}" for name in others) or "none of its other features does"
    raise FileFormatError(
        f"{source}: {key} holds {say_names(own)}, a place and not the joints {say_names(missing)}; "
        f"say what holds these: {where}"
    )


def _clock(
    source: Path,
    episode: str,
    index: FrameNumbers,
    clocks: dict[str, Times],
    rate: float,
    options: ReadOptions,
) -> Clock:
    """Return times by frame numbers, as frames may be missing; by time stamps if these are late.

    LeRobot writes number / fps as `timestamp`, other recorders the time when a frame was taken.
    """
    asked = options.time_column not in (None, NO_COLUMN)
    stamps = clocks.get(_STAMPS, index / rate)
    late = np.abs(stamps - stamps[0] - (index - index[0]) / rate).max() > _LATE / rate
    if asked or (late and options.time_column is None):
        return clock_from_arrays(source, episode, len(index), clocks, options, {"fps": rate})
    clock = clock_of(episode, len(index), options, declared=DeclaredRate(rate, "fps"))
    clock = replace(clock, times=index * clock.period)
    others = {n: a for n, a in clocks.items() if n != _STAMPS and looks_like_time(n, a)}
    if options.time_column is None and others:
        refuse_clocks_that_differ(f"{source}: {episode}", {_STAMPS: clock.times} | others)
    return clock


def _widths(features: dict[str, Any]) -> dict[str, int]:
    """Numbers a frame of each feature that has one or several in a row."""
    return {
        name: int(feature["shape"][0])
        for name, feature in features.items()
        if isinstance(feature, dict)
        and str(feature.get("dtype", "")).startswith(("float", "int", "uint", "bool"))
        and isinstance(feature.get("shape"), list)
        and len(feature["shape"]) == 1
        and int(feature["shape"][0]) > 0
    }


def _listed(source: Path) -> dict[int, dict[str, Any]]:
    """What the metadata say of each episode; empty where they list none."""
    listed: dict[int, dict[str, Any]] = {}
    meta = source / "meta"
    for path in (*sorted(meta.glob("episodes/**/*.parquet")), *meta.glob("episodes.jsonl")):
        with named_damage(path, "LeRobot's list of episodes"):
            if path.suffix == ".jsonl":
                rows = list(map(json.loads, path.read_text(encoding="utf-8").splitlines()))
            else:
                rows = _table(path, ["episode_index", "length", _TASKS]).to_pylist()
            listed |= {
                int(row["episode_index"]): row | {"length": int(row["length"])} for row in rows
            }
    return listed


def _task(row: Mapping[str, Any]) -> str:
    tasks = row.get(_TASKS) or "not said"
    return tasks if isinstance(tasks, str) else ", ".join(map(str, tasks))


def _frames(source: Path, keys: tuple[str, ...]) -> dict[int, Frames]:
    """Frame numbers and features of each episode, in time order; stamps if there are any."""
    paths = sorted((source / "data").glob("**/*.parquet"))
    if not paths:
        raise FileFormatError(
            f"{source} has no data/**.parquet; copy the whole data set, not only meta/"
        )
    parts = []
    for path in paths:
        with named_damage(path, "LeRobot frames, complete once its recorder called finalize()"):
            table = _table(path, ["episode_index", "frame_index", *keys])
            episode = table["episode_index"].to_numpy().astype(np.int64)
            index = table["frame_index"].to_numpy().astype(np.int64)
            none = np.full((len(index), 1), np.nan)
            own = (_rows(table[key]) if key in table.column_names else none for key in keys)
            if len(episode) > 0:
                parts.append((episode, index, *own))
    if not parts:
        return {}
    with named_damage(source, f"LeRobot data with one width of {keys[0]}"):
        episode, index, *values = map(np.concatenate, zip(*parts, strict=True))
    order = np.argsort(index, kind="stable")
    found = dict(zip(keys, values, strict=True))
    if not np.all(np.isfinite(found[_STAMPS])):
        del found[_STAMPS]
    return {
        number: (index[rows], {key: value[rows] for key, value in found.items()})
        for number in np.unique(episode).tolist()
        for rows in [order[episode[order] == number]]
    }


def _table(path: Path, columns: list[str]) -> Any:
    """Columns of a Parquet file, unless its footer claims more than a recording has."""
    import pyarrow.parquet as parquet

    file = parquet.ParquetFile(path)
    groups = [file.metadata.row_group(i) for i in range(file.metadata.num_row_groups)]
    parts = [group.column(j) for group in groups for j in range(group.num_columns)]
    there = file.schema_arrow.names
    columns = [name for name in columns if name not in (_STAMPS, _TASKS) or name in there]
    columns += [name for name in there if says_success(name) and name not in columns]
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


def _names(feature: Any) -> tuple[str, ...]:
    """Channel names in every form that writers give them; none where there are none."""
    groups = read_metadata({"": feature.get("names") if isinstance(feature, dict) else None})[0]
    names = tuple(chain(*groups.values()))
    if len(set(names)) < len(names):  # two arms whose joints have one name each
        names = tuple(f"{group}.{name}" for group, own in groups.items() for name in own)
    return names

"""LeRobot data sets on disk, version 3.0 and 2.1, read with pyarrow alone.

Layout (lerobot 0.6.1, datasets/utils.py): `meta/info.json`, episodes listed in
`meta/episodes/**.parquet` (2.1: `meta/episodes.jsonl`), frames in `data/**.parquet`. Frames are
collected by their own `episode_index`: the listed file pointers can be stale in converted data
(huggingface/lerobot issue 2401), a file may hold several episodes, an episode several files.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.errors import FileFormatError
from prior_reinforce.importing.files import load_extra, named_damage
from prior_reinforce.importing.recording import Reading, Recording, made_up_names

_MEASURED, _COMMANDED = "observation.state", "action"


def read_lerobot(source: Path, reading: Reading) -> list[Recording]:
    """Read every episode of a data set's folder."""
    parquet = load_extra("pyarrow.parquet", "lerobot")
    info_path = source / "meta" / "info.json"
    with named_damage(info_path, "LeRobot's meta/info.json"):
        info = json.loads(info_path.read_text(encoding="utf-8"))
        features = dict(info["features"])
        rate = reading.rate or float(info["fps"])
        if not 0 < rate < 1e6:
            raise ValueError(f"fps is {rate}")
    key = _column(source, features, reading.key)
    lengths = _listed_lengths(parquet, source)
    frames = _frames(parquet, source, key)
    wanted = [e for e in sorted(lengths.keys() | frames.keys()) if reading.wants(str(e))]
    remarks: tuple[str, ...] = ()
    if reading.key is None and key == _MEASURED and _COMMANDED in features:
        remarks = (f"motion is {_MEASURED} (measured); key {_COMMANDED} has the commanded one",)
    recordings = []
    for episode in wanted:
        index, positions = frames.get(episode, (np.zeros(0), np.zeros((0, 0))))
        listed = lengths.get(episode, len(index))
        if len(index) != listed or len(index) == 0:
            raise FileFormatError(
                f"{source}: episode {episode} has {len(index)} of {listed} listed frames under "
                "data/; copy the data set again, or name only the other episodes"
            )
        names = _names(features[key], positions.shape[1])
        recordings.append(
            Recording(
                str(episode),
                index / rate,
                positions,
                names or made_up_names(positions.shape[1]),
                named=names is not None,
                remarks=remarks,
            )
        )
    return recordings


def _column(source: Path, features: dict[str, Any], key: str | None) -> str:
    vectors = [
        name
        for name, feature in features.items()
        if isinstance(feature, dict)
        and str(feature.get("dtype", "")).startswith("float")
        and len(feature.get("shape", ())) == 1
        and feature["shape"][0] > 1
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


def _listed_lengths(parquet: Any, source: Path) -> dict[int, int]:
    """Frames of each episode according to the metadata; empty where it lists none."""
    lengths: dict[int, int] = {}
    for path in sorted((source / "meta" / "episodes").glob("**/*.parquet")):
        with named_damage(path, "LeRobot's list of episodes"):
            table = parquet.read_table(path, columns=["episode_index", "length"]).to_pydict()
            pairs = zip(table["episode_index"], table["length"], strict=True)
            lengths.update({int(episode): int(length) for episode, length in pairs})
    path = source / "meta" / "episodes.jsonl"
    if path.is_file():
        with named_damage(path, "LeRobot's list of episodes"):
            for line in path.read_text(encoding="utf-8").splitlines():
                row = json.loads(line)
                lengths[int(row["episode_index"])] = int(row["length"])
    return lengths


def _frames(parquet: Any, source: Path, key: str) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Frame numbers (T,) and positions (T, D) of each episode, in time order."""
    parts: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for episode, index, positions in _parts(parquet, source, key):
        parts.setdefault(episode, []).append((index, positions))
    frames = {}
    for episode, pieces in parts.items():
        index = np.concatenate([piece[0] for piece in pieces])
        with named_damage(source, f"LeRobot data with one width of {key}"):
            positions = np.concatenate([piece[1] for piece in pieces])
        order = np.argsort(index, kind="stable")
        frames[episode] = index[order], positions[order]
    return frames


def _parts(parquet: Any, source: Path, key: str) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    paths = sorted((source / "data").glob("**/*.parquet"))
    if not paths:
        raise FileFormatError(
            f"{source} has no data/**.parquet; copy the whole data set, not only meta/"
        )
    for path in paths:
        with named_damage(path, "LeRobot frames"):
            table = parquet.read_table(path, columns=["episode_index", "frame_index", key])
            episodes = np.asarray(table["episode_index"].to_pylist(), dtype=np.int64)
            index = np.asarray(table["frame_index"].to_pylist(), dtype=np.int64)
            positions = np.array(table[key].to_pylist(), dtype=np.float64)
            if len(episodes) == 0:
                continue
            positions = positions.reshape(len(episodes), -1)
        for episode in np.unique(episodes).tolist():
            own = episodes == episode
            yield episode, index[own], positions[own]


def _names(feature: dict[str, Any], count: int) -> tuple[str, ...] | None:
    """Channel names; some writers nest them as {"motors": [...]}, some give none."""
    names = feature.get("names")
    if isinstance(names, dict) and len(names) == 1:
        names = next(iter(names.values()))
    if not isinstance(names, list) or len(names) != count:
        return None
    return tuple(map(str, names))

"""Recordings in NPZ or NPY: a file an episode, or one file whose motion has shape (N, T, D).

An NPY holds the motion alone. Arrays of an NPZ: the motion (`key`, or `q`, `plans`, `positions`,
`actions`), `t` or `dt` or `rate`, and optionally `joint_names` or `names`, and `outcome`,
`outcomes` or `outcomes_seen`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from prior_reinforce.bench.importing.bounds import MOST_BYTES, check_bytes
from prior_reinforce.bench.importing.clock import Clock
from prior_reinforce.bench.importing.options import ReadOptions
from prior_reinforce.bench.importing.recording import (
    NO_COLUMN,
    Episodes,
    Recording,
    files_at,
    named_damage,
    recorded,
    unread,
)
from prior_reinforce.bench.importing.units import SECONDS, split_unit
from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import open_npz

Arrays = Mapping[str, np.ndarray]
SUFFIXES = (".npz", ".npy")
_TIMES = ("t", "time", "timestamp", "timestamps")
_MOTION_KEYS = ("q", "plans", "positions", "actions")
_OUTCOME_KEYS = ("outcome", "outcomes", "outcomes_seen")


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read a file, or every one of a folder as an episode."""
    paths = files_at(source, SUFFIXES)
    for path in paths:
        if len(paths) > 1 and options.leaves_out(path.stem):
            yield path.stem, unread
        else:
            yield from _episodes(path, options)


def _episodes(path: Path, options: ReadOptions) -> Episodes:
    arrays = _arrays(path)
    key = options.key or next((name for name in _MOTION_KEYS if name in arrays), None)
    if key is None or key not in arrays:
        raise FileFormatError(
            f"{path} has no array {key or ' or '.join(_MOTION_KEYS)}; it holds "
            f"{sorted(arrays)}: say which with the key"
        )
    motions = arrays[key]
    if motions.ndim not in (2, 3) or motions.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{path}: {key} has shape {motions.shape} and type {motions.dtype}, expected numbers "
            "of shape (T, D) or (N, T, D)"
        )
    outcomes = next((arrays[name] for name in _OUTCOME_KEYS if name in arrays), None)
    episodes = [path.stem]
    if motions.ndim == 2:
        motions, outcomes = motions[None], None if outcomes is None else outcomes.reshape(1, -1)
    else:
        episodes = [str(index) for index in range(len(motions))]
    if outcomes is not None and (
        outcomes.ndim != 2 or len(outcomes) != len(motions) or outcomes.dtype.kind not in "fiu"
    ):
        raise FileFormatError(
            f"{path}: outcomes have shape {outcomes.shape}, expected numbers of shape "
            f"({len(motions)}, k)"
        )
    names = tuple(map(str, np.ravel(arrays.get("joint_names", arrays.get("names", ())))))

    def episode_of(index: int) -> Recording:
        clock = _clock(path, arrays, motions.shape[1], index, episodes[index], options)
        outcome = None if outcomes is None else outcomes[index]
        return recorded(episodes[index], clock, motions[index], names, outcome=outcome)

    for index, episode in enumerate(episodes):
        yield episode, partial(episode_of, index)


def _arrays(path: Path) -> Arrays:
    """Everything in a file; of our own demonstrations and plans also their metadata."""
    if path.suffix.lower() == ".npy":
        check_bytes(path, path.stat().st_size)
        with named_damage(path, "NPY with plain numbers"), path.open("rb") as file:
            return {_MOTION_KEYS[0]: np.load(file, allow_pickle=False)}
    remedy = "it must be an NPZ with plain number arrays; copy it again, or say its format"
    with open_npz(path, remedy, MOST_BYTES) as archive:
        content = {name: archive[name] for name in archive.files}
        if "metadata" in content:
            metadata = json.loads(str(content.pop("metadata")))
            form = metadata.get("format", metadata)
            content.setdefault("dt", np.array(float(form["dt"])))
            content.setdefault("names", np.array(form.get("names") or form.get("joint_names")))
        return content


def _clock(
    path: Path, arrays: Arrays, count: int, index: int, episode: str, options: ReadOptions
) -> Clock:
    with named_damage(path, "NPZ with times t, or dt, or rate"):
        name = options.time_column
        if name is None:
            name = next((n for n in arrays if split_unit(n, SECONDS)[0] in _TIMES), None)
        elif name not in (*arrays, NO_COLUMN):
            raise FileFormatError(f"{path} has no array {name}; it holds {sorted(arrays)}")
        if name is not None and name in arrays:
            stamps = arrays[name]
            if stamps.size == count:
                stamps = stamps.ravel()  # a column, as panda_py's `get_log` has it
            elif stamps.ndim == 2:
                stamps = stamps[index]
            return options.clock(episode, count, stamps=stamps, name=name)
        if name is None and "dt" in arrays:
            return options.clock(episode, count, name="dt", own_rate=1 / float(arrays["dt"]))
        if name is None and "rate" in arrays:
            return options.clock(episode, count, name="rate", own_rate=float(arrays["rate"]))
    return options.clock(episode, count)

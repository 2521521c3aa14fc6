"""Recordings in NPZ or NPY: a file an episode, or one file whose motion has shape (N, T, D).

An NPY holds the motion; an NPZ also `t`, `dt` or `rate`, and perhaps names, units, `lengths` and
outcomes. There the motion is `key`, `q`, `plans`, `positions`, `actions`, or an array a joint.
"""

from __future__ import annotations

import contextlib
import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.beside import Arrays
from prior_reinforce.arm.recordings.bounds import MOST_BYTES, check_bytes
from prior_reinforce.arm.recordings.naming import read_metadata
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import (
    EPISODE_COLUMNS,
    Episodes,
    files_at,
    named_damage,
    natural_order,
    unread,
)
from prior_reinforce.arm.recordings.stated import by_field, motion_keys, recording_of_arrays
from prior_reinforce.arm.recordings.units import SECONDS, split_unit
from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import open_npz
from prior_reinforce.units import base_of

SUFFIXES = (".npz", ".npy")
_MOTION_KEYS = ("q", "plans", "positions", "actions")
_TAKE = re.compile(r"(.+?)_?\d+")
"""Name of an array that is a throw of its own: `throw_0`."""
_OUTCOME_KEYS = ("outcome", "outcomes", "outcomes_seen")


def read(source: Path, options: ReadOptions) -> Episodes:
    """Read a file, or every one of a folder as an episode."""
    paths = files_at(source, SUFFIXES)
    for path in paths:
        if len(paths) > 1 and options.leaves_out(path.stem):
            yield path.stem, unread
        else:
            arrays = {name: _times(name, array) for name, array in by_field(_arrays(path)).items()}
            yield from _each(path, arrays, options)


def _each(path: Path, arrays: Arrays, options: ReadOptions) -> Episodes:
    """Yield the episodes of a file: arrays `throw_0`, or frames numbered by an array."""
    numbered = {name: found[1].lower() for name in arrays if (found := _TAKE.fullmatch(name))}
    takes = [n for n, own in numbered.items() if own in EPISODE_COLUMNS and arrays[n].ndim == 2]
    if len(takes) > 1 and not options.key and not any(name in arrays for name in _MOTION_KEYS):
        shared = {name: array for name, array in arrays.items() if name not in takes}
        outcomes = [name for name in _OUTCOME_KEYS if name in shared]
        if any(len(np.atleast_1d(shared[name])) != len(takes) for name in outcomes):
            each = ", ".join(takes)
            raise FileFormatError(f"{path}: {outcomes[0]} needs a row for each of {each}")
        for i, name in enumerate(sorted(takes, key=natural_order)):
            own = shared | {key: shared[key][i] for key in outcomes}
            yield from _episodes(path, {**own, _MOTION_KEYS[0]: arrays[name]}, name, options)
        return
    column = next((name for name in arrays if name.lower() in EPISODE_COLUMNS), None)
    if column is None or arrays[column].ndim != 1 or len(set(arrays[column].tolist())) < 2:
        yield from _episodes(path, arrays, path.stem, options)
        return
    numbers, rest = arrays[column], {k: v for k, v in arrays.items() if k != column}
    for number in sorted(set(numbers.tolist())):
        rows = np.flatnonzero(numbers == number)
        own = {k: v[rows] if v.shape[:1] == numbers.shape else v for k, v in rest.items()}
        yield from _episodes(path, own, str(number), options)


def _episodes(path: Path, arrays: Arrays, name: str, options: ReadOptions) -> Episodes:
    keys = motion_keys(path, options, arrays, _MOTION_KEYS, most=3)
    motions = arrays[keys[0]]
    outcomes = next((arrays[name] for name in _OUTCOME_KEYS if name in arrays), None)
    episodes, several = [name], motions.ndim == 3
    chunks = several and len(motions) > motions.shape[1] > 1
    # A frame later, all actions but the last are the next ones.
    if chunks and np.array_equal(motions[1:, :-1], motions[:-1, 1:]):
        raise FileFormatError(
            f"{path}: {keys[0]} of shape {motions.shape} looks like chunks of {motions.shape[1]} "
            f"actions a frame: write the first of each, {keys[0]}[:, 0], or name another by --key"
        )
    if not several:
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
    texts, numbers = read_metadata({n: a for n, a in arrays.items() if a.dtype.kind in "SU"})
    names = next((texts[name] for name in ("joint_names", "names") if name in texts), ())
    wrong = len(keys) == 1 and len(set(names)) != (*motions.shape, 1)[2]

    for index, episode in enumerate(episodes):
        own = {
            name: array[index] if several and array.shape[:1] == motions.shape[:1] else array
            for name, array in arrays.items()
            if array.dtype.kind in "biuf" and name not in _OUTCOME_KEYS
        }
        of_file: dict[str, Any] = {"texts": texts, "stated": {**numbers, **own}}
        of_file |= {"names": names if wrong else ()}
        of_file |= {"outcome": None if outcomes is None else outcomes[index]}
        there = {name: array for name, array in own.items() if array.ndim > 0}
        yield episode, partial(recording_of_arrays, path, episode, keys, there, options, **of_file)


def _arrays(path: Path) -> Arrays:
    """Everything in a file; of our own demonstrations and plans also their metadata."""
    if path.suffix.lower() == ".npy":
        check_bytes(path, path.stat().st_size)
        with named_damage(path, "NPY with plain numbers"), path.open("rb") as file:
            return {_MOTION_KEYS[0]: np.load(file, allow_pickle=False)}
    remedy = "it must be an NPZ with plain number arrays; copy it again, or say its format"
    with open_npz(path, remedy, MOST_BYTES) as archive:
        content = {name: np.asarray(archive[name]) for name in archive.files}
        said: Any = {}
        with contextlib.suppress(ValueError, KeyError):
            said = json.loads(str(content["metadata"]))
        ours = isinstance(said, dict) and str(said.get("file_format")).startswith("prior-reinforce")
        if ours:  # else another program's, which is searched as any text is
            form = said.get("format", said)
            content.setdefault("dt", np.array(float(form["dt"])))
            content.setdefault("names", np.array(form.get("names") or form.get("joint_names")))
            del content["metadata"]
        return content


def _times(name: str, array: np.ndarray) -> np.ndarray:
    """Return dates and times as numbers, in the unit in their name, else in [s]; others as is."""
    if array.dtype.kind == "M":
        array = array - np.datetime64(0, "s")
    if array.dtype.kind != "m":
        return array
    return array / np.timedelta64(1, "s") / base_of(split_unit(name, SECONDS)[1] or "s")[1]

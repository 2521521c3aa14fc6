"""Find the motion among a file's arrays, with the names, units and length that the file states.

Recorders name these as they like, so contents count: names are as many as columns.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.beside import MASK, Arrays, arrays_beside, follows, may_move
from prior_reinforce.arm.recordings.clock import clock_from_arrays
from prior_reinforce.arm.recordings.naming import (
    OTHER_NAMES,
    Texts,
    find_channels,
    missing_channels,
)
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.recording import (
    MOST_LOST,
    Positions,
    Recording,
    recorded,
    refuse_exchanged,
    without_units,
)
from prior_reinforce.arm.recordings.time_finder import Clock, says_time
from prior_reinforce.arm.recordings.units import CHANNEL_UNITS, Ambiguity, known_unit, say_names
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError
from prior_reinforce.plans.channels import (
    Kind,
    is_of_pose,
    is_of_tool,
    kinds,
    one_for_all,
    says_no_position,
)

_NAMES = re.compile(r"name|joint|dof|motor|actuator|channel|column|label|ax[ei]s", re.IGNORECASE)
_FRAMES = re.compile(
    r"lengths?|(n|num)_?(frames|steps|samples)|(episode|traj|trajectory|sequence)_(len|lengths?)"
)
OUTCOME = re.compile(r"(.*[^a-z])?(outcomes?|landings?|landed)([^a-z].*)?", re.IGNORECASE)
"""Names of arrays of outcomes."""
JOINT_WORDS = r"(joint|angle|angular|position|motion|rotation|q)s?"
_UNIT = re.compile(rf"(.*\.)?(({JOINT_WORDS}_?)*units?|units?\.({JOINT_WORDS}_?)+)", re.IGNORECASE)
"""Path of the joints' units, deep in a file's metadata."""
_IN_UNITS = re.compile(r"(^|[._])units?\.[^.]+$", re.IGNORECASE)
"""Path of a channel's own unit: `meta.units.elbow`."""
_SOUND, _FASTER = 1_000_000, 20
"""Size of an array with a sample rate of its own at most, or so many times the motion's. Ours:
sound has more."""
_FAR_OFF, _SLACK = 5.0, 0.01
"""Standard deviations by which a motion may be off the stated mean, and rounding of that. Ours."""
_ACTIONS = re.compile(r"(^|[^a-z])actions?$", re.I)
"""Names of actions, which a controller may scale."""
_STATES = re.compile(r"(^|[^a-z])(q|q?pos(itions?)?|(joint_?)?states?|joints?|obs\w*)$", re.I)
"""Names of measured joints."""
_ROUNDING = 1e-6
"""Rounding of single precision near 1."""
_VALID = re.compile(
    r"((observations?|obs|data|frames?|robot|arm|joints?|joint_states?)[/.])*"
    r"((is|frame|pose|data)_)?(valid|tracked)(_(mask|flag))?"
)
"""Flags that are 0 in frames that were not measured; `ball/tracked` is of something else."""
_SUCCESS = re.compile(
    r"((is|was|has|task|episode|demo|trial|throw)[ _]?)*"
    r"((?P<good>success(ful)?|succeeded)|fail(ed|ure)?|aborted|discard(ed)?)",
    re.IGNORECASE,
)
"""Flags of an episode that went well, or did not; `next.success` is LeRobot's."""
_TRUE, _FALSE = {"true", "yes", "1", "1.0"}, {"false", "no", "0", "0.0"}
_STEMS = re.compile("[/.]")
"""Separators in an array's path: `observations/q`, `stats.q_mean`."""


def by_field(
    arrays: Mapping[str, Any], field_of: Callable[[Any, str], Any] = getitem
) -> dict[str, Any]:
    """Return arrays with each field of a record by itself, by the field's name."""
    fields = [(name, field) for name, array in arrays.items() for field in array.dtype.names or ()]
    twice = len({field for _, field in fields} | arrays.keys()) < len(fields) + len(arrays)
    plain = {name: array for name, array in arrays.items() if not array.dtype.names}
    return plain | {f"{n}.{f}" if twice else f: field_of(arrays[n], f) for n, f in fields}


def motion_keys(
    where: object,
    options: ReadOptions,
    arrays: Mapping[str, Any],
    usual: Sequence[str],
    *,
    most: int = 2,
) -> tuple[str, ...]:
    """Return the arrays of the motion: the user's, the first `usual` one, the joints', or the only.

    The motion has up to `most` dimensions, (T, D) or (N, T, D); an array of one joint has (T,).
    FileFormatError lists arrays that may be it if none is, or one has another shape or no numbers.
    """
    shapes = {name: array.shape for name, array in arrays.items() if array.dtype.kind in "fiu"}
    single = [name for name, shape in shapes.items() if len(shape) == 1]
    fit = sorted(name for name, shape in shapes.items() if 2 <= len(shape) <= most)
    there = [name for name in fit if not OUTCOME.fullmatch(name)]
    keys = options.key or tuple(name for name in usual if name in shapes)[:1]
    keys = keys or tuple(single[i] for i in find_channels(options.joints or (), single) or ())
    keys = keys or tuple(there if len(there) == 1 and not says_no_position(there[0]) else ())
    for key in keys or [name for name in usual if name in arrays] or [" or ".join(usual)]:
        least = 1 if options.key or (key in single and key not in usual) else 2
        if not least <= len(shapes.get(key, ())) <= most:
            has = f"no array {key}" if key else "no array that is surely the motion"
            if key in arrays:
                has = f"{key} of shape {arrays[key].shape} and type {arrays[key].dtype}"
            remedy = "say which with --key"
            if there and all(map(says_no_position, there)):
                remedy = "by their names these are no positions: record those, or if one holds them"
                remedy += ", --key"
            raise FileFormatError(
                f"{where} has {has} (expected numbers of shape (T, D)"
                f"{' or (N, T, D)' * (most > 2)}); it holds {there or fit}: {remedy}"
            )
    return keys


def worth_reading(shapes: Mapping[str, Sequence[int]], keys: Sequence[str]) -> Iterator[str]:
    """Yield the arrays of the motion, those that may move beside it, its times, and masks."""
    count, most = shapes[keys[0]][0], max(_SOUND, _FASTER * math.prod(shapes[keys[0]]))
    for name, shape in shapes.items():
        size = math.prod(shape)
        fits = 0 < len(shape) <= 2 and (shape[0] == count or size <= most)
        if name in keys or (fits and (size == count or may_move(name, math.prod(shape[1:])))):
            yield name


def recording_of_arrays(
    where: Path,
    episode: str,
    keys: Sequence[str],
    arrays: Arrays,
    options: ReadOptions,
    *,
    texts: Texts,
    stated: Mapping[str, Any] | None = None,
    names: Sequence[str] = (),
    clock: Clock | None = None,
    **more: Any,
) -> Recording:
    """Return the recording whose motion is the arrays `keys`, (T,) or (T, D), side by side.

    `arrays` are all of the episode, `texts` and `stated` the file's texts and further numbers, such
    as a rate. `names` are those of the columns, if they are known.
    """
    refuse_rates(f"{where}: {episode}", keys, options.joints or ())
    count = len(arrays[keys[0]])
    stated = stated or {}
    # A number a frame is (T,), also where it was written as (T, 1) or (1, T).
    flat = {n: a.ravel() for n, a in arrays.items() if a.size == count and n not in keys}
    arrays = {**arrays, **flat}
    kept, why = recorded_frames(f"{where}: {episode}", keys[0], {**stated, **arrays}, count)
    arrays, stated = (
        {n: a[:kept] if np.shape(a)[:1] == (count,) else a for n, a in each.items()}
        for each in (arrays, stated)
    )
    positions, known = _joined(where, keys, arrays, texts, options.joints)
    positions, unmeasured = without_invalid(episode, positions, arrays)
    if options.units is None:
        _refuse_normalised(f"{where}: {episode}", positions, {**stated, **arrays}, keys)
        if Kind.ANGLE in kinds(options.joints or ()):
            _refuse_scaled(f"{where}: {episode}", positions, arrays, keys)
    bare, units = without_units(names or known)
    if not bare and len(positions) > 1:
        refuse_exchanged(episode, positions)
    said = stated_units(texts, bare or ("",) * positions.shape[1])
    units = tuple(a or b for a, b in zip(said, units or (None,) * len(said), strict=False))
    clock = clock or clock_from_arrays(where, episode, kept, arrays, options, stated, keys)
    others = {name: array for name, array in arrays.items() if name not in keys}
    called = (*keys, *(names or known))
    more["beside"] = arrays_beside(positions, others, clock.times, called)
    failed = failures({**texts, **stated, **arrays})
    more["remarks"] = (*more.get("remarks", ()), *why, *unmeasured, *failed)
    if not bare:
        unclear = _other_names(episode, texts, positions.shape[1], options.joints or ())
        more["ambiguities"] = (*clock.ambiguities, *unclear)
    return recorded(episode, clock, positions, bare, units=units, **more)


def refuse_rates(where: str, keys: Sequence[str], joints: Sequence[str]) -> None:
    """Refuse to take as joints what a key calls velocities, torques or the like."""
    if Kind.ANGLE not in kinds(joints) or any(map(says_no_position, joints)):
        return
    for key in keys:
        name = _STEMS.split(key)[-1]
        if says_no_position(name) and not is_of_pose(name) and not is_of_tool(name):
            raise FileFormatError(
                f"{where}: {key} looks like velocities, torques or the like, and not the positions "
                f"of {say_names(joints)}: name what holds those with --key, or record them; if it "
                "holds them, rename it"
            )


def _refuse_normalised(
    where: str, positions: np.ndarray, stated: Mapping[str, Any], keys: Sequence[str]
) -> None:
    """Refuse a motion `q` that is far from the `mean` or `q_mean`, or the range, in its file."""
    stems = {"", *(_STEMS.split(key.lower())[-1] for key in keys)}
    for words in (("mean", "std"), ("min", "max")):
        limits = [
            np.ravel(numbers)
            for word in words
            for name, numbers in stated.items()
            if (stem := re.fullmatch(rf"(|.*[^a-z]){word}", name.lower()))
            and _STEMS.split(stem[1].rstrip("/._ "))[-1] in stems
            and np.size(numbers) == positions.shape[1]
            and np.asarray(numbers).dtype.kind in "fiu"
        ]
        if len(limits) != len(words):
            continue  # none, or of several arrays
        one, two = limits
        low, high = (one - _FAR_OFF * two, one + _FAR_OFF * two) if words[0] == "mean" else limits
        if np.all(low == -1) and np.all(high == 1):
            continue  # of what a controller takes, whatever is recorded
        middle = np.nanmedian(positions, axis=0)
        if np.any((middle < low - _SLACK) | (middle > high + _SLACK)):
            raise FileFormatError(
                f"{where} says {' and '.join(words)} of its columns, and the motion is far from "
                "these: write it as it was before it was normalised; or if it is not, say its unit "
                "with --units"
            )


def _refuse_scaled(where: str, positions: Positions, arrays: Arrays, keys: Sequence[str]) -> None:
    """Refuse actions within -1 and 1 that are scaled: they reach an end, or no joints follow."""
    most = np.nanmax(np.abs(positions), initial=0.0)
    if not any(_ACTIONS.search(key) for key in keys) or most > 1 + _ROUNDING:
        return
    alike = [name for name, array in arrays.items() if array.shape == positions.shape]
    joints = [n for n in alike if n not in keys and _STATES.search(n) and not says_no_position(n)]
    unlike = joints and not any(follows(arrays[name], positions, (1.0,)) for name in joints)
    if most > 1 - _ROUNDING or unlike:
        by_key = f"--key {' or '.join(joints)}" if joints else "--key"
        raise FileFormatError(
            f"{where}: {keys[0]} stays within -1 and 1, as actions do that a controller scales: "
            f"name what was measured with {by_key}; if these are angles, say so with --units rad"
        )


def _other_names(
    episode: str, texts: Texts, count: int, joints: Sequence[str]
) -> Iterator[Ambiguity]:
    """Ask about names that hold wanted joints, but are not as many as the columns."""
    for key, names in texts.items():
        missing = missing_channels(joints, names)
        if len(missing) < len(joints) and tuple(joints)[: len(names)] != names:
            every = (*names, *missing)
            order = shlex.join(every) if len(every) == count else "NAME ..."
            what = f"{episode} has {count} columns, and {key} names {say_names(names)}"
            what += ": it looks as if these were the first, in that order"
            yield Ambiguity(what, f"--joints {order}")
            return


def _joined(
    where: Path, keys: Sequence[str], arrays: Arrays, texts: Texts, joints: Sequence[str] | None
) -> tuple[Positions, tuple[str, ...]]:
    """Put arrays (T,) and (T, D) of the same frames side by side, and name their columns.

    The file names all of them, or those of the first array; else the keys do.
    """
    columns = [arrays[key] if arrays[key].ndim > 1 else arrays[key][:, None] for key in keys]
    if len({len(column) for column in columns}) > 1:
        each = ", ".join(f"{key} has {len(arrays[key])}" for key in keys)
        raise FileFormatError(
            f"the arrays have different frames: {each}; take one of them, or write the others at "
            f"the times of {keys[0]}: numpy.interp(its times, their own times, their values)"
        )
    widths = [column.shape[1] for column in columns]
    names = list(stated_names(where, texts, sum(widths), joints))
    place = _coordinates(keys[0], widths)
    if len(keys) == 1 and not names:
        names = place
    if len(keys) > 1 and not names:
        names = list(stated_names(where, texts, widths[0], joints)) if widths[0] > 1 else [keys[0]]
        names = names or place or [f"{keys[0]}_{i}" for i in range(widths[0])]
        for key, width in zip(keys[1:], widths[1:], strict=True):
            names += [key if width == 1 else f"{key}_{i}" for i in range(width)]
    return np.concatenate(columns, axis=1).astype(np.float64), tuple(names)


def _coordinates(key: str, widths: Sequence[int]) -> list[str]:
    """Return names for the numbers of a place, `tcp_x`, or of a pose; none if they may be joints.

    An array called only `positions` is a place beside the four numbers of an attitude.
    """
    names = [f"{key}_{one}" for one in ("xyz" if widths[0] == 3 else range(widths[0]))]
    bare = key.rpartition("/")[2].lower() in ("p", "pos", "position", "positions")
    is_place = Kind.PLACE in kinds(names) and (4 in widths or not bare)
    return names if is_place else []


def stated_names(
    where: object, texts: Texts, count: int, joints: Sequence[str] | None = None
) -> tuple[str, ...]:
    """Return the names of so many columns among a file's texts; none if there are none.

    They hold a wanted joint, or are called names. FileFormatError if two contradict each other.
    """
    wanted = tuple(joints or ())
    fit = {
        key: names
        for key, names in texts.items()
        if len(names) == len(set(names)) == count and all(names) and not says_no_position(key)
        if not all(known_unit(word) for word in names)
    }
    sure = [k for k, names in fit.items() if len(missing_channels(wanted, names)) < len(wanted)]
    called = [key for key in fit if _NAMES.search(key) and not OTHER_NAMES.search(key)]
    keys = {fit[key]: key for key in sure or called}
    if len(keys) > 1:
        each = "; ".join(f"{key} says {say_names(names)}" for names, key in keys.items())
        raise FileFormatError(
            f"{where} names the columns in two ways: {each}; keep the right one in the file"
        )
    return next(iter(keys), ())


def stated_units(texts: Texts, names: Sequence[str]) -> tuple[str | None, ...]:
    """Return the stated unit of each column; a single one holds for all that can be in it."""
    by_name = {key.rpartition(".")[2]: texts[key] for key in texts if _IN_UNITS.search(key)}
    if {*names} & by_name.keys():  # {"units": {"elbow": "deg", ...}}
        texts = {"units": tuple(by_name.get(name, ("",))[0] for name in names)}
    for key, words in texts.items():
        if "unit" not in key.lower() or says_time(key) or len(words) not in (1, len(names)):
            continue
        if "." in key and (OTHER_NAMES.search(key) or not _UNIT.fullmatch(key)):
            continue
        units = [unit if unit in CHANNEL_UNITS else None for unit in map(known_unit, words)]
        if len(words) == 1 and units[0] is not None:
            units = one_for_all(units[0], names)
        if any(units):
            return tuple(units)
    return (None,) * len(names)


def says_valid(name: str) -> bool:
    """Whether a flag's name says that 0 marks frames without a measurement: `is_valid`."""
    return _VALID.fullmatch(name.lower()) is not None


def without_invalid(
    episode: str, positions: Positions, flags: Arrays
) -> tuple[Positions, tuple[str, ...]]:
    """Set a motion (T, D) to nan where a flag (T,) says it was not measured; return remarks too.

    InvalidDemonstrationsError if these are more frames than may be lost.
    """
    positions, remarks = positions.copy(), []
    for name, flag in flags.items():
        if says_valid(name) and flag.shape == positions.shape[:1] and np.all(np.isin(flag, (0, 1))):
            lost = flag == 0
            what = f"{name} is 0 in {lost.sum()} of {len(lost)} frames, which calls them unmeasured"
            if np.mean(lost) > MOST_LOST:
                raise InvalidDemonstrationsError(
                    f"episode {episode}: {what}; if it is of something else, rename it in the "
                    "file, else drop that episode (--leave-out)"
                )
            positions[lost] = np.nan
            remarks += [f"{what}: they are left out"] * bool(lost.any())
    return positions, tuple(remarks)


def says_success(name: str) -> bool:
    """Whether a flag's name says how an episode went: `is_success`, `failed`."""
    return _SUCCESS.fullmatch(_STEMS.split(name)[-1]) is not None


def failures(flags: Mapping[str, Any]) -> Iterator[str]:
    """Remark on flags, of the episode or of each frame, that call it failed."""
    for name, value in flags.items():
        if (match := _SUCCESS.fullmatch(_STEMS.split(name)[-1])) is None:
            continue
        values = {str(one).lower() for one in np.ravel(value).tolist()}
        if values and values <= _TRUE | _FALSE and bool(values & _TRUE) != bool(match["good"]):
            yield (
                f"{name} calls it failed: its motion is learned, with where it landed; if it is no "
                "motion to learn from, leave that episode out (--leave-out)"
            )


def other_count(where: str, declared: str, key: str, count: int) -> FileFormatError:
    """Return what to raise where an episode declares another number of frames than it holds."""
    return FileFormatError(
        f"{where} declares {declared} but {key} holds {count}; copy the file again, or leave that "
        "episode out"
    )


def recorded_frames(
    where: str, key: str, stated: Mapping[str, Any], count: int
) -> tuple[int, tuple[str, ...]]:
    """Return how many frames are no padding, and a remark.

    A stated number of frames tells it, a mask, or a motion of nan at the end. FileFormatError if
    frames beyond the stated number move.
    """
    found, kept = "", count
    for name, value in stated.items():
        own, numbers = name.rpartition("/")[2].lower(), np.asarray(value)
        n = count
        flags = MASK.fullmatch(own) and numbers.shape == (count,) and numbers.dtype.kind in "biuf"
        if flags and not (says_valid(own) and numbers[0] == 0):
            real = numbers.astype(bool) == bool(numbers[0])
            n = int(np.argmin(np.append(real, False)))
            n = count if np.any(real[n:]) else n
        elif _FRAMES.fullmatch(own) and numbers.size == 1 and numbers.dtype.kind in "iu":
            n = int(numbers.reshape(()))
            rest = np.nan_to_num(np.asarray(stated[key], dtype=float)[n:])
            if 0 < n < count and np.any(np.diff(rest, axis=0)):
                raise other_count(where, f"{n} samples by {name}", key, count)
        elif name == key and numbers.dtype.kind == "f":
            ends = np.isnan(numbers[::-1]).all(axis=tuple(range(1, numbers.ndim)))
            n = count - int(np.argmin(np.append(ends, False)))
        if 1 < n < kept:
            found, kept = f"nan in {name}" if name == key else name, n
    remark = f"{count - kept} frames at the end left out, which are padding by {found}"
    return kept, (remark,) * (kept < count)

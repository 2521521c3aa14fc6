"""What a file holds beside the motion: its names and units, its length, and what else moves.

Recorders call these things as they like. So they are told by what they hold: names are texts, as
many as the columns; a command repeats the motion; a clock runs with it.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from prior_reinforce.arm.recordings.bounds import check_names
from prior_reinforce.arm.recordings.channels import one_for_all
from prior_reinforce.arm.recordings.clock import (
    COUNTER,
    NO_COLUMN,
    SAME_RATE,
    Clock,
    Times,
    clock_among,
    declared_rate,
    rises,
    says_time,
    tells_time,
)
from prior_reinforce.arm.recordings.naming import Texts, missing_channels, said_in, vectors
from prior_reinforce.arm.recordings.recording import (
    Positions,
    Recording,
    recorded,
    without_units,
)
from prior_reinforce.arm.recordings.tables import Table
from prior_reinforce.arm.recordings.units import (
    CHANNEL_UNITS,
    SECONDS,
    Ambiguity,
    known_unit,
    say_names,
)
from prior_reinforce.arm.robots.limits import says_no_position
from prior_reinforce.errors import FileFormatError
from prior_reinforce.plans.signals import held_channels
from prior_reinforce.plans.whole_turns import TURN

if TYPE_CHECKING:
    from prior_reinforce.arm.recordings.options import ReadOptions

Arrays = Mapping[str, np.ndarray]
_MOST_BESIDE = 64
"""Numbers a frame of what may be a part of the motion; ours: two hands have fewer, a lidar more."""
_NAMES = re.compile(r"name|joint|dof|motor|actuator|channel|column|label|ax[ei]s", re.IGNORECASE)
_OTHER_NAMES = re.compile(r"link|body|bodies|camera|task|object|site|sensor|frame", re.IGNORECASE)
_ELSE = re.compile(
    r"(^|/)(next_obs|env_states?|timestamps?)/|(^|[/.])(actions?|states|objects?)$|(^|[/._])"
    r"(rewards?|dones?|success(es)?|terminals?|terminated|truncated|discounts?)$|(^|[/._])(cos|sin"
    r"|modes?|status)($|_)|volt|control_output|camera|image|f_ext|dtheta",
    re.IGNORECASE,
)
"""Names of what moves and is no part of an arm: outcomes and whole states of a simulator."""
_FRAMES = re.compile(
    r"lengths?|(n|num)_?(frames|steps|samples)|(episode|traj|trajectory|sequence)_(len|lengths?)"
)
_MASK = re.compile(
    r"((is|frame|attention|episode)_)?(pad|padded|padding|valid|masks?|(pad|padding|valid)_mask)"
)
_PLACE_KEY = re.compile(
    r"(.*[^a-z])?(eef?|tcp|tool|tip|hand|flange|cart(esian)?|end_?effector)([^a-z].*)?"
    r"|p|pos|positions?|xyz|trans(lation)?|place",
    re.IGNORECASE,
)
"""What three numbers are called that are a place."""
_UNIT = re.compile(r"((joint|angle|angular|position|motion|rotation)s?_?)?units?", re.IGNORECASE)
"""What the joints' units are called among others, deep in what a file says of itself."""
_MOST_SAID = 1_000_000
"""Bytes of a JSON beside a table at most. Ours: it says what the columns are."""
_SAME, _SHIFTS = 0.3, 21
"""Part of its spread by which a reading may differ from another, and delays that are tried, up to a
fifth of the recording either way. Ours: a command differs by what a controller lags behind."""
_SCALES = (1.0, TURN["deg"] / TURN["rad"], TURN["rad"] / TURN["deg"], 1000.0, 100.0, 0.01, 0.001)
"""Factors between readings in two units."""
_OTHER_ZERO = 1.0
"""Part of its spread by which a command lies beside the motion at most, as under a load. Ours; what
starts from another pose is another arm."""
_MEASURED = re.compile(r"act|meas|real|state|curr|ist(?![a-z])|obs|feedback", re.IGNORECASE)
_SIDE = re.compile(
    r"(?<!b)right|left|izq|der(?=ech)|gauche|droite?|(robot|arm|hand|gripper)_?\d+"
    r"|(?<![a-z])[lr](?![a-z])"
)
"""Which of two arms a name is of."""
_FEWEST, _BENDS = 20, 6
"""Frames of what moves at a rate of its own and has no times, and how often it goes through its
range at most; ours: tables of other things jump."""
_SAME_CLOCK = 0.01
"""Share by which two clocks of a recording differ at most. Ours."""


def recorded_among(
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

    `arrays` are all that may say something of it, `texts` what the file says in words, and `stated`
    further numbers, of which one may count frames, or be the rate. `names` are those of the columns
    if they are known.
    """
    count = len(arrays[keys[0]])
    stated = stated or {}
    stated = stated if options.time_column else with_rate(where, stated, options.rate)
    kept, why = frames_said(f"{where}: {episode}", keys[0], {**stated, **arrays}, count)
    arrays = {n: a[:kept] if a.shape[:1] == (count,) else a for n, a in arrays.items()}
    positions, known = joined(where, keys, arrays, texts, options.joints)
    bare, units = without_units(names or known)
    said = units_said(texts, bare or ("",) * positions.shape[1])
    units = tuple(a or b for a, b in zip(said, units or (None,) * len(said), strict=False))
    if clock is None:
        declared = None if options.time_column == NO_COLUMN else stated
        clock = clock_among(where, episode, kept, arrays, options, declared)
    others = {name: array for name, array in arrays.items() if name not in keys}
    called = (*keys, *(names or known))
    more = {"left_out": moves_beside(positions, others, clock.times, called)} | more
    more["remarks"] = (*more.get("remarks", ()), *why)
    if not bare:
        unclear = _other_names(episode, texts, positions.shape[1], options.joints or ())
        more["ambiguities"] = (*clock.ambiguities, *unclear)
    return recorded(episode, clock, positions, bare, units=units, **more)


def _other_names(
    episode: str, texts: Texts, count: int, joints: Sequence[str]
) -> Iterator[Ambiguity]:
    """Ask about texts that hold wanted joints and are not as many as the columns."""
    for key, own in texts.items():
        missing = missing_channels(joints, own)
        if len(missing) < len(joints) and tuple(joints)[: len(own)] != own:
            order = shlex.join((*own, *missing)) if len(own) + len(missing) == count else "NAME ..."
            what = f"{episode} has {count} columns, and {key} names {say_names(own)}"
            what += ": it looks as if these were the first, in that order"
            yield Ambiguity(what, f"--joints {order}")
            return


def joined(
    where: Path,
    keys: Sequence[str],
    arrays: Arrays,
    texts: Texts,
    joints: Sequence[str] | None = None,
) -> tuple[Positions, tuple[str, ...]]:
    """Put arrays (T,) and (T, D) of the same frames side by side, with the names of the columns.

    Names are of all columns, or of the first array's; without any, several keys name the columns.
    """
    columns = [arrays[key] if arrays[key].ndim > 1 else arrays[key][:, None] for key in keys]
    if len({len(column) for column in columns}) > 1:
        each = ", ".join(f"{key} has {len(arrays[key])}" for key in keys)
        raise FileFormatError(
            f"the arrays have different frames: {each}; take one of them, or write the others at "
            f"the times of {keys[0]}: numpy.interp(its times, their own times, their values)"
        )
    widths = [column.shape[1] for column in columns]
    said = list(names_said(where, texts, sum(widths), joints))
    if len(keys) > 1 and not said:
        said = list(names_said(where, texts, widths[0], joints)) if widths[0] > 1 else [keys[0]]
        place = widths[0] == 3 and _PLACE_KEY.fullmatch(keys[0].rpartition("/")[2])
        said = said or [
            f"{keys[0]}_{'xyz'[i]}" if place else f"joint{i + 1}" for i in range(widths[0])
        ]
        for key, width in zip(keys[1:], widths[1:], strict=True):
            said += [key if width == 1 else f"{key}_{i}" for i in range(width)]
    return np.concatenate(columns, axis=1).astype(np.float64), tuple(said)


def names_said(
    where: object, texts: Texts, count: int, joints: Sequence[str] | None = None
) -> tuple[str, ...]:
    """Return the names that a file's texts give to so many columns; none if none fit.

    Texts that hold a wanted joint are names, whatever they are called; others if they are called
    so. FileFormatError where two contradict each other.
    """
    wanted = tuple(joints or ())
    fit = {
        key: own
        for key, own in texts.items()
        if len(own) == len(set(own)) == count and all(own) and not says_no_position(key)
        if not all(known_unit(word) for word in own)
    }
    sure = {k: own for k, own in fit.items() if len(missing_channels(wanted, own)) < len(wanted)}
    called = {k: own for k, own in fit.items() if _NAMES.search(k) and not _OTHER_NAMES.search(k)}
    found = {own: key for key, own in (sure or called).items()}
    if len(found) > 1:
        each = "; ".join(f"{key} says {say_names(own)}" for own, key in found.items())
        raise FileFormatError(
            f"{where} names the columns in two ways: {each}; keep the right one in the file"
        )
    return next(iter(found), ())


def units_said(texts: Texts, names: Sequence[str]) -> tuple[str | None, ...]:
    """Return the unit of each column as a file's texts state it; none if they state no unit.

    A single one holds for all that can be in it.
    """
    for key, own in texts.items():
        if "unit" not in key.lower() or says_time(key) or len(own) not in (1, len(names)):
            continue
        if "." in key and (_OTHER_NAMES.search(key) or not _UNIT.fullmatch(key.split(".")[-1])):
            continue
        units = [unit if unit in CHANNEL_UNITS else None for unit in map(known_unit, own)]
        if len(own) == 1 and units[0] is not None:
            units = one_for_all(units[0], names)
        if any(units):
            return tuple(units)
    return (None,) * len(names)


def with_rate(
    where: object, stated: Mapping[str, Any], given: float | None = None
) -> dict[str, Any]:
    """Return a file's numbers, and by its bare name the rate among those deep in it: `meta.fps`.

    FileFormatError where it states two, and none is given.
    """
    split = {name: name.rpartition(".") for name in stated}
    places = {n: bare for n, (at, _, bare) in split.items() if not _OTHER_NAMES.search(at)}
    rates = {
        name: declared_rate(where, {bare: stated[name]})["own_rate"]
        for name, bare in places.items()
        if ("." in name or np.size(stated[name]) == 1)
        and declared_rate(where, {bare: stated[name]})
    }
    deep = [name for name in rates if "." in name]
    for name, rate in rates.items():
        first, of_first = next(iter(rates.items()))
        if deep and given is None and abs(rate - of_first) > SAME_RATE * of_first:
            raise FileFormatError(
                f"{where}: {first} says {of_first:.4g} frames a second, but {name} {rate:.4g}; "
                "take one: --rate"
            )
    own = {places[name]: stated[name] for name in deep[:1] if len(rates) == len(deep)}
    return {**stated, **own}


def headed(table: Table, joints: Sequence[str] | None = None) -> Table:
    """Return a table without heads under those that a JSON beside it gives to its columns.

    It is called as the table, or is the only one of the folder. Names of all columns but the first
    are taken if that one rises, as times do.
    """
    path = Path(table.where)
    found = [path.with_suffix(".json")]
    if not table.named and not found[0].is_file():
        found = [p for p in path.parent.glob("*.json") if not p.with_suffix(path.suffix).exists()]
    if table.named or len(found) != 1 or found[0].stat().st_size > _MOST_SAID:
        return table
    texts = said_in({"": found[0].read_bytes()})[0]
    names = names_said(found[0], texts, len(table.names), joints)
    if not names and len(table) and rises(table.stamps(0)):
        names = names_said(found[0], texts, len(table.names) - 1, joints)
        names = ("t", *names) if names else ()
    if not names:
        return table
    check_names(found[0], names)
    texts = {f".{key}": own for key, own in texts.items()}
    units = units_said(texts, names)
    if not any(units):  # of the columns but the time's
        units = (None, *units_said(texts, names[1:]))
    units = tuple(None if says_time(n) else u for n, u in zip(names, units, strict=True))
    return replace(table, names=names, units=units, named=True)


def frames_said(
    where: str, key: str, stated: Mapping[str, Any], count: int
) -> tuple[int, tuple[str, ...]]:
    """Return how many of the frames were recorded, the rest being padding, and a remark on it.

    A number of frames says so, or a mask that is one thing for the first frames and another for the
    rest. FileFormatError where frames beyond that number move.
    """
    found, kept = "", count
    for name, value in stated.items():
        own, numbers = name.rpartition("/")[2].lower(), np.asarray(value)
        n = count
        if _MASK.fullmatch(own) and numbers.shape == (count,) and numbers.dtype.kind in "biuf":
            real = numbers.astype(bool) == bool(numbers[0])
            n = int(np.argmin(np.append(real, False)))
            n = count if np.any(real[n:]) else n
        elif _FRAMES.fullmatch(own) and numbers.size == 1 and numbers.dtype.kind in "iu":
            n = int(numbers.reshape(()))
            rest = np.nan_to_num(np.asarray(stated[key], dtype=float)[n:])
            if 0 < n < count and np.any(np.diff(rest, axis=0)):
                raise FileFormatError(
                    f"{where} declares {n} samples by {name} but {key} holds {count}; copy the "
                    "file again, or leave that episode out"
                )
        if 1 < n < kept:
            found, kept = name, n
    remark = f"{count - kept} frames at the end left out, which are padding by {found}"
    return kept, (remark,) * (kept < count)


def columns_beside(
    names: Sequence[str], values: Positions, taken: Sequence[int], times: Times
) -> dict[str, tuple[float, float]]:
    """Return the range of each column that moves beside those taken; numbered ones are a group."""
    others = [i for i in range(len(names)) if i not in taken]
    groups = [[others[i] for i in g] for g in vectors([names[i] for i in others]).values()]
    in_groups = {i for group in groups for i in group}
    groups += [[i] for i in others if i not in in_groups]
    arrays = {say_names([names[i] for i in group]): values[:, group] for group in groups}
    return moves_beside(values[:, list(taken)], arrays, times, [names[i] for i in taken])


def moves_beside(
    motion: Positions, others: Arrays, times: Times, called: Sequence[str] = ()
) -> dict[str, tuple[float, float]]:
    """Return the range of each array that moves and is not taken, at the motion's rate or its own.

    `called` are names of the motion. Not listed are clocks, other readings of the motion such as
    its commands, and what is named like rates, forces, poses, or anything else that is no part of
    an arm.
    """
    found = {}
    for name, values in others.items():
        if values.ndim not in (1, 2) or values.dtype.kind not in "biuf" or not values.size:
            continue
        columns = values.reshape(len(values), -1).astype(np.float64)
        if not may_move(name, columns.shape[1]):
            continue
        moving = columns[:, [i for i in range(columns.shape[1]) if _moves(columns[:, i])]]
        said, at = name, times
        if len(columns) != len(motion):
            if not _is_series(name, moving, others):
                continue
            said = f"{name} ({len(columns)} frames, beside {len(motion)})"
            at = np.linspace(times[0], times[-1], len(columns))
            columns = np.column_stack([np.interp(times, at, own) for own in columns.T])
        clocks = all(is_clock(name, column, at) for column in moving.T)
        if not clocks and (_of_another(name, called) or not _follows(columns, motion)):
            found[said] = float(np.nanmin(moving)), float(np.nanmax(moving))
    return found


def twin_vectors(names: Sequence[str], values: Positions) -> Iterator[Ambiguity]:
    """Ask which of two vectors of numbered columns is the motion: one repeats the other."""
    groups = [(s, g) for s, g in vectors(names).items() if not says_no_position(s)]
    for (one, own), (other, of_other) in combinations(groups, 2):
        alike = len(own) == len(of_other) and not _of_another(other, [one])
        if alike and _follows(values[:, own], values[:, of_other]):
            measured = other if _MEASURED.search(other) else one
            what = f"{other} repeats {one}, as a command does"
            yield Ambiguity(f"{what}: it looks as if {measured} were measured", f"--key {measured}")
            return


def _is_series(name: str, moving: np.ndarray, others: Arrays) -> bool:
    """Whether an array that is not as long as the motion was recorded at a rate of its own.

    It has times of its own, or is long and changes as what moves does; matrices and tables do not.
    """
    for other, values in others.items():
        if other != name and values.shape == moving.shape[:1] and tells_time(other, values):
            return True
    through = np.abs(np.diff(moving, axis=0)).sum(axis=0) <= _BENDS * np.ptp(moving, axis=0)
    return len(moving) >= _FEWEST and bool(np.all(through))


def _of_another(name: str, called: Sequence[str]) -> bool:
    """Whether an array is by its name of another arm than the motion: the right one's."""
    own, of_motion = sides(name), {side for one in called for side in sides(one)}
    return bool(own - of_motion) and bool(of_motion or own & {"left", "right"})


def sides(name: str) -> set[str]:
    """Return which of several arms a name says that it is of: `left`, `r`, `robot1`."""
    spaced = re.sub("(?<=[a-z])(?=[A-Z])", "_", name).lower()
    return {match.group().replace("_", "") for match in _SIDE.finditer(spaced)}


def may_move(name: str, width: int = 1) -> bool:
    """Whether an array of so many numbers a frame could be a part of the motion, by its name."""
    own = name.rpartition("/")[2]
    no_motion = says_no_position(own) or says_time(own) or _MASK.fullmatch(own)
    return width <= _MOST_BESIDE and not no_motion and not _ELSE.search(name)


def is_clock(name: str, values: Times, times: Times) -> bool:
    """Whether a column tells the time or counts frames: by its name, or by how fast it rises."""
    steps = np.diff(values)
    seconds = times[-1] - times[0]
    if len(steps) < 2 or not np.all(steps > 0) or seconds <= 0:
        return False
    whole = bool(np.all(values % 1 == 0))
    if says_time(name) or (whole and (np.median(steps) == 1 or COUNTER.search(name.lower()))):
        return True
    rates = [(values[-1] - values[0]) * scale / seconds for scale in SECONDS.values()]
    line = values[0] + (values[-1] - values[0]) * (times - times[0]) / seconds
    near = np.abs(values - line).max() <= 3 * np.median(steps)
    return bool(near and any(abs(rate - 1) < _SAME_CLOCK for rate in rates))


def _moves(values: Times) -> bool:
    """Whether what there is of a column moves, other than by noise."""
    values = values[np.isfinite(values)]
    if len(values) < 2 or np.ptp(values) <= 1e-9 * np.abs(values).max():
        return False
    return not held_channels([values[:, None]], ("rad",))[0]


def _follows(values: np.ndarray, motion: Positions) -> bool:
    """Whether columns are another reading of the motion's: in another unit, or a command."""
    width, most = values.shape[1], motion.shape[1]
    if width > most and width % most == 0:  # several vectors under one name
        return all(_follows(values[:, k :: width // most], motion) for k in range(width // most))
    finite = np.all(np.isfinite(np.concatenate([values, motion], axis=1)), axis=1)
    values, motion = values[finite], motion[finite]
    if not max(2, most / 2) <= width <= most or not len(values):
        return False
    delays = np.unique(np.linspace(-(len(values) // 5), len(values) // 5, _SHIFTS).astype(int))
    for first in range(most - width + 1):
        own = motion[:, first : first + width]
        for delay in sorted(delays.tolist(), key=abs):
            one = values[max(0, delay) : len(values) + min(0, delay)]
            two = own[max(0, -delay) : len(own) - max(0, delay)]
            spread = np.std(two, axis=0)
            spread = np.maximum(spread, np.median(spread))
            for scale in _SCALES:
                apart = one - scale * two
                near = np.abs(apart.mean(axis=0)) <= _OTHER_ZERO * scale * spread
                if np.all(near & (np.std(apart, axis=0) <= _SAME * scale * spread)):
                    return True
    return False

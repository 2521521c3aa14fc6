"""Channels that move in a file beside the motion: a gripper, a rail, a second arm.

Recorders name them as they like, so numbers tell them apart: a command repeats the motion.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from prior_reinforce.arm.recordings.naming import vectors
from prior_reinforce.arm.recordings.recording import Beside, Positions, Recording
from prior_reinforce.arm.recordings.time_finder import Times, is_clock, looks_like_time, says_time
from prior_reinforce.arm.recordings.units import CHANNEL_UNITS, Ambiguity, say_names, split_unit
from prior_reinforce.plans.channels import commanded, is_of_base, measured_of, says_no_position
from prior_reinforce.plans.interpolation import interp_columns
from prior_reinforce.plans.signals import held_channels
from prior_reinforce.plans.whole_turns import TURN

Arrays = Mapping[str, np.ndarray]
_MOST_BESIDE = 64
"""Channels of an array that may be part of an arm, at most. Ours: two hands have fewer, a lidar
more."""
_ELSE = re.compile(
    r"(^|/)(next_obs|env_states?|timestamps?)/|(^|[/.])(actions?|states|objects?)$|(^|[/._])"
    r"(rewards?|dones?|success(es)?|is_first|is_last|(is_)?terminals?|terminated|truncated"
    r"|discounts?)$|(^|[/._])(cos|sin|modes?|status)($|_)|volt|control_output|camera|image|f_ext|dtheta",
    re.IGNORECASE,
)
"""Names of arrays that move and are no part of an arm: outcomes, whole states of a simulator."""
MASK = re.compile(
    r"((is|frame|attention|episode)_)?(pad|padded|padding|valid|masks?|(pad|padding|valid)_mask)"
)
_SAME, _SHIFTS = 0.3, 21
"""Part of its spread by which a channel may differ from another reading of it, and how many delays
are tried, up to a fifth of the recording either way. Ours: controllers lag behind commands."""
_SCALES = (1.0, TURN["deg"] / TURN["rad"], TURN["rad"] / TURN["deg"], 1000.0, 100.0, 0.01, 0.001)
"""Factors between readings in two units."""
_OTHER_ZERO = 1.0
"""Part of its spread by which a command may be offset from the motion, as under a load. Ours."""
_SIDE = re.compile(
    r"(?<!b)right|left|izq|der(?=ech)|gauche|droite?|(robot|arm|hand|gripper)_?\d+"
    r"|(?<![a-z])[lr](?![a-z])"
)
"""Sides of an arm in a name."""
_FEWEST, _BENDS = 20, 6
"""Fewest frames of an array with a sample rate of its own and no time stamps, and how often it goes
through its range at most. Ours: tables of other things jump."""


def moving_beside(recordings: Iterable[Recording]) -> dict[str, tuple[float, float]]:
    """Return the channels that move beside the motion, with their ranges; a mobile base last."""
    ends: dict[str, list[float]] = {}
    for recording in recordings:
        for low, high, name in recording.beside.values():
            ends.setdefault(name, []).extend((low, high))
    called = sorted(filter(None, ends), key=is_of_base)
    return {name: (min(ends[name]), max(ends[name])) for name in called}


def columns_beside(
    names: Sequence[str], values: Positions, taken: Sequence[int], times: Times
) -> dict[str, Beside]:
    """Return the columns beside the motion's, which are `taken`; numbered ones are one array."""
    others = [i for i in range(len(names)) if i not in taken]
    bare = [split_unit(names[i], CHANNEL_UNITS)[0] for i in others]
    groups = [[others[i] for i in group] for group in vectors(bare).values()]
    in_groups = {i for group in groups for i in group}
    groups += [[i] for i in others if i not in in_groups]
    columns_of = {say_names([names[i] for i in group]): group for group in groups}
    arrays = {name: values[:, group] for name, group in columns_of.items()}
    columns = {name: [names[i] for i in group] for name, group in columns_of.items()}
    of_motion = [names[i] for i in taken]
    return arrays_beside(values[:, list(taken)], arrays, times, of_motion, columns)


def arrays_beside(
    motion: Positions,
    others: Arrays,
    times: Times,
    called: Sequence[str] = (),
    columns: Mapping[str, Sequence[str]] | None = None,
) -> dict[str, Beside]:
    """Return every channel of the arrays beside the motion, at its sample rate or their own.

    `called` are names of the motion, and `columns` those of the arrays' channels. A moving channel
    is called by its array; those of a mobile base, lengths and angles, by their own names. Arrays
    of several channels whose name is of no part of an arm are left out.
    """
    found = {}
    for name, values in others.items():
        width, of_base = math.prod(values.shape[1:]), is_of_base(name.rpartition("/")[2])
        may = may_move(name, width) and 1 <= values.ndim <= (3 if of_base else 2)
        if values.dtype.kind not in "biuf" or not values.size or not (may or values.ndim == 1):
            continue
        numbers = values.reshape(len(values), -1).astype(np.float64)
        numbered = [f"{name}[{i}]" for i in range(width)]
        own = (columns or {}).get(name, numbered) if width > 1 else [name]
        moving = [i for i, column in enumerate(numbers.T) if may and _moves(column)]
        at, rate, along = times, "", numbers
        if moving and len(values) != len(motion):
            at = np.linspace(times[0], times[-1], len(values))
            rate = f" ({len(values)} frames, beside {len(motion)})"
            along = interp_columns(times, at, numbers)
            moving = moving if _is_series(name, numbers[:, moving], others) else []
        clocks = all(is_clock(name, numbers[:, i], at) for i in moving)
        if clocks or (not _of_another(name, called) and follows(along, motion)):
            moving = []
        for i, (channel, column) in enumerate(zip(own, numbers.T, strict=True)):
            if np.any(np.isfinite(column)):
                said = f"{channel if of_base else name}{rate}" if i in moving else ""
                found[channel] = Beside(float(np.nanmin(column)), float(np.nanmax(column)), said)
    return found


def twin_vectors(names: Sequence[str], values: Positions) -> Iterator[Ambiguity]:
    """Ask which of two vectors of numbered columns, or of columns and commands, is the motion."""
    groups = [(s, g) for s, g in vectors(names).items() if not says_no_position(s)]
    for (one, own), (other, of_other) in combinations(groups, 2):
        alike = len(own) == len(of_other) and not _of_another(other, [one])
        if alike and follows(values[:, own], values[:, of_other]):
            measured = measured_of([one, other])
            seen = f"it looks as if {measured} were measured" if measured else "name what was"
            in_vectors = {i for group in vectors(names).values() for i in group}
            alone = [i for i in range(len(names)) if i not in in_vectors and _moves(values[:, i])]
            single = [names[i] for i in alone]
            keys = " ".join(f"--key {shlex.quote(key)}" for key in (measured or "WHICH", *single))
            what = f"{other} repeats {one}, as a command does: {seen}"
            yield Ambiguity(what, keys, guessed=False)
            return
    if orders := commanded(names):
        are = "are commands or targets" if len(orders) > 1 else "is a command or a target"
        what = f"{say_names(orders)} {are} beside what was measured"
        rest = shlex.join([name for name in names if name not in orders])
        yield Ambiguity(what, f"--joints {rest}", guessed=False)


def _is_series(name: str, moving: np.ndarray, others: Arrays) -> bool:
    """Whether an array of another length is sampled over time: by time stamps, or smoothly."""
    for other, values in others.items():
        if other != name and values.shape == moving.shape[:1] and looks_like_time(other, values):
            return True
    through = np.abs(np.diff(moving, axis=0)).sum(axis=0) <= _BENDS * np.ptp(moving, axis=0)
    return len(moving) >= _FEWEST and bool(np.all(through))


def _of_another(name: str, called: Sequence[str]) -> bool:
    """Whether an array's name is of another arm than the motion: the right one."""
    own, of_motion = sides(name), {side for one in called for side in sides(one)}
    return bool(own - of_motion) and bool(of_motion or own & {"left", "right"})


def sides(name: str) -> set[str]:
    """Return the arms that a name mentions: `left`, `r`, `robot1`."""
    spaced = re.sub("(?<=[a-z])(?=[A-Z])", "_", name).lower()
    return {match.group().replace("_", "") for match in _SIDE.finditer(spaced)}


def may_move(name: str, width: int = 1) -> bool:
    """Whether an array of so many channels may be part of an arm, by its name."""
    own = name.rpartition("/")[2]
    other = (says_no_position(own) or says_time(own)) and not is_of_base(own)  # base_pose, base_T
    no_motion = other or MASK.fullmatch(own)
    return width <= _MOST_BESIDE and not no_motion and not _ELSE.search(name)


def _moves(values: Times) -> bool:
    """Whether a channel moves by more than noise, where it has values."""
    values = values[np.isfinite(values)]
    if len(values) < 2 or np.ptp(values) <= 1e-9 * np.abs(values).max():
        return False
    return not held_channels([values[:, None]], ("rad",))[0]


def follows(values: np.ndarray, motion: Positions, scales: Sequence[float] = _SCALES) -> bool:
    """Whether channels repeat some of the motion's: in another unit, or as a command."""
    width, most = values.shape[1], motion.shape[1]
    if 0 < most < width and width % most == 0:  # several vectors under one name
        n = width // most
        return all(follows(values[:, k::n], motion, scales) for k in range(n))
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
            for scale in scales:
                apart = one - scale * two
                near = np.abs(apart.mean(axis=0)) <= _OTHER_ZERO * scale * spread
                if np.all(near & (np.std(apart, axis=0) <= _SAME * scale * spread)):
                    return True
    return False

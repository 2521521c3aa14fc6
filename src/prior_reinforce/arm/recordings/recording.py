"""One episode as recorded, and what the readers of all formats share."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.recordings.bounds import check_names
from prior_reinforce.arm.recordings.time_finder import Clock, Times, is_set_back
from prior_reinforce.arm.recordings.units import (
    CHANNEL_UNITS,
    Ambiguity,
    say_names,
    split_unit,
    unit_of_other,
)
from prior_reinforce.arrays import Point
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError, PriorReinforceError
from prior_reinforce.files import without_advice

Positions = Float[np.ndarray, "T D"]
"""D channels at T times, in their units."""
Episodes = Iterable[tuple[str, Callable[[], "Recording"]]]
"""Names of a source's episodes, and how to read each; those left out are never read."""
_WIDER = 5
"""Columns without names to a frame that no motion has. Ours."""
MOST_LOST = 0.1
"""Part of an episode's frames that may be lost. Ours: beyond that, the recorder failed."""
_LEAP = 3.0
"""A leap is so many times a motion's largest step. Ours."""
EPISODE_COLUMNS = tuple(
    name + ending
    for name in ("episode", "throw", "trial", "demo", "run", "wurf", "versuch", "essai", "tiro")
    for ending in ("", "_id", "_index", "_number")
)
"""Names of a column that says to which episode a row belongs."""
ROW_COLUMNS = (*EPISODE_COLUMNS, "take")
"""The same in a table with a row a recording."""


class Beside(NamedTuple):
    """A channel that a file holds beside the motion."""

    low: float
    """Least value."""
    high: float
    """Greatest value."""
    moving: str = ""
    """Name, of it or of its array, if it moves and may be part of an arm; else empty."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One demonstration before trimming and resampling: uneven times, any channels."""

    episode: str
    """Name within its source, by which outcomes and messages refer to it."""
    times: Times
    """Time of each frame from the first, strictly increasing."""
    positions: Positions
    """Positions in the recorder's units."""
    names: tuple[str, ...] = ()
    """Names of the D channels as recorded, without units (`x_cm` is `x`); if the file names none,
    `column1`, `column2`, ..., so that none is taken for a joint by its name."""
    outcome: Point | None = None
    """Where the object landed, for the rare file that holds it."""
    remarks: tuple[str, ...] = ()
    """Notes on how it was read."""
    units: tuple[str | None, ...] = ()
    """Unit of each channel in the file; None if it states none. Empty takes those in the names."""
    clock: str = ""
    """Source of the times, for a person: `t in ms`."""
    ambiguities: tuple[Ambiguity, ...] = ()
    """What is only inferred of the times."""
    columns: tuple[str, ...] = ()
    """The file's own names of the D channels, if not `names`: numbered columns that are taken as
    the joints in order."""
    beside: Mapping[str, Beside] = field(default_factory=dict)
    """What else the file holds, channel by channel: by the file's name, with its unit."""
    named: bool = True
    """Whether the file names the channels; false without names."""

    def __post_init__(self) -> None:
        """Copy, and refuse what is no recording: InvalidDemonstrationsError, FileFormatError."""
        check_names("a recording", (self.episode, *self.names, *self.columns))
        episode = f"episode {self.episode}"
        try:
            times = np.array(self.times, dtype=np.float64)
            positions = np.array(self.positions, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise InvalidDemonstrationsError(
                f"{episode} must hold numbers: {error}; mend or drop it"
            ) from error
        width = positions.shape[1] if positions.ndim == 2 else 0
        names = tuple(map(str, self.names)) or tuple(f"column{i + 1}" for i in range(width))
        names, units = without_units(names) if not self.units else (names, tuple(self.units))
        fits = positions.shape == (times.size, len(names)) and len(names) > 0
        if times.ndim != 1 or not fits or times.size < 2:
            raise InvalidDemonstrationsError(
                f"{episode} has times {times.shape} and positions {positions.shape} for "
                f"{len(names)} channels; expected (T,) and (T, {len(names)}) with T >= 2: mend or "
                "drop it"
            )
        if not (self.named and self.names):
            refuse_exchanged(self.episode, positions)
        repeated = [name for name, count in Counter(names).items() if count > 1]
        if repeated:
            raise InvalidDemonstrationsError(
                f"{episode} repeats a channel name: {say_names(repeated)}; rename the channels"
            )
        bad = np.flatnonzero(~np.isfinite(times))
        if bad.size:
            raise InvalidDemonstrationsError(
                f"{episode}: time is {times[bad[0]]} at frame {bad[0]}, expected a finite number; "
                "mend or drop that episode"
            )
        remarks, (first, stop) = self.remarks, _without_zeros(positions)
        for count, end in ((first, "start"), (times.size - stop, "end")):
            remarks += (f"{count} frames at the {end} left out, which are all 0",) * (count > 0)
        times, positions = times[first:stop], positions[first:stop]
        # A frame that repeats the one before, time and all; another at the same time is an error.
        same = (np.diff(times) == 0) & np.all(np.diff(positions, axis=0) == 0, axis=1)
        if np.any(same) and not np.all(same):
            kept = np.concatenate([[True], ~same])
            times, positions = times[kept], positions[kept]
            remarks += (f"{same.sum()} frames were recorded twice; once is kept",)
        _refuse_disorder(episode, times, positions)
        times -= times[0]
        times.setflags(write=False)
        positions.setflags(write=False)
        is_named = self.named and bool(self.names)
        checked = {
            "times": times, "positions": positions, "named": is_named, "names": names,
            "units": units, "columns": tuple(self.columns) or names, "remarks": remarks,
        }  # fmt: skip
        if self.outcome is not None:
            checked["outcome"] = np.atleast_1d(np.array(self.outcome, dtype=np.float64))
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def duration(self) -> float:
        """Time from the first to the last frame, in [s]."""
        return float(self.times[-1])

    @property
    def period(self) -> float:
        """Median time between two frames, in [s]."""
        return float(np.median(np.diff(self.times)))


def refuse_exchanged(episode: str, positions: Positions) -> None:
    """Refuse a motion without names whose rows look like columns: InvalidDemonstrationsError."""
    count, width = positions.shape
    if width > _WIDER * count:
        raise InvalidDemonstrationsError(
            f"episode {episode} has {count} frames of {width} numbers each, as a motion has whose "
            "rows and columns are exchanged: save it with a row a frame"
        )


def _refuse_disorder(episode: str, times: Times, positions: Positions) -> None:
    """Refuse times that do not increase: InvalidDemonstrationsError says what may be wrong."""
    steps = np.diff(times)
    if np.all(steps > 0):
        return
    frame = int(np.argmax(steps <= 0)) + 1
    remedy = "sort frames that are out of order; if the clock was set back, leave that episode out"
    at_rate = "read the frames at their known rate with --time-column none --rate HZ"
    if np.all(steps >= 0):
        remedy = f"it repeats, as of a coarse clock: {at_rate}, or by another --time-column"
    elif is_set_back(times, positions):
        remedy = "the joints go on as if the frames were in order, so it is the times that are "
        remedy += "wrong, as where a clock was set back, or nanoseconds behind a point lack their "
        remedy += f"zeros: {at_rate}, or leave that episode out"
    raise InvalidDemonstrationsError(
        f"{episode}: time does not increase at frame {frame} ({times[frame - 1]:g} s, then "
        f"{times[frame]:g} s); {remedy}"
    )


def recorded(
    episode: str, clock: Clock, positions: Positions, names: tuple[str, ...] = (), **more: Any
) -> Recording:
    """Return a recording at the times of a clock; `more` are further fields."""
    fields = {"clock": clock.source, "ambiguities": clock.ambiguities} | more
    return Recording(episode, clock.times, positions, names, **fields)


def _without_zeros(positions: Positions) -> tuple[int, int]:
    """Return the first frame and the end of a motion without frames of 0 at either end.

    Zeros pad short episodes, and are read before a driver is up. Two channels or more, or the only
    one, leap into them by more than they ever step.
    """
    count = len(positions)
    others = np.flatnonzero(np.any(positions != 0, axis=1))
    if len(others) < 3 or not np.all(np.isfinite(positions)):
        return 0, count
    first, stop = int(others[0]), int(others[-1]) + 1
    steps = np.abs(np.diff(positions[first:stop], axis=0)).max(axis=0)
    leaps = (steps > 0) & (np.abs(positions[[first, stop - 1]]) / _LEAP > steps)
    begins, ends = leaps.sum(axis=1) >= min(2, positions.shape[1])
    return first if begins else 0, stop if ends else count


def unread() -> Recording:
    """Stand in for an episode that was left out unread."""
    raise AssertionError("left-out episodes are never read")


def without_units(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    """Return names without units, and the units; whole names if they would coincide else.

    A word in square brackets is a unit, `pressure [bar]`, unless it tells names apart: `q[elbow]`.
    """
    for any_word in (True, False):
        split = [split_unit(name, CHANNEL_UNITS, any_word=any_word) for name in names]
        bare = tuple(name for name, _ in split)
        if len(set(bare)) == len(set(names)):
            break
    else:
        bare = tuple(names)
    return bare, tuple(unit or unit_of_other(name) for name, unit in split)


@contextmanager
def named_damage(path: Path, what: str) -> Iterator[None]:
    """Turn whatever a format's library raises on a damaged file into one FileFormatError.

    Parsers raise anything on damaged bytes: keep only parsing inside.
    """
    try:
        yield
    except PriorReinforceError:
        raise
    except Exception as error:
        words = without_advice(error).split("\n")[0][:200] or "no reason given"
        raise FileFormatError(
            f"cannot read {path} as {what} ({type(error).__name__}: {words}); it is damaged or "
            "something else: copy it again from where it was recorded, or say its format"
        ) from error


@contextmanager
def or_leave_out(episode: str, differs: Callable[[], bool]) -> Iterator[None]:
    """Add to an error about a file that differs from the others that it may be left out."""
    try:
        yield
    except (FileFormatError, InvalidDemonstrationsError) as error:
        if "--leave-out" in str(error) or not differs():
            raise
        what = f"{error}; or if that is no recording, --leave-out {shlex.quote(episode)}"
        raise type(error)(what) from error


def natural_order(name: object) -> tuple[tuple[int, str], ...]:
    """Return a sort key by which `demo_10` follows `demo_9`."""
    parts = re.split(r"([0-9]+)", str(name))
    # By length and digits: Python makes no number of 5,000 digits.
    digits = [part.lstrip("0") if i % 2 else part for i, part in enumerate(parts)]
    return tuple((len(d), d) if i % 2 else (-1, d) for i, d in enumerate(digits))


def files_at(source: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """Return a file itself, or a folder's files with one of the suffixes, in natural order."""
    if not source.is_dir():
        return [source]
    files = [path for path in source.iterdir() if path.is_file() and not is_hidden(path)]
    found = [
        path for path in files if has_suffix(path, suffixes) and path.stem.lower() != "outcomes"
    ]
    return sorted(found, key=natural_order)


def is_hidden(path: Path) -> bool:
    """Whether a path is hidden: macOS adds a `._a.csv` to `a.csv`."""
    return path.name.startswith((".", "~"))


def has_suffix(path: Path, suffixes: tuple[str, ...]) -> bool:
    """Whether a name ends in one of the suffixes, in capitals or not."""
    return path.suffix.lower() in suffixes


def has_files(source: Path, suffixes: tuple[str, ...]) -> bool:
    """Whether a file has one of the suffixes, or a folder holds one that has."""
    return bool(files_at(source, suffixes)) and (source.is_dir() or has_suffix(source, suffixes))

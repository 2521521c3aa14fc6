"""Find the time stamps and the frame rate among a table's columns, or a file's arrays."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Shaped

from prior_reinforce.arm.recordings.naming import OTHER_NAMES
from prior_reinforce.arm.recordings.units import FRAME, SECONDS, Ambiguity, split_unit
from prior_reinforce.errors import FileFormatError
from prior_reinforce.units import base_of

Times = Float[np.ndarray, " T"]
"""Times of T frames, in [s]."""
Stamps = Shaped[np.ndarray, "..."]
"""Times of T frames as a file holds them: in its unit, of any shape and kind."""
Columns = Mapping[Any, tuple[str, Stamps]]
"""Name and numbers of columns by their place in a table, or of arrays by their name."""
FEWEST_COUNTS = 20
"""Fewest frames by which a counter can be told. Ours."""
COUNTER = re.compile(
    r"(^|[^a-z])(seq|frame|sample|index|idx|count|counter|tick|row|nr|step)s?($|[^a-z])"
)
"""Names of columns that count frames."""
LONGEST = 60.0
"""Longest recording of a throw, slide or swing, in [s]. Ours, and wide on purpose."""
_SHORTEST = 0.1
"""Shortest one, in [s]. Ours."""
_SLOWEST, _FASTEST = 1.0, 1e4
"""Frame rates in [Hz] beyond which a stated rate or unit is doubted. Ours."""
ARRAY_TIMES = ("t", "time", "timestamp", "timestamps")
"""Names of arrays of time stamps; fewer than of columns, since arrays may be of anything."""
_WORDS = (*ARRAY_TIMES, "times", "stamp", "elapsed", "duration")
COLUMN_TIMES = (
    *_WORDS, "elapsed_time", "datetime", "date", "zeit", "uhrzeit", "hora", "heure", "ora",
)  # fmt: skip
"""Names of columns of time stamps."""
_SAYS_TIME = re.compile(
    rf"(^|[^a-z])({'|'.join(_WORDS)}|date|ts|epoch|clock|secs?|seconds?)($|[^a-z])"
    r"|[a-z]_?(time|stamp)(_?m?s|_?sec)?$|zeit|temps|tiempo|tempo|czas|sekund|secondes|segundos|врем"
    r"|时间|時間|時刻|时刻|시간",
    re.IGNORECASE,
)
"""Names that contain a word for time; the numbers tell whether it is that of the frames."""
_PERIOD = re.compile(
    r"((control|sampl[a-z]*|frame)[ _]?)?(dt|period|time[ _]?step|delta[ _]?t(ime)?)"
    r"|sampl[a-z]*[ _]?(time|interval)"
)
"""Names of the sample period."""
_TICKS = (6.3e17, 6.6e17)
"""Numbers that are .NET's ticks of 100 ns since the year 1, from 1997 to 2092."""
_EPOCH = (1e9, 4.1e9)
"""Seconds since 1970, from 2001 to 2099, in which a clock that is set counts."""
_PERIODS, SHIFT = 3.0, 0.1
"""A clock was set where it leaps by more than so many periods, and by more than so long, in [s].
Ours: queues of messages hold them for some 10 ms."""
GAP = 3.0
"""Time without a new frame is a gap beyond so many periods. Ours: less is a recorder's jitter."""
_DETOUR, _MOVES = 0.01, 0.02
"""In the order of a clock that was set back, channels go further by at least this part of their
ranges; only channels that move by at least this part of the largest range count. Ours."""
_NEARLY, _ANY_SPEED = 1.25, 2.5
"""Factors by which a clock may run faster or slower than the frame rate: an array that rises, and
one that steps evenly. Ours."""
_EVEN = 0.25
"""Part of the median step by which half of even steps differ at most. Ours: receivers jitter."""
_FEW_COUNTS = 100
"""Whole numbers with smaller steps may count anything, cycles of a servo for instance. Ours."""
_SAME_CLOCK = 0.01
"""Share by which two clocks of a recording differ at most. Ours."""
SAME_RATE = 0.05
"""Rates that differ by a smaller share are one. Ours: clocks of recorders jitter and drift."""
_LOWEST_RATE, _HIGHEST_RATE = 1e-3, 1e6
"""Declared frames a second beyond which a file is damaged. Ours."""
_RATE = re.compile(
    r"((control|sampl[a-z]*|frame|record[a-z]*)[ _]?)?(fps|fs|hz|rate|freq(uency)?)([ _]?hz)?"
)
"""What files call their frames a second."""


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of an episode's frames, and their source."""

    times: Times
    """From any origin."""
    source: str
    """For a person: `t in ms`, `the given rate`."""
    ambiguities: tuple[Ambiguity, ...] = ()
    """What is only inferred of them."""

    @property
    def period(self) -> float:
        """Median time between two frames, in [s]; nan where there is one frame."""
        return float(np.median(np.diff(self.times))) if len(self.times) > 1 else math.nan


class FoundTimes(NamedTuple):
    """Columns of time stamps."""

    columns: tuple[Any, ...] = ()
    """None, one, or whole seconds and a part of a second."""
    held: tuple[Any, ...] = ()
    """Other clocks, which must agree with them."""
    unit: str | None = None
    """Unit of the last column, where other columns or its numbers tell it."""
    summed: bool = False
    """Whether the column holds sample periods, which are summed up."""
    guessed: tuple[Ambiguity, ...] = ()


def find_times(
    where: object, columns: Columns, called: Collection[Any], *, no_motion: bool = False
) -> FoundTimes:
    """Return the column of time stamps, by names and numbers.

    It is the first that is `called` a time for certain, or named like one and rises steadily; else
    the first named like one that rises anyhow, which is asked about, or falls; else sample periods.
    Other clocks must agree with it; with `no_motion`, so must every column that steps evenly.
    FileFormatError if two columns of one name differ.
    """
    times = [*called, *(i for i, each in columns.items() if looks_like_time(*each))]
    increasing = [
        i
        for i, (name, values) in columns.items()
        if says_time(name) and len(values) > 1 and np.all(np.diff(values.astype(float), axis=0) > 0)
    ]
    is_sure = bool(times)
    times = times or increasing or [i for i, each in columns.items() if counts_down(*each)]
    if not times:
        periods = tuple(i for i, each in columns.items() if is_periods(*each))
        return FoundTimes(periods[:1], summed=bool(periods))
    _refuse_times_that_differ(where, [columns[i] for i in columns if i in times])
    rate = _rate_of(columns[times[0]][1])
    others = [
        i
        for i, (_, values) in columns.items()
        if skips_frames(values) or (no_motion and _steps_evenly(rate, values))
    ]
    first, *held = dict.fromkeys([*times, *increasing, *others])
    doubts: tuple[Ambiguity, ...] = ()
    if not is_sure and first in increasing and len(columns[first][1]) > 2:
        name, steps = columns[first][0], np.diff(columns[first][1].astype(float))
        what = f"{where}: {name} is called a time, but steps by {steps.min():g} to {steps.max():g}"
        what += " (if it is not that of the frames: --time-column none, and --rate HZ)"
        doubts = (Ambiguity(what, f"--time-column {shlex.quote(name)}", guessed=False),)
    return FoundTimes((first,), tuple(held), guessed=doubts)


def guess_times(
    where: object, columns: Columns, rate: float | None, *, in_arrays: bool
) -> FoundTimes:
    """Return what may be time stamps although no name says so: a column that rises steadily.

    With a known rate, that column or a frame counter must agree with it; else the user is asked.
    Arrays may hold anything: exactly one must rise, not be named a counter, and run nearly at the
    rate.
    """
    rising = [i for i, (_, values) in columns.items() if rises(values)]
    if rate is not None or in_arrays:  # what counts frames one by one, or few, says nothing
        long = [i for i in rising if len(columns[i][1]) >= FEWEST_COUNTS]
        rising = [i for i in long if np.any(np.diff(columns[i][1]) != 1)]
    if in_arrays:
        rising = [i for i in rising if _may_be_clock(rate, *columns[i])]
        rising = rising if len(rising) == 1 else []
    if rate is not None:
        skipping = [i for i, (_, values) in columns.items() if skips_frames(values)]
        return FoundTimes((*skipping, *rising)[:1], unit=FRAME if skipping else None)
    if not rising:
        return FoundTimes()
    name = columns[rising[0]][0].removeprefix("column ")
    column = f"column {name}" if name.isdigit() else name
    what = f"{where} names no times, and {column} looks like the time"
    option = f"--time-column {shlex.quote(name)}"
    return FoundTimes((rising[0],), guessed=(Ambiguity(what, option, guessed=False),))


def _refuse_times_that_differ(where: object, times: Sequence[tuple[str, Stamps]]) -> None:
    """Refuse times of one name, `Time.1` beside it, that differ by half a frame or more."""
    for (name, one), (again, other) in combinations(times, 2):
        bare, same = (re.sub(r"\.\d+$", "", each) for each in (name, again))
        if bare != same or one.shape != other.shape:
            continue
        if np.abs(one - other).max() > np.median(np.abs(np.diff(one))) / 2:
            raise FileFormatError(
                f"{where} has two columns {bare} that differ, {one[0]:g} and {other[0]:g} first: "
                "each channel has its own times; write all at the times of one: numpy.interp(its "
                "times, their own times, their values)"
            )


def is_frame_rate(hertz: float) -> bool:
    """Whether a frame rate is plausible."""
    return _SLOWEST <= hertz <= _FASTEST


def is_throw(seconds: float) -> bool:
    """Whether a duration is plausible for a throw."""
    return _SHORTEST <= seconds <= LONGEST


def says_time(name: str) -> bool:
    """Whether a name contains a word for time, in some language."""
    spaced = re.sub("(?<=[a-z])(?=[A-Z])", "_", name)
    return _SAYS_TIME.search(spaced) is not None


def is_counter(name: str, values: Stamps) -> bool:
    """Whether whole numbers are named a frame counter; ticks are mostly of a clock."""
    said = COUNTER.search(name.lower())
    return (
        said is not None
        and said[2] != "tick"
        and not says_time(name)
        and bool(np.all(values % 1 == 0))
    )


def says_period(name: str) -> bool:
    """Whether a name is that of a sample period: `dt`, `period_ms`."""
    return _PERIOD.fullmatch(split_unit(name, SECONDS)[0].strip().lower()) is not None


def is_periods(name: str, values: Stamps) -> bool:
    """Whether a column holds sample periods, and not the time itself."""
    steps = values[1:].astype(float)
    return says_period(name) and len(steps) > 0 and bool(np.all(steps > 0)) and not rises(values)


def rises(values: Stamps) -> bool:
    """Whether a column rises steadily, as clocks and counters do and no joint does."""
    steps = np.diff(values.astype(float))
    return bool(len(steps) > 1 and np.all(steps > 0) and steps.max() < 10 * np.median(steps))


def looks_like_time(name: str, values: Stamps) -> bool:
    """Whether a column rises steadily, and its name, unit or numbers are those of a time."""
    said = says_time(name) or split_unit(name, SECONDS)[1] is not None
    return (said or are_ticks(values) or epoch_unit(values) is not None) and rises(values)


def counts_down(name: str, values: Stamps) -> bool:
    """Whether a column named like a time falls steadily: `time_to_release`."""
    return says_time(name) and rises(-values.astype(float))


def _rate_of(stamps: Stamps) -> float:
    """Frame rate, per unit of the time stamps; nan where these stand still."""
    steps = np.abs(np.diff(stamps.astype(float).ravel()))
    step = float(np.median(steps)) if steps.size else 0.0
    return 1 / step if step > 0 else np.nan


def _runs_at(rate: float, stamps: Stamps, factor: float) -> bool:
    """Whether time stamps in s, ms, us or ns run at a frame rate, within a factor."""
    faster = rate / _rate_of(stamps)
    if not faster > 0:
        return False
    thousands = np.log(faster) / np.log(1000)
    return bool(abs(thousands - np.round(thousands)) < np.log(factor) / np.log(1000))


def _may_be_clock(rate: float | None, name: str, stamps: Stamps) -> bool:
    """Whether an array that rises may be a clock, which runs at the rate if that is known."""
    if rate is not None and _steps_evenly(rate, stamps):
        return True
    return not COUNTER.search(name.lower()) and (rate is None or _runs_at(rate, stamps, _NEARLY))


def _steps_evenly(rate: float, stamps: Stamps) -> bool:
    """Whether a column of any name steps evenly, at about the frame rate.

    Numbers that begin long before the recording, as since a machine was started, are surely a
    clock: of these the rate may be another.
    """
    numbers = stamps.astype(float)
    steps = np.diff(numbers, axis=0)
    if numbers.ndim != 1 or len(steps) < FEWEST_COUNTS or not np.all(steps > 0):
        return False
    step = np.median(steps)
    even = np.median(np.abs(steps - step)) < _EVEN * step
    counts = np.all(numbers % 1 == 0) and step < _FEW_COUNTS
    own_origin = numbers[0] > numbers[-1] - numbers[0]
    factor = _ANY_SPEED if own_origin else 1 + _SAME_CLOCK
    return bool(even and not counts) and _runs_at(rate, stamps, factor)


def epoch_unit(values: Stamps) -> str | None:
    """Return the unit, s, ms, us or ns, in which numbers are dates since 1970; None if in none."""
    if not values.size:
        return None
    ends = np.array([values.min(), values.max()], dtype=float)
    for unit in ("s", "ms", "us", "ns"):
        first, last = ends * SECONDS[unit]
        if _EPOCH[0] <= first <= last <= _EPOCH[1]:
            return unit
    return None


def skips_frames(values: Stamps) -> bool:
    """Whether a column counts frames, of which some are missing: 7, 8, 9, 21, 22."""
    steps = np.diff(values.astype(float))
    if len(steps) < 2 or steps.min() <= 0 or np.any(values % 1):
        return False
    return bool(np.median(steps) == steps.min() < steps.max())


def are_ticks(values: Stamps) -> bool:
    """Whether numbers are as large as .NET's ticks, and make no recording in nanoseconds."""
    if values.size < 2 or values.min() < _TICKS[0] or values.max() > _TICKS[1]:
        return False
    length = 1e-9 * float(values.max() - values.min())
    return length < _SHORTEST or values.size / length > _FASTEST


def is_set_on(shift: Times, period: float) -> np.ndarray:
    """Where a clock was set: it leaps by more than its period by so much, in [s]."""
    return shift > max(SHIFT, _PERIODS * period)


def is_set_back(times: Stamps, positions: Float[np.ndarray, "T D"], least: float = 0.0) -> bool:
    """Whether a clock was set back: in its order, channels (of a range `least`) go further."""
    ranges = np.fmax.reduce(positions) - np.fmin.reduce(positions)
    in_order = positions[np.argsort(times, kind="stable")]
    ways = [np.nansum(np.abs(np.diff(each, axis=0)), axis=0) for each in (in_order, positions)]
    floor = max(least, _MOVES * np.fmax.reduce(ranges, initial=0.0)) or 1.0
    return bool(np.mean((ways[0] - ways[1]) / np.fmax(ranges, floor)) > _DETOUR)


def is_clock(name: str, values: Times, times: Times) -> bool:
    """Whether a column tells the time or counts frames: by its name, or by how fast it rises."""
    steps = np.diff(values)
    seconds = times[-1] - times[0]
    if len(steps) < 2 or not np.all(steps > 0) or seconds <= 0:
        return False
    whole = bool(np.all(values % 1 == 0))
    if (
        says_time(name)
        or epoch_unit(values)
        or (whole and (np.median(steps) == 1 or COUNTER.search(name.lower())))
    ):
        return True
    rates = [(values[-1] - values[0]) * scale / seconds for scale in SECONDS.values()]
    line = values[0] + (values[-1] - values[0]) * (times - times[0]) / seconds
    near = np.abs(values - line).max() <= 3 * np.median(steps)
    return bool(near and any(abs(rate - 1) < _SAME_CLOCK for rate in rates))


class DeclaredRate(NamedTuple):
    """A frame rate that a file declares."""

    hertz: float
    name: str
    """What the file calls it: `fps`, or `dt_ms`, of which it is the inverse."""

    def check(self, episode: str) -> None:
        """Refuse a rate at which nothing is recorded: FileFormatError."""
        if not _LOWEST_RATE < self.hertz < _HIGHEST_RATE:
            raise FileFormatError(
                f"episode {episode}: {self.name} says {self.hertz:g} frames a second; mend it, or "
                "leave it out"
            )

    @property
    def likely(self) -> list[float]:
        """What it may be, in [Hz]: `dt` 20, at which no arm is recorded, is in ms, or a rate."""
        if is_frame_rate(self.hertz):
            return [self.hertz]
        in_units = [self.hertz / scale for u, scale in SECONDS.items() if u not in ("min", "h")]
        inverse = [1 / self.hertz]
        is_rate = _RATE.fullmatch(self.name.lower())
        return list(filter(is_frame_rate, inverse + in_units if is_rate else in_units + inverse))


def declared_rate(
    where: object, numbers: Mapping[str, Any], given: float | None = None
) -> DeclaredRate | None:
    """Return the frame rate among the numbers of a file: `fps` 50 or `dt_ms` 20.

    Numbers deep in it, `meta.fps`, count less. FileFormatError if two differ, and none of them is
    the `given` rate.
    """
    found: dict[str, DeclaredRate] = {}
    for path, value in sorted(numbers.items(), key=lambda item: "." in item[0]):
        place, _, name = path.rpartition(".")
        is_period, unit = says_period(name), split_unit(name, SECONDS)[1]
        if OTHER_NAMES.search(place) or not (is_period or _RATE.fullmatch(name.lower())):
            continue
        if np.size(value) != 1 or np.asarray(value).dtype.kind not in "fiu":
            raise FileFormatError(
                f"{where}: {path} is no number; expected times t, or dt, or rate: mend it, or "
                "leave it unread with --time-column none --rate HZ"
            )
        number = float(value) * base_of(unit or "s")[1]
        found[path] = DeclaredRate(1 / number if is_period and number else number, name)
    agree = [path for path, rate in found.items() if given and same_rate(given, rate.hertz)]
    first = next(iter((*agree, *found)), "")
    for path, (hertz, _) in found.items():
        if given is None and not same_rate(hertz, found[first].hertz):
            raise FileFormatError(
                f"{where}: {first} says {found[first].hertz:.4g} frames a second, but {path} "
                f"{hertz:.4g}; take one: --rate"
            )
    return found.get(first)


def same_rate(one: float, two: float) -> bool:
    """Whether two rates differ by no more than clocks do."""
    return abs(one - two) <= SAME_RATE * two


def either(rates: Sequence[float]) -> str:
    """Name rates of which one holds: `50 or 20`."""
    return " or ".join(f"{rate:.4g}" for rate in rates)

"""Times of the frames: from the file's own times, its rate, or the rate that is given."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from prior_reinforce.arm.recordings.naming import OTHER_NAMES
from prior_reinforce.arm.recordings.time_finder import (
    ARRAY_TIMES,
    FRAME,
    Columns,
    FoundTimes,
    Stamps,
    Times,
    are_ticks,
    find_times,
    is_counter,
    is_frame_rate,
    is_periods,
    is_throw,
    other_times,
    rises,
    says_period,
    says_time,
    skips_frames,
)
from prior_reinforce.arm.recordings.units import SECONDS, Ambiguity, judge_unit, split_unit
from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidDemonstrationsError
from prior_reinforce.units import base_of, without_number

if TYPE_CHECKING:
    from prior_reinforce.arm.recordings.options import ReadOptions

TIME_UNITS = (*SECONDS, FRAME)
NO_COLUMN = "none"
"""Value of `time_column` by which no times are read, and of `episode_column`."""
_IN_BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]*[^\W\d_][^\[\]()]*?)\s*[\])]\s*$")
"""`Time [weeks]`, a word in brackets."""
_QUALIFIES = re.compile(
    r"rel(ative)?|abs(olute)?|local|utc|gmt|unix|epoch|elapsed|system|ros|robot|controller|pc", re.I
)
"""Words that say what kind of time it is, and no unit."""
_HERTZ = re.compile(r"(\d+(?:[.,]\d+)?)[ _-]?hz", re.I)
"""`throw_4_50Hz`."""
SAME_RATE = 0.05
"""Rates that differ by a smaller share are one. Ours: clocks of recorders jitter and drift."""
_APART = 3.0
"""Frames by which two clocks of one recording may differ. Ours: jitter is a frame or two."""
_BRIEF = 0.5
"""Seconds below which 0, 1, 2, ... count frames, and no milliseconds: a throw has rests. Ours."""
_LOWEST_RATE, _HIGHEST_RATE = 1e-3, 1e6
"""Declared frames a second beyond which a file is damaged. Ours."""
_RATE = re.compile(
    r"((control|sampl[a-z]*|frame|record[a-z]*)[ _]?)?(fps|fs|hz|rate|freq(uency)?)([ _]?hz)?"
)
"""What files call their frames a second."""


def declared_rate(
    where: object, said: Mapping[str, Any], given: float | None = None
) -> dict[str, Any]:
    """Return the rate that a file declares, if any, as `clock_of` takes it.

    `said` are its numbers by name, for instance `fps` 50 or `dt_ms` 20, or by their place deep in
    it, `meta.fps`; these count less. FileFormatError if two differ, and no rate is given that one
    of them says.
    """
    found: dict[str, float] = {}
    for name, value in sorted(said.items(), key=lambda item: "." in item[0]):
        place, _, called = name.rpartition(".")
        is_period, unit = says_period(called), split_unit(called, SECONDS)[1]
        if OTHER_NAMES.search(place) or not (is_period or _RATE.fullmatch(called.lower())):
            continue
        if np.size(value) != 1 or np.asarray(value).dtype.kind not in "fiu":
            raise FileFormatError(
                f"{where}: {name} is no number; expected times t, or dt, or rate: mend it, or "
                "leave it unread with --time-column none --rate HZ"
            )
        number = float(value) * base_of(unit or "s")[1]
        found[name] = 1 / number if is_period and number else number
    agree = [own for own in found.items() if given is not None and _same(given, own[1])]
    first, of_first = next(iter((*agree, *found.items())), ("", 0.0))
    for name, rate in found.items():
        if given is None and not _same(rate, of_first):
            raise FileFormatError(
                f"{where}: {first} says {of_first:.4g} frames a second, but {name} {rate:.4g}; "
                "take one: --rate"
            )
    return {"rate_name": first.rpartition(".")[2], "own_rate": of_first} if found else {}


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


def clock_of(
    episode: str,
    count: int,
    *,
    stamps: Stamps | None = None,
    name: str = "",
    unit: str | None = None,
    own_rate: float | None = None,
    rate_name: str = "",
    rate: float | None = None,
    time_unit: str | None = None,
) -> Clock:
    """Return the times of an episode.

    Args:
        episode: For messages.
        count: T.
        stamps: The file's own times; None where it has none.
        name: Name of their column or array.
        unit: Unit that the format fixes for them; None reads it from the name, or infers it.
        own_rate: Rate that the file declares, in [Hz]; the stamps must agree with it.
        rate_name: What the file calls that rate.
        rate: Rate that the user gave. It must agree with stamps, and with a declared one that may
            be.
        time_unit: Unit that the user gave, one of `TIME_UNITS`.

    Raises:
        ConfigurationError: An option contradicts the file, or has no use.
        InvalidDemonstrationsError: Stamps that are not numbers, or of another length.
        FileFormatError: Neither times nor a rate, or a declared rate that cannot be.
    """
    if own_rate is not None and not _LOWEST_RATE < own_rate < _HIGHEST_RATE:
        raise FileFormatError(
            f"episode {episode}: {rate_name or name} says {own_rate:g} frames a second; mend it, "
            "or leave it out"
        )
    if stamps is None:
        if time_unit is not None:
            raise ConfigurationError(
                f"--time-unit {time_unit} is of a column of times, and episode {episode} has none; "
                "drop it, or name the column"
            )
        own, name = rate or own_rate, rate_name or name
        if own is None:
            raise FileFormatError(
                f"episode {episode} holds neither times nor a rate; give the rate in frames a "
                "second: --rate"
            )
        times = np.arange(count) / own
        likely = [] if own_rate is None else _likely_rates(name, own_rate)
        if rate is None:
            doubts = () if own_rate is None else _doubt_rate(name, own_rate, likely, count)
            return Clock(times, f"{name} in the file", doubts)
        is_said = any(_same(rate, each) for each in likely or [rate])
        if own_rate in likely and not is_said:
            raise ConfigurationError(
                f"--rate {rate:g}, but {name} in the file says {own_rate:.4g} frames a second; "
                "drop --rate, or leave the file's rate unread: --time-column none"
            )
        in_name = _HERTZ.search(episode)
        stated = float(in_name[1].replace(",", ".")) if in_name else rate
        said = "" if _same(rate, stated) else f" (the name {episode} says {stated:g} Hz)"
        said += "" if is_said else f" ({name} in the file says {_or(likely)} Hz)"
        return Clock(times, f"the given rate{said}")
    try:
        numbers = np.asarray(stamps, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidDemonstrationsError(
            f"episode {episode}: {name} must hold numbers: {error}; mend it, or name another column"
        ) from error
    if numbers.shape != (count,):
        raise InvalidDemonstrationsError(
            f"episode {episode} has {count} frames, but {name} of shape {numbers.shape}; expected "
            "one time a frame"
        )
    known = unit or split_unit(name, SECONDS)[1]
    known, of_one = without_number(known) if known else (None, 1.0)  # of `t [0.1 ms]`
    numbers = numbers * of_one
    counts = not known and time_unit is None and is_counter(name, numbers)
    if counts and (rate or own_rate):
        steps = np.diff(numbers)
        if np.all(steps >= 1) and 2 * np.sum(steps > 1) <= len(steps):  # by one, but for lost ones
            known = FRAME
    if known is None and time_unit is None and are_ticks(numbers):
        numbers, known = (numbers - numbers[0]) * 100, "ns"
    unknown = None if known or time_unit else _IN_BRACKETS.search(name)
    if unknown is not None and not _QUALIFIES.fullmatch(unknown[1]):
        raise FileFormatError(
            f"episode {episode}: {name} is in {unknown[1]!r}, which is no known unit of time "
            f"({', '.join(SECONDS)}): say it with --time-unit, or convert that column"
        )
    if FRAME in (time_unit, known):
        frames = rate or own_rate
        if frames is None or time_unit not in (None, FRAME):
            raise ConfigurationError(
                f"{name} counts frames, so the rate is wanted: add --rate, and no other --time-unit"
            )
        step = np.diff(numbers).min(initial=np.inf) if unit == FRAME else 1.0
        return Clock(numbers / step / frames, f"{name}, frames at {frames:g} Hz")
    if not np.all(np.isfinite(numbers)):
        return Clock(numbers, name)  # the recording names the frame
    if rises(-numbers):
        raise InvalidDemonstrationsError(
            f"episode {episode}: {name} falls with every frame, as what counts down does: write "
            "its negative, or turn frames in reverse round, or give --time-column none --rate HZ"
        )
    # From the first on, since nanoseconds since 1970 are 0.2 us coarse as floats.
    elapsed = numbers - (numbers[0] if count else 0.0)
    period = float(np.median(np.diff(numbers))) if count > 1 else 0.0
    if abs(period) not in (0.0, np.clip(abs(period), 1e-12, 1e15)):
        raise FileFormatError(
            f"episode {episode}: {name} steps by {period:g} a frame, which is no time in any unit; "
            "mend it, or leave the times unread with --time-column none"
        )
    by = "its name says" if unit is None else "its format says"
    chosen, ambiguities = _judge(name, period, numbers, known, by)
    if time_unit is not None and time_unit == known:
        chosen, ambiguities = known, ()  # said twice
    elif time_unit is not None:
        if known is not None and not ambiguities:
            raise ConfigurationError(
                f"{name} is in {known}, but --time-unit says {time_unit}; drop it"
            )
        chosen, ambiguities = _judge(name, period, numbers, time_unit, "--time-unit says")
    elif counts and ambiguities:
        return Clock(elapsed * SECONDS[chosen], f"{name} in {chosen}", ambiguities)
    elif known is None and period > 0 and (at := rate or own_rate):
        # A rate that agrees in one unit settles it.
        agrees = [u for u, scale in SECONDS.items() if _same(at, 1 / (period * scale))]
        chosen, ambiguities = (agrees[0], ()) if agrees else (chosen, ambiguities)
    seconds = period * SECONDS[chosen]
    if rate is not None and not (period > 0 and _same(rate, 1 / seconds)):
        found = f"{1 / seconds:.4g} Hz" if period > 0 else "no rate"
        raise ConfigurationError(
            f"--rate {rate:g}, but {name} in {chosen} says {found}; drop --rate, say the unit with "
            "--time-unit, or leave the times unread with --time-column none"
        )
    if own_rate is not None and rate is None and period > 0 and not _same(own_rate, 1 / seconds):
        raise FileFormatError(
            f"episode {episode}: {name} says {1 / seconds:.4g} frames a second, but {rate_name} "
            f"{own_rate:.4g}; take one: --time-column {name}, or --time-column none"
        )
    return Clock(elapsed * SECONDS[chosen], f"{name} in {chosen}", ambiguities)


def clock_among(
    where: Path,
    episode: str,
    count: int,
    arrays: Mapping[str, np.ndarray],
    options: ReadOptions,
    said: Mapping[str, Any] | None = None,
    motion: Collection[str] = (),
) -> Clock:
    """Return times from the arrays of an episode that say they are, held against each other.

    `said` are further numbers of the file, a rate perhaps among them. An array that is asked for by
    name counts more. Where none says so, one that is no part of the `motion` may be the time.
    """
    asked = options.time_column
    if asked not in (None, NO_COLUMN, *arrays):
        raise FileFormatError(f"{where} has no array {asked}; it holds {sorted(arrays)}: name one")
    every = {name: (name, array) for name, array in arrays.items()}
    called = [name for name in arrays if split_unit(name, SECONDS)[0] in ARRAY_TIMES]
    fit = {n: own for n, own in every.items() if own[1].shape == (count,) and n not in motion}
    free = fit | {name: every[name] for name in called}
    found = find_times(where, free, called, no_motion=True)
    timed = asked not in (None, NO_COLUMN) and found.columns
    said = {n: _first(v, count) for n, v in (said or {}).items() if not _are_periods(n, v, count)}
    said = {n: v for n, v in said.items() if np.shape(v) != (count,)}  # a rate of each frame
    if asked == NO_COLUMN and options.rate is not None:  # what is no number is left unread
        said = {n: v for n, v in said.items() if np.size(v) == 1}
    own = {} if timed else declared_rate(where, said, options.rate)
    if asked is not None and asked in arrays:
        found = FoundTimes((asked,), summed=_are_periods(asked, arrays[asked], count))
    elif asked == NO_COLUMN:
        found = FoundTimes()
    elif not found.columns:
        rate = options.rate or own.get("own_rate")
        found = other_times(where, fit, rate, in_arrays=True)
    if not found.columns:
        return options.clock(episode, count, **own)
    return clock_at(f"{where}: {episode}", episode, count, found, every, options, **own)


def _first(values: Any, count: int) -> Any:
    """The one number of values that are the same in each frame; others as they are."""
    same = np.shape(values) == (count,) and np.all(np.equal(values, values[0]))
    return values[0] if same else values


def _are_periods(name: str, values: Any, count: int) -> bool:
    """Whether values, of which each frame has one, are the times since the frame before."""
    stamps = np.asarray(values)
    return stamps.shape == (count,) and is_periods(name.rpartition(".")[2], stamps)


def clock_at(
    where: str,
    episode: str,
    count: int,
    found: FoundTimes,
    columns: Columns,
    options: ReadOptions,
    **of_file: Any,
) -> Clock:
    """Return the times of the found column, held against others; `of_file` is as in `clock_of`."""
    name, stamps = columns[found.columns[0]]
    if found.summed:
        stamps = np.concatenate([[0.0], np.cumsum(stamps[1:])])
    of_file["unit"] = found.unit or of_file.get("unit")
    clock = options.clock(episode, count, stamps=stamps, name=name, **of_file)
    held = {columns[i][0]: columns[i][1] for i in found.held if columns[i][1].shape == (count,)}
    if count > 1:
        hold_together(where, {name: clock.times, **held})
    return replace(clock, ambiguities=(*found.guessed, *clock.ambiguities))


def hold_together(where: str, clocks: Mapping[str, Times]) -> None:
    """Refuse times of the same frames that contradict each other, the first being those in use.

    Another clock may count in another unit, and begin anywhere; it may not run faster, or jump:
    FileFormatError names both, with what they say.
    """
    (name, used), *others = clocks.items()
    period = float(np.median(np.diff(used)))
    for other, stamps in others:
        stamps = stamps.astype(float)
        steps = np.diff(stamps)
        own = float(np.median(steps))
        scales = [scale for scale in SECONDS.values() if period > 0 and _same(own * scale, period)]
        if not scales and skips_frames(stamps):
            scales = [period / own]
        if own <= 0 or (not scales and np.all(steps == 1)):
            continue  # it counts frames, or is no clock
        if not (scales or period > 0):
            raise FileFormatError(
                f"{where}: {name} repeats, as of a coarse clock, and {other} steps by {own:.4g}; "
                f"if that is the time, say --time-column {other}, else --time-column none --rate HZ"
            )
        if not scales:
            raise FileFormatError(
                f"{where}: {name} says {1 / period:.4g} frames a second, but {other} steps by "
                f"{own:.4g}; say which is the time: --time-column {name}, or {other}"
            )
        apart = np.abs((stamps - stamps[0]) * scales[0] - (used - used[0]))
        if apart.max() > max(SAME_RATE * (used[-1] - used[0]), _APART * period):
            frame = int(np.argmax(np.abs(np.diff(apart)))) + 1
            raise FileFormatError(
                f"{where}: {name} and {other} part by {apart.max():.3g} s, most at frame {frame}; "
                f"say which is the time: --time-column {name}, or {other}"
            )


def _likely_rates(name: str, rate: float) -> list[float]:
    """What a declared rate may be: `dt` 20, at which no arm is recorded, is in ms, or a rate."""
    in_units = [rate / scale for unit, scale in SECONDS.items() if unit not in ("min", "h")]
    others = [1 / rate, *in_units] if _RATE.fullmatch(name.lower()) else [*in_units, 1 / rate]
    return [rate] if is_frame_rate(rate) else list(filter(is_frame_rate, others))


def _doubt_rate(
    name: str, rate: float, likely: Sequence[float], count: int
) -> tuple[Ambiguity, ...]:
    """Doubt a declared rate at which no arm is recorded, for those that it may be."""
    if rate in likely:
        return ()
    likely = likely or [rate]
    what = f"{name} in the file says {rate:.4g} frames a second, {count / rate:.4g} s in all"
    return (Ambiguity(f"{what}: it looks like {_or(likely)}", f"--rate {likely[0]:.6g}"),)


def _or(rates: Sequence[float]) -> str:
    return " or ".join(f"{rate:.4g}" for rate in rates)


def _judge(
    name: str, period: float, numbers: Times, said: str | None, by: str
) -> tuple[str, tuple[Ambiguity, ...]]:
    """Infer the unit of a column of times, and say if it is ambiguous.

    `period` (between two frames) and the `numbers` are in that unit; `said` is what a person, the
    name or the format gives, and `by` which of them: `its name says`.
    """
    length = float(numbers[-1] - numbers[0]) if len(numbers) else 0.0

    def rate_in(unit: str) -> str:
        scale = SECONDS[unit]
        return f"{1 / (period * scale):.4g} Hz and {length * scale:.3g} s long"

    unit = said or "s"
    looks = judge_unit(unit, period, period=True)
    if looks == unit or period <= 0:
        return unit, ()
    if said is not None and (
        is_frame_rate(1 / (period * SECONDS[unit]))
        or not (looks and is_throw(length * SECONDS[looks]))
    ):
        return said, ()  # believed, unless another unit makes it the length of a throw
    as_said = f", as {by}," if said is not None else ""
    what = f"{name} in {unit}{as_said} would be {rate_in(unit)}, "
    if looks is None:
        return "s", (Ambiguity(f"{what}and no other unit fits better", "--time-unit s"),)
    what += f"in {looks} {rate_in(looks)}"
    too_short = is_throw(length) and not is_throw(length * SECONDS[looks])
    if said is None and period != 1 and too_short:
        what += f", which no throw is; it looks like key frames in {unit}"
        return unit, (Ambiguity(what, f"--time-unit {unit}"),)
    what += f": it looks like {looks}"
    if said is None and "tick" in name.lower() and period != 1 and is_frame_rate(1e7 / period):
        what = f"{name} steps by {period:g}, and nothing says how long a tick is"
        what += " (.NET's are 100 ns: then write that column in ns, times 100)"
        return "s", (Ambiguity(what, "--time-unit UNIT", guessed=False),)
    counts, is_time = is_counter(name, numbers), says_time(name) or name.lower() in SECONDS
    brief = numbers[0] in (0, 1) and length * SECONDS[looks] < _BRIEF
    if said is None and (counts or (period == 1 and (brief or not is_time))):
        steps = f", {period:g} at a time" if period != 1 else ""
        what = f"{name} counts frames{steps}, and nothing says how many a second are"
        if period != 1 or not counts:
            what += f" (or it is a time: --time-unit {looks}"
            what += "; or say it of the rows: --time-column none --rate HZ)" if counts else ")"
        return "s", (Ambiguity(what, "--time-unit frame --rate HZ", guessed=False),)
    if said is None and period == 1:
        what += " (or it counts frames: --time-unit frame --rate HZ)"
    return looks, (Ambiguity(what, f"--time-unit {looks}"),)


def _same(one: float, two: float) -> bool:
    return abs(one - two) <= SAME_RATE * two

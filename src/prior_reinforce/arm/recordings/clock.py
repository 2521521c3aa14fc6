"""Times of the frames: from time stamps, the file's frame rate, or the user's."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.options import NO_COLUMN, ReadOptions
from prior_reinforce.arm.recordings.time_finder import (
    ARRAY_TIMES,
    SAME_RATE,
    Clock,
    Columns,
    DeclaredRate,
    FoundTimes,
    Stamps,
    Times,
    are_ticks,
    declared_rate,
    either,
    find_times,
    guess_times,
    is_counter,
    is_frame_rate,
    is_periods,
    is_throw,
    rises,
    same_rate,
    says_time,
    skips_frames,
)
from prior_reinforce.arm.recordings.units import FRAME, SECONDS, Ambiguity, judge_unit, split_unit
from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidDemonstrationsError
from prior_reinforce.units import without_number

_IN_BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]*[^\W\d_][^\[\]()]*?)\s*[\])]\s*$")
"""A word in brackets at the end of a name: `Time [weeks]`."""
_QUALIFIES = re.compile(
    r"rel(ative)?|abs(olute)?|local|utc|gmt|unix|epoch|elapsed|system|ros|robot|controller|pc", re.I
)
"""Words in brackets that are no unit, but a kind of time."""
_HERTZ = re.compile(r"(\d+(?:[.,]\d+)?)[ _-]?hz", re.I)
"""A frame rate in an episode's name: `throw_4_50Hz`."""
_APART = 3.0
"""Frames by which two clocks of one recording may differ. Ours: jitter is a frame or two."""
_BRIEF = 0.5
"""Seconds below which 0, 1, 2, ... count frames, and no milliseconds: a throw has rests. Ours."""


def clock_of(
    episode: str,
    count: int,
    options: ReadOptions,
    *,
    stamps: Stamps | None = None,
    name: str = "",
    unit: str | None = None,
    declared: DeclaredRate | None = None,
) -> Clock:
    """Return the times of an episode from its time stamps, or where it has none from a frame rate.

    Args:
        episode: Its name.
        count: Frames.
        options: The user's rate and unit of time; the rate must agree with the file.
        stamps: The file's time stamps, if there are any.
        name: Name of their column or array.
        unit: Unit that the format fixes for them; None reads it from the name, or infers it.
        declared: Frame rate that the file declares; time stamps must agree with it.

    Raises:
        ConfigurationError: An option contradicts the file, or has no use.
        InvalidDemonstrationsError: Time stamps that are not numbers, or of another length.
        FileFormatError: Neither time stamps nor a rate, or an impossible declared rate.
    """
    if options.time_column == NO_COLUMN and options.rate is not None:
        declared = None
    if declared is not None:
        declared.check(episode)
    if stamps is None:
        return _clock_at_rate(episode, count, options, declared)
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
    return _TimeStamps(episode, name, numbers, unit, options, declared).clock()


def _clock_at_rate(
    episode: str, count: int, options: ReadOptions, declared: DeclaredRate | None
) -> Clock:
    """Times of frames at the user's rate, else at the declared one."""
    rate = options.rate
    if options.time_unit is not None:
        raise ConfigurationError(
            f"--time-unit {options.time_unit} is of a column of times, and episode {episode} has "
            "none; drop it, or name the column"
        )
    if rate is not None:
        return Clock(
            np.arange(count) / rate, f"the given rate{_other_rates(episode, rate, declared)}"
        )
    if declared is None:
        raise FileFormatError(
            f"episode {episode} holds neither times nor a rate; give the rate in frames a "
            "second: --rate"
        )
    (hertz, name), likely = declared, declared.likely
    doubts: tuple[Ambiguity, ...] = ()
    if hertz not in likely:
        looks = likely or [hertz]
        what = f"{name} in the file says {hertz:.4g} frames a second, {count / hertz:.4g} s in all"
        doubts = (Ambiguity(f"{what}: it looks like {either(looks)}", f"--rate {looks[0]:.6g}"),)
    return Clock(np.arange(count) / hertz, f"{name} in the file", doubts)


def _other_rates(episode: str, rate: float, declared: DeclaredRate | None) -> str:
    """Name other rates in the episode's name or file; ConfigurationError if the file's may be."""
    in_name = _HERTZ.search(episode)
    stated = float(in_name[1].replace(",", ".")) if in_name else rate
    said = "" if same_rate(rate, stated) else f" (the name {episode} says {stated:g} Hz)"
    if declared is None or any(same_rate(rate, each) for each in declared.likely or [rate]):
        return said
    if declared.hertz in declared.likely:
        raise ConfigurationError(
            f"--rate {rate:g}, but {declared.name} in the file says {declared.hertz:.4g} frames a "
            "second; drop --rate, or leave the file's rate unread: --time-column none"
        )
    return f"{said} ({declared.name} in the file says {either(declared.likely)} Hz)"


class _TimeStamps:
    """Time stamps of an episode's frames, on the way to its times in [s]."""

    def __init__(
        self,
        episode: str,
        name: str,
        numbers: Times,
        fixed: str | None,
        options: ReadOptions,
        declared: DeclaredRate | None,
    ) -> None:
        """Find out what is known of their unit: the format's (`fixed`), or that in their name."""
        self.episode, self.name, self.fixed = episode, name, fixed
        self.given, self.rate, self.declared = options.time_unit, options.rate, declared
        self.any_rate = options.rate or (declared.hertz if declared else None)
        unit, size = without_number(fixed or split_unit(name, SECONDS)[1] or "")
        self.numbers = numbers * size  # of `t [0.1 ms]`
        self.unit: str | None = unit or None
        silent = not unit and self.given is None
        self.is_counter = silent and is_counter(name, self.numbers)
        if self.is_counter and self.any_rate and self._goes_on_by_one():
            self.unit = FRAME
        elif silent and are_ticks(self.numbers):
            self.numbers, self.unit = (self.numbers - self.numbers[0]) * 100, "ns"
        elif silent:
            self._refuse_unknown_unit()

    def clock(self) -> Clock:
        """Return the times, by the unit that is known, agrees with a rate, or is likely."""
        name, numbers = self.name, self.numbers
        if FRAME in (self.given, self.unit):
            return self._clock_of_counter()
        if not np.all(np.isfinite(numbers)):
            return Clock(numbers, name)  # the recording names the frame
        if rises(-numbers):
            raise InvalidDemonstrationsError(
                f"episode {self.episode}: {name} falls with every frame, as what counts down does: "
                "write its negative, or turn frames in reverse round, or give --time-column none "
                "--rate HZ"
            )
        period = float(np.median(np.diff(numbers))) if len(numbers) > 1 else 0.0
        if abs(period) not in (0.0, np.clip(abs(period), 1e-12, 1e15)):
            raise FileFormatError(
                f"episode {self.episode}: {name} steps by {period:g} a frame, which is no time in "
                "any unit; mend it, or leave the times unread with --time-column none"
            )
        unit, ambiguities = self._judged(period)
        # From the first on, since nanoseconds since 1970 are 0.2 us coarse as floats.
        elapsed = numbers - (numbers[0] if len(numbers) else 0.0)
        if not (self.is_counter and ambiguities):
            self._check_rates(period, unit)
        return Clock(elapsed * SECONDS[unit], f"{name} in {unit}", ambiguities)

    def _goes_on_by_one(self) -> bool:
        """Whether a counter goes on by one from frame to frame, but for lost ones."""
        steps = np.diff(self.numbers)
        return bool(np.all(steps >= 1) and 2 * np.sum(steps > 1) <= len(steps))

    def _refuse_unknown_unit(self) -> None:
        unknown = _IN_BRACKETS.search(self.name)
        if unknown is not None and not _QUALIFIES.fullmatch(unknown[1]):
            raise FileFormatError(
                f"episode {self.episode}: {self.name} is in {unknown[1]!r}, which is no known unit "
                f"of time ({', '.join(SECONDS)}): say it with --time-unit, or convert that column"
            )

    def _clock_of_counter(self) -> Clock:
        """Times of frames that are counted, by the rate."""
        if not self.any_rate or self.given not in (None, FRAME):
            raise ConfigurationError(
                f"{self.name} counts frames, so the rate is wanted: add --rate, and no other "
                "--time-unit"
            )
        step = np.diff(self.numbers).min(initial=np.inf) if self.fixed == FRAME else 1.0
        times = self.numbers / step / self.any_rate
        return Clock(times, f"{self.name}, frames at {self.any_rate:g} Hz")

    def _judged(self, period: float) -> tuple[str, tuple[Ambiguity, ...]]:
        """The unit, and what makes it doubtful; `period` is between two frames, in that unit."""
        by = "its name says" if self.fixed is None else "its format says"
        unit, doubts = _judge(self.name, period, self.numbers, self.unit, by)
        if self.given is None:
            if self.unit or not self.any_rate or period <= 0 or (self.is_counter and doubts):
                return unit, doubts
            # A rate that agrees in one unit settles it.
            rates = {u: 1 / (period * scale) for u, scale in SECONDS.items()}
            agrees = next((u for u, rate in rates.items() if same_rate(self.any_rate, rate)), None)
            return (agrees, ()) if agrees else (unit, doubts)
        if self.given == self.unit:  # said twice
            return self.given, ()
        if self.unit is not None and not doubts:
            raise ConfigurationError(
                f"{self.name} is in {self.unit}, but --time-unit says {self.given}; drop it"
            )
        return _judge(self.name, period, self.numbers, self.given, "--time-unit says")

    def _check_rates(self, period: float, unit: str) -> None:
        """Refuse time stamps that contradict the user's rate, or the declared one."""
        name, own = self.name, 1 / (period * SECONDS[unit]) if period > 0 else 0.0
        if self.rate is not None and not (own and same_rate(self.rate, own)):
            found = f"{own:.4g} Hz" if own else "no rate"
            raise ConfigurationError(
                f"--rate {self.rate:g}, but {name} in {unit} says {found}; drop --rate, say the "
                "unit with --time-unit, or leave the times unread with --time-column none"
            )
        if self.declared and self.rate is None and own and not same_rate(self.declared.hertz, own):
            raise FileFormatError(
                f"episode {self.episode}: {name} says {own:.4g} frames a second, but "
                f"{self.declared.name} {self.declared.hertz:.4g}; take one: --time-column {name}, "
                "or --time-column none"
            )


def clock_from_arrays(
    where: Path,
    episode: str,
    count: int,
    arrays: Mapping[str, np.ndarray],
    options: ReadOptions,
    numbers: Mapping[str, Any] | None = None,
    motion: Collection[str] = (),
) -> Clock:
    """Return times from those arrays of an episode that are time stamps, which must agree.

    `numbers` are further numbers of the file, perhaps a frame rate. An array that the user names
    counts more. Where none is named a time, one that is not of the `motion` may be.
    """
    asked = options.time_column
    if asked not in (None, NO_COLUMN, *arrays):
        raise FileFormatError(f"{where} has no array {asked}; it holds {sorted(arrays)}: name one")
    every = {name: (name, array) for name, array in arrays.items()}
    called = [name for name in arrays if split_unit(name, SECONDS)[0] in ARRAY_TIMES]
    fit = {n: (n, a) for n, a in arrays.items() if a.shape == (count,) and n not in motion}
    found = find_times(where, fit | {n: every[n] for n in called}, called, no_motion=True)
    unread = options.rate is not None if asked == NO_COLUMN else asked and found.columns
    declared = None if unread else _rate_among(where, numbers or {}, count, options.rate)
    if asked in arrays:
        found = FoundTimes((asked,), summed=_are_periods(str(asked), arrays[str(asked)], count))
    elif asked == NO_COLUMN:
        found = FoundTimes()
    elif not found.columns:
        rate = options.rate or (declared.hertz if declared else None)
        found = guess_times(where, fit, rate, in_arrays=True)
    return clock_from_columns(
        f"{where}: {episode}", episode, count, found, every, options, declared
    )


def _rate_among(
    where: Path, numbers: Mapping[str, Any], count: int, given: float | None
) -> DeclaredRate | None:
    """The declared rate, which may stand in every frame; rates that change are none."""
    found = {}
    for name, value in numbers.items():
        of_frames = np.shape(value) == (count,)
        if not of_frames:
            found[name] = value
        elif not _are_periods(name, value, count) and np.all(np.equal(value, value[0])):
            found[name] = value[0]
    return declared_rate(where, found, given)


def _are_periods(name: str, values: Any, count: int) -> bool:
    """Whether an array holds the sample period of each frame."""
    stamps = np.asarray(values)
    return stamps.shape == (count,) and is_periods(name.rpartition(".")[2], stamps)


def clock_from_columns(
    where: str,
    episode: str,
    count: int,
    found: FoundTimes,
    columns: Columns,
    options: ReadOptions,
    declared: DeclaredRate | None,
) -> Clock:
    """Return the times in the found columns, which others must agree with; else by the rate."""
    if not found.columns:
        return clock_of(episode, count, options, declared=declared)
    name, stamps = columns[found.columns[0]]
    if found.summed:
        stamps = np.concatenate([[0.0], np.cumsum(stamps[1:])])
    clock = clock_of(
        episode, count, options, stamps=stamps, name=name, unit=found.unit, declared=declared
    )
    held = {columns[i][0]: columns[i][1] for i in found.held if columns[i][1].shape == (count,)}
    if count > 1:
        refuse_clocks_that_differ(where, {name: clock.times, **held})
    return replace(clock, ambiguities=(*found.guessed, *clock.ambiguities))


def refuse_clocks_that_differ(where: str, clocks: Mapping[str, Times]) -> None:
    """Refuse clocks of the same frames that contradict the first: FileFormatError names both.

    Another clock may be in another unit and begin anywhere; it may not run faster, or jump.
    """
    (name, used), *others = clocks.items()
    period = float(np.median(np.diff(used)))
    for other, stamps in others:
        stamps = stamps.astype(float)
        steps = np.diff(stamps)
        own = float(np.median(steps))
        scales = [
            scale for scale in SECONDS.values() if period > 0 and same_rate(own * scale, period)
        ]
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


def _judge(
    name: str, period: float, numbers: Times, said: str | None, by: str
) -> tuple[str, tuple[Ambiguity, ...]]:
    """Infer the unit of time stamps from their period, and doubt an implausible one.

    `said` is the stated unit, and `by` who states it: `its name says`.
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
    doubt = Ambiguity(f"{what}: it looks like {looks}", f"--time-unit {looks}")
    if said is not None:
        return looks, (doubt,)
    if "tick" in name.lower() and period != 1 and is_frame_rate(1e7 / period):
        what = f"{name} steps by {period:g}, and nothing says how long a tick is"
        what += " (.NET's are 100 ns: then write that column in ns, times 100)"
        return "s", (Ambiguity(what, "--time-unit UNIT", guessed=False),)
    counts, is_time = is_counter(name, numbers), says_time(name) or name.lower() in SECONDS
    brief = numbers[0] in (0, 1) and length * SECONDS[looks] < _BRIEF
    if counts or (period == 1 and (brief or not is_time)):
        steps = f", {period:g} at a time" if period != 1 else ""
        what = f"{name} counts frames{steps}, and nothing says how many a second are"
        if period != 1 or not counts:
            what += f" (or it is a time: --time-unit {looks}"
            what += "; or say it of the rows: --time-column none --rate HZ)" if counts else ")"
        return "s", (Ambiguity(what, "--time-unit frame --rate HZ", guessed=False),)
    if period == 1:
        also = f"{doubt.what} (or it counts frames: --time-unit frame --rate HZ)"
        doubt = replace(doubt, what=also)
    return looks, (doubt,)

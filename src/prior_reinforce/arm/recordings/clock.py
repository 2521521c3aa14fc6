"""Times of the frames: from the file's own times, its rate, or the rate that is given."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Shaped

from prior_reinforce.arm.recordings.units import SECONDS, Ambiguity, judge_unit, split_unit
from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidDemonstrationsError

Times = Float[np.ndarray, " T"]
"""Times of T frames, in [s]."""
Stamps = Shaped[np.ndarray, "..."]
"""Times of T frames as a file holds them: in its unit, of any shape and kind."""
FRAME = "frame"
"""The unit of a column that counts frames; the rate says how long one is."""
TIME_UNITS = (*SECONDS, FRAME)
_SAYS_TIME = re.compile(
    r"(^|[^a-z])(t|ts|times?|timestamps?|stamp|epoch|clock|elapsed|duration|date|secs?|seconds?)"
    r"($|[^a-z])"
    r"|[a-z]_?(time|stamp)(_?m?s|_?sec)?$|zeit|temps|tiempo|tempo|czas|sekund|secondes|segundos|врем"
    r"|时间|時間|時刻|时刻|시간",
    re.IGNORECASE,
)
_SHORTEST, LONGEST = 0.1, 60.0
"""Seconds that a throw, slide or swing is recorded for. Ours, and wide on purpose."""
_SAME_RATE = 0.05
"""Rates that differ by a smaller share are one. Ours: clocks of recorders jitter and drift."""
_APART = 3.0
"""Frames by which two clocks of one recording may differ. Ours: jitter is a frame or two."""
_LOWEST_RATE, _HIGHEST_RATE = 1e-3, 1e6
"""Declared frames a second beyond which a file is damaged. Ours."""


def says_time(name: str) -> bool:
    """Whether a column's name says, in some language, that it is a time."""
    spaced = re.sub("(?<=[a-z])(?=[A-Z])", "_", name)
    return _SAYS_TIME.search(spaced) is not None


def rises(values: Times) -> bool:
    """Whether a column rises steadily, as times and counters do and no joint does."""
    steps = np.diff(values)
    return bool(len(steps) > 1 and np.all(steps > 0) and steps.max() < 10 * np.median(steps))


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
        rate: Rate that the user gave. It overrides a declared one, and must agree with stamps.
        time_unit: Unit that the user gave, one of `TIME_UNITS`.

    Raises:
        ConfigurationError: An option contradicts the file, or has no use.
        InvalidDemonstrationsError: Stamps that are not numbers, or of another length.
        FileFormatError: Neither times nor a rate, an implausible declared rate, or one that the
            stamps contradict.
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
        return _even(episode, count, rate_name or name, own_rate, rate)
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
    if known is not None and time_unit not in (None, known):
        raise ConfigurationError(f"{name} is in {known}, but --time-unit says {time_unit}; drop it")
    chosen, ambiguities = time_unit or known, tuple[Ambiguity, ...]()
    if chosen == FRAME:
        if rate is None:
            raise ConfigurationError(f"{name} counts frames, so the rate is wanted: add --rate")
        return Clock(numbers / rate, f"{name}, frames at {rate:g} Hz")
    if not np.all(np.isfinite(numbers)):
        return Clock(numbers, name)  # the recording names the frame
    # From the first on, since nanoseconds since 1970 are 0.2 us coarse as floats.
    elapsed = numbers - (numbers[0] if count else 0.0)
    period = float(np.median(np.diff(numbers))) if count > 1 else 0.0
    if abs(period) not in (0.0, np.clip(abs(period), 1e-12, 1e15)):
        raise FileFormatError(
            f"episode {episode}: {name} steps by {period:g} a frame, which is no time in any unit; "
            "mend it, or leave the times unread with --time-column none"
        )
    if chosen is None or time_unit is not None:
        chosen, ambiguities = _judge(name, period, float(elapsed[-1]) if count else 0.0, chosen)
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


def hold_together(where: str, clocks: Mapping[str, Times]) -> None:
    """Refuse times of the same frames that contradict each other, the first being those in use.

    Another clock may count in another unit, and begin anywhere; it may not run faster, or jump:
    FileFormatError names both, with what they say.
    """
    (name, used), *others = clocks.items()
    period = float(np.median(np.diff(used)))
    for other, stamps in others:
        steps = np.diff(stamps)
        own = float(np.median(steps))
        scales = [scale for scale in SECONDS.values() if period > 0 and _same(own * scale, period)]
        if own <= 0 or (not scales and np.all(steps == 1)):
            continue  # it counts frames, or is no clock
        if not scales:
            raise FileFormatError(
                f"{where}: {name} says {1 / period:.4g} frames a second, but {other} steps by "
                f"{own:.4g}; say which is the time: --time-column {name}, or {other}"
            )
        apart = np.abs((stamps - stamps[0]) * scales[0] - (used - used[0]))
        if apart.max() > max(_SAME_RATE * (used[-1] - used[0]), _APART * period):
            frame = int(np.argmax(np.abs(np.diff(apart)))) + 1
            raise FileFormatError(
                f"{where}: {name} and {other} part by {apart.max():.3g} s, most at frame {frame}; "
                f"say which is the time: --time-column {name}, or {other}"
            )


def _even(episode: str, count: int, name: str, own_rate: float | None, rate: float | None) -> Clock:
    """Times at the given rate, else at the declared one."""
    chosen, source = rate or own_rate, "the given rate"
    if chosen is None:
        raise FileFormatError(
            f"episode {episode} holds neither times nor a rate; give the rate in frames a second: "
            "--rate"
        )
    if rate is None:
        source = f"{name} in the file"
    elif own_rate is not None and not _same(rate, own_rate):
        source = f"the given rate ({name} in the file says {own_rate:g} Hz)"
    return Clock(np.arange(count) / chosen, source)


def _judge(
    name: str, period: float, length: float, said: str | None
) -> tuple[str, tuple[Ambiguity, ...]]:
    """Infer the unit of a column of times, and say if it is ambiguous.

    `period` (between two frames) and `length` are in that unit; `said` is what the user gave.
    """

    def rate_in(unit: str) -> str:
        scale = SECONDS[unit]
        return f"{1 / (period * scale):.4g} Hz and {length * scale:.3g} s long"

    unit = said or "s"
    looks = judge_unit(unit, period, period=True)
    if looks == unit or period <= 0:
        return unit, ()
    is_throw = looks is not None and _SHORTEST <= length * SECONDS[looks] <= LONGEST
    if said is not None and not is_throw:
        return said, ()  # believed, unless another unit makes it the length of a throw
    by = ", as --time-unit says," if said is not None else ""
    what = f"{name} in {unit}{by} would be {rate_in(unit)}, "
    if looks is None:
        return "s", (Ambiguity(f"{what}and no other unit fits better", "--time-unit s"),)
    what += f"in {looks} {rate_in(looks)}: it looks like {looks}"
    if said is None and period == 1:
        what += " (or it counts frames: --time-unit frame --rate HZ)"
    return looks, (Ambiguity(what, f"--time-unit {looks}"),)


def _same(one: float, two: float) -> bool:
    return abs(one - two) <= _SAME_RATE * two

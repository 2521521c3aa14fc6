"""When each frame was recorded: from the file's own times, its rate, or the rate that is given."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Shaped

from prior_reinforce.bench.importing.units import SECONDS, Doubt, split_unit
from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidDemonstrationsError

Times = Float[np.ndarray, " T"]
"""Of T frames, [s]."""
Stamps = Shaped[np.ndarray, "..."]
"""Of T frames, in the file's unit; as a file holds them, so of any shape and kind."""
FRAME = "frame"
"""The unit of a column that counts frames; the rate says how long one is."""
TIME_UNITS = (*SECONDS, FRAME)
_SLOWEST, _FASTEST = 5.0, 5000.0
"""Frames a second at which arms are recorded. Ours: teleoperation at 10 Hz is the slowest in use,
libfranka's and RTDE's logs have 1000 and 500."""
_SHORTEST, LONGEST = 0.1, 60.0
"""Seconds that a throw, slide or swing is recorded for. Ours, and wide on purpose."""
_AGREE = 0.05
"""Two rates that differ by less are one."""


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of an episode's frames, and where they are from."""

    times: Times
    """From any origin."""
    source: str
    """For a person: `t in ms`, `the given rate`."""
    doubts: tuple[Doubt, ...] = ()
    """What is only guessed of them."""

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
    rate: float | None = None,
    time_unit: str | None = None,
) -> Clock:
    """Return the times of an episode.

    Args:
        episode: For messages.
        count: T.
        stamps: The file's own times; None where it has none.
        name: Of their column or array, or of what declares the rate.
        unit: Unit that the format fixes for them; None reads it from the name, or guesses.
        own_rate: Frames a second that the file declares.
        rate: The rate that was given. It overrides a declared one, and must agree with stamps.
        time_unit: The unit that was given, one of `TIME_UNITS`.

    Raises:
        ConfigurationError: What was given contradicts the file, or has no use.
        InvalidDemonstrationsError: Stamps that are no numbers, or of another length.
        FileFormatError: No times, no rate, and none given.
    """
    if stamps is None:
        if time_unit is not None:
            raise ConfigurationError(
                f"--time-unit {time_unit} is of a column of times, and episode {episode} has none; "
                "drop it, or name the column"
            )
        return _even(episode, count, name, own_rate, rate)
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
    chosen = time_unit or known
    if chosen == FRAME:
        if rate is None:
            raise ConfigurationError(f"{name} counts frames, so the rate is wanted: add --rate")
        return Clock(numbers / rate, f"{name}, frames at {rate:g} Hz")
    if not np.all(np.isfinite(numbers)):
        return Clock(numbers, name)  # the recording names the frame
    steps = np.diff(numbers)
    period = float(np.median(steps)) if steps.size else 0.0
    doubts: tuple[Doubt, ...] = ()
    if chosen is None:
        chosen = _guess(period)
        doubts = _doubts(name, period, numbers, chosen)
    elif time_unit is not None and _is_slip(chosen, period, numbers):
        looks = _guess(period)
        doubts = (
            Doubt(
                f"{name} in {chosen}, as --time-unit says, would be "
                f"{_say_clock(period, numbers, chosen)}, in {looks} "
                f"{_say_clock(period, numbers, looks)}: it looks like {looks}",
                f"--time-unit {looks}",
            ),
        )
        chosen = looks
    _check_rate(rate, period * SECONDS[chosen], name, chosen)
    # From the first on, since nanoseconds since 1970 are 0.2 us coarse as floats.
    first = numbers[0] if numbers.size else 0.0
    return Clock((numbers - first) * SECONDS[chosen], f"{name} in {chosen}", doubts)


def _even(episode: str, count: int, name: str, own_rate: float | None, rate: float | None) -> Clock:
    if rate is None and own_rate is None:
        raise FileFormatError(
            f"episode {episode} holds neither times nor a rate; give the rate in frames a second: "
            "--rate"
        )
    source = "the given rate"
    if rate is None:
        rate, source = own_rate, f"{name} in the file"
    elif own_rate is not None and not _same(rate, own_rate):
        source = f"the given rate ({name} in the file says {own_rate:g} Hz)"
    assert rate is not None
    return Clock(np.arange(count) / rate, source)


def _guess(period: float) -> str:
    """The first unit in which the frames come as fast as arms are recorded; seconds if none is."""
    return next((unit for unit in SECONDS if _is_fit(unit, period)), "s")


def _is_slip(unit: str, period: float, stamps: Times) -> bool:
    """Whether no arm is recorded like that, and another unit makes it a throw."""
    looks = _guess(period)
    if _is_fit(unit, period) or not _is_fit(looks, period):
        return False
    return _SHORTEST <= float(stamps[-1] - stamps[0]) * SECONDS[looks] <= LONGEST


def _say_clock(period: float, stamps: Times, unit: str) -> str:
    scale = SECONDS[unit]
    rate, length = 1 / (period * scale), float(stamps[-1] - stamps[0]) * scale
    return f"{rate:.4g} Hz and {length:.3g} s long"


def _is_fit(unit: str, period: float) -> bool:
    """Whether arms are recorded so fast."""
    return period > 0 and _SLOWEST <= 1 / (period * SECONDS[unit]) <= _FASTEST


def _doubts(name: str, period: float, stamps: Times, unit: str) -> tuple[Doubt, ...]:
    if period <= 0 or (unit == "s" and _is_fit("s", period)):
        return ()
    as_seconds = f"{name} in s would be {_say_clock(period, stamps, 's')}"
    if unit == "s":
        return (Doubt(f"{as_seconds}, and no other unit fits better", "--time-unit s"),)
    counts = " (or it counts frames: --time-unit frame --rate HZ)" if period == 1 else ""
    return (
        Doubt(
            f"{as_seconds}, in {unit} {_say_clock(period, stamps, unit)}: it looks like "
            f"{unit}{counts}",
            f"--time-unit {unit}",
        ),
    )


def _check_rate(rate: float | None, period: float, name: str, unit: str) -> None:
    if rate is not None and not (period > 0 and _same(rate, 1 / period)):
        found = f"{1 / period:.4g} Hz" if period > 0 else "no rate"
        raise ConfigurationError(
            f"--rate {rate:g}, but {name} in {unit} says {found}; drop --rate, say the unit with "
            "--time-unit, or leave the times unread with --time-column none"
        )


def _same(one: float, two: float) -> bool:
    return abs(one - two) <= _AGREE * two

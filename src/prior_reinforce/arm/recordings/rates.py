"""Frame rates that files declare: `fps`, `dt_ms`, ..., and whether rates agree."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.naming import OTHER_NAMES
from prior_reinforce.arm.recordings.time_finder import is_frame_rate, says_period
from prior_reinforce.arm.recordings.units import SECONDS, split_unit
from prior_reinforce.errors import FileFormatError
from prior_reinforce.units import base_of

SAME_RATE = 0.05
"""Rates that differ by a smaller share are one. Ours: clocks of recorders jitter and drift."""
_LOWEST_RATE, _HIGHEST_RATE = 1e-3, 1e6
"""Declared frames a second beyond which a file is damaged. Ours."""
_RATE = re.compile(
    r"((control|sampl[a-z]*|frame|record[a-z]*)[ _]?)?(fps|fs|hz|rate|freq(uency)?)([ _]?hz)?"
)
"""What files call their frames a second."""


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

"""Units of recordings: read from names, converted, and judged by what an arm can do.

No guess is silent. Each is an `Ambiguity`: what is implausible, what it looks like, and the option
that settles it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from prior_reinforce.arrays import BEYOND_DOUBT, FARTHEST, LARGEST_TURN
from prior_reinforce.errors import ConfigurationError, UnclearUnitsError

_SPELLINGS = {
    "rad": ("rad", "radian", "radians"),
    "deg": ("deg", "degree", "degrees", "°"),
    "m": ("m", "metre", "metres", "meter", "meters"),
    "cm": ("cm", "centimetre", "centimetres", "centimeter", "centimeters"),
    "mm": ("mm", "millimetre", "millimetres", "millimeter", "millimeters"),
    "in": ("in", "inch", "inches", '"'),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
_ANGLES = {"rad": 1.0, "deg": math.pi / 180}
_LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
SECONDS: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of time, in [s]."""
CHANNEL_UNITS = (*_ANGLES, *_LENGTHS)
"""Units that a channel's name may carry: angles and lengths."""
_SLOWEST, _FASTEST = 5.0, 5000.0
"""Frames a second at which arms are recorded. Ours: teleoperation at 10 Hz is the slowest in use,
libfranka's and RTDE's logs have 1000 and 500."""
_PLAUSIBLE: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "rad": {"rad": (0.0, LARGEST_TURN), "deg": (0.0, 720.0)},
    "m": {"m": (0.0, FARTHEST), "cm": (0.0, 300.0), "mm": (0.0, math.inf)},
    "period": {u: (1 / (_FASTEST * scale), 1 / (_SLOWEST * scale)) for u, scale in SECONDS.items()},
}
"""Units that angles, lengths and periods may be in, the likeliest first, with the least and the
greatest number: of angles and lengths the largest one, of periods the time between two frames.
Ours: no joint turns two turns; above 300, millimetres are likelier than an arm of three metres."""
_BRACKETS = re.compile(r"(?P<name>.+?)\s*[\[(]\s*(?P<unit>[^\[\]()]+?)\s*[\])]")
_ENDING = re.compile(r"(?P<name>.+?)[_ ](?P<unit>[a-zµμ°]+)")


@dataclass(frozen=True)
class Ambiguity:
    """Something that a recording does not state, and whose default is implausible."""

    what: str
    """What is implausible, and what it looks like: a clause."""
    option: str
    """The option that confirms what it looks like, for instance `--time-unit ms`."""


def raise_if_ambiguous(ambiguities: Iterable[Ambiguity], also: str = "") -> None:
    """Raise if anything is ambiguous; `also` are other problems, so that all are reported at once.

    Raises:
        UnclearUnitsError: Names all of them, and the options that settle them.
    """
    found = list(dict.fromkeys(ambiguities))
    if found:
        options = " ".join(dict.fromkeys(one.option for one in found))
        what = "; ".join(one.what for one in found)
        raise UnclearUnitsError(what, options, also)


def known_unit(text: str) -> str | None:
    """Return the unit that a text spells, for instance `deg` for `°`; None if it spells none."""
    return _UNITS.get(text.strip().strip("[]()").strip().lower())


def split_unit(column: str, among: Collection[str] | None = None) -> tuple[str, str | None]:
    """Split a column's name into the name and the unit in it.

    Args:
        column: For instance `x_cm`, `q0 [deg]` or `time (ms)`.
        among: Units that may stand there; None takes all, and in square brackets any word at all:
            `volume [ml]`.

    Returns:
        For instance `("x", "cm")`; the whole name and None if there is no such unit.
    """
    for pattern in (_BRACKETS, _ENDING):
        match = pattern.fullmatch(column.strip())
        unit = match and known_unit(match["unit"])
        if match is None or (pattern is _ENDING and match["unit"] == "in"):
            continue  # `plug_in` is no length
        if unit in (among or _SPELLINGS):
            return match["name"].strip(), unit
        if among is None and column.strip().endswith("]"):
            return match["name"].strip(), match["unit"]
    return column, None


def base_of(unit: str) -> tuple[str, float]:
    """Return the base unit and the factor to it, rad and pi/180 for deg; other units stay."""
    for units in (_ANGLES, _LENGTHS, SECONDS):
        if unit in units:
            return next(iter(units)), units[unit]
    return unit, 1.0


def conversion(recorded: str, wanted: str, name: str) -> float:
    """Return the factor from one unit to another.

    Raises:
        ConfigurationError: One cannot be converted to the other.
    """
    (here, factor), (there, divisor) = base_of(recorded), base_of(wanted)
    if here != there:
        raise ConfigurationError(
            f"{name} is recorded in {recorded}, but plans are in {wanted}; say its unit with "
            "--units, or correct the plan's units"
        )
    return factor / divisor


def judge_unit(unit: str, number: float, *, period: bool = False) -> str | None:
    """Return the unit that a number looks like: the same if that is plausible, None if none fits.

    Args:
        unit: `rad` or `m`, or for a period a unit of time; any other unit is plausible.
        number: The largest absolute angle or length, or a period.
        period: Whether it is the time between two frames.
    """
    ranges = _PLAUSIBLE.get("period" if period else unit, {unit: (0.0, math.inf)})
    fitting = [u for u, (low, high) in ranges.items() if low <= number <= high]
    return unit if unit in fitting else next(iter(fitting), None)


def is_possible(unit: str, number: float) -> bool:
    """Return whether an angle or a length can be in a unit if that is stated explicitly."""
    return unit not in _PLAUSIBLE or number <= BEYOND_DOUBT * _PLAUSIBLE[unit][unit][1]


def say_names(names: Sequence[str]) -> str:
    """Abbreviate a list of names: `q[0] to q[6], t`; consecutive numbers are one group."""
    groups: list[list[str]] = []
    for name in names:
        if groups and _follows(groups[-1][-1], name):
            groups[-1].append(name)
        else:
            groups.append([name])
    return listed([g[0] if len(g) == 1 else f"{g[0]} to {g[-1]}" for g in groups])


def listed(items: Sequence[str], separator: str = ", ") -> str:
    """Join up to twelve items, and count the rest."""
    more = f" and {len(items) - 12} more" if len(items) > 12 else ""
    return separator.join(items[:12]) + more


def _follows(before: str, name: str) -> bool:
    """Whether the names differ in one number only, which is one higher in the second."""
    one, two = re.split(r"(\d+)", before), re.split(r"(\d+)", name)
    differ = [(a, b) for a, b in zip(one, two, strict=False) if a != b]
    if len(one) != len(two) or len(differ) != 1:
        return False
    ((a, b),) = differ
    return a.isdigit() and b.isdigit() and int(b) == int(a) + 1

"""Units of recordings: read from names, converted, and guessed from what an arm can do.

A guess is never taken silently. It is a `Doubt`: what cannot be, what it looks like, and the option
that says so.
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
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
_BASE: Mapping[str, tuple[str, float]] = {
    "rad": ("rad", 1.0),
    "deg": ("rad", math.pi / 180),
    "m": ("m", 1.0),
    "cm": ("m", 0.01),
    "mm": ("m", 0.001),
}
SECONDS: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of time, in [s]."""
_LARGEST_DEGREES = 720.0
"""Ours: beyond two turns it is no angle of a joint in degrees either."""
_LARGEST_CENTIMETRES = 300.0
"""Ours: above it millimetres are likelier than an arm that reaches three metres."""
_BRACKETS = re.compile(r"(?P<name>.+?)\s*[\[(]\s*(?P<unit>[^\[\]()]+?)\s*[\])]")
_ENDING = re.compile(r"(?P<name>.+?)[_ ](?P<unit>[a-zµμ°]+)")


@dataclass(frozen=True)
class Doubt:
    """Something that a recording does not say, and that cannot be what it would be taken for."""

    what: str
    """What cannot be, and what it looks like: a clause."""
    option: str
    """The option that says it is as it looks, for instance `--time-unit ms`."""


def refuse_doubts(doubts: Iterable[Doubt], also: str = "") -> None:
    """Do nothing where nothing is in doubt.

    Args:
        doubts: What is.
        also: What else is wrong, so that nobody has to come twice.

    Raises:
        UnclearUnitsError: Names all doubts, and the options that settle them.
    """
    found = list(dict.fromkeys(doubts))
    if found:
        options = " ".join(dict.fromkeys(doubt.option for doubt in found))
        what = "; ".join(doubt.what for doubt in found)
        raise UnclearUnitsError(what, options, also)


def known_unit(text: str) -> str | None:
    """Return the unit that a text spells, for instance `deg` for `°`; None where it spells none."""
    return _UNITS.get(text.strip().strip("[]()").strip().lower())


def split_unit(column: str, among: Collection[str]) -> tuple[str, str | None]:
    """Split a column's name into the name and the unit in it.

    Args:
        column: For instance `x_cm`, `q0 [deg]` or `time (ms)`.
        among: Units that may stand there.

    Returns:
        For instance `("x", "cm")`; the whole name and None where there is no such unit.
    """
    for pattern in (_BRACKETS, _ENDING):
        match = pattern.fullmatch(column.strip())
        if match is not None and known_unit(match["unit"]) in among:
            return match["name"].strip(), known_unit(match["unit"])
    return column, None


def split_any_unit(column: str) -> tuple[str, str | None]:
    """Split a column's name as `split_unit` does, with any unit at all in square brackets.

    Args:
        column: For instance `x_cm`, `arrival_ms` or `volume [ml]`.
    """
    name, unit = split_unit(column, (*CHANNEL_UNITS, *SECONDS))
    match = _BRACKETS.fullmatch(column.strip())
    if unit is not None or match is None or not column.strip().endswith("]"):
        return name, unit
    return match["name"].strip(), known_unit(match["unit"]) or match["unit"]


CHANNEL_UNITS = tuple(_BASE)
"""Units that a channel's name may carry: angles and lengths."""


def base_of(unit: str) -> tuple[str, float]:
    """Return a recorded unit's own, and what to multiply with: rad and pi/180 for deg.

    Units of neither angle, length nor time stay as they are.
    """
    if unit in SECONDS:
        return "s", SECONDS[unit]
    return _BASE.get(unit, (unit, 1.0))


def conversion(recorded: str, wanted: str, name: str) -> float:
    """Return what to multiply numbers of one unit with to get another.

    Raises:
        ConfigurationError: An angle is wanted in metres, or the like.
    """
    (here, factor), (there, divisor) = base_of(recorded), base_of(wanted)
    if here != there:
        raise ConfigurationError(
            f"{name} is recorded in {recorded}, but plans are in {wanted}; say its unit with "
            "--units, or correct the plan's units"
        )
    return factor / divisor


def guess_unit(wanted: str, reach: float) -> str | None:
    """Return the unit that numbers look like which cannot be in the one that is wanted.

    Args:
        wanted: Unit that the numbers would be taken for.
        reach: Largest of them, without its sign.

    Returns:
        `deg`, `cm` or `mm`; the unit itself where they can be in it; None where no unit fits.
    """
    if wanted == "rad" and reach > LARGEST_TURN:
        return "deg" if reach <= _LARGEST_DEGREES else None
    if wanted == "m" and reach > FARTHEST:
        return "cm" if reach <= _LARGEST_CENTIMETRES else "mm"
    return wanted


def cannot_be(unit: str, reach: float) -> bool:
    """Whether numbers reach farther than could be in a unit, even where somebody says it is theirs.

    Args:
        unit: `rad` or `m`; others may hold any number.
        reach: Largest of them, without its sign.
    """
    return guess_unit(unit, reach / BEYOND_DOUBT) != unit


def say_names(names: Sequence[str]) -> str:
    """Say many names in few words: `q[0] to q[6], t`; names that are numbered on are one group."""
    groups: list[list[str]] = []
    for name in names:
        if groups and _follows(groups[-1][-1], name):
            groups[-1].append(name)
        else:
            groups.append([name])
    said = [g[0] if len(g) == 1 else f"{g[0]} to {g[-1]}" for g in groups]
    return ", ".join(said[:12]) + (f" and {len(said) - 12} more" if len(said) > 12 else "")


def _follows(before: str, name: str) -> bool:
    """Whether one name is the other but for a number that is one higher."""
    one, two = re.split(r"(\d+)", before), re.split(r"(\d+)", name)
    differ = [i for i, (a, b) in enumerate(zip(one, two, strict=False)) if a != b]
    if len(one) != len(two) or len(differ) != 1:
        return False
    a, b = one[differ[0]], two[differ[0]]
    return a.isdigit() and b.isdigit() and int(b) == int(a) + 1

"""The units of plans and outcomes: what they measure, how they are spelt, how large numbers get."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

Kind = Literal["length", "angle", "time", "share"]
"""What a unit measures, in [m], [rad], [s] or [1]; angles repeat after a turn, the others do not.
A unit that is not listed here counts something, and is a kind of its own."""
NS_PER_S = 10**9
"""Nanoseconds of a second, as ROS counts its times (builtin_interfaces/Time: sec, nanosec)."""
STATED = 7.0
"""Numbers may be this many times larger where their unit is stated (ours): beyond, at eight turns
of a joint or 35 m, it is stated wrongly."""


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit, and how large numbers in it get."""

    kind: Kind
    factor: float
    """Number of the kind's base units in one: 0.01 for cm."""
    plural: str
    """Its name in a sentence: `centimetres`."""
    spellings: str
    """Other ways to write it, in lower case, apart by blanks."""
    largest: float = math.inf
    """Largest plausible number, of a place or a joint; more is the next unit of its kind."""
    error_limit: float = math.inf
    """From here on an error or a tolerance is implausible."""
    spoken: str = ""
    """The unit that people say instead; empty where they say this one."""
    small: str = ""
    """Name of its thousandth; empty where it has none."""


# Largest numbers are ours. No arm on a table reaches, throws or is seen farther than 5 m; above
# 300 cm, millimetres are likelier. Joints turn one turn (6.28 rad) either way, never two. Errors
# of a metre or half a turn are another unit far more often than a miss by as much.
UNITS: Mapping[str, Unit] = {
    "m": Unit(
        kind="length", factor=1.0, plural="metres", spellings="metre meter meters",
        largest=5.0, error_limit=1.0, spoken="cm", small="mm",
    ),
    "cm": Unit(
        kind="length", factor=0.01, plural="centimetres",
        spellings="centimetre centimeter centimeters", largest=300.0,
    ),
    "mm": Unit(
        kind="length", factor=0.001, plural="millimetres",
        spellings="millimetre millimeter millimeters",
    ),
    "in": Unit(kind="length", factor=0.0254, plural="inches", spellings='inch "'),
    "rad": Unit(
        kind="angle", factor=1.0, plural="radians",
        spellings="radian radiant radianti radianes bogenmaß bogenmass",
        largest=7.0, error_limit=math.pi, spoken="deg", small="mrad",
    ),
    # Not `grad`, which is a degree in German and a gradian elsewhere.
    "deg": Unit(
        kind="angle", factor=math.pi / 180, plural="degrees",
        spellings="degree ° gradi grado grados degré degrés", largest=720.0,
    ),
    "s": Unit(
        kind="time", factor=1.0, plural="seconds", spellings="sec secs second", spoken="ms"
    ),
    "ms": Unit(
        kind="time", factor=1e-3, plural="milliseconds",
        spellings="msec msecs millisec millisecs millisecond millis",
    ),
    "us": Unit(
        kind="time", factor=1e-6, plural="microseconds",
        spellings="µs μs usec usecs usecond useconds microsec microsecs microsecond micros",
    ),
    "ns": Unit(
        kind="time", factor=1e-9, plural="nanoseconds",
        spellings="nsec nsecs nsecond nseconds nanosec nanosecs nanosecond nanos",
    ),
    "day": Unit(kind="time", factor=86400.0, plural="days", spellings=""),
    "min": Unit(kind="time", factor=60.0, plural="minutes", spellings="mins minute"),
    "h": Unit(kind="time", factor=3600.0, plural="hours", spellings="hr hrs hour"),
    "percent": Unit(
        kind="share", factor=0.01, plural="percent", spellings="%", largest=100.0
    ),
    "share": Unit(kind="share", factor=1.0, plural="shares", spellings="fraction"),
    "rev": Unit(
        kind="angle", factor=2 * math.pi, plural="revolutions",
        spellings="revs revolution turn turns umdrehung umdrehungen",
    ),
    "mrad": Unit(
        kind="angle", factor=1e-3, plural="milliradians", spellings="milliradian"
    ),
}  # fmt: skip
SPELT = {
    spelling: name
    for name, unit in UNITS.items()
    for spelling in (name, unit.plural, *unit.spellings.split())
}
"""Unit by each of its spellings, in lower case."""


_TIME = f"({'|'.join(spelling for spelling, name in SPELT.items() if UNITS[name].kind == 'time')})"
_PER_TIME = re.compile(
    rf"(/|\bper) *\(?{_TIME}(?![a-z])\^?(?P<over>\d?)|\W{_TIME}\^?-(?P<up>\d)", re.IGNORECASE
)
_RATES = {"rpm": "rev/min", "rps": "rev/s", "dps": "deg/s"}
_RATE = re.compile(rf"(?<![a-z])({'|'.join(_RATES)})(?![a-z])", re.IGNORECASE)
_FORCE = re.compile(r"[km]?n\W?([cm]?m)?")
_NUMBERED = re.compile(r"(\d*\.?\d+) *([^\d\s.].*)")
"""A number before a unit: a motor's `0.01 deg`."""


def spelt(text: str) -> str | None:
    """Return the name of the unit that a text spells, `deg` for `°`; None if it spells none."""
    return SPELT.get(text.lower())


def without_number(unit: str) -> tuple[str, float]:
    """Return a unit and the number before it: `deg` and 0.01 of `0.01 deg`, 1 where there is none.

    What is no listed unit behind a number stays whole.
    """
    match = _NUMBERED.fullmatch(unit)
    name = spelt(match[2]) if match else None
    return (name, float(match[1])) if match and name else (unit, 1.0)


def kind_of(unit: str) -> str:
    """Return what a unit measures; the unit itself if it is not listed."""
    name, _ = without_number(unit)
    return UNITS[name].kind if name in UNITS else unit


def per_time(unit: str) -> int:
    """Return how often a unit is divided by time: 0 for m, 1 for rad s^-1 and rpm, 2 for m/s^2."""
    return len(_over_time(unit)[1])


def _over_time(unit: str) -> tuple[str, list[str]]:
    """What is divided by time, and each unit of time that it is divided by: `m`, `s` and `s`."""
    text = _RATE.sub(lambda match: _RATES[match[0].lower()], _plain(unit))
    times: list[str] = []
    for match in _PER_TIME.finditer(text):
        _, over, power, raised, power_below = match.groups()
        times += [SPELT[(over or raised).lower()]] * int(power or power_below or 1)
    return _PER_TIME.sub("", text).strip(" ()[]") if times else unit, times


def is_force(unit: str) -> bool:
    """Whether a unit is of forces or torques: N, Nm, N cm."""
    return _FORCE.fullmatch(_plain(unit).lower()) is not None


def _plain(unit: str) -> str:
    """A unit without raised digits."""
    return unicodedata.normalize("NFKC", unit).replace("\u2212", "-").strip()


def is_rate(unit: str) -> bool:
    """Return whether numbers in a unit are speeds, 0 at rest: m/s, rad/sec, deg/min, rpm."""
    return per_time(unit) == 1


def rates(units: Sequence[str]) -> list[int]:
    """Return the columns that are speeds."""
    return [i for i, unit in enumerate(units) if is_rate(unit)]


def units_of(kind: Kind) -> dict[str, float]:
    """Return the units of a kind with their factors, the base unit first."""
    return {name: unit.factor for name, unit in UNITS.items() if unit.kind == kind}


def base_of(unit: str) -> tuple[str, float]:
    """Return the base unit and the factor to it, rad and pi/180 for deg; other units stay."""
    of, times = _over_time(unit)
    if times:
        base, number = base_of(spelt(of) or of)
        return base + "/s" * len(times), number / math.prod(UNITS[time].factor for time in times)
    name, number = without_number(unit)
    known = UNITS.get(name)
    if known is None or known.kind == "share":
        return name, number
    return next(iter(units_of(known.kind))), number * known.factor


def factor(unit: str, wanted: str) -> float | None:
    """Return what to multiply a number with, for another unit; None if that cannot be."""
    (here, of_one), (there, of_other) = base_of(unit), base_of(wanted)
    if kind_of(unit) == kind_of(wanted) == "share":
        of_one, of_other = of_one * UNITS[here].factor, of_other * UNITS[there].factor
    elif here != there:
        return None
    return of_one / of_other


def spoken(unit: str) -> tuple[str, float]:
    """Return the unit that people say for another, and how many of it are one: `cm`, 100 for m."""
    said = (UNITS[unit].spoken if unit in UNITS else "") or unit
    return said, factor(unit, said) or 1.0


def in_unit(quantities: Mapping[Kind, float], unit: str) -> float | None:
    """Return the quantity of a unit's kind, in that unit; None if there is none for it.

    Quantities are in base units, by kind: `{"angle": 0.3}`.
    """
    known = UNITS.get(unit)
    quantity = None if known is None else quantities.get(known.kind)
    return None if known is None or quantity is None else quantity / known.factor


def looks_like(unit: str, number: float, *, error: bool = False, stated: bool = False) -> str:
    """Return the unit that a number in [m] or [rad] is in by its size; empty if it is plausible.

    Numbers in other units are all plausible. `error` is of an error or a tolerance, not a place or
    a joint's angle; `stated` of a unit that a person said.
    """
    known = UNITS.get(unit)
    if known is None or not known.spoken or known.kind == "time":
        return ""
    if error:
        return known.spoken if known.error_limit <= abs(number) < math.inf else ""
    if abs(number) <= known.largest * (STATED if stated else 1.0):
        return ""
    finer = known.kind == "length" and UNITS[known.spoken].largest < abs(number) < math.inf
    return known.small if finer else known.spoken

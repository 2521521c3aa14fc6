"""Units of recordings: read from names, converted, and judged by what an arm can do.

No guess is silent: each is an `Ambiguity`, with the option that settles it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from prior_reinforce.errors import ConfigurationError, UnclearUnitsError
from prior_reinforce.units import (
    STATED,
    UNITS,
    factor,
    is_rate,
    kind_of,
    spelt,
    spoken,
    units_of,
    without_number,
)
from prior_reinforce.wording import listed

SECONDS = units_of("time")
"""Units of time, in [s]."""
FRAME = "frame"
"""Unit of a column that counts frames; the rate says how long one is."""
TIME_UNITS = (*SECONDS, FRAME)
CHANNEL_UNITS = (*units_of("angle"), *units_of("length"), "percent")
"""Units that a channel's name may carry."""
_UNITS = (*CHANNEL_UNITS, *SECONDS)
_SLOWEST, _FASTEST = 5.0, 5000.0
"""Frames a second at which arms are recorded. Ours: teleoperation at 10 Hz is the slowest in use,
libfranka's and RTDE's logs have 1000 and 500."""
_PLAUSIBLE: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "rad": {unit: (0.0, UNITS[unit].largest) for unit in ("rad", "deg")},
    "m": {unit: (0.0, UNITS[unit].largest) for unit in ("m", "cm", "mm")},
    "rad/s": {"rad/s": (0.0, 15.0), "deg/s": (0.0, 900.0)},
    "m/s": {"m/s": (0.0, 15.0), "mm/s": (0.0, 15e3)},
    "percent": {"share": (0.0, 1.1), "percent": (1.1, UNITS["percent"].largest)},
    "opening in m": {"m": (0.0, 0.3), "cm": (1.1, 30.0), "mm": (1.1, UNITS["mm"].largest)},
    "opening in mm": {"mm": (0.3, UNITS["mm"].largest), "m": (0.0, 0.3)},
    "opening in percent": {"share": (0.1, 1.1), "percent": (2.0, UNITS["percent"].largest)},
    "opening in share": {"share": (0.0, 1.1), "percent": (2.0, UNITS["percent"].largest)},
    "period": {u: (1 / (_FASTEST * scale), 1 / (_SLOWEST * scale)) for u, scale in SECONDS.items()},
}
"""Plausible units, the likeliest first, with the least and the greatest number: of angles or
lengths the largest, of periods the time between two frames. Ours: no joint turns two turns, or
faster than 15 rad/s; above 300, millimetres are likelier than metres; no gripper opens by 30 cm, or
only by 0.3 mm; one within about 1 is recorded as a share, but below 0.1 as well in metres, and to 2
in radians."""
_BRACKETS = re.compile(r"(?P<name>.+?)(?: in)?\s*[\[(]\s*(?P<unit>[^\[\]()]+?)\s*[\])]")
_ENDING = re.compile(r"(?P<name>.+?)(?:[_ ]in)?[_ ](?P<unit>[a-zµμ°]+)")
_CAMEL = re.compile(r"(?P<name>.*[a-z0-9])(?P<unit>[A-Z][a-z]+|DEG|RAD|MM|CM|MS|US|NS)")
"""`panDeg`."""
_NO_ENDING = {
    _ENDING: ("in", "min", "h", "turn", "turns"),
    _CAMEL: ("in", "min", "rev", "day", "share", "turn", "turns"),
}
"""Words that are no unit there: in `plug_in`, `q_min`, `firstDay`."""
_BEFORE_NUMBER = re.compile(r"(?P<name>.+?)_(?P<unit>deg|rad|mm|cm)(?P<number>_?\d+)", re.I)
"""`q_deg_0`."""
_OF_OTHERS = re.compile(r".+_(?:(?P<of>deg|rad|mm|m|d)_?p(?:er_?)?s(?:ec)?|(?P<load>Nm))", re.I)
"""Units of speeds and loads at the end of names, which keep them: `vel_1_degps`, `load_1_Nm`."""
_UNKNOWN = re.compile(r"(?P<name>.+?)\s*\[\s*(?P<unit>[^\[\]]*[^\W\d_][^\[\]]*?|%)\s*\]")
"""`pressure [bar]` or `x [cm ahead]`, in an unknown unit: what holds a letter, unlike `x[0]`."""


@dataclass(frozen=True)
class Ambiguity:
    """Something that a recording does not state, and whose default is implausible."""

    what: str
    """What is implausible, and what it looks like: a clause."""
    option: str
    """The option that confirms what it looks like, for instance `--time-unit ms`."""
    guessed: bool = True
    """Whether it can be guessed; else it is asked about even where guesses are taken."""


def raise_if_ambiguous(
    ambiguities: Iterable[Ambiguity], also: str = "", *, take_guesses: bool = False
) -> None:
    """Raise UnclearUnitsError with all ambiguities, their options, and `also` other problems.

    With `take_guesses`, only ambiguities that cannot be guessed are raised.
    """
    found = [one for one in dict.fromkeys(ambiguities) if not (take_guesses and one.guessed)]
    if found:
        options = " ".join(dict.fromkeys(one.option for one in found))
        what = "; ".join(one.what for one in found)
        raise UnclearUnitsError(what, options, also)


def known_unit(text: str) -> str | None:
    """Return the unit that a text spells, for instance `deg` for `°`; None if it spells none."""
    unit = spelt(text.strip().strip("[]().").strip())
    return unit if unit in _UNITS else None


def split_unit(
    column: str, among: Collection[str] = _UNITS, *, any_word: bool = False
) -> tuple[str, str | None]:
    """Split a column's name `x_cm`, `q0 [deg]` or `time (ms)` into the name and the unit in it.

    `among` are possible units, in brackets also behind a number, `(0.001deg)`; with `any_word`, so
    is any word in square brackets, `volume [ml]`. Without a unit, the name and None.
    """
    for pattern in (_BRACKETS, _ENDING, _BEFORE_NUMBER, _CAMEL):
        match = pattern.fullmatch(column.strip())
        unit = match and known_unit(match["unit"])
        if match is None or match["unit"].lower() in _NO_ENDING.get(pattern, ()):
            continue
        if pattern is _BEFORE_NUMBER:
            return match["name"] + match["number"], unit
        if unit in among:
            return match["name"].strip(), unit
        of_number, number = without_number(match["unit"])
        if pattern is _BRACKETS and number != 1 and of_number in among:
            return match["name"].strip(), match["unit"]
    match = _UNKNOWN.fullmatch(column.strip()) if any_word else None
    return (match["name"], spelt(match["unit"]) or match["unit"]) if match else (column, None)


def unit_of_other(column: str) -> str | None:
    """Return the unit of a speed or a load in a name, `vel_1_degps`; None where it says none."""
    match = _OF_OTHERS.fullmatch(column.strip())
    if match is None:
        return None
    of = (match["of"] or "").lower()
    return "Nm" if match["load"] else f"{'deg' if of == 'd' else of}/s"


def conversion(recorded: str, wanted: str, name: str) -> float:
    """Return the factor from one unit to another; ConfigurationError if there is none."""
    scale = factor(recorded, wanted)
    if scale is None:
        share = kind_of(wanted) == "share"  # 0.08 m, fully open, are 100 percent
        example = f"'{1250 if share else 0.001:g} {spoken(wanted)[0]}'"
        if not spelt(without_number(recorded)[0]) and re.search("[A-Za-z]", recorded):
            example = f"{spoken(wanted)[0]} or {example}"
        example = "deg/s or mm/s" if is_rate(wanted) else example
        raise ConfigurationError(
            f"{name} is recorded in {recorded}, but plans are in {wanted}; say what one {recorded} "
            f"is, such as --units {example}, or correct the plan's units"
        )
    return scale


def judge_unit(
    unit: str, number: float, *, period: bool = False, opening: bool = False
) -> str | None:
    """Return the unit that a number looks like: the same if plausible, None if none fits.

    The number is the largest angle, length or share, a gripper's `opening`, or the `period` between
    two frames; 0 and other units are always plausible.
    """
    if number == 0 and not period:
        return unit
    kind = "period" if period else f"opening in {unit}" if opening else unit
    ranges = _PLAUSIBLE.get(kind) or _PLAUSIBLE.get(unit, {unit: (0.0, float("inf"))})
    fitting = [u for u, (low, high) in ranges.items() if low <= number <= high]
    return unit if unit in fitting else next(iter(fitting), None)


def is_possible(unit: str, number: float) -> bool:
    """Return whether an angle or a length can be in a unit if that is stated explicitly."""
    return unit not in _PLAUSIBLE or number <= STATED * _PLAUSIBLE[unit][unit][1]


def say_names(names: Sequence[str]) -> str:
    """Abbreviate a list of names: `q[0] to q[6], t`; consecutive numbers are one group."""
    groups: list[list[str]] = []
    for name in names:
        if groups and _follows(groups[-1][-1], name):
            groups[-1].append(name)
        else:
            groups.append([name])
    return listed([g[0] if len(g) == 1 else f"{g[0]} to {g[-1]}" for g in groups])


def _follows(before: str, name: str) -> bool:
    """Whether a name is the one before with one number one higher."""
    return any(
        name == f"{before[: n.start()]}{int(n[0]) + 1:0{len(n[0])}}{before[n.end() :]}"
        for n in re.finditer(r"\d+", before)
    )

"""Units of recordings: read from names, converted, and judged by what an arm can do.

No guess is silent. Each is an `Ambiguity`: what is implausible, what it looks like, and the option
that settles it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from prior_reinforce.errors import ConfigurationError, UnclearUnitsError
from prior_reinforce.plans.whole_turns import TURN, attitudes
from prior_reinforce.units import STATED, UNITS, base_of, factor, spelt, units_of

SECONDS = units_of("time")
"""Units of time, in [s]."""
CHANNEL_UNITS = (*units_of("angle"), *units_of("length"), "percent")
"""Units that a channel's name may carry."""
_UNITS = (*CHANNEL_UNITS, *SECONDS)
_SLOWEST, _FASTEST = 5.0, 5000.0
"""Frames a second at which arms are recorded. Ours: teleoperation at 10 Hz is the slowest in use,
libfranka's and RTDE's logs have 1000 and 500."""
_PLAUSIBLE: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "rad": {unit: (0.0, UNITS[unit].largest) for unit in ("rad", "deg")},
    "m": {unit: (0.0, UNITS[unit].largest) for unit in ("m", "cm", "mm")},
    "percent": {"percent": (1.0, UNITS["percent"].largest), "share": (0.0, 1.0)},
    "opening": {"m": (0.0, 0.3), "cm": (0.0, 30.0), "mm": (0.0, UNITS["mm"].largest)},
    "period": {u: (1 / (_FASTEST * scale), 1 / (_SLOWEST * scale)) for u, scale in SECONDS.items()},
}
"""Units that angles, lengths and periods may be in, the likeliest first, with the least and the
greatest number: of angles and lengths the largest one, of periods the time between two frames.
Ours: no joint turns two turns; above 300, millimetres are likelier than an arm of three metres; no
gripper opens by 30 cm; one that moves by less than a percent is recorded as a share."""
_NO_ANGLE = re.compile(
    r"grip|jaw|finger|width|claw|opening|suction|robotiq|wsg|greifer|pince|夹爪|夹具|vacuum|valve"
    r"|pressure|force|torque|voltage|temperature",
    re.I,
)
_APART: Mapping[str, Sequence[float]] = {"rad": (180 / math.pi,), "m": (100.0, 1000.0)}
"""How many times larger numbers get by the next unit: rad to deg, m to cm and mm."""
_ALIKE, _FAR_APART = 1.5, 20.0
"""How much takes of one task may differ, and times apart from which two plausible units are two.
Ours."""
_MATRIX = re.compile(r"(?P<stem>.*?)[_\[ ]*(?P<row>[0-4])[,_]?(?P<column>[0-4])\]?")
_TURNS = (
    r"yaw|roll|pitch|rotation|angle|winkel|mcp|pip|dip|cmc|flex(ion)?|abd(uction)?|azimuth|heading"
)
_ANGLE_ALWAYS = re.compile(rf"(^|[^a-z])({_TURNS})s?($|[^a-z])", re.I)
"""Names of angles, whatever else stands beside: `gripper_yaw`, `index_finger_mcp`."""
_ANGLE = re.compile(
    rf"(^|[^a-z])({_TURNS}|joint|gelenk|j|q|a|pan|tilt|turn|rot(ation)?|wrist|elbow|shoulder|waist"
    r"|hip|knee|ankle|neck|theta|phi|psi)s?($|[^a-z])", re.I
)  # fmt: skip
_LENGTH = re.compile(
    r"(^|[^a-z])(e\d|ext(ernal)?([_ ]?axis)?[_ ]?\d*|rail|track|linear|slider?|gantry|prismatic"
    r"|carriage)($|[^a-z])",
    re.I,
)
"""Names of axes that may be lengths: a KUKA's `E1`."""
_PLACE = re.compile(r"(?P<stem>|.*[^a-z0-9])(?P<axis>[xyz])", re.IGNORECASE)
_OF_PLACE = re.compile(
    r"(.*[^a-z])?(p|pos|positions?|place|trans(lation)?|cart(esian)?|tcp|tool|tip|ee|eef|pose|xyz"
    r"|(end_?)?effector|flange|hand|location)[^a-z]*",
    re.IGNORECASE,
)
"""What x, y and z are the place of: `tool_x`. Others may be joints: `hip_x`, `hip_y`."""
_BRACKETS = re.compile(r"(?P<name>.+?)\s*[\[(]\s*(?P<unit>[^\[\]()]+?)\s*[\])]")
_ENDING = re.compile(r"(?P<name>.+?)[_ ](?P<unit>[a-zµμ°]+)")
_CAMEL = re.compile(r"(?P<name>.*[a-z0-9])(?P<unit>[A-Z][a-z]+|DEG|RAD|MM|CM|MS|US|NS)")
"""`panDeg`."""
_NO_ENDING = {
    _ENDING: ("in", "min", "h", "turn", "turns"),
    _CAMEL: ("in", "min", "rev", "day", "share", "turn", "turns"),
}
"""Words that are no unit there: in `plug_in`, `q_min`, `firstDay`."""
_BEFORE_NUMBER = re.compile(r"(?P<name>.+?)_(?P<unit>deg|rad|mm|cm)(?P<number>_?\d+)", re.I)
"""`q_deg_0`."""
_UNKNOWN = re.compile(r"(?P<name>.+?)\s*\[\s*(?P<unit>[^\W\d_][^\[\]\s]*|%)\s*\]")
"""`pressure [bar]`, in a unit that this program does not know."""


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
    """Raise UnclearUnitsError if anything is ambiguous, with all options that settle it.

    `also` are other problems, so that all are reported at once. With `take_guesses`, only what
    cannot be guessed is raised.
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


def is_no_angle(name: str) -> bool:
    """Whether a channel's name says that it is no angle unless its unit is said: a gripper's."""
    return _NO_ANGLE.search(name) is not None and not _ANGLE_ALWAYS.search(_spaced(name))


def says_angle(name: str) -> bool:
    """Whether a channel's name says that it is an angle: `base_yaw`, `joint3`, `A1`."""
    return _ANGLE.search(_spaced(name)) is not None and not is_no_angle(name)


def may_be_length(name: str) -> bool:
    """Whether a channel's name leaves open if it turns or slides: a rail, an external axis."""
    return _LENGTH.search(name) is not None and not _ANGLE_ALWAYS.search(_spaced(name))


def _spaced(name: str) -> str:
    """`baseYaw` as `base_Yaw`."""
    return re.sub("(?<=[a-z0-9])(?=[A-Z])", "_", name)


def place_names(names: Sequence[str]) -> set[str]:
    """Return the channels that are lengths by their names: x, y and z, or `tool_x` and `tool_y`."""
    of_attitudes = {name for group in attitudes(names) for name in group}
    groups: dict[str, dict[str, str]] = {}
    for name in names:
        match = _PLACE.fullmatch(name.strip())
        stem = "" if match is None else match["stem"]
        if (
            match is not None
            and name not in of_attitudes
            and (not stem or _OF_PLACE.fullmatch(stem))
        ):
            groups.setdefault(match["stem"], {})[match["axis"].lower()] = name
    return {name for group in groups.values() if len(group) > 1 for name in group.values()}


def matrix_names(names: Sequence[str]) -> set[str]:
    """Return the entries of rotation matrices: `R11` to `R33`, which have no unit."""
    groups: dict[str, dict[str, str]] = {}
    for name in names:
        if (match := _MATRIX.fullmatch(name.strip())) is not None:
            groups.setdefault(match["stem"], {})[match["row"] + match["column"]] = name
    found: set[str] = set()
    for group in groups.values():
        rows, columns = ({place[k] for place in group} for k in (0, 1))
        if min(len(rows), len(columns)) >= 3 and len(group) == len(rows) * len(columns):
            found |= {*group.values()}
    return found


def one_for_all(unit: str, names: Sequence[str]) -> list[str | None]:
    """Return one unit for each channel that can be in it; grippers and places are no angles."""
    is_angle, lengths = base_of(unit)[0] in TURN, place_names(names)
    return [None if is_angle and (is_no_angle(n) or n in lengths) else unit for n in names]


def split_unit(column: str, among: Collection[str] | None = None) -> tuple[str, str | None]:
    """Split a column's name `x_cm`, `q0 [deg]` or `time (ms)` into the name and the unit in it.

    `among` are units that may stand there; None takes all, and in square brackets any word at all:
    `volume [ml]`. Without such a unit, the whole name and None.
    """
    for pattern in (_BRACKETS, _ENDING, _BEFORE_NUMBER, _CAMEL):
        match = pattern.fullmatch(column.strip())
        unit = match and known_unit(match["unit"])
        if match is None or match["unit"].lower() in _NO_ENDING.get(pattern, ()):
            continue
        if pattern is _BEFORE_NUMBER:
            return match["name"] + match["number"], unit
        if unit in (among or _UNITS):
            return match["name"].strip(), unit
        if among is None and column.strip().endswith("]"):
            return match["name"].strip(), match["unit"]
    return column, None


def stated_unit(channel: str) -> tuple[str, str | None]:
    """Split a channel's name like `split_unit`; any word in square brackets counts as a unit."""
    name, unit = split_unit(channel, CHANNEL_UNITS)
    match = _UNKNOWN.fullmatch(channel.strip())
    if unit is not None or match is None:
        return name, unit
    return match["name"], spelt(match["unit"]) or match["unit"]


def conversion(recorded: str, wanted: str, name: str) -> float:
    """Return the factor from one unit to another.

    Raises:
        ConfigurationError: One cannot be converted to the other.
    """
    scale = factor(recorded, wanted)
    if scale is None:
        raise ConfigurationError(
            f"{name} is recorded in {recorded}, but plans are in {wanted}; say its unit with "
            "--units, or correct the plan's units"
        )
    return scale


def judge_unit(
    unit: str, number: float, *, period: bool = False, opening: bool = False
) -> str | None:
    """Return the unit that a number looks like: the same if that is plausible, None if none fits.

    The number is the largest absolute angle or length in `rad`, `m` or percent (other units are
    plausible all, and so is 0), a gripper's `opening`, or a `period` between two frames in a unit
    of time.
    """
    if number == 0 and not period:
        return unit
    kind = "period" if period else "opening" if opening and unit == "m" else unit
    ranges = _PLAUSIBLE.get(kind, {unit: (0.0, float("inf"))})
    fitting = [u for u, (low, high) in ranges.items() if low <= number <= high]
    return unit if unit in fitting else next(iter(fitting), None)


def odd_takes(reach: Sequence[float], unit: str) -> list[int]:
    """Return the takes whose numbers are apart from most others' by as much as two units are.

    `reach` is the largest number of each take: of angles in `rad`, of lengths in `m`, else of what
    is a share where it is at most 1.
    """
    middle = sorted(reach)[(len(reach) - 1) // 2]
    odd = []
    for k, number in enumerate(reach):
        if min(number, middle) <= 0:
            continue
        apart = max(number / middle, middle / number)
        looks, usual = (judge_unit(unit, n) if unit else str(n <= 1) for n in (number, middle))
        between = any(f / _ALIKE <= apart <= f * _ALIKE for f in _APART.get(unit, ()))
        if between or (looks != usual and apart >= _FAR_APART):
            odd.append(k)
    return odd


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

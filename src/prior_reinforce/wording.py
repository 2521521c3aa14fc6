"""Errors, places, lengths and tolerances in words.

An operator stands behind the robot and looks along x, from the robot's base over the table:

                      an error, seen from the goal    a place, seen from the base
    x                 long or short                   ahead or behind
    y                 left or right                   left or right
    z                 high or low                     up or down
    a time            late or early
    another amount    too much or too little

A component is x, y or z by its name, else by its position. An error is outcome minus goal. Lengths
are said in centimetres, errors of other tasks by their names and units. `parsing` reads the words.

Source: paper, Section IV, "Perception Process" (coarse human feedback); the words are ours.
"""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from itertools import cycle

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.readings import Reading
from prior_reinforce.terminal import plain
from prior_reinforce.units import SPELT, UNITS, kind_of, spoken

WORDS: tuple[tuple[str, str], ...] = (("long", "short"), ("left", "right"), ("high", "low"))
"""For x, y and z of an error: the word where it is positive, the word where it is negative."""
PLACE_WORDS: tuple[tuple[str, str], ...] = (("ahead", "behind"), ("left", "right"), ("up", "down"))
"""The same for a place."""
TIME_WORDS: tuple[str, str] = ("late", "early")
"""The same for a component that is a time."""
AMOUNT_WORDS: tuple[str, str] = ("too much", "too little")
"""The same for the only component, where it is no length, time or angle: ml, pins."""
SYNONYMS = {
    **dict.fromkeys(("far", "beyond", "past"), "long"),
    **{"above": "high", "below": "low"},
    **dict.fromkeys(("much", "many", "more", "over"), AMOUNT_WORDS[0]),
    **dict.fromkeys(("little", "few", "less", "under"), AMOUNT_WORDS[1]),
}
"""Other words of an error, and which of these they mean."""
_OTHER_WAYS = {"over": ("long", "high"), "under": ("short", "low")}
"""Words that may mean several of these."""
_AXES = {"x": 0, "y": 1, "z": 2, "height": 2}
CHANCES = (0.0, 0.1), (0.1, 0.65), (0.65, 1.0)
"""Bounds of P(hit) for each word that says how likely a hit is."""
_FEW_TRIALS = 10
"""Beyond, the number is a guess, and is not said (ours)."""
_EXAMPLE_LENGTHS = ("5cm", "2cm", "1cm")
_EXAMPLE_PLACE = (92, 10, 5)
_FROM_BASE = re.compile(r"(?P<length>.*?)\s*(?:away )?from (?:the )?(?:base|robot|arm|foot)\b.*")
_EXAMPLES = {"time": "20ms", "angle": "5deg"}


def as_html(text: str) -> str:
    """Return a text of several lines as a notebook shows it: as it is, names and all."""
    return f"<pre>{html.escape(plain(text, keep=chr(10)))}</pre>"


def say_chance(p_hit: float) -> str:
    """Say how likely a hit is, in one of three words.

    Ours: P(hit) is off by more than a tenth. The bounds were chosen on the rows of `reproduction
    once`: of trials called unlikely 0 to 21 % hit, possible 21 to 63 %, likely 62 to 87 %, by
    condition. On those of `adaptation`, which were not looked at, 37 % of 145 unlikely ones hit
    where each goal stands alone, none of 41 with earlier goals; possible 37 and 46 %, likely 78
    and 81 %.
    """
    _, (possible, likely), _ = CHANCES
    return "unlikely" if p_hit < possible else "likely" if p_hit >= likely else "possible"


def say_trials(expected: float) -> str:
    """Say how many trials are expected to the next hit: `about 2.2`, or `more than 10`."""
    return f"about {expected:.1f}" if expected <= _FEW_TRIALS else f"more than {_FEW_TRIALS}"


def say_count(n: int, what: str) -> str:
    """Say how many there are: `1 trial`, `3 trials`."""
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


def say_cost(demonstrations: int, trials: float) -> str:
    """Say the paper's count N of a goal, or of several with the mean of their trials.

    For instance `N = 6 demonstrations + 2 trials = 8`, or `... + 2.5 trials = 8.5`.
    """
    shown = say_count(demonstrations, "demonstration")
    if isinstance(trials, int):
        return f"N = {shown} + {say_count(trials, 'trial')} = {demonstrations + trials}"
    return f"N = {shown} + {trials:.1f} trials = {demonstrations + trials:.1f}"


def listed(items: Sequence[str], separator: str = ", ", most: int = 12) -> str:
    """Join the first items, and count the rest."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return separator.join(items[:most]) + more


def in_words(form: OutcomeFormat) -> bool:
    """Whether words describe outcomes: lengths in metres, at most three of them."""
    return form.outcome_dim <= len(WORDS) and set(form.units) == {"m"}


def axes_of(form: OutcomeFormat) -> list[int]:
    """Which of x, y and z components are, by their names, else by their positions; 3: none."""
    by_position = [3 if kind_of(unit) == "time" else min(j, 3) for j, unit in enumerate(form.units)]
    pairs = zip(form.names, by_position, strict=True)
    by_name = [axis if axis == 3 else _AXES.get(name.lower(), axis) for name, axis in pairs]
    spatial = [axis for axis in by_name if axis < 3]
    return by_name if len(set(spatial)) == len(spatial) else by_position


def to_words(error: ArrayLike, form: OutcomeFormat | None = None) -> str:
    """Describe an error as an operator would: `5 cm long, 2 cm left`, or `x +0.05 m, t -0.1 s`.

    Args:
        error: Outcome minus goal, shape (k,), in the outcomes' units.
        form: What the outcomes are; x, y and z in metres if not given.
    """
    form = form or OutcomeFormat.metres(np.size(error))
    if not in_words(form):
        return _components(error, form, "+")
    said = _terms(error, [WORDS[axis] for axis in axes_of(form)])
    return ", ".join(term for term in said if not term.startswith("0 ")) or "on the goal"


def too_far(goal: ArrayLike, form: OutcomeFormat) -> str:
    """Say which words mean too far where a throw goes to a side: `long and left`; else empty."""
    axes, place = axes_of(form), np.asarray(goal, dtype=float)
    if not (in_words(form) and {0, 1} <= {*axes}):
        return ""
    along = np.arctan2(place[axes.index(1)], place[axes.index(0)])
    eighths = np.rint(along / (np.pi / 4)) * (np.pi / 4)
    parts = zip(np.round([np.cos(eighths), np.sin(eighths)]), WORDS[:2], strict=True)
    words = [word[0 if part > 0 else 1] for part, word in parts if part]
    return "" if words == [WORDS[0][0]] else " and ".join(words)


def say_reading(reading: Reading, form: OutcomeFormat) -> str:
    """Describe what was seen: in its own words, with all units, else as its number."""
    if reading.said:
        return reading.said
    if not np.any(np.isfinite(reading.low) | np.isfinite(reading.high)):
        return "hit" if reading.hit else "missed"
    return to_words(reading.error_seen, form)


def say_understood(reading: Reading, form: OutcomeFormat) -> str:
    """Say which numbers of an error the words were taken for, where they say others; else ""."""
    if not (in_words(form) and reading.said and reading.has_place):
        return ""
    known = np.isfinite(reading.low) & np.isfinite(reading.high)
    terms = _terms(reading.error_seen, [WORDS[axis] for axis in axes_of(form)])
    parts = [
        term if is_number else term.split()[-1]
        for term, is_number in zip(terms, known, strict=True)
        if not term.startswith("0 ")
    ]
    understood, number = ", ".join(parts), r"\d+(?:\.\d+)?"
    new = {*re.findall(number, understood)} - {*re.findall(number, reading.said)}
    return understood if new else ""


def say_place(place: ArrayLike, form: OutcomeFormat) -> str:
    """Describe a goal, condition or outcome: `92 cm ahead, 10 cm left`, or `x 0.92 m, t 0.3 s`."""
    if in_words(form):
        return ", ".join(_terms(place, [PLACE_WORDS[axis] for axis in axes_of(form)]))
    return _components(place, form)


def is_amount(form: OutcomeFormat) -> bool:
    """Whether outcomes are one number that is no length and no time, as an angle or ml are."""
    return form.outcome_dim == 1 and kind_of(form.units[0]) not in ("length", "time")


def error_words(
    form: OutcomeFormat, words: Sequence[tuple[str, str]] = WORDS
) -> list[tuple[str, str] | None]:
    """For each component the words where it is positive and negative; None where it has none."""
    if is_amount(form) and kind_of(form.units[0]) != "angle":
        return [AMOUNT_WORDS]
    pairs = [
        TIME_WORDS if kind_of(unit) == "time" else words[axis] if axis < len(words) else None
        for axis, unit in zip(axes_of(form), form.units, strict=True)
    ]
    return [pair if pairs.count(pair) == 1 else None for pair in pairs]


def error_example(form: OutcomeFormat) -> str:
    """An error in words: `5cm long, 2cm left, 20ms late`; empty where a component has no words."""
    said = [
        f"{example} {pair[0]}"
        for j, (pair, unit) in enumerate(zip(error_words(form), form.units, strict=True))
        if pair and (example := _example(j, unit, form.outcome_dim))
    ]
    return ", ".join(said) if len(said) == form.outcome_dim else ""


def place_example(form: OutcomeFormat) -> str:
    """A place as it can be said: `92cm ahead, 10cm left`, or `distance 92cm, height 10cm`."""
    numbers = _EXAMPLE_PLACE[: form.outcome_dim]
    if in_words(form):
        words = (PLACE_WORDS[axis][0] for axis in axes_of(form))
        return ", ".join(f"{number}cm {word}" for number, word in zip(numbers, words, strict=True))
    return ", ".join(
        f"{name} {number}" + f"{spoken(unit)[0]}" * (unit != "1")
        for name, number, unit in zip(form.names, cycle(numbers), form.units, strict=False)
    )


def say_unread(
    part: str, text: str, known: Sequence[str], form: OutcomeFormat, place: bool, direction: str
) -> str:
    """Say that a part of a text cannot be read, and what may stand there: one of `known`.

    `direction` is the one of them that the part of an error says; empty if it says none.
    """
    if place and (from_base := _FROM_BASE.fullmatch(part)):
        return (
            f"{part!r} may be straight to the place or along x only; measure along x and say "
            f"{from_base['length']} {known[0]}"
        )
    example = place_example(form) if place else error_example(form)
    said = f', for instance "{example}"' * bool(example)
    if direction and not place:  # how far is what cannot be read
        said = f', for instance "{direction}" alone'
        said += f', or "5-10cm {direction}"' * (kind_of(form.units[0]) == "length")
    elif not place:
        said += ', or "hit" or "miss"'
    where = "" if part == text.strip().lower() else f" in {text!r}"
    unknown = [
        word
        for word in re.findall(r"[^\W\d_]+", part)
        if word not in (*known, *SPELT, *form.units, "a", "an", "to", "the", "by")
    ]
    hints = [
        f"{word!r} may be {' or '.join(may)}: write that"
        for word in unknown
        if (may := [*filter(known.__contains__, _OTHER_WAYS.get(word, ()))])
        or (may := [each for each in known if each.startswith(word)])
    ]
    if hints:
        where += f": {'; '.join(hints)}"
    elif unknown:
        kinds = {kind_of(unit) for unit in form.units}
        units = dict.fromkeys([*(each for each in UNITS if kind_of(each) in kinds), *form.units])
        said_units = ", ".join(unit for unit in units if unit != "1")
        listed = f" ({said_units})" if said_units else ""
        those = " and ".join(map(repr, unknown))
        where += f": it has {those}, which is no unit{listed} and no direction"
        if {*unknown} & {*TIME_WORDS}:
            where += f"; outcomes have no time: {form}"
    elif "/" in part:
        where += ": write 0.5 for 1/2"
    number = "a length" if any(kind_of(u) == "length" for u in form.units) else "a number, its unit"
    words = f"{number} and one of {', '.join(known)}" if known else "a number and its unit"
    return f"cannot read {part!r}{where}; write {words}{said}"


def say_too_large(number: float, unit: str, stated: bool) -> str:
    """Say that an arm makes no such number, or makes it only if its unit was stated."""
    if kind_of(unit) == "length":
        return f"{number:g} {unit} is farther than any arm throws"
    return f"{number:g} {unit} is {'much ' * stated}more than a turn"


def _example(j: int, unit: str, k: int) -> str:
    """A number with a unit for component j of k; empty where only that unit itself is known."""
    if kind_of(unit) == "length":
        return "2in" if unit == "in" else _EXAMPLE_LENGTHS[j]
    return _EXAMPLES.get(kind_of(unit), f"2{unit}".removesuffix("1") if k == 1 else "")


def say_length(length: float, form: OutcomeFormat) -> str:
    """Format a distance between outcomes: `1.5 cm`, `0.2 rad`; `0.25` if units are mixed."""
    units = form.units
    if set(units) == {"m"}:
        return f"{_centimetres(length)} cm"
    unit = units[0] if len(set(units)) == 1 and units[0] != "1" else ""
    return f"{float(f'{length:.3g}'):g} {unit}".strip()


def say_beyond(beyond: ArrayLike, form: OutcomeFormat) -> str:
    """Say how far a place lies outside of others, where it does: `29 cm in x, 2 cm in y`."""
    parts = zip(np.asarray(beyond, float), form.names, form.units, strict=True)
    return ", ".join(
        f"{say_length(value, OutcomeFormat((name,), (unit,)))} in {name}"
        for value, name, unit in parts
        if value > 0.0
    )


def bare_units(form: OutcomeFormat) -> str:
    """Say what `from_words` takes a number without a unit for: `centimetres`, `inches`, `rad`."""
    bare = [
        bare_unit(unit) for unit in form.units if kind_of(unit) == "length" or form.outcome_dim == 1
    ]
    plural = (UNITS[unit].plural if kind_of(unit) == "length" else unit for unit in bare)
    return " and ".join(dict.fromkeys(plural))


def bare_unit(unit: str) -> str:
    """Return the unit of a number without one: centimetres in metres, else the outcome's own."""
    return "cm" if unit == "m" else unit


def say_tolerance(form: OutcomeFormat) -> str:
    """Say what counts as reached, to the last digit: `1.5 cm`, `1.5 cm and 20 ms`.

    With names where components of one unit differ: `x 2 cm and y 1 cm`.
    """
    each = []
    for value, unit in zip(form.tolerance, form.units, strict=True):
        # A round number of radians is no round number of degrees.
        said, scale = (unit, 1.0) if kind_of(unit) == "angle" else spoken(unit)
        each.append(f"{value * scale:g}" + f" {said}" * (said != "1"))
    if len(set(each)) > len(set(form.units)):
        each = [f"{name} {said}" for name, said in zip(form.names, each, strict=True)]
    return " and ".join(dict.fromkeys(each))


def _terms(values: ArrayLike, words: Sequence[tuple[str, str]]) -> list[str]:
    return [
        f"{_centimetres(value)} cm {positive if round(value, 3) >= 0 else negative}"
        for value, (positive, negative) in zip(np.asarray(values, float), words, strict=False)
    ]


def _centimetres(length: float) -> str:
    return f"{round(abs(length) * 100, 1):g}"


def _components(values: ArrayLike, form: OutcomeFormat, sign: str = "") -> str:
    # Adding 0.0 turns -0 into 0.
    return ", ".join(
        f"{name} {round(float(value), 4) + 0.0:{sign}.4g}" + f" {unit}" * (unit != "1")
        for name, value, unit in zip(form.names, np.asarray(values, float), form.units, strict=True)
    )

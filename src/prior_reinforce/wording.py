"""Errors and places in words, and back: the one place that converts either way.

An operator stands behind the robot and looks along x, from the robot's base over the table:

                      an error, seen from the goal    a place, seen from the base
    x                 long or short                   ahead or behind
    y                 left or right                   left or right
    z                 high or low                     up or down
    a time            late or early

`names` and `units` are those of the k components of an outcome. A component is x, y or z by its
name, else by its position. An error is outcome minus goal. Lengths are said in centimetres, errors
of other tasks by their names and units.

Source: paper, Section IV, "Perception Process" (coarse human feedback); the words are ours.
"""

from __future__ import annotations

import html
import math
import os
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TextIO

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import BEYOND_DOUBT, FARTHEST, LARGEST_TURN, as_error
from prior_reinforce.errors import InvalidFeedbackError
from prior_reinforce.readings import EYE_BETWEEN, OPEN_ERROR, Reading

WORDS: tuple[tuple[str, str], ...] = (("long", "short"), ("left", "right"), ("high", "low"))
"""For x, y and z of an error: the word where it is positive, the word where it is negative."""
PLACE_WORDS: tuple[tuple[str, str], ...] = (("ahead", "behind"), ("left", "right"), ("up", "down"))
"""The same for a place."""

_UNPRINTED = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Unicode's control and format characters, lone surrogates, and line separators."""
_Point = Float[np.ndarray, " k"]
_LEAST_BARE_CM = 0.1
"""Ours: nobody sees a throw to a millimetre; a smaller number without a unit is in metres."""
_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
_TO_UNIT = {(a, b): _METRES[a] / _METRES[b] for a in _METRES for b in _METRES} | {
    ("ms", "s"): 0.001, ("s", "ms"): 1000.0,
    ("deg", "rad"): math.pi / 180, ("rad", "deg"): 180 / math.pi,
}  # fmt: skip
"""What to multiply with, from the unit that was said to the outcome's."""
_TIMES: tuple[str, str] = ("late", "early")
"""The words of a component that is a time."""
_EXAMPLES = {"m": "cm", "s": "20ms", "ms": "20ms", "rad": "5deg", "deg": "5deg"}
_AXES = {"x": 0, "y": 1, "z": 2, "height": 2}
_FILLERS = re.compile(r"\b(?:about|approximately|approx\.?|around|roughly|circa|ca\.?|too)\s+|~\s*")
"""What people say beside a length, which is an estimate anyway."""
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d+\s*[a-z])")
_RANGE = re.compile(r"(?<=[\da-z\"°.])\s*(?:–|-|\bto\b)\s*(?=\.?\d)")
_PLUS_MINUS = r"(?:\+-|\+/-|±)"
_NUMBER = r"\d{1,6}(?:\.\d*)?|\.\d+"
_UNIT = r"cm|mm|ms|deg(?:rees?)?|°|rad|inch(?:es)?|\"|(?:m|in|s)(?![a-z])|"
_SHORT = {"inch": "in", "inches": "in", '"': "in", "°": "deg", "degree": "deg", "degrees": "deg"}
_TERM = re.compile(
    rf"(?:(?:(?P<least>{_NUMBER})\s*(?P<least_unit>{_UNIT})\s*-\s*)?"
    rf"(?P<value>{_NUMBER})\s*(?P<unit>{_UNIT})\s*"
    rf"(?:{_PLUS_MINUS}\s*(?P<sd>{_NUMBER})\s*(?P<sd_unit>{_UNIT})\s*)?)?"
    r"(?:to the )?(?P<word>[a-z]+)"
)
_BARE_TERM = re.compile(rf"(?P<value>{_NUMBER})\s*(?P<unit>cm|mm|m|in)")
_FROM_BASE = re.compile(r"(?P<length>.*?)\s*(?:away )?from (?:the )?(?:base|robot|arm|foot)\b.*")
_PLACE_TERM = re.compile(rf"(?P<number>[+-]?(?:{_NUMBER}))\s*(?P<unit>{_UNIT})(?:\s*[,;]\s*|\s+|$)")
_FARTHEST = {
    "m": (FARTHEST, "farther than any arm throws"), "rad": (LARGEST_TURN, "more than a turn")
}  # fmt: skip
_OPEN_SDS = 10.0
"""Number used for what is no length and of which only the direction is known, in its least sds
(ours): in tolerances as far as 5 cm, where 1.5 cm are allowed."""
_SOMEWHERE = "somewhere"
_ON_THE_GOAL = ("on the goal", "spot on", "0")
_HITS = {"hit": True, "miss": False}


def plain(text: str, keep: str = "") -> str:
    """Escape control characters but for `keep` in untrusted text, such as a name, to print it."""
    return "".join(
        char.encode("unicode_escape").decode()
        if char not in keep and unicodedata.category(char) in _UNPRINTED
        else char
        for char in text
    )


RED, YELLOW, GREEN = "1;31", "33", "32"
"""ANSI codes."""


def coloured(text: str, code: str, stream: TextIO) -> str:
    """Return a text in an ANSI colour where its stream is a terminal that shows one (NO_COLOR)."""
    plainly = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return text if plainly or not stream.isatty() else f"\x1b[{code}m{text}\x1b[0m"


def as_html(text: str) -> str:
    """Return a text of several lines as a notebook shows it: as it is, names and all."""
    return f"<pre>{html.escape(plain(text, keep=chr(10)))}</pre>"


def in_words(units: Sequence[str]) -> bool:
    """Whether words describe outcomes of these units: lengths, at most three of them."""
    return len(units) <= len(WORDS) and all(unit == "m" for unit in units)


def axes_of(names: Sequence[str], units: Sequence[str]) -> list[int]:
    """Which of x, y and z components are, by their names, else by their positions; 3: none."""
    by_position = [3 if unit in ("s", "ms") else min(j, 3) for j, unit in enumerate(units)]
    pairs = zip(names, by_position, strict=True)
    by_name = [axis if axis == 3 else _AXES.get(name.lower(), axis) for name, axis in pairs]
    spatial = [axis for axis in by_name if axis < 3]
    return by_name if len(set(spatial)) == len(spatial) else by_position


def to_words(error: ArrayLike, names: Sequence[str] = "xyz") -> str:
    """Describe an error as an operator would: `5 cm long, 2 cm left`, or `on the goal`.

    Args:
        error: Outcome minus goal, at most three numbers, in [m].
        names: Of the components.
    """
    said = _terms(error, [WORDS[axis] for axis in axes_of(names, "m" * len(names))])
    return ", ".join(term for term in said if not term.startswith("0 ")) or "on the goal"


def say_error(error: ArrayLike, names: Sequence[str], units: Sequence[str]) -> str:
    """Describe an error: `5 cm long, 2 cm left`, or `x +0.05 m, t -0.1 s`."""
    return to_words(error, names) if in_words(units) else _components(error, names, units, "+")


def say_reading(reading: Reading, names: Sequence[str], units: Sequence[str]) -> str:
    """Describe what was seen: in its own words, with all units, else as its number."""
    if reading.said:
        return _with_units(reading.said, names, units)
    if not np.any(np.isfinite(reading.low) | np.isfinite(reading.high)):
        return "hit" if reading.hit else "missed"
    return say_error(reading.error_seen, names, units)


def say_place(place: ArrayLike, names: Sequence[str], units: Sequence[str]) -> str:
    """Describe a goal, condition or outcome: `92 cm ahead, 10 cm left`, or `x 0.92 m, t 0.3 s`."""
    if in_words(units):
        return ", ".join(_terms(place, [PLACE_WORDS[axis] for axis in axes_of(names, units)]))
    return _components(place, names, units)


def error_words(
    names: Sequence[str], units: Sequence[str], words: Sequence[tuple[str, str]] = WORDS
) -> list[tuple[str, str] | None]:
    """For each component the words where it is positive and negative; None where it has none."""
    pairs = [
        _TIMES if unit in ("s", "ms") else words[axis] if axis < len(words) else None
        for axis, unit in zip(axes_of(names, units), units, strict=True)
    ]
    return [pair if pairs.count(pair) == 1 else None for pair in pairs]


def error_example(names: Sequence[str], units: Sequence[str]) -> str:
    """An error in words: `5cm long, 2cm left, 20ms late`; empty where a component has no words."""
    pairs, lengths = error_words(names, units), ("5cm", "2cm", "1cm")
    said = [
        f"{('2in' if unit == 'in' else lengths[j]) if unit in _METRES else number} {pair[0]}"
        for j, (pair, unit) in enumerate(zip(pairs, units, strict=True))
        if pair and (number := _EXAMPLES.get(unit, "0.2" if len(units) == 1 else ""))
    ]
    return ", ".join(said) if len(said) == len(units) else ""


def say_length(length: float, units: Sequence[str]) -> str:
    """Format a distance between outcomes: `1.5 cm`, `0.2 rad`; `0.25` if units are mixed."""
    if set(units) == {"m"}:
        return f"{_centimetres(length)} cm"
    unit = units[0] if len(set(units)) == 1 else ""
    return f"{float(f'{length:.3g}'):g} {unit}".strip()


def bare_units(units: Sequence[str]) -> str:
    """Say what `from_words` takes a number without a unit for: `centimetres`, `inches`, `rad`."""
    spelt = {"cm": "centimetres", "in": "inches"}
    bare = [_bare(unit) for unit in units if unit in _METRES or len(units) == 1]
    return " and ".join(dict.fromkeys(spelt.get(unit, unit) for unit in bare))


def say_tolerance(
    tolerance: Sequence[float] | _Point, names: Sequence[str], units: Sequence[str]
) -> str:
    """Say what counts as reached, to the last digit: `1.5 cm`, `1.5 cm and 20 ms`.

    With names where components of one unit differ: `x 2 cm and y 1 cm`.
    """
    drawn = {"m": (100.0, "cm"), "s": (1000.0, "ms")}
    each = [
        f"{value * drawn.get(unit, (1.0, unit))[0]:g} {drawn.get(unit, (1.0, unit))[1]}"
        for value, unit in zip(tolerance, units, strict=True)
    ]
    if len(set(each)) > len(set(units)):
        each = [f"{name} {said}" for name, said in zip(names, each, strict=True)]
    return " and ".join(dict.fromkeys(each))


def from_words(
    text: str, names: Sequence[str], units: Sequence[str], least_sd: ArrayLike = 0.0
) -> Reading:
    """Read an error from words, for instance `5cm long, 2 cm left`, `20ms late`, `5-7 in short`.

    A length without a unit is in centimetres, or in the outcome's inches; a component that is not
    named is zero. 0, 2, 5 cm and tens are an observer's words (`Reading.by_eye`), other numbers
    estimates (`Reading.estimated`), `5 +- 0.5 cm long` is a measurement. `long` means by 1 cm or
    more, and leaves components that are not named unknown; so does `5 cm long, somewhere`. `hit`
    and `miss` stand alone or beside terms.

    Args:
        text: The words.
        names: Of the k components.
        units: Of the k components.
        least_sd: Least standard deviation of what is no length and was not measured, in `units`.

    Returns:
        The reading, in `units`.

    Raises:
        InvalidFeedbackError: Unknown words, or one direction named twice.
    """
    k, sds = len(units), np.broadcast_to(np.asarray(least_sd, dtype=np.float64), len(units))
    parts = _parts(text)
    hits = {_HITS[part] for part in parts if part in _HITS}
    terms = [part for part in parts if part not in (*_HITS, _SOMEWHERE, *_ON_THE_GOAL)]
    if len(hits) > 1:
        raise InvalidFeedbackError(f"{text!r} says hit and miss; say one of them")
    hit = hits.pop() if hits else None
    if hit is not None and not terms:
        return replace(Reading.only(hit, k), said=text)
    said = _read(terms, text, names, units)
    rest_unknown = _SOMEWHERE in parts or any(term.size is None for term in said.values())
    metres = np.array([_METRES.get(unit, 0.0) for unit in units])
    is_length = metres > 0.0
    number = np.zeros(k)
    for j, term in said.items():
        unknown = OPEN_ERROR / metres[j] if is_length[j] else _OPEN_SDS * sds[j]
        number[j] = term.sign * (unknown if term.size is None else term.size)
        farthest, why = _FARTHEST.get("m" if is_length[j] else units[j], (math.inf, ""))
        if abs(number[j]) * (metres[j] or 1.0) > farthest:
            raise InvalidFeedbackError(
                f"{text!r} is {number[j]:g} {units[j]}, {why}; say it again, in "
                f"{'cm' if is_length[j] else 'deg'}, or void the trial if that is true"
            )
    seen = Reading.estimated(number, sds)
    bounds = np.array([seen.low, seen.high, seen.sd])  # of each component
    if np.any(is_length):
        eye = Reading.by_eye((number * metres)[is_length])
        bounds[:, is_length] = np.array([eye.low, eye.high, eye.sd]) / metres[is_length]
    if rest_unknown:
        unsaid = [j for j in range(k) if j not in said]
        bounds[:, unsaid] = [[-math.inf], [math.inf], [0.0]]
    for j, term in said.items():
        if term.size is None:
            nearest = EYE_BETWEEN[0] / metres[j] if is_length[j] else 0.0
            bounds[:, j] = *sorted((term.sign * nearest, term.sign * math.inf)), 0.0
        elif term.least is not None:
            low, high = sorted((term.sign * term.least, number[j]))
            number[j], bounds[:, j] = 0.5 * (low + high), (low, high, 0.0)
        elif term.sd is not None:
            bounds[:, j] = number[j], number[j], term.sd
    return Reading(number, bounds[0], bounds[1], bounds[2], hit, text)


def as_reading(
    seen: Reading | ArrayLike | None,
    hit: bool | None,
    names: Sequence[str],
    units: Sequence[str],
    least_sd: _Point,
) -> Reading:
    """Return what was seen of a trial as a reading; `seen`, `hit` and errors as in `Session.tell`.

    `least_sd`, shape (k,), in `units`, is the least sd of numbers of unknown origin.
    """
    if not (hit is None or isinstance(hit, (bool, np.bool_))):
        raise InvalidFeedbackError(f"hit must be True, False or None, got {hit!r}")
    if seen is None:
        if hit is None:
            raise InvalidFeedbackError("say what was seen, or whether it hit")
        return Reading.only(bool(hit), len(units))
    if isinstance(seen, str):
        reading = from_words(seen, names, units, least_sd)
    elif isinstance(seen, Reading):
        as_error(seen.error_seen, len(units))
        reading = seen
    else:
        reading = Reading.estimated(as_error(seen, len(units)), least_sd)
    return reading.with_hit(hit)


def read_numbers(text: str) -> list[tuple[float, float | None]] | None:
    """Read numbers, each with that after its `+-` (`0.05+-0.003, -0.02 ± 0.001`); None if none."""
    parts = re.sub(rf"\s*{_PLUS_MINUS}\s*", "±", text).replace(",", " ").split()
    try:
        split = [part.split("±") for part in parts]
        return [(float(number), float(*sd) if sd else None) for number, *sd in split]
    except (ValueError, TypeError):
        return None


def read_uncertain_place(
    text: str, names: Sequence[str], units: Sequence[str]
) -> tuple[_Point, float]:
    """Read a place, and the standard deviation that may follow it: `92cm 10cm +- 2cm`.

    Raises:
        InvalidFeedbackError: As `read_place` does, or a `+-` for components of several units.
    """
    said, *spread = re.split(_PLUS_MINUS, text, maxsplit=1)
    place = read_place(said, names, units)
    sd = abs(float(read_place(spread[0], ("+-",), units[:1])[0])) if spread else 0.0
    if sd and len(set(units)) > 1:
        raise InvalidFeedbackError("+- is for components of one unit; leave it out")
    return place, sd


def read_place(text: str, names: Sequence[str], units: Sequence[str]) -> _Point:
    """Read a place from numbers in the outcome's units, numbers with a unit, or words.

    For instance `0.92 0.10`, `92cm 10cm`, `92 10 cm`, or `92cm ahead, 10cm left`; beside words, a
    length without one is the component in that position: `92cm, 10cm left`.

    Raises:
        InvalidFeedbackError: It is none of these, has a `+-`, or is farther than any arm throws.
    """
    if re.search(_PLUS_MINUS, text):
        raise InvalidFeedbackError(f"cannot read {text!r} as one place; leave out the +-")
    k, expected = len(names), f"{len(names)} finite numbers: {', '.join(names)}"
    numbers = _numbers_with_units(text, units)
    if numbers is None:
        if k <= len(WORDS) and set(units) <= set(_METRES):
            place = np.zeros(k)
            for j, term in _read(_parts(text), text, names, units, place=True).items():
                place[j] = term.sign * (term.size or 0.0)
            return place
        raise InvalidFeedbackError(f"cannot read {text!r}; give {expected}")
    if len(numbers) != k or not all(map(math.isfinite, numbers)):
        raise InvalidFeedbackError(f"{text!r} is not {expected}; give those")
    has_units = read_numbers(text) is None
    for number, unit in zip(numbers, units, strict=True):
        farthest, said = _FARTHEST.get(unit, (math.inf, ""))
        possible = abs(number) <= farthest * BEYOND_DOUBT and unit == "m"
        if abs(number) > farthest and not (has_units and possible):
            raise InvalidFeedbackError(
                f"{number:g} {unit} is {said}; say the unit, for instance "
                f"{number:g}{'cm' if unit == 'm' else 'deg'}"
                + (f", or {number:g}{unit}" if possible else "")
            )
    return np.array(numbers)


def _numbers_with_units(text: str, units: Sequence[str]) -> list[float] | None:
    """Numbers in the outcome's units, such as `0.92 0.1` or `92cm, 10 cm`; None if it is none.

    A unit after the last number only is that of all.
    """
    bare = read_numbers(text)
    if bare is not None:
        return [number for number, _ in bare]
    terms = list(_PLACE_TERM.finditer(text.strip()))
    if "".join(term[0] for term in terms) != text.strip():
        return None
    said = [_SHORT.get(term["unit"], term["unit"]) for term in terms]
    if not any(said[:-1]):
        said = said[-1:] * len(terms)
    if len(said) != len(units):
        return [math.nan] * len(said)
    numbers = []
    for term, unit, wanted in zip(terms, said, units, strict=True):
        scale = 1.0 if unit in ("", wanted) else _TO_UNIT.get((unit, wanted))
        if not unit or scale is None:
            return None
        numbers.append(float(term["number"]) * scale)
    return numbers


@dataclass(frozen=True)
class _Term:
    """What was said of one component, in its unit."""

    sign: float
    size: float | None
    """None where only the direction was said."""
    least: float | None = None
    """Lower end, where a range was said: `size` is its upper one."""
    sd: float | None = None


def _parts(text: str) -> list[str]:
    plainer = _DECIMAL_COMMA.sub(".", _FILLERS.sub("", text.strip().lower()))
    plainer = _RANGE.sub("-", plainer)
    parts = re.split(r"\s*(?:,|;|\band\b)\s*|(?<=[a-z])\s+(?=\.?\d)", plainer)
    return [part.rstrip(".! ") for part in parts]


def _with_units(text: str, names: Sequence[str], units: Sequence[str]) -> str:
    """Words with the unit that was understood where none was said: `5 cm long` for `5 long`."""
    pairs = zip(error_words(names, units), units, strict=True)
    unit_of = {word: unit for pair, unit in pairs for word in pair or ()}
    said = []
    for part in _parts(text):
        term = _TERM.fullmatch(part)
        if term is None or not term["value"] or term["unit"] or term["sd_unit"]:
            said.append(part)
            continue
        unit = _bare(unit_of.get(term["word"], units[0]))
        least = f"{term['least']}-" if term["least"] else ""
        spread = f" +- {term['sd']}" if term["sd"] else ""
        said.append(f"{least}{term['value']}{spread} {unit} {term['word']}")
    return text if said == _parts(text) else ", ".join(said)


def _bare(unit: str) -> str:
    """The unit of a number that has none."""
    return "cm" if unit == "m" else unit


def _read(
    parts: Sequence[str], text: str, names: Sequence[str], units: Sequence[str], place: bool = False
) -> dict[int, _Term]:
    """Read the terms of a text by component; a place has a number for each, and no `+-`."""
    words, k = PLACE_WORDS if place else WORDS, len(units)
    pairs = error_words(names, units, words)
    known = {word: (j, pair) for j, pair in enumerate(pairs) if pair for word in pair}
    if k == 1 and units[0] not in _METRES:  # whatever is more of it
        known |= {word: (0, pair) for pair in (*words, _TIMES) for word in pair}
    read: dict[int, _Term] = {}
    for turn, part in enumerate(parts):
        match, bare = _TERM.fullmatch(part), _BARE_TERM.fullmatch(part)
        told = {} if match is None else match.groupdict()
        if bare is not None and place and len(parts) > 1 and turn < k:
            told, j, pair, sign = bare.groupdict(), turn, pairs[turn], 1.0
        elif told.get("word") not in known or (
            place and (not told["value"] or told["sd"] or told["least"])
        ):
            raise InvalidFeedbackError(_unread(part, text, [*known], names, units, place))
        else:
            j, pair = known[told["word"]]
            sign = -1.0 if told["word"] == pair[1] else 1.0
        if j in read:
            raise InvalidFeedbackError(
                f"{text!r} names {' and '.join(pair or names[j])} twice; give each direction once"
            )
        numbers: list[float | None] = []
        for which in ("value", "least", "sd"):
            unit = told.get(f"{which}_unit") or told.get("unit") or told.get("sd_unit") or ""
            said = told.get(which)
            numbers.append(_in_unit(said, unit, units[j], k, part) if said else None)
        read[j] = _Term(sign, *numbers)
    return read


def _unread(
    part: str,
    text: str,
    known: Sequence[str],
    names: Sequence[str],
    units: Sequence[str],
    place: bool,
) -> str:
    if place and (from_base := _FROM_BASE.fullmatch(part)):
        return (
            f"{part!r} may be straight to the place or along x only; measure along x and say "
            f"{from_base['length']} {known[0]}"
        )
    example = '"92cm ahead, 10cm left"' if place else f'"{error_example(names, units)}", or "hit"'
    where = "" if part == text.strip().lower() else f" in {text!r}"
    said = f"cannot read {part!r}{where}; write a length and one of {', '.join(known)}"
    return f"{said}, for instance {example}"


def _in_unit(number: str, said: str, unit: str, k: int, part: str) -> float:
    """A number in the outcome's unit."""
    value, said = float(number), _SHORT.get(said, said)
    if not said and unit == "m" and 0 < value < _LEAST_BARE_CM:
        raise InvalidFeedbackError(
            f"{part!r} has no unit and would be {10 * value:g} mm; say m, cm or mm"
        )
    if not said and (unit in _METRES or k == 1):
        said = _bare(unit)
    factor = 1.0 if said == unit else _TO_UNIT.get((said, unit))
    if factor is None:
        raise InvalidFeedbackError(f"{part!r} is to be in {unit}; say that unit")
    return value * factor


def _terms(values: ArrayLike, words: Sequence[tuple[str, str]]) -> list[str]:
    return [
        f"{_centimetres(value)} cm {positive if round(value, 3) >= 0 else negative}"
        for value, (positive, negative) in zip(np.asarray(values, float), words, strict=False)
    ]


def _centimetres(length: float) -> str:
    return f"{round(abs(length) * 100, 1):g}"


def _components(
    values: ArrayLike, names: Sequence[str], units: Sequence[str], sign: str = ""
) -> str:
    # Adding 0.0 turns -0 into 0.
    return ", ".join(
        f"{name} {round(float(value), 4) + 0.0:{sign}.4g} {unit}"
        for name, value, unit in zip(names, np.asarray(values, float), units, strict=True)
    )

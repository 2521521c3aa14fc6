"""Errors and places in words, and back: the one place that converts either way.

An operator stands behind the robot and looks along x, from the robot's base over the table:

                      an error, seen from the goal    a place, seen from the base
    component 0 (x)   long or short                   ahead or behind
    component 1 (y)   left or right                   left or right
    component 2 (z)   high or low                     up or down

An error is outcome minus goal. Words are for lengths, of at most three components, in centimetres;
anything else is given by its names and units.
Source: paper, Section IV, "Perception Process" (coarse human feedback); the words are ours.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import BEYOND_DOUBT, FARTHEST, as_error
from prior_reinforce.errors import InvalidFeedbackError
from prior_reinforce.readings import EYE_BETWEEN, OPEN_ERROR, Reading

WORDS: tuple[tuple[str, str], ...] = (("long", "short"), ("left", "right"), ("high", "low"))
"""For each component of an error: the word where it is positive, the word where it is negative."""
PLACE_WORDS: tuple[tuple[str, str], ...] = (("ahead", "behind"), ("left", "right"), ("up", "down"))
"""The same for a place."""

_UNPRINTED = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Unicode's control and format characters, lone surrogates, and line separators."""
_Point = Float[np.ndarray, " k"]
_LEAST_BARE_CM = 0.1
"""Ours: nobody sees a throw to a millimetre; a smaller number without a unit is in metres."""
_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
_TO_UNIT = {(unit, "m"): factor for unit, factor in _METRES.items()} | {
    ("ms", "s"): 0.001, ("deg", "rad"): math.pi / 180, ("rad", "deg"): 180 / math.pi
}  # fmt: skip
"""What to multiply with, from the unit that was said to the outcome's."""
_TIMES: tuple[str, str] = ("late", "early")
"""The words of a component that is a time."""
_FILLERS = re.compile(r"\b(?:about|approximately|approx\.?|around|roughly|circa|ca\.?|too)\s+|~\s*")
"""What people say beside a length, which is an estimate anyway."""
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d+\s*[a-z])")
_PLUS_MINUS = r"(?:\+-|\+/-|±)"
_NUMBER = r"\d{1,6}(?:\.\d*)?|\.\d+"
_UNIT = r"cm|mm|m|in|"
_TERM = re.compile(
    rf"(?:(?P<value>{_NUMBER})\s*(?P<unit>{_UNIT})\s*"
    rf"(?:{_PLUS_MINUS}\s*(?P<sd>{_NUMBER})\s*(?P<sd_unit>{_UNIT})\s*)?)?"
    r"(?:to the )?(?P<word>[a-z]+)"
)
_BARE_TERM = re.compile(rf"(?P<value>{_NUMBER})\s*(?P<unit>cm|mm|m|in)")
_FROM_BASE = re.compile(r"(?P<length>.*?)\s*(?:away )?from (?:the )?(?:base|robot|arm|foot)\b.*")
_PLACE_TERM = re.compile(
    rf"(?P<number>[+-]?(?:{_NUMBER}))\s*(?P<unit>cm|mm|m|in|deg|rad|ms|s|)(?:\s*[,;]\s*|\s+|$)"
)
_WITH_WORD = re.compile(
    rf"(?P<number>{_NUMBER})\s*(?:(?P<unit>cm|mm|m|in|deg|rad|ms|s)(?![a-z])\s*)?"
    r"(?:to the )?(?P<word>[a-z]+)"
)
_SOMEWHERE = "somewhere"
_ON_THE_GOAL = ("on the goal", "0")
_HITS = {"hit": True, "miss": False}


def plain(text: str, keep: str = "") -> str:
    """Escape control characters in untrusted text, such as a name, before it is printed.

    Args:
        text: The text.
        keep: Control characters that stay.
    """
    return "".join(
        char.encode("unicode_escape").decode()
        if char not in keep and unicodedata.category(char) in _UNPRINTED
        else char
        for char in text
    )


def in_words(units: Sequence[str]) -> bool:
    """Whether words describe outcomes of these units: lengths, at most three of them."""
    return len(units) <= len(WORDS) and all(unit == "m" for unit in units)


def to_words(error: ArrayLike) -> str:
    """Describe an error as an operator would: `5 cm long, 2 cm left`, or `on the goal`.

    Args:
        error: Outcome minus goal, at most three numbers, in [m].
    """
    said = _terms(error, WORDS)
    return ", ".join(term for term in said if not term.startswith("0 ")) or "on the goal"


def say_error(error: ArrayLike, names: Sequence[str], units: Sequence[str]) -> str:
    """Describe an error: `5 cm long, 2 cm left`, or `x +0.05 m, t -0.1 s`."""
    return to_words(error) if in_words(units) else _components(error, names, units, sign="+")


def say_reading(reading: Reading, names: Sequence[str], units: Sequence[str]) -> str:
    """Describe what was seen: in its own words, with all units, else as its number."""
    if reading.said:
        return _with_units(reading.said)
    if not np.any(np.isfinite(reading.low) | np.isfinite(reading.high)):
        return "hit" if reading.hit else "missed"
    return say_error(reading.error_seen, names, units)


def say_place(place: ArrayLike, names: Sequence[str], units: Sequence[str]) -> str:
    """Describe a goal, condition or outcome: `92 cm ahead, 10 cm left`, or `x 0.92 m, t 0.3 s`."""
    if in_words(units):
        return ", ".join(_terms(place, PLACE_WORDS))
    return _components(place, names, units)


def say_length(length: float, units: Sequence[str]) -> str:
    """Format a distance between outcomes: `1.5 cm`, `0.2 rad`; `0.25` if units are mixed."""
    if set(units) == {"m"}:
        return f"{_centimetres(length)} cm"
    unit = units[0] if len(set(units)) == 1 else ""
    return f"{float(f'{length:.3g}'):g} {unit}".strip()


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


def from_words(text: str, outcome_dim: int) -> Reading:
    """Read an error from words.

    Args:
        text: For instance `5cm long, 2 cm left`; numbers without a unit are centimetres, and a
            component that is not named is zero. 0, 2, 5 cm and tens are an observer's words
            (`Reading.by_eye`), other numbers estimates (`Reading.estimated`), `5 +- 0.5 cm long` is
            a measurement. `long` means by 1 cm or more, and leaves components that are not named
            unknown; so does `5 cm long, somewhere`. `hit` and `miss` stand alone or beside terms.
        outcome_dim: k, at most 3.

    Returns:
        The reading, in [m].

    Raises:
        InvalidFeedbackError: Unknown words, or one direction named twice.
    """
    if outcome_dim > len(WORDS):
        raise InvalidFeedbackError(
            f"words describe up to {len(WORDS)} components, this task has {outcome_dim}: give "
            "numbers"
        )
    words = WORDS[:outcome_dim]
    hits, terms, rest_unknown = set(), [], False
    for part in _parts(text):
        if part in _HITS:
            hits.add(_HITS[part])
        elif part == _SOMEWHERE:
            rest_unknown = True
        elif part not in _ON_THE_GOAL:
            terms.append(part)
    if len(hits) > 1:
        raise InvalidFeedbackError(f"{text!r} says hit and miss; say one of them")
    hit = hits.pop() if hits else None
    if hit is not None and not terms:
        return replace(Reading.only(hit, outcome_dim), said=text)
    said = _read(terms, text, words, 'for instance "5cm long, 2cm left", or "hit"', sizes=False)
    rest_unknown |= any(term.size is None for term in said.values())
    number = np.array([said[j].error if j in said else 0.0 for j in range(outcome_dim)])
    eye = Reading.by_eye(number)
    low, high, sd = eye.low.copy(), eye.high.copy(), eye.sd.copy()
    for j in range(outcome_dim):
        if j not in said:
            if rest_unknown:
                low[j], high[j], sd[j] = -math.inf, math.inf, 0.0
        elif said[j].size is None:
            ends = EYE_BETWEEN[0], math.inf
            low[j], high[j] = ends if said[j].sign > 0 else (-ends[1], -ends[0])
            sd[j] = 0.0
        elif said[j].sd is not None:
            low[j], high[j], sd[j] = number[j], number[j], said[j].sd
    return Reading(number, low, high, sd, hit, text)


def as_reading(
    seen: Reading | ArrayLike | None,
    hit: bool | None,
    units: Sequence[str],
    least_sd: _Point,
) -> Reading:
    """Return what was seen of a trial as a reading.

    Args:
        seen: A reading, words, or outcome minus goal as numbers of unknown origin, shape (k,); None
            if only `hit` is known.
        hit: Whether the goal was reached, if that was seen directly.
        units: Units of the k components.
        least_sd: Least standard deviation of numbers of unknown origin, shape (k,), in `units`.

    Raises:
        InvalidFeedbackError: Wrong shape, not finite, or words that cannot be read.
    """
    if not (hit is None or isinstance(hit, (bool, np.bool_))):
        raise InvalidFeedbackError(f"hit must be True, False or None, got {hit!r}")
    k = len(units)
    if seen is None:
        if hit is None:
            raise InvalidFeedbackError("say what was seen, or whether it hit")
        return Reading.only(bool(hit), k)
    if isinstance(seen, str):
        if not in_words(units):
            raise InvalidFeedbackError(
                f"words are for lengths, these outcomes are in {', '.join(units)}; give {k} numbers"
            )
        reading = from_words(seen, k)
    elif isinstance(seen, Reading):
        as_error(seen.error_seen, k)
        reading = seen
    else:
        reading = Reading.estimated(as_error(seen, k), least_sd)
    return reading.with_hit(hit)


def read_error(text: str, units: Sequence[str]) -> Reading | _Point:
    """Read an error from words, in the outcome's units.

    Args:
        text: As in `from_words`; a time is `20ms late`, and for a single component the words are
            `long` and `short`, whatever its unit: `5 deg long`.
        units: Units of the k components.

    Returns:
        A reading if all components are lengths of one unit; else a number of unknown origin for
        each component.

    Raises:
        InvalidFeedbackError: As `from_words` does.
    """
    k = len(units)
    if len(set(units)) == 1 and units[0] in _METRES:
        reading, scale = from_words(text, k), 1 / _METRES[units[0]]
        if scale == 1:
            return reading
        error, low, high = (scale * n for n in (reading.error_seen, reading.low, reading.high))
        return Reading(error, low, high, scale * reading.sd, reading.hit, reading.said)
    words = [
        _TIMES if unit in ("s", "ms") and k > 1 else w
        for w, unit in zip(WORDS, units, strict=False)
    ]
    number = np.full(k, np.nan)
    for part in _parts(text):
        match = _WITH_WORD.fullmatch(part)
        pair = next((w for w in words if match and match["word"] in w), None)
        if match is None or pair is None or words.count(pair) > 1:
            said = " or ".join(word for w in words for word in w)
            raise InvalidFeedbackError(
                f"cannot read {part!r}; write a number with its unit and {said}, or give {k} "
                "numbers"
            )
        j, sign = words.index(pair), -1.0 if pair.index(match["word"]) else 1.0
        unit = match["unit"] or units[j]
        factor = 1.0 if unit == units[j] else _TO_UNIT.get((unit, units[j]))
        if factor is None or (not match["unit"] and k > 1):
            raise InvalidFeedbackError(f"{part!r} is to be in {units[j]}; say that unit")
        if not np.isnan(number[j]):
            raise InvalidFeedbackError(f"{text!r} names {' and '.join(pair)} twice; give each once")
        number[j] = sign * float(match["number"]) * factor
    return np.nan_to_num(number)


def read_numbers(text: str) -> list[tuple[float, float | None]] | None:
    """Read numbers, each with the number after its `+-`; None if the text is anything else.

    Args:
        text: For instance `0.05+-0.003, -0.02 ± 0.001`.
    """
    parts = re.sub(rf"\s*{_PLUS_MINUS}\s*", "±", text).replace(",", " ").split()
    try:
        split = [part.split("±") for part in parts]
        return [(float(number), float(*sd) if sd else None) for number, *sd in split]
    except (ValueError, TypeError):
        return None


def read_uncertain_place(
    text: str, names: Sequence[str], units: Sequence[str]
) -> tuple[_Point, float]:
    """Read a place as `read_place` does, and the standard deviation that may follow it.

    Args:
        text: For instance `92cm 10cm +- 2cm`.
        names: Names of the components.
        units: Units of the components.

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

    Args:
        text: For instance `0.92 0.10`, `92cm 10cm`, `92 10 cm`, or `92cm ahead, 10cm left`; beside
            words, a length without one is the component in that position: `92cm, 10cm left`.
        names: Names of the components.
        units: Units of the components.

    Raises:
        InvalidFeedbackError: It is none of these, or farther than any arm throws.
    """
    expected = f"{len(names)} finite numbers: {', '.join(names)}"
    numbers = _numbers_with_units(text, units)
    if numbers is None:
        if in_words(units):
            words, example = PLACE_WORDS[: len(names)], 'for instance "92cm ahead, 10cm left"'
            said = _read(_parts(text), text, words, example, sizes=True)
            return np.array([said[j].error if j in said else 0.0 for j in range(len(names))])
        raise InvalidFeedbackError(f"cannot read {text!r}; give {expected}")
    if len(numbers) != len(names) or not all(map(math.isfinite, numbers)):
        raise InvalidFeedbackError(f"{text!r} is not {expected}; give those")
    has_units = read_numbers(text) is None
    for number, unit in zip(numbers, units, strict=True):
        possible = abs(number) <= FARTHEST * BEYOND_DOUBT
        if unit == "m" and abs(number) > FARTHEST and not (has_units and possible):
            raise InvalidFeedbackError(
                f"{number:g} m is farther than any arm throws; say the unit, for instance "
                f"{number:g}cm" + (f", or {number:g}m" if possible else "")
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
    said = [term["unit"] for term in terms]
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
    """What was said of one component, in [m]."""

    sign: float
    size: float | None
    """None where only the direction was said."""
    sd: float | None

    @property
    def error(self) -> float:
        """The number that stands for it."""
        return self.sign * (OPEN_ERROR if self.size is None else self.size)


def _parts(text: str) -> list[str]:
    plainer = _DECIMAL_COMMA.sub(".", _FILLERS.sub("", text.strip().lower()))
    parts = re.split(r"\s*(?:,|;|\band\b)\s*|(?<=[a-z])\s+(?=\.?\d)", plainer)
    return [part.rstrip(".! ") for part in parts]


def _with_units(text: str) -> str:
    """Words with the unit that was understood where none was said: `5 cm long` for `5 long`."""
    said = []
    for part in _parts(text):
        term = _TERM.fullmatch(part)
        if term is None or not term["value"] or term["unit"] or term["sd_unit"]:
            said.append(part)
            continue
        spread = f" +- {term['sd']}" if term["sd"] else ""
        said.append(f"{term['value']}{spread} cm {term['word']}")
    return text if said == _parts(text) else ", ".join(said)


def _read(
    parts: Sequence[str],
    text: str,
    words: Sequence[tuple[str, str]],
    example: str,
    *,
    sizes: bool,
) -> dict[int, _Term]:
    """Read the terms of a text by component; `sizes` wants a number for each, and no `+-`."""
    known = [word for pair in words for word in pair]
    read: dict[int, _Term] = {}
    for turn, part in enumerate(parts):
        match, bare = _TERM.fullmatch(part), _BARE_TERM.fullmatch(part)
        understood = match is not None and match["word"] in known
        if bare is not None and sizes and len(parts) > 1 and turn < len(words):
            match, component, negative = bare, turn, 0
        elif match is None or not understood or (sizes and (not match["value"] or match["sd"])):
            raise InvalidFeedbackError(_unread(part, text, known, example, sizes=sizes))
        else:
            component, negative = divmod(known.index(match["word"]), 2)
        if component in read:
            raise InvalidFeedbackError(
                f"{text!r} names {' and '.join(words[component])} twice; give each direction once"
            )
        size = sd = None
        told = match.groupdict()
        if told["value"]:
            unit = told["unit"] or told.get("sd_unit") or ""
            size = _metres(told["value"], unit, part)
            if told.get("sd"):
                sd = _metres(told["sd"], told["sd_unit"] or unit, part)
        read[component] = _Term(-1.0 if negative else 1.0, size, sd)
    return read


def _unread(part: str, text: str, known: Sequence[str], example: str, *, sizes: bool) -> str:
    from_base = _FROM_BASE.fullmatch(part) if sizes else None
    if from_base is not None:
        return (
            f"{part!r} may be straight to the place or along x only; measure along x and say "
            f"{from_base['length']} {known[0]}"
        )
    where = "" if part == text.strip().lower() else f" in {text!r}"
    return f"cannot read {part!r}{where}; write a length and one of {', '.join(known)}, {example}"


def _metres(number: str, unit: str, part: str) -> float:
    value = float(number)
    if not unit and 0 < value < _LEAST_BARE_CM:
        raise InvalidFeedbackError(
            f"{part!r} has no unit and would be {10 * value:g} mm; say m, cm or mm"
        )
    return value * _METRES[unit or "cm"]


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

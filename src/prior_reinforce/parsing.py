"""Read errors and places from words and numbers, for instance `5cm long, 2 cm left`.

A text is split into parts at commas; a part is a number, a range or a measurement with a word of
direction (`wording` has the words). Numbers without a unit are in centimetres where the outcome's
unit is the metre, else in the outcome's own. Every text gives a result or an InvalidFeedbackError
that quotes the part that cannot be read.

Source: paper, Section IV, "Perception Process" (coarse human feedback); the grammar is ours.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Point, as_error, as_goal
from prior_reinforce.errors import InvalidFeedbackError, InvalidGoalError
from prior_reinforce.formats import OutcomeFormat, as_bare_error
from prior_reinforce.numerals import (
    BARE_TERM,
    PLUS_MINUS,
    WITH_COMMA,
    patterns,
    read_numbers,
    with_points,
)
from prior_reinforce.phrases import plainer, values_by_name
from prior_reinforce.readings import EYE_BETWEEN, OPEN_ERROR, Reading
from prior_reinforce.units import SPELT, factor, kind_of, looks_like, spelt, units_of
from prior_reinforce.wording import (
    AMOUNT_WORDS,
    PLACE_WORDS,
    SYNONYMS,
    TIME_WORDS,
    WORDS,
    bare_unit,
    error_words,
    is_amount,
    place_example,
    say_too_large,
    say_unread,
    to_words,
)

_LEAST_BARE_CM = 0.1
"""Ours: nobody sees a throw to a millimetre; a smaller number without a unit is in metres."""
_OPEN_SDS = 10.0
"""Error assumed where only the direction is known, of what is no length, in its least sds (ours):
in tolerances as far as 5 cm, where 1.5 cm are allowed."""
_SOMEWHERE, _LOST = "somewhere", "lost"
_ON_THE_GOAL = ("on the goal", "spot on", "0")
_HITS = {"hit": True, "miss": False, _LOST: False}
_RANGE = re.compile(r"(?<=[\da-z\"°.])\s*(?:–|-|\bto\b)\s*(?=\.?\d)")
_COMMA, _NEXT = re.compile(r"\s*(?:,|;|&|\band\b)\s*"), re.compile(r"(?<=[a-z])\s+(?=\.?\d)")


def from_words(text: str, form: OutcomeFormat | None = None) -> Reading:
    """Read an error from words, for instance `5cm long, 2 cm left`, `20ms late`, `5-7 in short`.

    A length without a unit is in centimetres, or in the outcome's inches; a component that is not
    named is zero. 0, 2, 5 cm and tens are an observer's words (`Reading.by_eye`), other numbers
    estimates (`Reading.estimated`), `5 +- 0.5 cm long` is a measurement. `long` means by 1 cm or
    more, and leaves components that are not named unknown; so does `5 cm long, somewhere`. `hit`
    and `miss` stand alone or beside terms; `lost` alone: nobody saw where the object went.

    Args:
        text: The words.
        form: What the outcomes are; its tolerance gives the least sd of numbers that are no
            lengths and were not measured. x and y in metres if not given.

    Returns:
        The reading, in the outcomes' units; `said` is the text, with the units that were understood
        where it has none.

    Raises:
        InvalidFeedbackError: Unknown words, or one direction named twice.
    """
    form = (form or OutcomeFormat.metres(2)).as_listed()
    if (error := _by_name(text, form)) is not None:
        for number, unit in zip(error, form.units, strict=True):
            _refuse_too_large(number, unit, text, stated=True)
        return replace(Reading.estimated(error, form.least_sd), said=text)
    parts = _parts(text, form)
    hits = {_HITS[part] for part in parts if part in _HITS}
    if len(hits) > 1:
        raise InvalidFeedbackError(f"{text!r} says hit and miss; say one of them")
    hit = hits.pop() if hits else None
    directed = [part for part in parts if part not in (*_HITS, _SOMEWHERE, *_ON_THE_GOAL)]
    if _LOST in parts and directed:
        raise InvalidFeedbackError(
            f"{text!r} says where it went and that it was lost; say one of them"
        )
    if hit is not None and not directed:
        return replace(Reading.only(hit, form.outcome_dim, lost=_LOST in parts), said=text)
    terms = _terms(directed, text, form)
    reading = _reading(terms, text, form, _SOMEWHERE in parts)
    said = text
    if not all(term.stated for term in terms.values()):
        understood = {term.part: term.said for term in terms.values()}
        said = ", ".join(understood.get(part, part) for part in parts)
    if is_amount(form) and any(term.size is not None for term in terms.values()):
        said += f" ({to_words(reading.error_seen, form)})"  # which sign the word was taken for
    return replace(reading, hit=hit, said=said)


def _by_name(text: str, form: OutcomeFormat) -> list[float] | None:
    """Read an error as `to_words` may print it, `x +5 cm, t -0.1 s`; None if it is no such text."""
    values = values_by_name(text.replace("\u2212", "-"), form.names)
    if values is None or read_numbers(values) is not None:  # without units
        return None
    numbers = _numbers_with_units(with_points(values, form.outcome_dim), form.units)
    return numbers if numbers and all(map(math.isfinite, numbers)) else None


def _reading(terms: dict[int, _Term], text: str, form: OutcomeFormat, somewhere: bool) -> Reading:
    """The intervals of an error from its terms; components without a term are 0, or unknown."""
    k, sds = form.outcome_dim, form.least_sd
    metres = np.array([units_of("length").get(unit, 0.0) for unit in form.units])
    is_length = metres > 0.0
    number = np.zeros(k)
    for j, term in terms.items():
        unknown = OPEN_ERROR / metres[j] if is_length[j] else _OPEN_SDS * sds[j]
        number[j] = term.sign * (unknown if term.size is None else term.size)
        _refuse_too_large(number[j], form.units[j], text, stated=term.stated)
    seen = Reading.estimated(number, sds)
    bounds = np.array([seen.low, seen.high, seen.sd])  # of each component
    if np.any(is_length):
        eye = Reading.by_eye((number * metres)[is_length])
        bounds[:, is_length] = np.array([eye.low, eye.high, eye.sd]) / metres[is_length]
    if somewhere or any(term.size is None for term in terms.values()):
        unnamed = [j for j in range(k) if j not in terms]
        bounds[:, unnamed] = [[-math.inf], [math.inf], [0.0]]
    for j, term in terms.items():
        if term.size is None:
            nearest = EYE_BETWEEN[0] / metres[j] if is_length[j] else 0.0
            bounds[:, j] = *sorted((term.sign * nearest, term.sign * math.inf)), 0.0
        elif term.least is not None:
            low, high = sorted((term.sign * term.least, number[j]))
            number[j], bounds[:, j] = 0.5 * (low + high), (low, high, 0.0)
        elif term.sd is not None:
            bounds[:, j] = number[j], number[j], term.sd
    return Reading(number, *bounds)


def _refuse_too_large(number: float, unit: str, text: str, *, stated: bool) -> None:
    """Refuse an error that no arm makes, or an angle that may be in a unit that was not stated."""
    is_length = kind_of(unit) == "length"  # 6 m long is a slip of 6 cm, whatever was said
    base = "m" if is_length else unit
    size = number * (factor(unit, base) or 1.0)
    if said := looks_like(base, size, stated=stated and not is_length):
        known = stated or is_length
        again = f"say it again, in {said}" if known else f"say its unit, {said} or {unit}"
        raise InvalidFeedbackError(
            f"{text!r}: {say_too_large(number, unit, stated)}; {again}, or void the trial if that "
            "is true"
        )


def as_reading(
    seen: Reading | ArrayLike | None,
    hit: bool | None,
    goal: Point,
    form: OutcomeFormat,
    expected: ArrayLike = 0.0,
    shown: ArrayLike = 0.0,
) -> Reading:
    """Return what was seen of a trial as a reading; arguments and errors as in `Session.tell`.

    `expected` and `shown` as for `as_bare_error`.
    """
    if not (hit is None or isinstance(hit, (bool, np.bool_))):
        raise InvalidFeedbackError(f"hit must be True, False or None, got {hit!r}")
    if seen is None:
        if hit is None:
            raise InvalidFeedbackError("say what was seen, or whether it hit")
        return Reading.only(bool(hit), form.outcome_dim)
    if isinstance(seen, str):
        reading = from_words(seen, form)
    elif isinstance(seen, Reading):
        as_error(seen.error_seen, form.outcome_dim)
        reading = seen
    else:
        reading = Reading.estimated(
            as_bare_error(seen, goal, form, expected=expected, shown=shown), form.least_sd
        )
    if reading.said and None not in (hit, reading.hit) and reading.hit != hit:
        beside = "hit" if hit else "miss"
        raise InvalidFeedbackError(f'"{reading.said}" contradicts {beside}; say one of them')
    reading = reading.with_hit(hit)
    if reading.hit is None and not reading.has_number:
        raise InvalidFeedbackError(f'"{reading.said}" says nothing of where it went; say lost')
    return reading


def as_place(place: ArrayLike | str, form: OutcomeFormat, shown: ArrayLike = 0.0) -> Point:
    """Return a goal as numbers in the outcome's units: it is given as such, or said (`read_place`).

    Numbers up to twice as large as `shown` outcomes, (N, k), are in their units. InvalidGoalError
    if it cannot be read, has another shape, is not finite, or of another unit by its size.
    """
    if isinstance(place, str):
        try:
            return read_place(place, form, shown)
        except InvalidFeedbackError as error:
            raise InvalidGoalError(f"goal: {error}") from error
    array = as_goal(place, form.names)
    if slip := form.slip(_beyond(array, shown), error=False):
        raise InvalidGoalError(f"goal: {slip}, or say its unit")
    return array


def read_uncertain_place(
    text: str, form: OutcomeFormat, shown: ArrayLike = 0.0
) -> tuple[Point, float]:
    """Read a place, and the standard deviation that may follow it: `92cm 10cm +- 2cm`.

    InvalidFeedbackError as in `read_place`, or if a `+-` is for components of several units.
    """
    said, *spread = re.split(PLUS_MINUS, text, maxsplit=1)
    place, of_sd = read_place(said, form, shown), OutcomeFormat(("+-",), form.units[:1])
    sd = abs(float(read_place(spread[0], of_sd)[0])) if spread else 0.0
    if sd and len(set(form.units)) > 1:
        raise InvalidFeedbackError("+- is for components of one unit; leave it out")
    return place, sd


def read_place(text: str, form: OutcomeFormat, shown: ArrayLike = 0.0) -> Point:
    """Read a place from numbers in the outcome's units, numbers with a unit, or words.

    For instance `0.92 0.10`, `92cm 10cm`, `92 10 cm`, `x 92cm, y 10cm`, or `92cm ahead, 10cm left`;
    beside words, a number without one is the component in that position: `92cm, 10cm left`. `shown`
    as for `as_place`. InvalidFeedbackError if it is none of these, has a `+-`, is farther than any
    arm throws, or nobody knows the unit of a number (`1.05 10cm`).
    """
    if re.search(PLUS_MINUS, text):
        raise InvalidFeedbackError(f"cannot read {text!r} as one place; leave out the +-")
    k, form = form.outcome_dim, form.as_listed()
    expected = f"{k} finite numbers: {', '.join(form.names)}, for instance {place_example(form)}"
    text = values_by_name(text, form.names) or text
    numbers = _numbers_with_units(text.replace("\u2212", "-"), form.units)
    if numbers is None or len(numbers) != k:
        text = with_points(text, k)
        numbers = _numbers_with_units(text, form.units)
    if numbers is None:
        lengths = [kind_of(unit) == "length" for unit in form.units]
        terms = dict[int, _Term]()
        if k <= len(WORDS) and any(lengths):
            terms = _terms(_parts(text, form), text, form, place=True)
        if any(j not in terms for j in range(k) if not all(lengths)):
            raise InvalidFeedbackError(f"cannot read {text!r}; give {expected}")
        place = np.array(
            [terms[j].sign * (terms[j].size or 0.0) if j in terms else 0.0 for j in range(k)]
        )
        bare = {j: bare_unit(form.units[j]) for j, term in terms.items() if not term.stated}
        return _with_clear_units(place, bare, form, shown, text)
    if len(numbers) != k or not all(map(math.isfinite, numbers)):
        raise InvalidFeedbackError(f"{text!r} is not {expected}; give those")
    stated = read_numbers(text) is None
    for number, unit in zip(_beyond(numbers, shown), form.units, strict=True):
        if not (said := looks_like(unit, number, stated=stated)):
            continue
        if not looks_like(unit, numbers[0]) and WITH_COMMA.fullmatch(text.strip()):
            raise InvalidFeedbackError(f"{text!r} may be one number; give {expected}")
        remedy = "correct the number or its unit"
        if not stated:
            remedy = f"say the unit, for instance {number:g}{said}"
            remedy += f", or {number:g}{unit}" * (not looks_like(unit, number, stated=True))
        raise InvalidFeedbackError(f"{say_too_large(number, unit, stated)}; {remedy}")
    shared = unit_of_all(text, form.units)
    bare = dict.fromkeys(range(k - 1), shared) if shared else {}
    return _with_clear_units(np.array(numbers), bare, form, shown, text)


def _with_clear_units(
    place: Point, bare: dict[int, str], form: OutcomeFormat, shown: ArrayLike, text: str
) -> Point:
    """Return a place, unless its numbers without a unit may be in the outcome's own, larger unit.

    `bare` has the unit in which each of these was read. In the outcome's own they may be if none is
    more than twice as large as the largest `shown`: of that component, or, where the text has a
    decimal point, of all components in that unit. InvalidFeedbackError names both units.
    """
    largest = np.broadcast_to(np.max(np.abs(np.atleast_2d(shown)), axis=0), place.shape)
    has_point, doubt = re.search(r"\.\d", text), ""
    for j, unit in bare.items():
        own, scale = form.units[j], factor(unit, form.units[j]) or 1.0
        number, of_unit = place[j] / scale, largest[[other == own for other in form.units]].max()
        if abs(number) > 2.0 * (of_unit if has_point else largest[j]):
            return place
        if number and scale < 1.0 and not doubt:
            doubt = f"{number:g} has no unit; say {number:g}{unit} or {number:g}{own}"
    if doubt:
        raise InvalidFeedbackError(f"{text!r}: {doubt}")
    return place


def _beyond(numbers: ArrayLike, shown: ArrayLike) -> Point:
    """The numbers that are more than twice what was shown; 0 in place of the others."""
    return np.where(np.abs(numbers) > 2.0 * np.max(np.abs(shown), axis=0), numbers, 0.0)


def _numbers_with_units(text: str, units: Sequence[str]) -> list[float] | None:
    """Numbers in the outcome's units, such as `0.92 0.1` or `92cm, 10 cm`; None if it is none.

    A unit after the last number only is that of all.
    """
    if (bare := read_numbers(text)) is not None:
        return [number for number, _ in bare]
    if not (terms := _numbers_of_place(text, units)):
        return None
    stated = [term["unit"] and (spelt(term["unit"]) or term["unit"]) for term in terms]
    if shared := unit_of_all(text, units):
        stated = [shared] * len(terms)
    if len(stated) != len(units):
        return [math.nan] * len(stated)
    numbers = []
    for term, unit, wanted in zip(terms, stated, units, strict=True):
        number = float(term["number"])
        scale = factor(unit or (wanted if number == 0.0 or wanted == "1" else ""), wanted)
        if scale is None:
            return None
        numbers.append(number * scale)
    return numbers


def unit_of_all(place: str, units: Sequence[str]) -> str:
    """Return the unit that a place has after its last number only: `cm` of `92 10 cm`; else ""."""
    *others, last = [term["unit"] for term in _numbers_of_place(place, units)] or [""]
    return (spelt(last) or last) if others and not any(others) else ""


def _numbers_of_place(text: str, units: Sequence[str]) -> list[re.Match[str]]:
    """Numbers, with or without units, where a text is nothing else."""
    terms = list(patterns(tuple(units))[2].finditer(text.strip()))
    return terms if "".join(term[0] for term in terms) == text.strip() else []


@dataclass(frozen=True)
class _Term:
    """What a part of a text says of one component, in its unit."""

    part: str
    said: str
    """The part, with its unit where it had none."""
    sign: float
    size: float | None
    """None where only the direction was said."""
    stated: bool
    """Whether the number has a unit, or there is none."""
    least: float | None = None
    """Lower end of a range, whose upper one is `size`."""
    sd: float | None = None
    """Standard deviation, where a `+-` was said."""


def _parts(text: str, form: OutcomeFormat) -> list[str]:
    """Split a text at commas, without fillers, in lower case."""
    plain = with_points(plainer(text), 0)
    said = [part.rstrip(".! ") for part in _COMMA.split(_RANGE.sub("-", plain))]
    _, first, _ = patterns(form.units)
    parts: list[str] = []
    for part in said:
        if part and not first.sub("", part):
            parts += [f"{length} {word}" for word, length in first.findall(part)]
        elif part[:1].isalpha() and part.split()[0] not in (*_HITS, _SOMEWHERE):
            parts.append(part)  # in `long 5cm left`, nobody knows which of them is 5 cm
        else:
            parts += [each.rstrip(".! ") for each in _NEXT.split(part)]
    return parts


def _terms(
    parts: Sequence[str], text: str, form: OutcomeFormat, *, place: bool = False
) -> dict[int, _Term]:
    """Read parts as terms, by component; a place has a number for each, and no `+-`."""
    words = PLACE_WORDS if place else WORDS
    pairs = error_words(form, words)
    if place:
        kinds = map(kind_of, form.units)
        pairs = [
            pair if kind == "length" else None for pair, kind in zip(pairs, kinds, strict=True)
        ]
    known = {word: (j, pair) for j, pair in enumerate(pairs) if pair for word in pair}
    if form.outcome_dim == 1 and kind_of(form.units[0]) != "length":
        others = (*words, TIME_WORDS, *[AMOUNT_WORDS] * is_amount(form))
        known |= {word: (0, pair) for pair in others for word in pair}
    terms: dict[int, _Term] = {}
    for position, part in enumerate(parts):
        match, bare = patterns(form.units)[0].fullmatch(part), BARE_TERM.fullmatch(part)
        found = {} if match is None else match.groupdict()
        if not place and found:
            found["word"] = SYNONYMS.get(found["word"], found["word"])
        beside = place and len(parts) > 1 and position < len(pairs)
        if bare and beside and factor(SPELT[bare["unit"]], form.units[position]) is not None:
            found, j, pair = bare.groupdict(), position, pairs[position]
        elif found.get("word") not in known or (
            place and (not found["value"] or found["sd"] or found["least"])
        ):
            said = [SYNONYMS.get(word, word) for word in re.findall("[a-z]+", part)]
            directions = [word for word in said if word in known]
            direction = directions[0] if len(directions) == 1 else ""
            raise InvalidFeedbackError(say_unread(part, text, [*known], form, place, direction))
        else:
            j, pair = known[found["word"]]
        if j in terms:
            again = terms[j].part.endswith(found.get("word") or " ")
            twice = found["word"] if again else " and ".join(pair or form.names[j])
            raise InvalidFeedbackError(f"{text!r} names {twice} twice; give each direction once")
        terms[j] = _term(part, found, pair, form.units[j], form.outcome_dim)
    return terms


def _term(
    part: str, found: dict[str, str | None], pair: tuple[str, str] | None, unit: str, k: int
) -> _Term:
    """Convert the numbers of a part to the component's unit."""
    word, value, least, sd = (found.get(name) for name in ("word", "value", "least", "sd"))
    of_all = found.get("unit") or found.get("sd_unit") or ""
    size, low, spread = (
        _in_unit(number, found.get(f"{name}_unit") or of_all, unit, k, part) if number else None
        for name, number in (("value", value), ("least", least), ("sd", sd))
    )
    said, stated = part, bool(of_all or not value)
    if not stated:
        number = f"{least}-" * bool(least) + f"{value}" + f" +- {sd}" * bool(sd)
        said = f"{number} {bare_unit(unit)}".removesuffix(" 1") + f" {word}"
    sign = -1.0 if pair is not None and word == pair[1] else 1.0
    return _Term(part, said, sign, size, stated, low, spread)


def _in_unit(number: str, stated: str, unit: str, k: int, part: str) -> float:
    """Convert a number to the outcome's unit; `stated` is empty where it has none."""
    value = float(number)
    if not stated and unit == "m" and 0 < value < _LEAST_BARE_CM:
        raise InvalidFeedbackError(
            f"{part!r} has no unit and would be {10 * value:g} mm; say m, cm or mm"
        )
    given = spelt(stated) or (unit if stated == unit.lower() else "")
    if not stated and (kind_of(unit) == "length" or k == 1):
        given = bare_unit(unit)
    scale = factor(given, unit)
    if scale is None:
        raise InvalidFeedbackError(f"{part!r} is to be in {unit}; say that unit")
    return value * scale

"""Numbers as people write them: with decimal commas, a spread behind a `+-`, a unit and a word."""

from __future__ import annotations

import re
from functools import lru_cache

from prior_reinforce.errors import InvalidFeedbackError
from prior_reinforce.units import SPELT

PLUS_MINUS = r"(?:\+-|\+/-|±)"
NUMBER = r"\d{1,6}(?:\.\d*)?|\.\d+"
_INNER_COMMA = re.compile(r"(?<=\d),(?=\d)")
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d+\s*(?:[-–±+/]+\s*[\d.,]+\s*)?(?:[^\W\d_]|[°\"%]))")
_BETWEEN, _LAST_UNIT = re.compile(r"[;,]?\s+|;"), re.compile(r"\s*(?:[^\W\d_]|[°\"%])\S*$")
WITH_COMMA = re.compile(r"[+-]?\d+(?:[.,]\d+)?")
_THOUSAND = re.compile(r"(?<![\d.,])[1-9]\d{0,2},\d{3}(?![\d.])")
BARE_TERM = re.compile(rf"(?P<value>{NUMBER})\s*(?P<unit>{'|'.join(map(re.escape, SPELT))})")
"""`92cm`."""


@lru_cache(maxsize=8)
def patterns(units: tuple[str, ...]) -> tuple[re.Pattern[str], ...]:
    """Patterns of what is said of outcomes in these units, of which a task may have its own.

    Of a term, `5-7 cm long`, `5 +- 0.5 cm long` or `long`; of one whose word is first, `long by
    5cm`; and of a place, `92cm`, with what parts it from the next number.
    """
    own = {each for unit in units if unit != "1" for each in (unit, unit.lower())}
    unit = "".join(  # some are none where letters follow: `2 somewhere`
        re.escape(each) + "(?![a-z])" * (each in ("m", "in", "s", "h", *own)) + "|"
        for each in sorted({*SPELT, *own}, key=len, reverse=True)
    )
    term = (
        rf"(?:(?:(?P<least>{NUMBER})\s*(?P<least_unit>{unit})\s*-\s*)?"
        rf"(?P<value>{NUMBER})\s*(?P<unit>{unit})\s*"
        rf"(?:{PLUS_MINUS}\s*(?P<sd>{NUMBER})\s*(?P<sd_unit>{unit})\s*)?)?"
        r"(?:to the )?(?P<word>[a-z]+)"
    )
    # Tried where a word begins only, or a text of 100,000 letters would take minutes.
    word_first = rf"(?<![a-z])(?:to the )?([a-z]+)\s+(?:by\s+)?((?:{NUMBER})\s*(?:{unit}))(?:\s+|$)"
    place = rf"(?P<number>[+-]?(?:{NUMBER}))\s*(?P<unit>{unit})(?:\s*[,;]\s*|\s+|$)"
    return tuple(re.compile(each, re.IGNORECASE) for each in (term, word_first, place))


def with_points(text: str, k: int) -> str:
    """Return a text whose decimal commas are points, and whose minuses are as typed.

    A comma is decimal where a unit, a word or a range follows, `1,2 cm`, or where there are k
    numbers, `0,92 0,1 m` of two. InvalidFeedbackError where it may part thousands: `1,500 mm`.
    """
    text = text.replace("\u2212", "-")
    numbers = _BETWEEN.split(_LAST_UNIT.sub("", text.strip()))
    all_numbers = len(numbers) == k and all(map(WITH_COMMA.fullmatch, numbers))
    pointed = (_INNER_COMMA if all_numbers else _DECIMAL_COMMA).sub(".", text)
    if pointed != text and (found := _THOUSAND.search(text)):
        whole, decimal = found[0].replace(",", ""), found[0].replace(",", ".")
        raise InvalidFeedbackError(
            f"{found[0]} in {text!r} may be a thousand; write {whole}, or {decimal}"
        )
    return pointed


def read_numbers(text: str) -> list[tuple[float, float | None]] | None:
    """Read numbers, each with that after its `+-` (`0.05+-0.003, -0.02 ± 0.001`); None if none."""
    mark = ";" if ";" in text else ","
    parts = re.sub(rf"\s*{PLUS_MINUS}\s*", "±", text).replace(mark, " ").split()
    try:
        split = [part.split("±") for part in parts]
        return [(float(number), float(*sd) if sd else None) for number, *sd in split]
    except (ValueError, TypeError):
        return None

"""Numbers said in words, and words read as numbers: the one place that does either.

An operator stands behind the robot and looks along x, from the robot's base over the table:

                      an error, seen from the goal    a place, seen from the base
    component 0 (x)   long or short                   ahead or behind
    component 1 (y)   left or right                   left or right
    component 2 (z)   high or low                     up or down

An error is outcome minus goal. Words go with lengths and at most three components, and are in
centimetres; anything else is said by its names and units.
Source: paper, Section IV, "Perception Process" (coarse human feedback); the words are ours.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.errors import InvalidFeedbackError

WORDS: tuple[tuple[str, str], ...] = (("long", "short"), ("left", "right"), ("high", "low"))
"""For each component of an error: the word where it is positive, the word where it is negative."""
PLACE_WORDS: tuple[tuple[str, str], ...] = (("ahead", "behind"), ("left", "right"), ("up", "down"))
"""The same for a place."""

_Point = Float[np.ndarray, " k"]
_LEAST_BARE_CM = 0.1
"""Ours: nobody sees a throw to a millimetre; a smaller number without a unit is in metres."""
_CM_PER_UNIT = {"cm": 1.0, "m": 100.0, "mm": 0.1, "": 1.0}
_TERM = re.compile(
    r"(?P<value>\d{1,6}(?:\.\d*)?|\.\d+)\s*(?P<unit>cm|mm|m|)\s*(?:to the )?(?P<word>[a-z]+)"
)


def in_words(units: Sequence[str]) -> bool:
    """Whether words describe outcomes of these units: lengths, at most three of them."""
    return len(units) <= len(WORDS) and all(unit == "m" for unit in units)


def to_words(error: ArrayLike) -> str:
    """Say an error as an operator would.

    Args:
        error: Outcome minus goal, at most three numbers, in [m].

    Returns:
        For instance `5 cm long, 2 cm left`; `on the goal` where it rounds to nothing.
    """
    said = _terms(error, WORDS)
    return ", ".join(term for term in said if not term.startswith("0 ")) or "on the goal"


def say_error(error: ArrayLike, names: Sequence[str], units: Sequence[str]) -> str:
    """Say an error: `5 cm long, 2 cm left`, or `x +0.05 m, t -0.1 s`."""
    return to_words(error) if in_words(units) else _components(error, names, units, sign="+")


def say_place(place: ArrayLike, names: Sequence[str], units: Sequence[str]) -> str:
    """Say a goal, a condition or an outcome: `92 cm ahead, 10 cm left`, or `x 0.92 m, t 0.3 s`."""
    if in_words(units):
        return ", ".join(_terms(place, PLACE_WORDS))
    return _components(place, names, units)


def say_length(length: float, units: Sequence[str]) -> str:
    """Say a distance between outcomes: `1.5 cm`, `0.2 rad`; `0.25` where units are mixed."""
    if set(units) == {"m"}:
        return f"{_centimetres(length)} cm"
    unit = units[0] if len(set(units)) == 1 else ""
    return f"{float(f'{length:.3g}'):g} {unit}".strip()


def from_words(text: str, outcome_dim: int) -> _Point:
    """Read an error from words.

    Args:
        text: For instance `5cm long, 2 cm left`, or `hit`. Numbers without a unit are centimetres.
            A component that is not named is zero.
        outcome_dim: k, at most 3.

    Returns:
        Outcome minus goal, in [m].

    Raises:
        InvalidFeedbackError: Words that are not understood, or one direction named twice.
    """
    if outcome_dim > len(WORDS):
        raise InvalidFeedbackError(
            f"words describe up to {len(WORDS)} components, this task has {outcome_dim}: give "
            "numbers"
        )
    if text.strip().lower() in {"hit", "on the goal", "0"}:
        return np.zeros(outcome_dim)
    return _read(text, WORDS[:outcome_dim], 'for instance "5cm long, 2cm left", or "hit"')


def read_place(text: str, names: Sequence[str], units: Sequence[str]) -> _Point:
    """Read a place from numbers in the outcome's units, or from words.

    Args:
        text: For instance `0.92 0.10`, or `92cm ahead, 10cm left`.
        names: Of the components.
        units: Of the components.

    Raises:
        InvalidFeedbackError: It is neither.
    """
    expected = f"{len(names)} finite numbers: {', '.join(names)}"
    try:
        numbers = [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        if in_words(units):
            return _read(text, PLACE_WORDS[: len(names)], 'for instance "92cm ahead, 10cm left"')
        raise InvalidFeedbackError(f"cannot read {text!r}; give {expected}") from None
    if len(numbers) != len(names) or not all(map(math.isfinite, numbers)):
        raise InvalidFeedbackError(f"{text!r} is not {expected}")
    return np.array(numbers)


def _read(text: str, words: Sequence[tuple[str, str]], example: str) -> _Point:
    known = [word for pair in words for word in pair]
    read: dict[int, float] = {}
    for part in re.split(r"\s*(?:,|;|\band\b)\s*", text.strip().lower()):
        match = _TERM.fullmatch(part)
        if match is None or match["word"] not in known:
            raise InvalidFeedbackError(
                f"cannot read {part!r} in {text!r}; write a length and one of {', '.join(known)}, "
                f"{example}"
            )
        component, negative = divmod(known.index(match["word"]), 2)
        if component in read:
            raise InvalidFeedbackError(
                f"{text!r} names {' and '.join(words[component])} twice; give each direction once"
            )
        value = float(match["value"])
        if not match["unit"] and 0 < value < _LEAST_BARE_CM:
            raise InvalidFeedbackError(
                f"{part!r} has no unit and would be {10 * value:g} mm; say m, cm or mm"
            )
        metres = value * _CM_PER_UNIT[match["unit"]] / 100
        read[component] = -metres if negative else metres
    return np.array([read.get(component, 0.0) for component in range(len(words))])


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

"""Words for an error: "5 cm long, 2 cm left". Defined once, here.

An operator stands behind the robot and looks along x, from the robot's base over the table:

    component 0 (x)   long  = beyond the goal, +      short = before the goal, -
    component 1 (y)   left  = +                       right = -
    component 2 (z)   high  = +                       low   = -

Errors are outcome minus goal, in [m]; the words are in centimetres.
Source: paper, Section IV, "Perception Process" (coarse human feedback); the words are ours.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from prior_reinforce.errors import InvalidFeedbackError

WORDS: tuple[tuple[str, str], ...] = (("long", "short"), ("left", "right"), ("high", "low"))
"""For each component of an error: the word where it is positive, the word where it is negative."""

_LEAST_BARE_CM = 0.1
"""Ours: nobody sees a throw to a millimetre; a smaller number without a unit is in metres."""
_CM_PER_UNIT = {"cm": 1.0, "m": 100.0, "mm": 0.1, "": 1.0}
_TERM = re.compile(r"(?P<value>\d+(?:\.\d*)?|\.\d+)\s*(?P<unit>cm|mm|m|)\s*(?P<word>[a-z]+)")


def to_words(error: Sequence[float] | np.ndarray) -> str:
    """Say an error as an operator would.

    Args:
        error: Outcome minus goal, shape (k,), k at most 3, in [m].

    Returns:
        For instance `5 cm long, 2 cm left`; `on the goal` where it rounds to nothing.
    """
    parts: list[str] = []
    for value, (positive, negative) in zip(np.asarray(error, dtype=float), WORDS, strict=False):
        centimetres = round(abs(value) * 100, 1)
        if centimetres > 0:
            parts.append(f"{centimetres:g} cm {positive if value > 0 else negative}")
    return ", ".join(parts) if parts else "on the goal"


def from_words(text: str, outcome_dim: int) -> np.ndarray:
    """Read an error from words.

    Args:
        text: For instance `5cm long, 2 cm left`, or `hit`. Numbers without a unit are centimetres.
            A component that is not named is zero.
        outcome_dim: k, at most 3.

    Returns:
        Outcome minus goal, shape (k,), in [m].

    Raises:
        InvalidFeedbackError: Words that are not understood, or one direction named twice.
    """
    known = [word for pair in WORDS[:outcome_dim] for word in pair]
    if outcome_dim > len(WORDS):
        raise InvalidFeedbackError(
            f"words describe up to {len(WORDS)} components, this task has {outcome_dim}: give "
            "numbers"
        )
    cleaned = text.strip().lower()
    error = np.zeros(outcome_dim)
    if cleaned in {"hit", "on the goal", "0"}:
        return error
    seen: set[int] = set()
    for part in re.split(r"\s*(?:,|;|\band\b)\s*", cleaned):
        match = _TERM.fullmatch(part)
        if match is None or match["word"] not in known:
            raise InvalidFeedbackError(
                f"cannot read {part!r} in {text!r}; write a length and one of {', '.join(known)}, "
                'for instance "5cm long, 2cm left", or "hit"'
            )
        component, sign = divmod(known.index(match["word"]), 2)
        if component in seen:
            raise InvalidFeedbackError(
                f"{text!r} names {' and '.join(WORDS[component])} twice; give each direction once"
            )
        seen.add(component)
        if not match["unit"] and 0 < float(match["value"]) < _LEAST_BARE_CM:
            millimetres = 10 * float(match["value"])
            raise InvalidFeedbackError(
                f"{part!r} has no unit and would be {millimetres:g} mm; say m, cm or mm"
            )
        metres = float(match["value"]) * _CM_PER_UNIT[match["unit"]] / 100
        error[component] = -metres if sign else metres
    return error


def in_words(units) -> bool:
    return len(units) <= len(WORDS) and set(units) == {"m"}


def say_error(error, names, units) -> str:
    return to_words(error) if in_words(units) else _components(error, names, units, "+.4g")


def say_place(place, names, units) -> str:
    return _components(place, names, units, ".4g")


def _components(values, names, units, form):
    return ", ".join(
        f"{name} {round(float(value), 4) + 0.0:{form}} {unit}"
        for name, value, unit in zip(names, values, units, strict=True)
    )

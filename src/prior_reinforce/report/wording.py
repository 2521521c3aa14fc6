"""How numbers are said on the page: centimetres and words where they apply, plain units else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.wording import WORDS, to_words

_PLACE_WORDS = (("ahead", "behind"), ("to the left", "to the right"), ("up", "down"))
"""A place, not an error: where it lies as seen from the robot's base."""

MINUS = "\N{MINUS SIGN}"


def display_factor(record: AdaptationRecord) -> float:
    """Number that turns the outcomes' unit into the one shown: metres become centimetres."""
    return 100.0 if record.in_metres else 1.0


def display_unit(record: AdaptationRecord, component: int | None = None) -> str:
    """Unit shown for a component; for a distance (None) empty where the units are mixed."""
    if record.in_metres:
        return "cm"
    units = record.demonstrations.outcome_units
    if component is not None:
        return units[component]
    return units[0] if len(set(units)) == 1 else ""


def say_length(record: AdaptationRecord, length: float) -> str:
    """Say a distance, for instance `1.5 cm`."""
    return f"{_number(record, length)} {display_unit(record)}".strip()


def say_error(record: AdaptationRecord, error: np.ndarray) -> str:
    """Say outcome minus goal, for instance `5 cm long, 2 cm left`."""
    if record.in_words:
        return to_words(error)
    return _components(record, error, signed=True)


def say_aim(record: AdaptationRecord, condition: np.ndarray) -> str:
    """Say where a condition lies, seen from the goal: `at the goal`, `3.1 cm long`."""
    if not record.in_words:
        return _components(record, condition, signed=False)
    words = to_words(condition - record.goal)
    return "at the goal" if words == "on the goal" else words


def say_place(record: AdaptationRecord, place: np.ndarray) -> str:
    """Say a place on the table, for instance `92 cm ahead, 10 cm to the left`."""
    if not record.in_words:
        return _components(record, place, signed=False)
    parts = []
    for i, (value, (positive, negative)) in enumerate(zip(place, _PLACE_WORDS, strict=False)):
        centimetres = _number(record, abs(value))
        if centimetres == "0":
            parts.append("in the middle" if i == 1 else f"0 cm {positive}")
        else:
            parts.append(f"{centimetres} cm {positive if value > 0 else negative}")
    return ", ".join(parts)


def direction_words(record: AdaptationRecord, component: int) -> tuple[str, str] | None:
    """Words for the positive and negative direction of a component; None where none apply."""
    return WORDS[component] if record.in_words else None


def join_words(parts: Sequence[str]) -> str:
    """Join as in a sentence: `a, b and c`."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def _components(record: AdaptationRecord, values: np.ndarray, *, signed: bool) -> str:
    return ", ".join(
        f"{name} {_number(record, value, signed=signed)} {display_unit(record, i)}".strip()
        for i, (name, value) in enumerate(
            zip(record.demonstrations.outcome_names, values, strict=True)
        )
    )


def _number(record: AdaptationRecord, value: float, *, signed: bool = False) -> str:
    """Centimetres to one decimal, other units to three digits; never `-0`."""
    size = abs(value) * display_factor(record)
    text = f"{round(size, 1):g}" if record.in_metres else f"{float(f'{size:.3g}'):g}"
    if text == "0":
        return text
    return (MINUS if value < 0 else "+" if signed else "") + text

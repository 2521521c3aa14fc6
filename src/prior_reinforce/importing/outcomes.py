"""Where each demonstration's object landed: no recording format says, so a table beside it does.

`outcomes.csv` has a line of column names, `episode` among them; every other column is a component
of the outcome, except `source` and `note`. A column `x_cm` or `x_mm` is converted to `x` in metres.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
)
from prior_reinforce.importing.files import named_damage
from prior_reinforce.importing.recording import Recording

OUTCOMES_FILE = "outcomes.csv"
_NOT_COMPONENTS = ("episode", "source", "note")
_METRES = {"_m": 1.0, "_cm": 0.01, "_mm": 0.001}
_REMEDY = f"write {OUTCOMES_FILE} with the columns episode,x,y beside the recording, or pass them"


@dataclass(frozen=True)
class Outcomes:
    """The outcomes that are known, by episode."""

    where: str
    """Where they are from, for messages."""
    names: tuple[str, ...]
    """Names of the k components; empty where the source names none."""
    values: Mapping[str, tuple[float, ...]]
    """k numbers by episode."""


def find_outcomes(source: Path, recordings: Sequence[Recording]) -> Outcomes:
    """Outcomes from `outcomes.csv` inside or beside the source, or from the recordings.

    Raises:
        InvalidDemonstrationsError: There are none; all episodes are named.
        FileFormatError: The table is damaged.
    """
    folders = [source, source.parent] if source.is_dir() else [source.parent]
    for folder in folders:
        if (folder / OUTCOMES_FILE).is_file():
            return read_outcomes(folder / OUTCOMES_FILE)
    own = {r.episode: tuple(map(float, r.outcome)) for r in recordings if r.outcome is not None}
    if own:
        return Outcomes("the recording itself", (), own)
    raise InvalidDemonstrationsError(
        f"no outcomes for episodes {_listed([r.episode for r in recordings])}, and no recording "
        f"format says where the object landed; {_REMEDY}"
    )


def read_outcomes(path: Path) -> Outcomes:
    """Read an `outcomes.csv`; rows whose cells are empty count as missing.

    Raises:
        FileFormatError: Missing, not such a table, or a cell that is no number.
    """
    if not path.is_file():
        raise FileFormatError(f"no outcomes at {path}; {_REMEDY}")
    with named_damage(path, "CSV in UTF-8"), path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file, strict=True)
        lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    header = [cell.strip() for cell in lines[0][1]] if lines else []
    columns = [i for i, name in enumerate(header) if name not in _NOT_COMPONENTS]
    if "episode" not in header or not columns or len(set(header)) != len(header):
        raise FileFormatError(
            f"{path} begins with {','.join(header)!r}, expected column names such as episode,x,y"
        )
    values: dict[str, tuple[float, ...]] = {}
    units = [_unit(header[i]) for i in columns]
    for line, row in lines[1:]:
        if len(row) != len(header):
            raise FileFormatError(
                f"{path}, line {line}: {len(row)} cells for {len(header)} columns; mend that line"
            )
        episode, cells = row[header.index("episode")].strip(), [row[i].strip() for i in columns]
        if episode in values:
            raise FileFormatError(f"{path}, line {line}: episode {episode} again; drop one of them")
        if any(cells):
            pairs = zip(cells, units, strict=True)
            values[episode] = tuple(_number(path, line, cell) * u[1] for cell, u in pairs)
    return Outcomes(path.name, tuple(unit[0] for unit in units), values)


def in_order(outcomes: Outcomes, names: Sequence[str] | None) -> Outcomes:
    """The outcomes with their components in the order of the names.

    Args:
        outcomes: Their components are matched by name where they have names, else by position.
        names: As wanted; None keeps the outcomes as they are.

    Raises:
        InvalidDemonstrationsError: A wanted component that the outcomes lack.
    """
    if names is None or not outcomes.names:
        return outcomes
    missing = [name for name in names if name not in outcomes.names]
    if missing:
        raise InvalidDemonstrationsError(
            f"{outcomes.where} has no column {', '.join(missing)}; it has "
            f"{', '.join(outcomes.names)}: rename or add it"
        )
    order = [outcomes.names.index(name) for name in names]
    values = {name: tuple(v[i] for i in order) for name, v in outcomes.values.items()}
    return Outcomes(outcomes.where, tuple(names), values)


def outcomes_of(
    recordings: Sequence[Recording], outcomes: Outcomes, *, partial: bool
) -> np.ndarray:
    """The outcome of each recording, in order.

    Episodes are matched by name, else by the number their names end in (`3` is `demo_003`).

    Args:
        recordings: N of them.
        outcomes: By episode.
        partial: Only some episodes were asked for, so outcomes of others are no mistake.

    Returns:
        Shape (N, k).

    Raises:
        InvalidDemonstrationsError: Outcomes that are missing, of a wrong length, not finite, or of
            episodes that do not exist; each is named.
    """
    by_number: dict[int, list[str]] = {}
    for name in outcomes.values:
        by_number.setdefault(_number_of(name), []).append(name)
    numbers = [_number_of(recording.episode) for recording in recordings]
    picked: dict[str, str] = {}
    for recording, number in zip(recordings, numbers, strict=True):
        if recording.episode in outcomes.values:
            picked[recording.episode] = recording.episode
        elif number >= 0 and numbers.count(number) == 1 and len(by_number.get(number, ())) == 1:
            picked[recording.episode] = by_number[number][0]
    missing = [r.episode for r in recordings if r.episode not in picked]
    if missing:
        raise InvalidDemonstrationsError(
            f"no outcome for episodes {_listed(missing)} in {outcomes.where} (it has "
            f"{_listed(list(outcomes.values))}); measure and add them, or leave those episodes out"
        )
    unknown = [name for name in outcomes.values if name not in picked.values()]
    if unknown and not partial:
        raise InvalidDemonstrationsError(
            f"{outcomes.where} names episodes {_listed(unknown)} that were not found (there are "
            f"{_listed([r.episode for r in recordings])}); correct the names, or record them again"
        )
    lengths = {len(outcomes.values[name]) for name in picked.values()}
    if len(lengths) != 1 or 0 in lengths:
        raise InvalidDemonstrationsError(
            f"outcomes in {outcomes.where} have {sorted(lengths)} components, expected one number "
            "for all, at least 1; complete them"
        )
    array = np.array([outcomes.values[picked[r.episode]] for r in recordings], dtype=np.float64)
    if not np.all(np.isfinite(array)):
        row = int(np.argwhere(~np.isfinite(array))[0][0])
        raise InvalidDemonstrationsError(
            f"the outcome of episode {recordings[row].episode} is {array[row].tolist()}, expected "
            "finite numbers; measure it, or leave that episode out"
        )
    return array


def given_outcomes(values: Mapping[str, Sequence[float]]) -> Outcomes:
    """Outcomes that were passed as numbers.

    Raises:
        ConfigurationError: Not numbers.
    """
    try:
        numbers = {str(name): tuple(map(float, value)) for name, value in values.items()}
    except (TypeError, ValueError) as error:
        raise ConfigurationError(
            f"outcomes must be numbers by episode, such as {{'0': (0.9, 0.1)}}: {error}"
        ) from error
    return Outcomes("the given outcomes", (), numbers)


def _unit(column: str) -> tuple[str, float]:
    for ending, metres in _METRES.items():
        if column.endswith(ending):
            return column.removesuffix(ending), metres
    return column, 1.0


def _number(path: Path, line: int, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileFormatError(
            f"{path}, line {line}: {text!r} is no finite number; measure that outcome, or empty "
            "the whole row's numbers"
        )
    return value


def _number_of(name: str) -> int:
    """The number a name ends in, -1 if in none."""
    match = re.search(r"(\d+)$", name)
    return int(match.group(1)) if match else -1


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:12])
    return f"{shown} and {len(names) - 12} more" if len(names) > 12 else shown or "none"

"""Where each demonstration's object landed: no recording format says, so a table beside it does.

`outcomes.csv` has a line of column names, `episode` among them; every other column is a component
of the outcome, except `source`, `note` and `comment`, and `sd`, by which the row's components are
uncertain. A column `x_cm` or `x [mm]` is converted to `x` in metres, an angle likewise to radians,
and a time to seconds; any other unit in brackets is kept: `volume [ml]`.
"""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from prior_reinforce.arrays import Points
from prior_reinforce.bench.importing.csv import EPISODE_COLUMNS
from prior_reinforce.bench.importing.recording import Recording
from prior_reinforce.bench.importing.tables import Table, read_tables
from prior_reinforce.bench.importing.units import (
    CHANNEL_UNITS,
    Doubt,
    base_of,
    cannot_be,
    conversion,
    guess_unit,
    known_unit,
    split_any_unit,
)
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
)
from prior_reinforce.files import write

OUTCOMES_FILE = "outcomes.csv"
_SD = "sd"
_NOT_COMPONENTS = (_SD, "episode", "source", "note", "notes", "comment", "comments")


@dataclass(frozen=True)
class Outcomes:
    """The outcomes that are known, by episode."""

    where: str
    """Where they are from, for messages."""
    names: tuple[str, ...]
    """Names of the k components; empty where the source names none."""
    values: Mapping[str, tuple[float, ...]]
    """k numbers by episode; metres and radians where their unit is said."""
    units: tuple[str | None, ...] = ()
    """Unit of each component; None where the source says none."""
    sd: Mapping[str, float] = field(default_factory=dict)
    """How uncertain each component is, by episode; nothing where it was measured."""
    sd_unit: str | None = None
    """Unit of that; None is the first component's."""


def find_outcomes(
    places: Sequence[Path],
    recordings: Sequence[Recording],
    given: str | os.PathLike[str] | Mapping[str, Sequence[float]] | None = None,
    names: Sequence[str] | None = None,
) -> Outcomes:
    """Find outcomes: those given, a table beside the recordings, the recordings' own.

    Args:
        places: Folders beside the recordings.
        recordings: Some hold their outcomes.
        given: A table, or numbers by episode.
        names: Of the components that are wanted, as in `read_outcomes`.

    Raises:
        ConfigurationError: What was given are no numbers.
        InvalidDemonstrationsError: There are none; all episodes are named.
        FileFormatError: The table is missing or damaged.
    """
    if isinstance(given, Mapping):
        try:
            numbers = {str(name): tuple(map(float, value)) for name, value in given.items()}
        except (TypeError, ValueError) as error:
            raise ConfigurationError(
                f"outcomes must be numbers by episode, such as {{'0': (0.9, 0.1)}}: {error}"
            ) from error
        return Outcomes("the given outcomes", (), numbers)
    path = Path(given) if given is not None else table_beside(places)
    if path is not None:
        return read_outcomes(path, names)
    own = {r.episode: tuple(r.outcome.tolist()) for r in recordings if r.outcome is not None}
    if own:
        return Outcomes("the recording itself", (), own)
    above = table_beside([place.parent for place in places])
    hint = (
        f" ({above} is not beside them: name it with --outcomes if it is theirs)" if above else ""
    )
    raise InvalidDemonstrationsError(
        f"no outcomes for episodes {_listed([r.episode for r in recordings])}, and no recording "
        f"format says where the object landed; write {places[0] / OUTCOMES_FILE} with the columns "
        "episode,x,y (import --inspect writes one to fill in), or name a table with "
        f"--outcomes{hint}"
    )


def table_beside(places: Sequence[Path]) -> Path | None:
    """Return the table of outcomes that stands in one of the folders; None where there is none."""
    names = (OUTCOMES_FILE, "outcomes.xlsx")
    return next((f / n for f in places for n in names if (f / n).is_file()), None)


def headed(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Return what a table calls its components: with their units, where those are known here."""
    return [f"{n} [{u}]" if u in CHANNEL_UNITS else n for n, u in zip(names, units, strict=True)]


def write_outcome_table(
    path: Path, episodes: Sequence[str], names: Sequence[str], units: Sequence[str]
) -> None:
    """Write a table to be filled in: the episodes' names, and a column a component with its unit.

    Raises:
        OSError: It cannot be written.
    """
    heads = headed(names, units)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["episode", *heads, "note"])
    writer.writerows([episode, *[""] * len(heads), ""] for episode in episodes)
    write(path, text.getvalue())


def read_outcomes(path: Path, names: Sequence[str] | None = None) -> Outcomes:
    """Read a table of outcomes; rows whose cells are empty count as missing.

    Args:
        path: A CSV of any dialect, or a workbook.
        names: Of the components that are wanted; None takes all columns but `episode` and notes.

    Raises:
        FileFormatError: Missing, not such a table, or a cell that is no number.
    """
    if not path.is_file():
        raise FileFormatError(f"no outcomes at {path}; give the path of a table episode,x,y")
    table = read_tables(path)[0]
    split = [split_any_unit(name) for name in table.names]
    lower = [name.lower() for name, _ in split]
    episode = next((i for i, name in enumerate(lower) if name in EPISODE_COLUMNS), None)
    columns = [i for i, name in enumerate(lower) if i != episode and name not in _NOT_COMPONENTS]
    uncertain = lower.index(_SD) if _SD in lower else None
    if names is not None and set(names) <= {split[i][0] for i in columns}:
        columns = [i for i in columns if split[i][0] in names]
    kept = [split[i][0] for i in columns]
    if episode is None or not columns or len(set(kept)) != len(kept):
        raise FileFormatError(
            f"{path} begins with {','.join(table.names)!r}, expected column names such as "
            "episode,x,y"
        )
    units = [table.units[i] or split[i][1] for i in columns]
    bases = [base_of(unit) if unit else (None, 1.0) for unit in units]
    values: dict[str, tuple[float, ...]] = {}
    sd: dict[str, float] = {}
    for row, name in enumerate(table.texts(episode)):
        line = table.lines[row]
        if name in values:
            raise FileFormatError(f"{path}, line {line}: episode {name} again; drop one of them")
        one = table.rows([row])
        if any(one.texts(i)[0] for i in columns):
            numbers = [_number(path, line, one, i) for i in columns]
            values[name] = tuple(n * u[1] for n, u in zip(numbers, bases, strict=True))
            if uncertain is not None and one.texts(uncertain)[0] not in ("", "0", "0.0"):
                sd[name] = _number(path, line, one, uncertain)
    sd_unit = None
    if uncertain is not None:
        sd_unit = table.units[uncertain] or split[uncertain][1] or units[0]
    bare = tuple(unit for unit, _ in bases)
    return Outcomes(str(path), tuple(kept), values, bare, sd, sd_unit)


def in_order(outcomes: Outcomes, names: Sequence[str] | None) -> Outcomes:
    """Return the outcomes with their components in the order of the names.

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
    units = tuple(outcomes.units[i] for i in order)
    return replace(outcomes, names=tuple(names), values=values, units=units)


def in_units(
    outcomes: Outcomes, wanted: Sequence[str] | None, given: str | None
) -> tuple[Outcomes, tuple[Doubt, ...]]:
    """Return the outcomes in the units that are wanted, and what is only guessed of them.

    Args:
        outcomes: Their components in order.
        wanted: Unit of each, as the task has it; None takes what is said, or metres.
        given: Unit of the components whose source says none, or that of all, said again where
            it is doubted; None takes the wanted one, or where nothing could land there, the one it
            looks like.

    Raises:
        ConfigurationError: A component is in a unit that cannot be converted, `given` has no use,
            or one `sd` stands for components of several units.
        InvalidDemonstrationsError: What is said of a unit cannot be.
    """
    k = max((len(value) for value in outcomes.values.values()), default=0)
    said = outcomes.units or (None,) * k
    chosen = wanted is not None
    if wanted is None:
        wanted = [base_of(unit or given or "m")[0] for unit in said]
    if len(wanted) != k or len(said) != k:
        return outcomes, ()  # another number of components: said when they are joined
    if given is not None and None not in said and given not in said:
        raise ConfigurationError(
            f"--outcome-unit {given} has no use, since {outcomes.where} says its units; drop it"
        )
    names = outcomes.names or tuple(map(str, range(1, k + 1)))
    if outcomes.sd and len(set(wanted)) > 1:
        raise ConfigurationError(
            f"{_SD} in {outcomes.where} is one number for components in {', '.join(wanted)}; leave "
            "that column out"
        )
    scale, looks = [], dict[str, list[str]]()
    for i, (name, own, spelt) in enumerate(zip(names, said, wanted, strict=True)):
        unit = known_unit(spelt) or spelt
        reach = max((abs(value[i]) for value in outcomes.values.values()), default=0.0)
        recorded = own or given or guess_unit(unit, reach) or unit
        if own is None and given is None and recorded != unit:
            looks.setdefault(recorded, []).append(f"{name} reaches {reach:.4g}")
        if chosen and base_of(recorded)[0] != base_of(unit)[0]:
            raise ConfigurationError(
                f"{name} in {outcomes.where} is in {recorded}, but its unit is to be {spelt}; "
                "correct either (a workspace has it in workspace.toml, [outcome])"
            )
        scale.append(conversion(recorded, unit, f"{name} in {outcomes.where}"))
        looks_like = guess_unit(unit, reach * scale[-1])
        if cannot_be(unit, reach * scale[-1]):
            raise InvalidDemonstrationsError(
                f"in {outcomes.where}, {name} is said to be in {recorded} and would reach "
                f"{reach * scale[-1]:.4g} {unit}, too far for an arm; if it is in {looks_like}, "
                f"call its column {name} [{looks_like}]"
            )
        if own is not None and given != unit and looks_like != unit:
            looks.setdefault(unit, []).append(
                f"{name} reaches {reach * scale[-1]:.4g} {unit} (if that is in {looks_like}, call "
                f"its column {name} [{looks_like}])"
            )
    doubts = tuple(
        Doubt(
            f"in {outcomes.where}, {' and '.join(reached)}, too far for an arm"
            + (f": it looks like {unit}" if unit not in said else ""),
            f"--outcome-unit {unit}",
        )
        for unit, reached in looks.items()
    )
    values = {
        episode: tuple(v * s for v, s in zip(value, scale, strict=False))
        for episode, value in outcomes.values.items()
    }
    first = known_unit(wanted[0]) or wanted[0]
    own_scale = conversion(outcomes.sd_unit, first, _SD) if outcomes.sd_unit else scale[0]
    sd = {episode: own_scale * value for episode, value in outcomes.sd.items()}
    return Outcomes(outcomes.where, outcomes.names, values, tuple(wanted), sd, wanted[0]), doubts


def missing_outcomes(episodes: Sequence[str], outcomes: Outcomes) -> list[str]:
    """Return the episodes that a table says nothing of, by the rule of `outcomes_of`."""
    picked = _matched(list(episodes), list(outcomes.values))
    return [episode for episode in episodes if episode not in picked]


def outcomes_of(recordings: Sequence[Recording], outcomes: Outcomes, *, partial: bool) -> Points:
    """Return the outcome of each recording, in order.

    Episodes are matched by name, else by the number their names end in (`3` is `demo_003`).

    Args:
        recordings: N of them.
        outcomes: By episode.
        partial: Only some episodes were asked for, so outcomes of others are no mistake.

    Raises:
        InvalidDemonstrationsError: Outcomes that are missing, of a wrong length, not finite, or of
            episodes that do not exist; each is named.
    """
    episodes = [recording.episode for recording in recordings]
    picked = _matched(episodes, list(outcomes.values))
    missing = [episode for episode in episodes if episode not in picked]
    if missing:
        raise InvalidDemonstrationsError(
            f"no outcome for episodes {_listed(missing)} in {outcomes.where} (it has "
            f"{_listed(list(outcomes.values))}); measure and add them, or leave those episodes out"
        )
    unknown = [name for name in outcomes.values if name not in picked.values()]
    if unknown and not partial:
        raise InvalidDemonstrationsError(
            f"{outcomes.where} names episodes {_listed(unknown)} that were not found (there are "
            f"{_listed(episodes)}); correct the names, or record them again"
        )
    rows = [outcomes.values[picked[episode]] for episode in episodes]
    lengths = set(map(len, rows))
    if len(lengths) != 1 or 0 in lengths:
        raise InvalidDemonstrationsError(
            f"outcomes in {outcomes.where} have {sorted(lengths)} components, expected one number "
            "for all, at least 1; complete them"
        )
    for episode, row in zip(episodes, rows, strict=True):
        if not all(map(math.isfinite, row)):
            raise InvalidDemonstrationsError(
                f"the outcome of episode {episode} is {list(row)}, expected finite numbers; "
                "measure it, or leave that episode out"
            )
    return np.array(rows, dtype=np.float64)


def uncertainty_of(recordings: Sequence[Recording], outcomes: Outcomes) -> Points:
    """Return how uncertain each recording's outcome is, shape (N, k), in order; 0 where measured.

    Args:
        recordings: N of them, all with an outcome.
        outcomes: By episode, in the wanted units.
    """
    episodes = [recording.episode for recording in recordings]
    picked = _matched(episodes, list(outcomes.values))
    k = len(next(iter(outcomes.values.values())))
    rows = [outcomes.sd.get(picked[episode], 0.0) for episode in episodes]
    return np.tile(np.array(rows, dtype=np.float64)[:, None], k)


def _matched(episodes: list[str], names: list[str]) -> dict[str, str]:
    """Name in the table by episode; a number that two names end in matches none."""
    numbers, there = list(map(_number_at_end, episodes)), list(map(_number_at_end, names))
    picked: dict[str, str] = {}
    for episode, number in zip(episodes, numbers, strict=True):
        if episode in names:
            picked[episode] = episode
        elif number >= 0 and numbers.count(number) == 1 and there.count(number) == 1:
            picked[episode] = names[there.index(number)]
    return picked


def _number(path: Path, line: int, row: Table, column: int) -> float:
    value = float(row.numbers(column)[0]) if row.is_number(column) else math.nan
    if not math.isfinite(value):
        raise FileFormatError(
            f"{path}, line {line}: {row.texts(column)[0]!r} is no finite number; measure that "
            "outcome, or empty the whole row's numbers"
        )
    return value


def _number_at_end(name: str) -> int:
    """The number a name ends in, -1 if in none."""
    match = re.search(r"(\d+)$", name)
    return int(match[1]) if match else -1


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:12])
    return f"{shown} and {len(names) - 12} more" if len(names) > 12 else shown or "none"

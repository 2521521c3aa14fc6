"""Read where each demonstration's object landed, from a table: no recording format holds it.

`outcomes.csv` has a header with `episode`; every other column is a component of the outcome, but
for `source`, `note`, `comment`, and `sd`, the standard deviation of the row's components. `x_cm`
and `x [mm]` are converted to metres, angles to radians, times to seconds; `volume [ml]` is kept.
"""

from __future__ import annotations

import csv
import io
import math
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.recordings.outcome_names import (
    FILE,
    Key,
    columns_of,
    digits_at_end,
    how_to_renumber,
    keys_of,
    number_of,
    order_of,
    other_places,
    refuse_unlike,
    remedy_for,
    rows_of,
    telling_column,
)
from prior_reinforce.arm.recordings.recording import ROW_COLUMNS
from prior_reinforce.arm.recordings.tables import Table, read_table
from prior_reinforce.arm.recordings.units import (
    CHANNEL_UNITS,
    Ambiguity,
    is_possible,
    known_unit,
    split_unit,
)
from prior_reinforce.arrays import Points
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError
from prior_reinforce.files import as_cell, named_disk_errors, write
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.units import base_of
from prior_reinforce.wording import listed

OUTCOMES_FILE = "outcomes.csv"
SD = "sd"
"""Column of the standard deviation of a row's components."""
_HUNDREDS = re.compile(r"[+-]?[1-9]\d\d+")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}([.,]\d{3})+")
_WITH_UNIT = re.compile(r"([-+\d.,]+) *([^\d\s.,]+)")
"""A number and its unit in one cell."""
_SIDED = re.compile(r"(?i)(?<![a-z])(l|r|left|right|links|rechts)(?![a-z])")
"""Words of a side beside a number: `10 L`."""
_UNCERTAINTY = re.compile(r"(.*[^a-z])?(sd|std|stdev|sigma|stderr|uncertainty)([^a-z].*)?|.*±.*")
_SEMICOLONS = "semicolons, where a comma is the decimal sign"
SOURCE = "source"
_NOT_COMPONENTS = (SD, SOURCE, "note", "notes", "comment", "comments")

Place = tuple[float, ...]
"""The components of an outcome, and their standard deviation."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Outcomes by episode or by trial."""

    where: str
    """Their source, for messages."""
    episodes: tuple[str, ...]
    """Names of the n rows."""
    values: Points
    """The components, shape (n, k); nan in a row without an outcome."""
    sd: Float[np.ndarray, " n"]
    """Standard deviation of each row's components; 0 where it is not said."""
    names: tuple[str, ...]
    """Names of the k components."""
    units: tuple[str | None, ...]
    """Unit of each component; None if the source names none."""
    sd_unit: str | None = None
    """Unit of `sd`; None for that of the first component, if the source names none."""
    named: bool = True
    """Whether the source names the components."""
    sources: tuple[str, ...] = ()
    """Cells by row of a column `source`, if there is one: whose answers they are."""
    word: str = ""
    """Word in the episodes' names whose number a row may give instead of the one at the end."""
    also: tuple[Key, ...] = ()
    """Other columns that may name the episodes."""
    scale: tuple[float, ...] = ()
    """What each component's numbers were multiplied with."""
    remarks: tuple[str, ...] = ()
    """Warnings for a person."""

    def only(self, names: Sequence[str]) -> Outcomes:
        """Return some components, in that order; InvalidDemonstrationsError if one is missing.

        Directions from the base are components too: `ahead` is x, `left` is y, `right` is -y.
        """
        columns = columns_of(names, self.names)
        missing = [name for name, found in columns.items() if not found]
        for name, found in columns.items():
            if len(found) > 1:
                raise InvalidDemonstrationsError(
                    f"{self.where} has {' and '.join(self.names[i] for i, _ in found)} for {name}: "
                    f"write one column {name}"
                )
        if missing:
            raise InvalidDemonstrationsError(
                f"{self.where} has no column {', '.join(missing)}; it has "
                f"{', '.join(self.names)}: {remedy_for(missing, self.names)}"
            )
        at, signs = zip(*(found[0] for found in columns.values()), strict=True)
        said = [
            f"{self.names[i]} is {'-' * (sign < 0)}{name}"
            for name, i, sign in zip(names, at, signs, strict=True)
            if self.names[i].lower() != name.lower()
        ]
        where = f"{self.where} ({', '.join(said)})" if said else self.where
        units = tuple(self.units[i] for i in at)
        values = self.values[:, list(at)] * np.array(signs, dtype=float)
        kept = replace(self, scale=tuple(self.scale[i] for i in at))
        return replace(kept, where=where, values=values, names=tuple(names), units=units)

    def of(self, episodes: Sequence[str]) -> Outcomes:
        """Return the outcomes of some episodes, by the rule of `outcomes_of`."""
        kept = sorted(rows_of(episodes, self.word, self.episodes).values())
        names = tuple(self.episodes[row] for row in kept)
        sources = tuple(self.sources[row] for row in kept if self.sources)
        values, sd = self.values[kept], self.sd[kept]
        return replace(self, episodes=names, values=values, sd=sd, sources=sources)

    @classmethod
    def of_numbers(cls, where: str, numbers: Mapping[str, Sequence[float]]) -> Outcomes:
        """Outcomes by episode; InvalidDemonstrationsError if they differ in components."""
        lengths = set(map(len, numbers.values())) or {0}
        if len(lengths) != 1 or (0 in lengths and numbers):
            raise InvalidDemonstrationsError(
                f"outcomes in {where} have {sorted(lengths)} components, expected one number for "
                "all, at least 1; complete them"
            )
        n, k = len(numbers), lengths.pop()
        values = np.array([*numbers.values()], dtype=np.float64).reshape(n, k)
        names = tuple(map(str, range(1, k + 1)))
        none, scale = (None,) * k, (1.0,) * k
        return cls(where, (*numbers,), values, np.zeros(n), names, none, named=False, scale=scale)


def table_beside(places: Sequence[Path]) -> Path | None:
    """Return the table of outcomes in one of the folders; None if there is none."""
    files = (path for folder in places if folder.is_dir() for path in folder.iterdir())
    found = (f for f in files if f.name.lower() == OUTCOMES_FILE and f.is_file())
    return min(found, key=lambda path: path.name != OUTCOMES_FILE, default=None)


def write_outcome_table(
    path: Path,
    rows: Mapping[str, Sequence[object]],
    names: Sequence[str],
    units: Sequence[str],
    beside: str = "note",
) -> None:
    """Write a table of outcomes as a CSV: each episode's components, then the column `beside`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    known = zip(names, units, strict=True)
    heads = [f"{name} [{unit}]" if unit in CHANNEL_UNITS else name for name, unit in known]
    writer.writerow(map(as_cell, ["episode", *heads, beside]))
    for episode, cells in rows.items():
        filled = [*cells, *[""] * (len(names) + 1 - len(cells))]
        writer.writerow([as_cell(episode), *filled])
    write(path, text.getvalue())


def keep_places(
    table: Path, places: Mapping[str, Place], form: OutcomeFormat, source: Path | None = None
) -> None:
    """Write places by episode as `import` reads them, with their source; or WorkspaceError."""
    units, beside = form.units, () if source is None else (source.resolve(),)
    rows = {episode: (*map(repr, place), *beside) for episode, place in places.items()}
    heads = (*form.names, SD), (*units, units[0])
    with named_disk_errors(table.parent):
        write_outcome_table(table, rows, *heads, beside=SOURCE if beside else "note")


def key_column(table: Table) -> int | None:
    """Return the column that names recordings: the first called so, or one of texts at the left."""
    bare = [split_unit(name, any_word=True)[0].lower() for name in table.names]
    key = next((i for i, name in enumerate(bare) if name in ROW_COLUMNS), None)
    if key is None and table.named and bare[0] not in _NOT_COMPONENTS and table.is_text(0):
        return 0
    return key


def read_outcomes(path: Path, names: Sequence[str] | None = None) -> Outcomes:
    """Read a table of outcomes, a CSV of any dialect; rows with empty cells are skipped.

    `names` are the wanted components; None takes all columns but the index and notes.
    FileFormatError if it is no such table, or a cell is no number.
    """
    example = "episode,x,y"
    if not path.is_file():
        raise FileFormatError(f"no table at {path}; give the path of a table {example}")
    table = read_table(path, head=ROW_COLUMNS)
    split = [split_unit(name, any_word=True) for name in table.names]
    # `distance_in` is in inches where there is a `distance`; elsewhere `plug_in` is no length.
    wanted = {f"{name}_in": (name, "in") for name in names or ()}
    split = [wanted.get(name, (name, unit)) for name, unit in split]
    lower = [name.lower() for name, _ in split]
    key = key_column(table)
    other = (*_NOT_COMPONENTS, *ROW_COLUMNS)
    texts = [i for i, cells in enumerate(table.cells) if cells and _is_text(cells)]
    columns = [i for i, name in enumerate(lower) if i not in (key, *texts) and name not in other]
    matches = columns_of(names or (), [split[i][0] for i in columns])
    if matches and all(matches.values()):  # others may hold anything
        fitting = {i for each in matches.values() for i, _ in each}
        exact = {i for i in fitting if split[columns[i]][0] in matches}
        columns = [columns[i] for i in sorted(exact if len(exact) == len(matches) else fitting)]
    components = [split[i][0] for i in columns]
    spreads = [
        name
        for i, name in enumerate(lower)
        if name != SD and components and i not in columns and _UNCERTAINTY.fullmatch(name)
    ]
    if spreads:
        raise FileFormatError(
            f"{path} says uncertainties in {', '.join(spreads)}, but a row has one, in a column "
            f"{SD}: write the largest of each row there, and take the others out"
        )
    rest = [name for i, (name, _) in enumerate(split) if i not in columns]
    left_out = other_places(path, matches, rest)
    twice = next((name for name in components if components.count(name) > 1), None)
    if key is None or not columns or twice:
        both = [table.names[i] for i in columns if split[i][0] == twice]
        why = f": {' and '.join(both)} are all {twice}; keep one" * bool(both)
        if key is None and table.named:
            why = ": none of these names the recordings; call the one that does so episode"
        raise FileFormatError(
            f"{path} begins with {','.join(table.names)!r:.200}, expected column names such as "
            f"{example}{why}"
        )
    units = [table.units[i] or split[i][1] for i in columns]
    _doubt_thousands(table, dict(zip(columns, units, strict=True)))
    scale = [base_of(unit)[1] if unit else 1.0 for unit in units]
    sd, source = (lower.index(name) if name in lower else None for name in (SD, SOURCE))
    table = table.rows([r for r in range(len(table)) if any(table.cells[i][r] for i in columns)])
    aside = [i for i in range(len(lower)) if i not in columns and lower[i] not in _NOT_COMPONENTS]
    (head, rows), *also = keys_of(table, key, aside)
    values = np.zeros((len(rows), len(columns)))
    sds = np.zeros(len(rows))
    for row in range(len(rows)):
        values[row] = [_finite(table, row, i) for i in columns]
        if sd is not None and table.cells[sd][row]:
            sds[row] = _finite(table, row, sd)
    sd_unit = None if sd is None else table.units[sd] or split[sd][1]
    return Outcomes(
        str(path),
        rows,
        values * scale,
        sds if sd_unit else scale[0] * sds,
        tuple(components),
        tuple(base_of(unit)[0] if unit else None for unit in units),
        sd_unit,
        sources=() if source is None else tuple(table.cells[source]),
        word=head.split("_")[0],
        also=(*also,),
        scale=tuple(scale),
        remarks=(f"{path}: {', '.join(left_out)} left out",) * bool(left_out),
    )


def _is_text(cells: Sequence[str]) -> bool:
    """Whether a column holds files, or notes: no outcome."""
    notes = any(cells) and not any(map(re.compile(r"\d|(?i:nan|inf)").search, cells))
    return notes or all(map(FILE.fullmatch, cells))


def _doubt_thousands(table: Table, columns: Mapping[int, str | None]) -> None:
    """Refuse `1.488` beside `-302`: is that one and a half, or one and a half thousand?

    So if every number with a decimal sign may be a thousand, and others are whole hundreds, or
    semicolons part cells, beside which a comma is the decimal sign. `columns` are those with units.
    """
    cells = [(table.cells[i][row], row, i) for i in columns for row in range(len(table))]
    signed = [each for each in cells if table.decimal in each[0]]
    beside = [cell for cell, _, _ in cells if _HUNDREDS.fullmatch(cell)]
    if table.delimiter == ";" and table.decimal == ".":
        # Without a unit, 1.488 is in metres, and 1488 would be found to be in millimetres.
        for i, (base, scale) in ((i, base_of(unit)) for i, unit in columns.items() if unit):
            most = float(np.nanmax(np.abs(table.values[:, i]), initial=0.0)) * scale
            beside += [_SEMICOLONS] * is_possible(base, 1000 * most)
    if signed and beside and all(_THOUSANDS.fullmatch(cell) for cell, _, _ in signed):
        cell, row, column = signed[0]
        raise table.unlike(
            row,
            column,
            f" beside {beside[0]}; if that is a thousand, write it without a sign, else write "
            f"{cell}0",
        )


def _finite(table: Table, row: int, column: int) -> float:
    value = float(table.values[row, column])
    if not math.isfinite(value):
        name, cell = table.names[column], table.cells[column][row][:40]
        remedy = "measure that outcome, or empty the whole row's numbers"
        if re.search(r"\d", cell):
            remedy = "write a plain number there"
            if _SIDED.search(cell):
                remedy += ", with the sign that the letter says: left is positive, right negative"
        if (said := _WITH_UNIT.fullmatch(cell)) and (unit := known_unit(said[2])):
            bare, head = split_unit(name, any_word=True)
            remedy = f"write {said[1]}, and the unit in the head: {bare} [{unit}]"
            if head not in (None, unit):
                remedy = f"write numbers in {head}, without units"
        raise table.unlike(row, column, f", expected a finite number; {remedy}")
    return value


def places_of(episodes: Sequence[str], outcomes: Outcomes) -> dict[str, Place]:
    """Return where each episode's object landed, if that is known, by the rule of `outcomes_of`."""
    return {
        episode: (*outcomes.values[row].tolist(), float(outcomes.sd[row]))
        for episode, row in rows_of(episodes, outcomes.word, outcomes.episodes).items()
        if np.all(np.isfinite(outcomes.values[row]))
    }


def beside_tables(
    found: Outcomes, own: Path | None, others: Sequence[Path]
) -> tuple[Outcomes, tuple[Ambiguity, ...]]:
    """Remark on tables beside their own that differ; ask about an only one not called so."""
    if own is None and len(others) == 1:
        what = f"{others[0]} has a row for each recording: it looks like the table of outcomes"
        return found, (Ambiguity(what, shlex.join(["--outcomes", str(others[0])])),)
    unlike = [str(other) for other in others if own is not None and _differs(other, found)]
    said = "has other numbers for these recordings: if it is meant,"
    each = (f"{other} {said} {shlex.join(['--outcomes', other])}" for other in unlike)
    return replace(found, remarks=(*found.remarks, *each)), ()


def _differs(path: Path, outcomes: Outcomes) -> bool:
    """Whether a table has the same components, and other numbers for a row of these outcomes."""
    places, names = dict[str, Place](), outcomes.names
    with suppress(FileFormatError, InvalidDemonstrationsError):
        places = places_of(outcomes.episodes, read_outcomes(path, names).only(names))
    each = zip(outcomes.episodes, outcomes.values, strict=True)
    return any(e in places and not np.allclose(places[e][:-1], own) for e, own in each)


def missing_outcomes(episodes: Sequence[str], outcomes: Outcomes) -> list[str]:
    """Return the episodes that a table lacks, by the rule of `outcomes_of`."""
    there = rows_of(episodes, outcomes.word, outcomes.episodes)
    return [episode for episode in episodes if episode not in there]


def check_rows(
    outcomes: Outcomes, chosen: Sequence[str], there: Sequence[str], *, others: bool = False
) -> Outcomes:
    """Check that every row is of one of the `chosen` episodes, or of another that is `there`.

    With `others`, rows of none are no mistake unless the table counts from another number. Returns
    the outcomes with the `episodes` and the `word` that match. InvalidDemonstrationsError if a row
    is of none, or as in `telling_column`.
    """
    keys = (outcomes.word, outcomes.episodes), *outcomes.also
    word, rows = telling_column(keys, chosen, there, outcomes.where)
    outcomes = replace(outcomes, word=word, episodes=rows)
    picked = {rows[row] for row in rows_of(chosen, outcomes.word, outcomes.episodes).values()}
    known = {*there} | picked | {number_of(name, word) for name in there} - {""}
    unknown = [name for name in rows if name not in known and digits_at_end(name) not in known]
    if unknown and {*outcomes.names} & {*there}:
        raise InvalidDemonstrationsError(
            f"{outcomes.where} has a row for {listed(unknown)} and a column for each episode; "
            "exchange rows and columns"
        )
    if unknown and (not others or how_to_renumber(word, there, rows)):
        raise InvalidDemonstrationsError(
            f"{outcomes.where} names episodes {listed(unknown)} that were not found (there are "
            f"{listed(there)}); {how_to_renumber(word, there, rows)}correct the names, or "
            "take out the rows of what was not recorded"
        )
    return outcomes


def in_order(source: Path, motions: Sequence[str], outcomes: Outcomes, advice: str) -> Outcomes:
    """Match outcomes to the motions that one file was cut into, by their numbers or their order.

    InvalidDemonstrationsError, with the advice, if they are not as many.
    """
    rows = outcomes.episodes
    if len(motions) != len(rows):
        remedy = "leave out those without one (--leave-out), or cut at other rests (--rests)"
        raise InvalidDemonstrationsError(
            f"{source} was cut into {len(motions)} motions, and {outcomes.where} has {len(rows)} "
            f"outcomes: name each outcome's motion ({motions[0]}); {advice or remedy}"
        )
    keys = [(outcomes.word, rows), *(key for key in outcomes.also if key[0] in ROW_COLUMNS)]
    orders = [order_of(cells) for _, cells in keys]
    refuse_unlike(outcomes.where, keys, [dict(zip(motions, o, strict=True)) for o in orders])
    return replace(outcomes, episodes=tuple(motions[i] for i in orders[0]))


def outcomes_of(
    episodes: Sequence[str],
    outcomes: Outcomes,
    advice: Callable[[Sequence[str]], str] = lambda missing: "",
) -> tuple[Points, Points]:
    """Return each episode's outcome, and its standard deviation, each (N, k).

    Episodes are matched by name, else by the number behind the outcomes' `word` or at the end:
    `3` is `demo_003`. InvalidDemonstrationsError, with the `advice`, if one is missing or not
    finite.
    """
    there = outcomes.episodes
    if missing := missing_outcomes(episodes, outcomes):
        back = advice(missing)
        renumber = how_to_renumber(outcomes.word, episodes, there)
        raise InvalidDemonstrationsError(
            f"no outcome for episodes {listed(missing)} in {outcomes.where} (it has "
            f"{listed(there) or 'none'}); {renumber}measure and add them, or "
            f"leave those episodes out, --leave-out {shlex.join(missing)}{'; ' * bool(back)}{back}"
        )
    rows = list(rows_of(episodes, outcomes.word, outcomes.episodes).values())
    values = outcomes.values[rows]
    for episode, row in zip(episodes, values, strict=True):
        if not np.all(np.isfinite(row)):
            raise InvalidDemonstrationsError(
                f"the outcome of episode {episode} is {row.tolist()}, expected finite numbers; "
                "measure it, or leave that episode out"
            )
    return values, np.tile(outcomes.sd[rows, None], values.shape[1])

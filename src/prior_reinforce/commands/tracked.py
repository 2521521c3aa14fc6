"""Trials told from a table, such as a tracker writes: a row a trial, where the object ended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prior_reinforce.arrays import Point
from prior_reinforce.bench.importing.tables import Table, read_tables
from prior_reinforce.bench.importing.units import (
    CHANNEL_UNITS,
    conversion,
    guess_unit,
    split_unit,
)
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands.reading import plausible, read_seen
from prior_reinforce.errors import FileFormatError, InvalidFeedbackError
from prior_reinforce.readings import Reading
from prior_reinforce.session.session import Session
from prior_reinforce.session.trials import Stage

_TRIAL, _SAID, _HIT = ("trial", "trial_id", "number"), "said", "hit"
_ANSWERS = {"yes": True, "y": True, "true": True, "1": True, "hit": True} | {
    "no": False, "n": False, "false": False, "0": False, "miss": False,
}  # fmt: skip
_SAME = 1e-4
"""Errors that differ by less, in the outcome's units, are one reading: a table may be rounded."""


@dataclass(frozen=True, eq=False)
class Row:
    """What a table says of one trial."""

    number: int
    seen: Reading | Point | None
    """As `Session.tell` takes it."""
    hit: bool | None


def rows_to_tell(path: Path, workspace: Workspace, session: Session) -> list[Row]:
    """Return what is to be told of a table: rows of trials that wait for it.

    Rows of trials that were told so already, or voided, and rows without a number, are passed over.

    Args:
        path: A CSV of any dialect or a workbook: `trial`, a column a component with where the
            object ended in the table frame (`x_cm`, `y [mm]`), or `said` in words; `hit` if that
            was seen.
        workspace: What the components are.
        session: Its trials.

    Raises:
        FileFormatError: No such table, or a cell that cannot be read.
        InvalidFeedbackError: A row of a trial that was told otherwise, or that cannot be meant.
        TrialStateError: A row of a trial that was never asked for.
    """
    if not path.is_file():
        raise FileFormatError(f"no table at {path}; give a CSV with the columns trial,x,y")
    table = read_tables(path)[0]
    lower = [name.lower() for name in table.names]
    trial = next((i for i, name in enumerate(lower) if name in _TRIAL), None)
    if trial is None:
        raise FileFormatError(
            f"{path} begins with {','.join(table.names)!r}, expected column names such as trial,x,y"
        )
    found = []
    for i in range(len(table)):
        row = table.rows([i])
        number = float(row.numbers(trial)[0])
        if not number.is_integer():
            raise FileFormatError(
                f"{row.where}, line {row.lines[0]}: trial is {number:g}, expected its number"
            )
        seen, hit = _seen(row, lower, workspace, session, int(number))
        if seen is None and hit is None:
            continue
        told = session.trial(int(number))
        if told.stage is Stage.VOIDED:
            continue
        if told.stage is not Stage.TOLD:
            found.append(Row(int(number), seen, hit))
        elif not _is_said(told.error_seen, seen):
            raise InvalidFeedbackError(
                f"{row.where}, line {row.lines[0]}: trial {told.number} was told otherwise; "
                f"correct it with: prior-reinforce amend {workspace.folder} {told.number}, or drop "
                "that row"
            )
    return found


def _seen(
    row: Table, lower: list[str], workspace: Workspace, session: Session, number: int
) -> tuple[Reading | Point | None, bool | None]:
    """What one row says; nothing where its cells are empty."""
    hit = None
    if _HIT in lower and (text := row.texts(lower.index(_HIT))[0].lower()):
        if text not in _ANSWERS:
            raise FileFormatError(
                f"{row.where}, line {row.lines[0]}: hit is {text!r}, expected yes or no; mend it"
            )
        hit = _ANSWERS[text]
    if _SAID in lower and (said := row.texts(lower.index(_SAID))[0]):
        return read_seen(workspace, said), hit
    split = [split_unit(name, CHANNEL_UNITS) for name in row.names]
    names, units = workspace.manifest.outcome_names, workspace.manifest.outcome_units
    columns = [next((i for i, (n, _) in enumerate(split) if n == name), None) for name in names]
    there = [i for i in columns if i is not None]
    if not any(row.texts(i)[0] for i in there):
        if len(there) < len(names) and _SAID not in lower:
            raise FileFormatError(
                f"{row.where} has no column for each of {', '.join(names)}, nor one called said; "
                f"it has {', '.join(row.names)}: add or rename one"
            )
        return None, hit
    if len(there) < len(names):
        raise FileFormatError(
            f"{row.where} has no column for each of {', '.join(names)}; it has "
            f"{', '.join(row.names)}: add it"
        )
    goal = session.goals[session.trial(number).goal_number - 1].goal
    place = np.zeros(len(names))
    for j, i in enumerate(there):
        value, said_unit = float(row.numbers(i)[0]), row.units[i] or split[i][1]
        looks = guess_unit(units[j], abs(value))
        if said_unit is None and looks != units[j]:
            raise InvalidFeedbackError(
                f"{row.where}, line {row.lines[0]}: {names[j]} at {value:g} {units[j]} looks like "
                f"{looks}; write the unit into the column's name, such as {names[j]} [{looks}]"
            )
        place[j] = value * conversion(said_unit or units[j], units[j], names[j])
    return plausible(workspace, place - goal), hit


def _is_said(error: Point | None, seen: Reading | Point | None) -> bool:
    """Whether a trial was told what a row says."""
    if error is None or seen is None:
        return True
    numbers = seen.error_seen if isinstance(seen, Reading) else seen
    return bool(np.allclose(error, numbers, rtol=0, atol=_SAME))

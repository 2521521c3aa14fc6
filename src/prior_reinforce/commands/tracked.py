"""Results of trials from a table, such as a tracker writes: one row for each trial."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arrays import Point
from prior_reinforce.bench.importing.outcomes import Outcomes, in_units, read_outcomes
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands.reading import plausible, read_seen
from prior_reinforce.errors import FileFormatError, InvalidFeedbackError
from prior_reinforce.readings import Reading
from prior_reinforce.session.trials import Stage, Trial

_TRIAL, _SAID, _HIT = ("trial", "trial_id", "number"), "said", "hit"
_ANSWERS = {"yes": True, "y": True, "true": True, "1": True, "hit": True} | {
    "no": False, "n": False, "false": False, "0": False, "miss": False,
}  # fmt: skip
_SAME = 1e-4
"""Errors that differ by less, in the outcome's units, are one reading: a table may be rounded."""


@dataclass(frozen=True, eq=False)
class Row:
    """One trial's row in a table."""

    number: int
    seen: Reading | Point | None
    """As `Session.tell` takes it."""
    hit: bool | None


def rows_to_tell(path: Path, workspace: Workspace) -> list[Row]:
    """Return the rows of a table whose trials still wait for a result.

    Rows of voided trials, and of trials with this very result, are skipped.

    Args:
        path: A CSV of any dialect or a workbook: `trial`, a column for each component with where
            the object ended in the table frame (`x_cm`, `y [mm]`), or `said` in words; `hit` if
            that was seen.
        workspace: Names and units of the components, and the trials.

    Raises:
        FileFormatError: No such table, or a cell that cannot be read.
        InvalidFeedbackError: An implausible row, or a trial that has another result already.
        TrialStateError: A row of a trial that was never asked for.
    """
    names, units = workspace.manifest.outcome_names, workspace.manifest.outcome_units
    table = read_outcomes(path, names, index=_TRIAL, texts=(_SAID, _HIT))
    if set(names) <= set(table.names):
        table, ambiguities = in_units(table.only(names), units, None)
        for one in ambiguities:
            raise InvalidFeedbackError(
                f"{one.what}; write the unit into the column's name, such as {names[0]} [cm]"
            )
    found = []
    for name, row in table.frame.iterrows():
        where = f"{path}, trial {name}"
        text = str(name)
        try:
            number = int(text)
        except ValueError:
            raise FileFormatError(f"{where}: trial is {text[:40]}, expected its number") from None
        told = workspace.state.trial(number)
        seen, hit = _seen(where, row, table, workspace, told)
        if told.stage is Stage.VOIDED:
            continue
        if told.stage is not Stage.TOLD:
            found.append(Row(told.number, seen, hit))
        elif not _is_said(told.error_seen, seen):
            raise InvalidFeedbackError(
                f"{where} was told otherwise; correct it with: prior-reinforce amend "
                f"{workspace.folder} {told.number}, or drop that row"
            )
    return found


def _seen(
    where: str, row: Any, table: Outcomes, workspace: Workspace, trial: Trial
) -> tuple[Reading | Point | None, bool | None]:
    """The error in one row, and whether it hit."""
    names, goal, hit = workspace.manifest.outcome_names, workspace.state.goal_of(trial), None
    if text := str(row.get(_HIT, "")).lower():
        if text not in _ANSWERS:
            raise FileFormatError(f"{where}: hit is {text[:40]!r}, expected yes or no; mend it")
        hit = _ANSWERS[text]
    if said := row.get(_SAID, ""):
        return read_seen(said, goal), hit
    place = np.array([row.get(name, np.nan) for name in names], dtype=np.float64)
    if np.all(np.isnan(place)) and hit is not None:
        return None, hit
    if np.any(np.isnan(place)):
        raise FileFormatError(
            f"{where}: it has {', '.join(table.names)}, and no column for each of "
            f"{', '.join(names)}, nor one called said; add or rename one"
        )
    return plausible(place - goal.goal, goal), hit


def _is_said(error: Point | None, seen: Reading | Point | None) -> bool:
    """Whether a trial already has the result in a row."""
    if error is None or seen is None:
        return True
    numbers = seen.error_seen if isinstance(seen, Reading) else seen
    return bool(np.allclose(error, numbers, rtol=0, atol=_SAME))

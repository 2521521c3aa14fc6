"""A trial's result: words, numbers, that it hit, or a row of a table that a tracker writes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro

from prior_reinforce.arrays import Point, as_error
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands.base import OnWorkspace, Words, trial_and_rest
from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidFeedbackError
from prior_reinforce.readings import Reading
from prior_reinforce.session.trials import Goal, Stage, Trial
from prior_reinforce.wording import error_example, from_words, read_numbers, read_uncertain_place

if TYPE_CHECKING:
    from prior_reinforce.bench.importing.outcomes import Outcomes

_IMPLAUSIBLE = {"m": (1.0, "centimetres"), "rad": (np.pi, "degrees")}
"""Ours: bare numbers from there on are of another unit far more often than a miss by as much."""
_TRIAL, _SAID, _HIT = ("trial", "trial_id", "number"), "said", "hit"
_ANSWERS = {"yes": True, "y": True, "true": True, "1": True, "hit": True} | {
    "no": False, "n": False, "false": False, "0": False, "miss": False,
}  # fmt: skip
_SAME = 1e-4
"""Errors that differ by less, in the outcome's units, are one reading: a table may be rounded."""
Result = tuple[Reading | Point | None, bool | None]
"""What was seen of a trial, and whether it hit, as `Session.tell` takes them."""


@dataclass(frozen=True)
class Seen(OnWorkspace):
    """A trial and its result."""

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] [TRIAL] [SEEN]")] = ()
    """The workspace (the current folder's if not given), the trial's number (the one that waits if
    not given), and what was seen, outcome minus goal: "5cm long, 2cm left", "5.2 +- 0.3 cm long",
    "long", "hit", "miss"; or a number for each component, in its own unit: 0.05 -0.02,
    0.05+-0.003 0.02+-0.003."""
    error: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="SEEN")] = None
    """What was seen, as a named option."""
    outcome: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="PLACE")] = None
    """Or where the object ended, in the table frame, said as a goal is: 0.92 0.10, 92cm 10cm,
    "92cm ahead, 10cm left", or measured: "92cm 10cm +- 2mm"."""
    hit: bool = False
    """The goal was reached, whatever the distance says."""
    miss: bool = False
    """The goal was not reached, whatever the distance says."""

    takes_words = True

    def read(self, workspace: Workspace, words: tuple[str, ...]) -> tuple[int, Result]:
        """Return the trial's number and what was seen of it."""
        number, seen = trial_and_rest(workspace, words)
        given = [bool(seen), self.error is not None, self.outcome is not None]
        said = any(given) or self.hit or self.miss
        if sum(given) > 1 or not said or (self.hit and self.miss):
            raise ConfigurationError(
                "say what was seen: words or numbers, or --error or --outcome, with --hit or "
                "--miss if that was seen as well, or one of those alone"
            )
        hit = True if self.hit else False if self.miss else None
        goal = workspace.state.goal_of(workspace.state.trial(number))
        if self.outcome is not None:
            return number, (read_landed(" ".join(self.outcome), goal), hit)
        said_words = seen or self.error
        error = None if said_words is None else read_seen(" ".join(said_words), goal)
        return number, (error, hit)


def read_seen(text: str, goal: Goal) -> Reading | Point:
    """Read outcome minus goal, in the outcome's units, from words or numbers.

    Raises:
        InvalidFeedbackError: It is neither, or another number of numbers.
    """
    k, numbers = len(goal.units), read_numbers(text)
    if numbers is None or (k > 1 and text == "0"):  # a lone 0 says: on the goal
        return from_words(text, goal.names, goal.units, goal.least_sd)
    if len(numbers) != k:
        raise InvalidFeedbackError(
            f"an error needs {k} numbers, got {len(numbers)}: outcome minus goal in "
            f"{', '.join(goal.names)}{_or_words(goal)}"
        )
    error = plausible(np.array([number for number, _ in numbers]), goal)
    sds = [sd for _, sd in numbers if sd is not None]
    if not sds:
        return error
    if len(sds) < k:
        raise InvalidFeedbackError(
            f"{text!r} has +- for {len(sds)} of {k} numbers; give all or none"
        )
    return Reading.measured(as_error(error, k), np.array(sds))


def read_landed(text: str, goal: Goal) -> Reading | Point:
    """Read outcome minus goal, in the outcome's units, from where the object ended.

    Raises:
        InvalidFeedbackError: It is no place.
    """
    k, numbers = len(goal.units), read_numbers(text)
    if numbers is not None and len(numbers) != k:
        raise InvalidFeedbackError(
            f"--outcome needs {k} numbers, got {len(numbers)}: {', '.join(goal.names)}"
        )
    if numbers is not None:
        plausible(np.array([number for number, _ in numbers]) - goal.goal, goal)
    place, sd = read_uncertain_place(text, goal.names, goal.units)
    return Reading.measured(place - goal.goal, sd) if sd else place - goal.goal


def plausible(error: Point, goal: Goal) -> Point:
    """Return the error, unless it looks like centimetres or degrees."""
    for value, unit in zip(error, goal.units, strict=True):
        least, looks = _IMPLAUSIBLE.get(unit, (np.inf, ""))
        if least <= abs(value) < np.inf:
            raise InvalidFeedbackError(
                f"an error of {abs(value):g} {unit} looks like {looks}; say the unit"
                f"{_or_words(goal)}"
            )
    return error


def _or_words(goal: Goal) -> str:
    example = error_example(goal.names, goal.units)
    return f', or words: "{example}"' if example else ""


def rows_to_tell(path: Path, workspace: Workspace) -> list[tuple[int, Result]]:
    """Return what a table says of the trials that still wait for a result, each by its number.

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
    # Here, for `tell` of a single trial answers at once.
    from prior_reinforce.bench.importing.outcomes import in_units, read_outcomes

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
        where, text = f"{path}, trial {name}", str(name)
        try:
            told = workspace.state.trial(int(text))
        except ValueError:
            raise FileFormatError(f"{where}: trial is {text[:40]}, expected its number") from None
        seen, hit = _read_row(where, row, table, workspace, told)
        if told.stage is Stage.VOIDED:
            continue
        if told.stage is not Stage.TOLD:
            found.append((told.number, (seen, hit)))
        elif not _is_said(told.error_seen, seen):
            raise InvalidFeedbackError(
                f"{where} was told otherwise; correct it with: prior-reinforce amend "
                f"{workspace.folder} {told.number}, or drop that row"
            )
    return found


def _read_row(where: str, row: Any, table: Outcomes, workspace: Workspace, trial: Trial) -> Result:
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

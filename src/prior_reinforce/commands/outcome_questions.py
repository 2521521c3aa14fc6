"""Prompt for where each recorded object landed, since no recording format holds it.

Every answer is on disk before the next question, and used again when the same source is imported
again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from pathlib import Path

import numpy as np

from prior_reinforce.arm.recordings.outcome_units import in_units
from prior_reinforce.arm.recordings.outcomes import (
    OUTCOMES_FILE,
    Outcomes,
    Place,
    keep_places,
    places_of,
    read_outcomes,
)
from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.commands.questions import answer_to, until_read
from prior_reinforce.errors import InvalidDemonstrationsError, PriorReinforceError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.parsing import read_uncertain_place
from prior_reinforce.terminal import plain
from prior_reinforce.units import factor
from prior_reinforce.wording import in_words, say_length, say_place

_REACH = 1.0
"""How far from the base objects land, in [m], where nobody has shown it. Ours: an arm's reach."""
_SKIP, _BACK = ("skip", "s"), ("back", "b")


def ask_for_outcomes(
    folder: Path, source: Path, known: Outcomes, selection: Selection, form: OutcomeFormat
) -> Outcomes | None:
    """Prompt for the outcomes that no table has; answers are kept in the folder of the workspace.

    Returns all outcomes known now, in the units of `form`, without skipped episodes; None if
    nothing was missing. InvalidDemonstrationsError if the input ended: the answers so far are kept;
    WorkspaceError if the disk is full, or the folder read-only.
    """
    outcomes = places_of(selection.episodes, known)
    missing = [episode for episode in selection.episodes if episode not in outcomes]
    if not missing:
        return None
    table, before = _typed_before(folder, source, form)
    again = {episode: before[episode] for episode in missing if episode in before}
    outcomes |= again
    if again:
        print(plain(f"typed before, in {table}: {', '.join(again)}"))
    missing = [episode for episode in missing if episode not in again]
    if missing:
        print(_explanation(form, missing))
    number = 0
    while number < len(missing):
        episode = missing[number]
        question = plain(f"{episode} ({number + 1} of {len(missing)}): ")
        try:
            answer = ask_place(partial(answer_to, question), form, *_SKIP, *_BACK)
        except EOFError as error:
            raise InvalidDemonstrationsError(
                f"no outcome for episode {episode}; import again to go on (what was typed is kept "
                f"in {table}), or leave it out with --leave-out"
            ) from error
        if answer in _BACK:
            number = max(0, number - 1)
            continue
        if isinstance(answer, str):
            outcomes.pop(episode, None)
        else:
            outcomes[episode] = answer
            spread = answer[-1]
            give = f", give or take {say_length(spread, form)}" if spread else ""
            print(f"  {say_place(answer[:-1], form)}{give}")
        keep_places(table, outcomes, form, source)
        number += 1
    keep_places(table, outcomes, form, source)
    return _read(table, form)


def ask_place(ask: Callable[[], str], form: OutcomeFormat, *words: str) -> Place | str:
    """Ask until the answer is a place with its standard deviation (0 if none), or one of `words`.

    EOFError if `ask` gets no answer.
    """
    near = [_REACH * (factor("m", unit) or 0.0) for unit in form.units]

    def read(text: str) -> Place | str:
        said = text.strip()
        if said.lower() in words:
            return said.lower()
        place, sd = read_uncertain_place(said, form, near)
        return (*place.tolist(), sd)

    return until_read(ask, read)


def _typed_before(folder: Path, source: Path, form: OutcomeFormat) -> tuple[Path, dict[str, Place]]:
    """The table of a source's answers, and what it already holds."""
    for number in count(1):
        table = folder / (OUTCOMES_FILE if number == 1 else f"outcomes-{number}.csv")
        if not table.is_file():
            return table, {}
        try:
            kept = _read(table, form)
        except PriorReinforceError:
            continue  # edited by hand, or of another task: prompt again, for another table
        if {*kept.sources} == {str(source.resolve())}:
            rows = np.column_stack([kept.values, kept.sd]).tolist()
            return table, dict(zip(kept.episodes, map(tuple, rows), strict=True))
    raise AssertionError("numbers do not end")


def _read(table: Path, form: OutcomeFormat) -> Outcomes:
    found = read_outcomes(table, form.names)
    if found.names != form.names or not found.sources:
        raise InvalidDemonstrationsError(f"{table} has other columns; name it with --outcomes")
    # Answers were checked when they were typed.
    return in_units(found, form.units, None)[0]


def _explanation(form: OutcomeFormat, missing: Sequence[str]) -> str:
    names, k = " ".join(form.names), form.outcome_dim
    units = ", ".join(dict.fromkeys(form.units))
    unit, words = "cm" if units == "m" else "", ""
    if in_words(form):
        example = ("92cm ahead", "10cm left", "5cm up")[:k]
        numbers = " ".join(term.split()[0] for term in example)
        words = f', "{numbers}", or words such as "{", ".join(example)}"'
    return (
        f"{len(missing)} episodes have no outcome: where did the object land, in the table frame?\n"
        f"type {names} [{units}]{words}; +- 2{unit} behind it says how "
        "uncertain it is; skip leaves an episode out, back goes back one"
    )

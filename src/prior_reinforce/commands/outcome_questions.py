"""Asking a person where each recorded object landed, since no recording format says.

Every answer is on disk before the next question: what was typed for a source is taken again when
the same source is imported again.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from prior_reinforce.bench.importing import Recording
from prior_reinforce.bench.importing.outcomes import (
    OUTCOMES_FILE,
    Outcomes,
    headed,
    outcomes_of,
    uncertainty_of,
)
from prior_reinforce.bench.workspace.manifest import Manifest
from prior_reinforce.errors import (
    InvalidDemonstrationsError,
    InvalidFeedbackError,
)
from prior_reinforce.files import named_disk_errors, write
from prior_reinforce.wording import in_words, plain, read_place, say_length, say_place

_SKIP, _BACK = ("skip", "s"), ("back", "b")
_SOURCE = "source"


@dataclass(frozen=True)
class Answers:
    """What is known of the outcomes after the questions."""

    table: Path
    """Where all of it is written."""
    skipped: tuple[str, ...]
    """Episodes that nobody could say anything of."""


def ask_for_outcomes(
    folder: Path, source: Path, known: Outcomes, recordings: Sequence[Recording], manifest: Manifest
) -> Answers | None:
    """Ask for the outcomes that no table has.

    Args:
        folder: Of the workspace, where what is typed is kept.
        source: What the recordings were read from.
        known: Outcomes of a table, in the manifest's units.
        recordings: Of the episodes in question.
        manifest: What an outcome is.

    Returns:
        None where nothing was missing.

    Raises:
        InvalidDemonstrationsError: The person stopped typing; the answers so far are kept.
        WorkspaceError: The disk is full, or the folder read-only.
    """
    outcomes: dict[str, tuple[float, ...]] = {}  # the components, and how uncertain they are
    for recording in recordings:
        try:
            found = outcomes_of([recording], known, partial=True)[0]
        except InvalidDemonstrationsError:
            continue
        sd = uncertainty_of([recording], known)[0, 0]
        outcomes[recording.episode] = (*found.tolist(), float(sd))
    missing = [r.episode for r in recordings if r.episode not in outcomes]
    if not missing:
        return None
    table = _table_of(folder, source)
    before = _typed_before(table, source, manifest)
    again = [episode for episode in missing if episode in before]
    outcomes |= {episode: before[episode] for episode in again}
    if again:
        print(plain(f"typed before, in {table}: {', '.join(again)}"))
    missing = [episode for episode in missing if episode not in before]
    if missing:
        print(_explanation(manifest, missing))
    skipped: set[str] = set()
    number = 0
    while number < len(missing):
        episode = missing[number]
        question = plain(f"{episode} ({number + 1} of {len(missing)}): ")
        answer = _ask(question, episode, table, manifest)
        if answer == _BACK[0]:
            number = max(0, number - 1)
            continue
        if isinstance(answer, str):
            skipped.add(episode)
            outcomes.pop(episode, None)
        else:
            skipped.discard(episode)
            outcomes[episode] = answer
            *place, sd = answer
            said = say_place(place, manifest.outcome_names, manifest.outcome_units)
            give = f", give or take {say_length(sd, manifest.outcome_units)}" if sd else ""
            print(f"  {said}{give}")
        _keep(table, source, outcomes, manifest)
        number += 1
    _keep(table, source, outcomes, manifest)
    return Answers(table, tuple(episode for episode in missing if episode in skipped))


def _table_of(folder: Path, source: Path) -> Path:
    """Where what is typed of a source is kept: a table of its own, since another's stays."""
    for number in count(1):
        table = folder / (OUTCOMES_FILE if number == 1 else f"outcomes-{number}.csv")
        if not table.is_file():
            return table
        with table.open(newline="", encoding="utf-8", errors="replace") as file:
            sources = {row.get(_SOURCE) for row in csv.DictReader(file)}
        if sources == {str(source.resolve())}:
            return table
    raise AssertionError("numbers do not end")


def _keep(
    table: Path, source: Path, outcomes: Mapping[str, tuple[float, ...]], manifest: Manifest
) -> None:
    """Write all that is known of a source to the table in the workspace."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["episode", *_heads(manifest), _SOURCE])
    for episode, values in outcomes.items():
        writer.writerow([episode, *map(repr, values), source.resolve()])
    with named_disk_errors(table.parent):
        write(table, text.getvalue())


def _typed_before(table: Path, source: Path, manifest: Manifest) -> dict[str, tuple[float, ...]]:
    """Outcomes that were typed for the same source."""
    if not table.is_file():
        return {}
    *names, sd = _heads(manifest)  # the first tables had no such column
    with table.open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row.get(_SOURCE) == str(source.resolve())]
    try:
        return {
            row["episode"]: (*(float(row[name]) for name in names), float(row.get(sd) or 0.0))
            for row in rows
        }
    except (KeyError, TypeError, ValueError):
        return {}  # changed by hand, or of another task: asked for again


def _heads(manifest: Manifest) -> list[str]:
    """What the columns of numbers are called."""
    units = manifest.outcome_units
    return headed((*manifest.outcome_names, "sd"), (*units, units[0]))


def _explanation(manifest: Manifest, missing: Sequence[str]) -> str:
    names = " ".join(manifest.outcome_names)
    units = ", ".join(dict.fromkeys(manifest.outcome_units))
    unit = "cm" if units == "m" else ""
    words = ""
    if in_words(manifest.outcome_units):
        k = len(manifest.outcome_names)
        example = ("92cm ahead", "10cm left", "5cm up")[:k]
        words = f', "{" ".join(("92cm", "10cm", "5cm")[:k])}", or words such as '
        words += f'"{", ".join(example)}"'
    return (
        f"{len(missing)} episodes have no outcome: where did the object land, in the table frame?\n"
        f"type {names} [{units}]{words}; +- 2{unit} behind it says how "
        "uncertain it is; skip leaves an episode out, back goes back one"
    )


def _ask(question: str, episode: str, table: Path, manifest: Manifest) -> tuple[float, ...] | str:
    """A place and how uncertain it is, `skip` or `back`."""
    while True:
        try:
            text = input(question).strip()
        except EOFError as error:
            raise InvalidDemonstrationsError(
                f"no outcome for episode {episode}; import again to go on (what was typed is kept "
                f"in {table}), or leave it out with --leave-out"
            ) from error
        for words in (_SKIP, _BACK):
            if text.lower() in words:
                return words[0]
        try:
            said, *give = re.split(r"\+-|\+/-|±", text, maxsplit=1)
            place = read_place(said, manifest.outcome_names, manifest.outcome_units)
            unit = manifest.outcome_units[:1]
            sd = abs(read_place(give[0], ("+-",), unit)[0]) if give else 0.0
            if sd and len(set(manifest.outcome_units)) > 1:
                raise InvalidFeedbackError("+- is for components of one unit; leave it out")
            return (*place.tolist(), float(sd))
        except InvalidFeedbackError as error:
            print(error)

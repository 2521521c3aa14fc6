"""Prompt for where each recorded object landed, since no recording format holds it.

Every answer is on disk before the next question, and used again when the same source is imported
again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import count
from pathlib import Path

from prior_reinforce.bench.importing.outcomes import (
    OUTCOMES_FILE,
    SD,
    Outcomes,
    in_units,
    outcomes_of,
    read_outcomes,
    write_outcome_table,
)
from prior_reinforce.bench.importing.selection import Selection
from prior_reinforce.bench.workspace.manifest import Manifest
from prior_reinforce.commands.base import answer_to
from prior_reinforce.errors import (
    InvalidDemonstrationsError,
    InvalidFeedbackError,
    PriorReinforceError,
)
from prior_reinforce.files import named_disk_errors
from prior_reinforce.wording import in_words, plain, read_uncertain_place, say_length, say_place

_SKIP, _BACK = ("skip", "s"), ("back", "b")
_SOURCE = "source"
Place = tuple[float, ...]
"""The components of an outcome, and their standard deviation."""


def ask_for_outcomes(
    folder: Path, source: Path, known: Outcomes, selection: Selection, manifest: Manifest
) -> Outcomes | None:
    """Prompt for the outcomes that no table has.

    Args:
        folder: The workspace, where answers are kept.
        source: The source of the recordings.
        known: Outcomes of a table, in the manifest's units.
        selection: The episodes in question.
        manifest: Names and units of an outcome.

    Returns:
        All outcomes known now, without skipped episodes; None if nothing was missing.

    Raises:
        InvalidDemonstrationsError: The input ended; the answers so far are kept.
        WorkspaceError: The disk is full, or the folder read-only.
    """
    outcomes: dict[str, Place] = {}
    for episode in selection.episodes:
        with suppress(InvalidDemonstrationsError):
            place, sd = outcomes_of([episode], known, partial=True)
            outcomes[episode] = (*place[0].tolist(), float(sd[0, 0]))
    missing = [episode for episode in selection.episodes if episode not in outcomes]
    if not missing:
        return None
    table, before = _typed_before(folder, source, manifest)
    again = {episode: before[episode] for episode in missing if episode in before}
    outcomes |= again
    if again:
        print(plain(f"typed before, in {table}: {', '.join(again)}"))
    missing = [episode for episode in missing if episode not in again]
    if missing:
        print(_explanation(manifest, missing))
    number = 0
    while number < len(missing):
        episode = missing[number]
        question = plain(f"{episode} ({number + 1} of {len(missing)}): ")
        try:
            answer = ask_place(partial(answer_to, question), manifest, *_SKIP, *_BACK)
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
            names, units, spread = manifest.outcome_names, manifest.outcome_units, answer[-1]
            give = f", give or take {say_length(spread, units)}" if spread else ""
            print(f"  {say_place(answer[:-1], names, units)}{give}")
        keep_places(table, outcomes, manifest, source)
        number += 1
    keep_places(table, outcomes, manifest, source)
    return _read(table, manifest)


def ask_place(ask: Callable[[], str], manifest: Manifest, *words: str) -> Place | str:
    """Ask until the answer is a place with its standard deviation (0 if none), or one of `words`.

    Raises:
        EOFError: `ask` gets no answer.
    """
    while True:
        text = ask().strip()
        if text.lower() in words:
            return text.lower()
        try:
            place, sd = read_uncertain_place(text, manifest.outcome_names, manifest.outcome_units)
        except InvalidFeedbackError as error:
            print(error, flush=True)
        else:
            return (*place.tolist(), sd)


def keep_places(
    table: Path, places: Mapping[str, Place], manifest: Manifest, source: Path | None = None
) -> None:
    """Write a table of places by episode, as `import` reads it, and the source of the episodes."""
    units, beside = manifest.outcome_units, () if source is None else (source.resolve(),)
    rows = {episode: (*map(repr, place), *beside) for episode, place in places.items()}
    heads = (*manifest.outcome_names, SD), (*units, units[0])
    with named_disk_errors(table.parent):
        write_outcome_table(table, rows, *heads, beside=_SOURCE if beside else "note")


def _typed_before(folder: Path, source: Path, manifest: Manifest) -> tuple[Path, dict[str, Place]]:
    """The table of a source's answers, and what it already holds."""
    for number in count(1):
        table = folder / (OUTCOMES_FILE if number == 1 else f"outcomes-{number}.csv")
        if not table.is_file():
            return table, {}
        try:
            kept = _read(table, manifest)
        except PriorReinforceError:
            continue  # edited by hand, or of another task: prompt again, for another table
        if set(kept.frame[_SOURCE]) == {str(source.resolve())}:
            rows = kept.frame[[*kept.names, SD]].itertuples()
            return table, {name: tuple(map(float, values)) for name, *values in rows}
    raise AssertionError("numbers do not end")


def _read(table: Path, manifest: Manifest) -> Outcomes:
    found = read_outcomes(table, manifest.outcome_names, texts=(_SOURCE,))
    if found.names != manifest.outcome_names or _SOURCE not in found.frame:
        raise InvalidDemonstrationsError(f"{table} has other columns; name it with --outcomes")
    # Answers were checked when they were typed.
    return in_units(found, manifest.outcome_units, None)[0]


def _explanation(manifest: Manifest, missing: Sequence[str]) -> str:
    names, k = " ".join(manifest.outcome_names), len(manifest.outcome_names)
    units = ", ".join(dict.fromkeys(manifest.outcome_units))
    unit, words = "cm" if units == "m" else "", ""
    if in_words(manifest.outcome_units):
        example = ("92cm ahead", "10cm left", "5cm up")[:k]
        numbers = " ".join(term.split()[0] for term in example)
        words = f', "{numbers}", or words such as "{", ".join(example)}"'
    return (
        f"{len(missing)} episodes have no outcome: where did the object land, in the table frame?\n"
        f"type {names} [{units}]{words}; +- 2{unit} behind it says how "
        "uncertain it is; skip leaves an episode out, back goes back one"
    )

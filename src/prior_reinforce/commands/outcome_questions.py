"""Asking a person where each recorded object landed, since no recording format says."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from prior_reinforce.errors import (
    InvalidDemonstrationsError,
    InvalidFeedbackError,
)
from prior_reinforce.files import named_disk_errors, write
from prior_reinforce.importing import Recording
from prior_reinforce.importing.outcomes import (
    OUTCOMES_FILE,
    Outcomes,
    find_outcomes,
    in_order,
    outcomes_of,
    read_outcomes,
)
from prior_reinforce.wording import in_words, read_place
from prior_reinforce.workspace.manifest import Manifest


def ask_for_outcomes(
    source: Path, given: Path | None, recordings: Sequence[Recording], manifest: Manifest
) -> dict[str, tuple[float, ...]]:
    """Ask for the outcomes that no table has.

    Args:
        source: What the recordings were read from.
        given: The table that was named, if any.
        recordings: Of the episodes in question.
        manifest: What an outcome is.

    Returns:
        Outcomes of all episodes, known and typed, by name; empty where nothing was missing.

    Raises:
        FileFormatError: The table is damaged.
        InvalidDemonstrationsError: It has other columns, or the person stopped typing.
    """
    known = _known(source, given, recordings, manifest)
    outcomes: dict[str, tuple[float, ...]] = {}
    missing: list[str] = []
    for recording in recordings:
        try:
            found = outcomes_of([recording], known, partial=True)[0]
        except InvalidDemonstrationsError:
            missing.append(recording.episode)
        else:
            outcomes[recording.episode] = tuple(found.tolist())
    if not missing:
        return {}
    print(_explanation(manifest, missing))
    for number, episode in enumerate(missing, start=1):
        outcomes[episode] = _ask(f"{episode} ({number} of {len(missing)}): ", episode, manifest)
    return {recording.episode: outcomes[recording.episode] for recording in recordings}


def keep_typed(
    folder: Path, outcomes: Mapping[str, tuple[float, ...]], names: Sequence[str]
) -> Path:
    """Write outcomes to a table in the workspace, so that nothing has to be typed twice.

    Raises:
        WorkspaceError: The disk is full, or the folder read-only.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["episode", *names])
    writer.writerows([episode, *map(repr, values)] for episode, values in outcomes.items())
    path = folder / OUTCOMES_FILE
    with named_disk_errors(folder):
        write(path, text.getvalue())
    return path


def _known(
    source: Path, given: Path | None, recordings: Sequence[Recording], manifest: Manifest
) -> Outcomes:
    if given is not None:
        return in_order(read_outcomes(given, manifest.outcome_names), manifest.outcome_names)
    try:
        names = manifest.outcome_names
        return in_order(find_outcomes(source, recordings, None, names), names)
    except InvalidDemonstrationsError:
        return Outcomes("nothing", (), {})


def _explanation(manifest: Manifest, missing: Sequence[str]) -> str:
    names = " ".join(manifest.outcome_names)
    units = ", ".join(dict.fromkeys(manifest.outcome_units))
    words = ""
    if in_words(manifest.outcome_units):
        example = ("92cm ahead", "10cm left", "5cm up")[: len(manifest.outcome_names)]
        words = f', or words such as "{", ".join(example)}"'
    return (
        f"{len(missing)} episodes have no outcome: where did the object land, in the table frame?\n"
        f"type {names} [{units}]{words}"
    )


def _ask(question: str, episode: str, manifest: Manifest) -> tuple[float, ...]:
    while True:
        try:
            text = input(question)
        except EOFError as error:
            raise InvalidDemonstrationsError(
                f"no outcome for episode {episode}; write {OUTCOMES_FILE} beside the recording, or "
                "leave it out with --episodes"
            ) from error
        try:
            place = read_place(text, manifest.outcome_names, manifest.outcome_units)
            return tuple(place.tolist())
        except InvalidFeedbackError as error:
            print(error)

"""The one way in: a recording on disk becomes `Demonstrations` and a preview."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from prior_reinforce.motions import Demonstrations
from prior_reinforce.workspace.importing.preprocessing import Preprocessing
from prior_reinforce.workspace.importing.preview import Preview
from prior_reinforce.workspace.importing.recording import Recording, RecordingFormat


@dataclass(frozen=True, eq=False)
class ImportResult:
    """What an import gives; nothing is on disk yet."""

    demonstrations: Demonstrations
    """Ready to be learned from: `demonstrations.save(path)`."""
    episodes: tuple[str, ...]
    """Name of each demonstration in its source, in order."""
    preview: Preview
    """`preview.text` to print, `preview.draw(path)` to look at."""


def read_recordings(
    source: str | os.PathLike[str],
    *,
    format: RecordingFormat | None = None,
    key: str | None = None,
    rate: float | None = None,
    episodes: Sequence[str] | None = None,
) -> list[Recording]:
    """Read every episode as it was recorded, for instance to ask for each one's outcome.

    Args:
        source: A file, or the folder that holds the recording.
        format: What it is; None detects it.
        key: Where the motion is: the array of an NPZ, the column of a LeRobot data set, the path
            of an HDF5 data set inside an episode, or the topic of a bag. None takes the only
            candidate.
        rate: Frames a second, for files that hold neither times nor a rate.
        episodes: Names of the episodes to keep, in order; None keeps all.

    Raises:
        FileFormatError: Missing, truncated, of another format, or ambiguous without `key`.
        InvalidDemonstrationsError: An episode that cannot be used, or one asked for that is not
            there.
        MissingExtraError: The format's optional library is not installed.
    """
    raise NotImplementedError


def import_demonstrations(
    source: str | os.PathLike[str],
    *,
    format: RecordingFormat | None = None,
    key: str | None = None,
    rate: float | None = None,
    episodes: Sequence[str] | None = None,
    outcomes: str | os.PathLike[str] | Mapping[str, Sequence[float]] | None = None,
    outcome_names: Sequence[str] | None = None,
    outcome_units: Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    preprocessing: Preprocessing = Preprocessing(),  # noqa: B008 - frozen
) -> ImportResult:
    """Read, select joints, trim, resample, join with the outcomes, and preview.

    Args:
        source: As in `read_recordings`, and so are the next four.
        format: What it is; None detects it.
        key: Where the motion is within the source.
        rate: Frames a second, for files that hold neither times nor a rate.
        episodes: Names of the episodes to keep, in order; None keeps all.
        outcomes: Where each demonstration's object landed: a CSV `episode,x,y[,z]`, or numbers by
            episode name. None takes `outcomes.csv` beside or inside the source.
        outcome_names: Names of the k components, in order; None takes the CSV's columns.
        outcome_units: Unit of each component; None is metres.
        joints: Recorded names to keep, in the plan's order; None keeps all as recorded. Where the
            file names nothing, they name its columns in order.
        names: What to call them in the plan format; None keeps the recorded names.
        units: Recorded unit of each kept joint (`deg` is converted); None is radians.
        preprocessing: Time step, horizon and trimming.

    Raises:
        FileFormatError: As in `read_recordings`, or a damaged `outcomes.csv`.
        InvalidDemonstrationsError: Missing outcomes or joints (named), or demonstrations that
            cannot be learned from.
        ConfigurationError: Settings that contradict each other.
        MissingExtraError: The format's optional library is not installed.
    """
    raise NotImplementedError

"""Demonstrations from the format they were recorded in: read, trim, resample, look at, use."""

from prior_reinforce.bench.importing.importer import (
    FORMATS,
    ImportResult,
    appended,
    import_demonstrations,
    inspect_recordings,
    outcome_places,
    read_recordings,
)
from prior_reinforce.bench.importing.inspection import Inspection
from prior_reinforce.bench.importing.preprocessing import Preprocessing
from prior_reinforce.bench.importing.preview import Preview
from prior_reinforce.bench.importing.recording import HowToRead, Recording

__all__ = [
    "FORMATS",
    "HowToRead",
    "ImportResult",
    "Inspection",
    "Preprocessing",
    "Preview",
    "Recording",
    "appended",
    "import_demonstrations",
    "inspect_recordings",
    "outcome_places",
    "read_recordings",
]

"""Demonstrations from the format they were recorded in: read, trim, resample, look at, use."""

from prior_reinforce.bench.importing.importer import (
    FORMATS,
    ImportResult,
    Recordings,
    appended,
    import_demonstrations,
    inspect_recordings,
    read,
    read_recordings,
)
from prior_reinforce.bench.importing.inspection import Inspection, inspect
from prior_reinforce.bench.importing.options import ReadOptions
from prior_reinforce.bench.importing.preprocessing import Preprocessing
from prior_reinforce.bench.importing.preview import Preview
from prior_reinforce.bench.importing.recording import Recording

__all__ = [
    "FORMATS",
    "ImportResult",
    "Inspection",
    "Preprocessing",
    "Preview",
    "ReadOptions",
    "Recording",
    "Recordings",
    "appended",
    "import_demonstrations",
    "inspect",
    "inspect_recordings",
    "read",
    "read_recordings",
]

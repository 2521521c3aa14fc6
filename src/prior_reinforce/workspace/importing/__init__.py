"""Demonstrations from the format they were recorded in: read, trim, resample, look at, use."""

from prior_reinforce.workspace.importing.importer import (
    ImportResult,
    import_demonstrations,
    read_recordings,
)
from prior_reinforce.workspace.importing.preprocessing import Preprocessing
from prior_reinforce.workspace.importing.preview import Preview
from prior_reinforce.workspace.importing.recording import Recording, RecordingFormat

__all__ = [
    "ImportResult",
    "Preprocessing",
    "Preview",
    "Recording",
    "RecordingFormat",
    "import_demonstrations",
    "read_recordings",
]

"""Demonstrations from the format they were recorded in: read, trim, resample, look at, use."""

from prior_reinforce.arm.recordings.appending import appended as appended
from prior_reinforce.arm.recordings.importer import FORMATS as FORMATS
from prior_reinforce.arm.recordings.importer import ImportResult as ImportResult
from prior_reinforce.arm.recordings.importer import Recordings as Recordings
from prior_reinforce.arm.recordings.importer import import_demonstrations as import_demonstrations
from prior_reinforce.arm.recordings.importer import inspect_recordings as inspect_recordings
from prior_reinforce.arm.recordings.importer import read as read
from prior_reinforce.arm.recordings.importer import read_recordings as read_recordings
from prior_reinforce.arm.recordings.inspection import Inspection as Inspection
from prior_reinforce.arm.recordings.inspection import Wanted as Wanted
from prior_reinforce.arm.recordings.inspection import inspect as inspect
from prior_reinforce.arm.recordings.options import ReadOptions as ReadOptions
from prior_reinforce.arm.recordings.preprocessing import Preprocessing as Preprocessing
from prior_reinforce.arm.recordings.preview import Preview as Preview
from prior_reinforce.arm.recordings.recording import Recording as Recording

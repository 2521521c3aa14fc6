"""Demonstrations from the page: recordings dropped, looked through, each outcome touched.

What was dropped lies in the workspace's `recordings/`, as it was recorded, and each touch is in
`outcomes.csv` beside it before it is answered: the same folder that `prior-reinforce import` reads.
"""

from __future__ import annotations

import os
import re
import shutil
import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from msgspec import Struct

from prior_reinforce.arm.console.verbs import Seen, Verbs
from prior_reinforce.arm.console.view import ConsoleState
from prior_reinforce.arm.recordings import ReadOptions, Recordings, inspect, read
from prior_reinforce.arm.recordings.naming import find_channels, numbered_like
from prior_reinforce.arm.recordings.outcomes import OUTCOMES_FILE, keep_places, places_of
from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.arm.recordings.units import Ambiguity, say_names
from prior_reinforce.errors import (
    FileFormatError,
    InvalidDemonstrationsError,
    InvalidFeedbackError,
    PriorReinforceError,
    WorkspaceError,
)
from prior_reinforce.files import named_disk_errors, require_inside, write

LARGEST_FILE = 64_000_000
"""Bytes of a file; ours: minutes of an arm at 1 kHz in any format, but no video."""
_LARGEST_ALL, _MOST_FILES = 1_000_000_000, 2_000
_PART = re.compile(r"\w[\w .()+=-]{0,99}")
"""Of a path: nothing hidden, nothing that leads out, nothing that is no name elsewhere."""
_DEEPEST = 6


class Dropped(Struct):
    """What was dropped, and what an import would make of it."""

    files: int
    text: str = ""
    """What it holds, as `import --inspect` says."""
    problem: str = ""
    """Why it cannot be read; empty where it can."""
    questions: list[str] = []
    """What is only guessed of its units, for a person to confirm."""
    recorded: list[str] = []
    """Names of their columns, where a person has to say which are the joints."""
    joints: list[str] = []
    """Names in the plan that these are chosen for."""
    episodes: dict[str, list[float] | None] = {}
    """The recordings, and where the object of each landed, if that is known."""


class Place(Struct, forbid_unknown_fields=True):
    """Where a recording's object landed."""

    episode: str
    outcome: list[float] | None
    """In the outcomes' units; None forgets it, and the episode is left out."""
    sd: float = 0.0
    """Standard deviation of each component, if it was measured."""


class Columns(Struct, forbid_unknown_fields=True):
    """Which recorded columns are the joints."""

    names: list[str]
    """In the plan's order."""


class Take(Seen):
    """Take the recordings in, in place of the demonstrations in use."""

    confirmed: bool = False
    """A person said that the guesses are right."""


class _Found(NamedTuple):
    """The recordings as they are read now."""

    recordings: Recordings
    selection: Selection
    rows: dict[str, tuple[float, ...]]
    """Outcome and its standard deviation by episode, where they are known."""
    unclear: tuple[Ambiguity, ...]
    """What is only guessed of their units."""


class _OtherNamesError(InvalidDemonstrationsError):
    """The recordings call their columns otherwise than the plan."""

    def __init__(self, joints: Sequence[str], recorded: Sequence[str]) -> None:
        self.joints, self.recorded = list(joints), list(recorded)
        super().__init__(
            f"the recordings have no column {say_names(joints)}: choose those that are these joints"
        )


class Imports:
    """The recordings that were dropped on a workspace."""

    def __init__(self, verbs: Verbs) -> None:
        """Work on the workspace of these verbs."""
        self._verbs, self._workspace = verbs, verbs.workspace
        self._folder = verbs.folder / "recordings"
        self._lock = threading.RLock()
        self._columns: tuple[str, ...] | None = None
        """Chosen on the page for the joints; of the recordings that lie there."""

    def drop(self, name: str, content: bytes) -> Dropped:
        """Keep a file of the recordings; its name may have folders."""
        parts = name.split("/")
        if len(parts) > _DEEPEST or not all(_PART.fullmatch(part) for part in parts):
            raise FileFormatError(f"{name[:80]!r} is no name of a recording; rename it")
        with self._lock:
            there = self._files()
            size = sum(map(_size, there)) + len(content)
            if size > _LARGEST_ALL or len(there) >= _MOST_FILES:
                raise FileFormatError("more than the page takes; use: prior-reinforce import")
            path = require_inside(self._folder / name, self._verbs.folder)
            with named_disk_errors(self._folder):
                write(path, content)
        self._verbs.publish({"recordings": len(there) + 1})
        return Dropped(len(there) + 1)

    def look(self) -> Dropped:
        """Say what the recordings hold, and what an import would make of them."""
        with self._lock:
            files = len(self._files())
            if not files:
                return Dropped(0)
            try:
                found = self._read()
                apart = replace(found.selection, ambiguities=())  # which are questions
                inspection = inspect(apart, self._workspace.wanted())
            except _OtherNamesError as error:
                return Dropped(
                    files, problem=str(error), recorded=error.recorded, joints=error.joints
                )
            except PriorReinforceError as error:
                return Dropped(files, problem=str(error))
        places = {name: [*row[:-1]] for name, row in found.rows.items()}
        episodes = {name: places.get(name) for name in found.selection.episodes}
        questions = [one.what for one in found.unclear]
        return Dropped(files, inspection.text, questions=questions, episodes=episodes)

    def place(self, body: Place) -> Dropped:
        """Write down where a recording's object landed."""
        form = self._workspace.manifest.outcome_format
        with self._lock:
            found = self._read()
            if body.episode not in found.selection.episodes:
                raise InvalidDemonstrationsError(f"there is no recording {body.episode[:80]!r}")
            if body.outcome is not None and len(body.outcome) != form.outcome_dim:
                raise InvalidFeedbackError(f"an outcome is numbers: {', '.join(form.names)}")
            rows = found.rows
            rows.pop(body.episode, None)
            if body.outcome is not None:
                rows[body.episode] = (*body.outcome, body.sd)
            table = found.recordings.outcome_places[0] / OUTCOMES_FILE
            keep_places(table, rows, form)
            self._verbs.publish({"recordings": len(rows)})
            return self.look()

    def columns(self, body: Columns) -> Dropped:
        """Choose the recorded columns that are the joints, where they have other names."""
        with self._lock:
            before, self._columns = self._columns, tuple(body.names)
            try:
                self._read()
            except PriorReinforceError:
                self._columns = before
                raise
        self._verbs.publish({"recordings": 0})
        return self.look()

    def take(self, body: Take) -> ConsoleState:
        """Take the recordings with a known outcome in, as `prior-reinforce import` does."""
        with self._lock, self._verbs.as_seen(body.seen):
            found = self._read()
            missing = [name for name in found.selection.episodes if name not in found.rows]
            if not found.rows:
                raise InvalidDemonstrationsError("no outcome is known yet; touch where they landed")
            result = self._workspace.import_recordings(
                found.recordings.source,
                leave_out=missing,
                take_guesses=body.confirmed,
                joints=found.recordings.options.joints,
            )
            try:
                result.preview.save(self._verbs.folder)
            except WorkspaceError as error:  # the demonstrations are taken in without it
                self._verbs.publish({"error": f"taken in, but there is no picture: {error}"})
        return self._verbs.state()

    def discard(self) -> Dropped:
        """Forget the recordings; what was taken in stays."""
        with self._lock, named_disk_errors(self._folder):
            if self._folder.is_dir():
                shutil.rmtree(require_inside(self._folder, self._verbs.folder))
            self._columns = None
            self._verbs.publish({"recordings": 0})
            return self.look()

    def _files(self) -> list[Path]:
        """The files that lie there, no link followed; if too many, some more than are taken."""
        found: list[Path] = []
        for folder, _, names in os.walk(require_inside(self._folder, self._verbs.folder)):
            found += (Path(folder, name) for name in names)
            if len(found) > _MOST_FILES:
                break
        return found

    def _read(self) -> _Found:
        if not self._folder.is_dir():
            raise InvalidDemonstrationsError("no recordings are here yet; drop some on the page")
        there = [path for path in self._folder.iterdir() if path.name.lower() != OUTCOMES_FILE]
        # A folder that was dropped alone is the recordings.
        source = there[0] if len(there) == 1 and there[0].is_dir() else self._folder
        wanted = self._workspace.wanted()
        joints = self._columns or wanted.names
        recordings = read(require_inside(source, self._verbs.folder), ReadOptions(joints=joints))
        first = recordings.episodes[0]
        if joints is not None and first.named and _needs_choice(joints, first.names):
            raise _OtherNamesError(wanted.names or joints, first.names)
        selection = recordings.select(wanted)
        known, unclear = recordings.outcomes(selection, wanted, may_lack=True)
        rows = places_of(selection.episodes, known)
        return _Found(recordings, selection, rows, unclear)


def _needs_choice(joints: Sequence[str], recorded: Sequence[str]) -> bool:
    """Whether nothing but a person can say which recorded columns are the joints."""
    try:
        found = find_channels(joints, recorded) or numbered_like(joints, recorded)
    except InvalidDemonstrationsError:  # several look like one
        return True
    return found is None


def _size(path: Path) -> int:
    """A file's bytes; 0 if it vanished meanwhile."""
    try:
        return path.lstat().st_size
    except FileNotFoundError:
        return 0

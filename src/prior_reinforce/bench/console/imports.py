"""Demonstrations from the page: recordings dropped, looked through, each outcome touched.

What was dropped lies in the workspace's `recordings/`, as it was recorded, and each touch is in
`outcomes.csv` beside it before it is answered: the same folder that `prior-reinforce import` reads.
"""

from __future__ import annotations

import re
import shutil
import threading
from pathlib import Path

from msgspec import Struct, structs

from prior_reinforce.bench.console.verbs import Console, Seen, Verbs
from prior_reinforce.bench.importing import Preprocessing, ReadOptions, Recordings, inspect, read
from prior_reinforce.bench.importing.outcomes import (
    OUTCOMES_FILE,
    SD,
    Outcomes,
    in_units,
    missing_outcomes,
    outcomes_of,
    write_outcome_table,
)
from prior_reinforce.bench.importing.selection import Selection
from prior_reinforce.bench.importing.units import Ambiguity
from prior_reinforce.bench.workspace.manifest import UNKNOWN, Manifest
from prior_reinforce.errors import (
    FileFormatError,
    InvalidDemonstrationsError,
    InvalidFeedbackError,
    PriorReinforceError,
)
from prior_reinforce.files import named_disk_errors, require_inside, write

LARGEST_FILE = 64_000_000
"""Bytes of a file; ours: minutes of an arm at 1 kHz in any format, but no video."""
_LARGEST_ALL, _MOST_FILES = 1_000_000_000, 2_000
_PART = re.compile(r"\w[\w .()+=-]{0,99}")
"""Of a path: nothing hidden, nothing that leads out, nothing that is no name elsewhere."""
_DEEPEST = 6


class Episode(Struct):
    """A recording, and where its object landed, if that is known."""

    name: str
    outcome: list[float] | None


class Dropped(Struct):
    """What was dropped, and what an import would make of it."""

    files: int
    text: str
    """What it holds, as `import --inspect` says."""
    problem: str
    """Why it cannot be read; empty where it can."""
    questions: list[str]
    """What is only guessed of its units, for a person to confirm."""
    episodes: list[Episode]


class Place(Struct, forbid_unknown_fields=True):
    """Where a recording's object landed."""

    episode: str
    outcome: list[float] | None
    """In the outcomes' units; None forgets it, and the episode is left out."""
    sd: float = 0.0
    """Standard deviation of each component, if it was measured."""


class Take(Seen):
    """Take the recordings in, in place of the demonstrations in use."""

    confirmed: bool = False
    """A person said that the guesses are right."""


class Imports:
    """The recordings that were dropped on a workspace."""

    def __init__(self, verbs: Verbs) -> None:
        """Work on the workspace of these verbs."""
        self._verbs, self._workspace = verbs, verbs.workspace
        self._folder = verbs.folder / "recordings"
        self._lock = threading.Lock()

    def drop(self, name: str, content: bytes) -> Dropped:
        """Keep a file of the recordings; its name may have folders."""
        parts = name.split("/")
        if len(parts) > _DEEPEST or not all(_PART.fullmatch(part) for part in parts):
            raise FileFormatError(f"{name[:80]!r} is no name of a recording; rename it")
        with self._lock:
            there = [path for path in self._folder.rglob("*") if path.is_file()]
            size = sum(path.stat().st_size for path in there) + len(content)
            if size > _LARGEST_ALL or len(there) >= _MOST_FILES:
                more = "that is more than the page takes; use: prior-reinforce import"
                raise FileFormatError(more)
            path = require_inside(self._folder / name, self._verbs.folder)
            with named_disk_errors(self._folder):
                write(path, content)
        self._verbs.publish({"recordings": len(there) + 1})
        return Dropped(len(there) + 1, "", "", [], [])

    def look(self) -> Dropped:
        """Say what the recordings hold, and what an import would make of them."""
        with self._lock:
            return self._look()

    def place(self, body: Place) -> Dropped:
        """Write down where a recording's object landed."""
        names, units = self._manifest.outcome_names, self._manifest.outcome_units
        with self._lock:
            recordings, selection = self._read()
            if body.episode not in selection.episodes:
                raise InvalidDemonstrationsError(f"there is no recording {body.episode[:80]!r}")
            if body.outcome is not None and len(body.outcome) != len(names):
                wanted = f"an outcome is {len(names)} numbers: {', '.join(names)}"
                raise InvalidFeedbackError(wanted)
            rows = dict(self._places(recordings, selection))
            rows.pop(body.episode, None)
            if body.outcome is not None:
                rows[body.episode] = (*body.outcome, body.sd)
            cells = {episode: tuple(map(repr, row)) for episode, row in rows.items()}
            table = recordings.outcome_places[0] / OUTCOMES_FILE
            with named_disk_errors(self._folder):
                write_outcome_table(table, cells, (*names, SD), (*units, units[0]))
            self._verbs.publish({"recordings": len(rows)})
            return self._look()

    def take(self, body: Take) -> Console:
        """Take the recordings with a known outcome in, as `prior-reinforce import` does."""
        manifest = self._manifest
        with self._lock, self._verbs.as_seen(body.seen):
            recordings, selection = self._read()
            known, unclear = self._known(recordings)
            unclear += recordings.ambiguities + selection.ambiguities
            if unclear and not body.confirmed:
                raise InvalidDemonstrationsError(f"{unclear[0].what}; say whether it is so")
            selection = selection.without(missing_outcomes(selection.episodes, known))
            if not selection.recordings:
                raise InvalidDemonstrationsError("no outcome is known yet; touch where they landed")
            inspection = inspect(
                selection, Preprocessing(manifest.format.dt), manifest.robot, manifest.gate
            )
            names, units = manifest.outcome_names, manifest.outcome_units
            result = recordings.demonstrations(inspection, known, names, units, partial=True)
            self._workspace.import_demonstrations(result.demonstrations, str(self._source))
            with named_disk_errors(self._verbs.folder):
                result.preview.draw(self._verbs.folder / "demonstrations.png")
        return self._verbs.state()

    def discard(self) -> Dropped:
        """Forget the recordings; what was taken in stays."""
        with self._lock, named_disk_errors(self._folder):
            if self._folder.is_dir():
                shutil.rmtree(require_inside(self._folder, self._verbs.folder))
            self._verbs.publish({"recordings": 0})
            return self._look()

    @property
    def _manifest(self) -> Manifest:
        return self._workspace.manifest

    @property
    def _source(self) -> Path:
        """The recordings: what was dropped, or the one folder that was."""
        there = [path for path in self._folder.iterdir() if path.name != OUTCOMES_FILE]
        return there[0] if len(there) == 1 and there[0].is_dir() else self._folder

    def _read(self) -> tuple[Recordings, Selection]:
        if not self._folder.is_dir():
            raise InvalidDemonstrationsError("no recordings are here yet; drop some on the page")
        form = self._manifest.format
        source = require_inside(self._source, self._verbs.folder)
        if form.names == UNKNOWN:  # the first import takes what was recorded
            recordings = read(source)
            return recordings, recordings.select()
        recordings = read(source, ReadOptions(joints=form.names))
        return recordings, recordings.select(form.names, form.units)

    def _known(self, recordings: Recordings) -> tuple[Outcomes, tuple[Ambiguity, ...]]:
        names = self._manifest.outcome_names
        try:
            found = recordings.outcomes(None, names)
        except InvalidDemonstrationsError:
            found = Outcomes.none(names)
        return in_units(found, self._manifest.outcome_units, None)

    def _places(self, recordings: Recordings, selection: Selection) -> dict[str, tuple[float, ...]]:
        """Outcome and its standard deviation by episode, where they are known."""
        known, _ = self._known(recordings)
        missing = missing_outcomes(selection.episodes, known)
        there = [episode for episode in selection.episodes if episode not in missing]
        if not there:
            return {}
        places, sds = outcomes_of(there, known, partial=True)
        pairs = zip(there, places.tolist(), sds.tolist(), strict=True)
        return {episode: (*place, sd[0]) for episode, place, sd in pairs}

    def _look(self) -> Dropped:
        files = sum(path.is_file() for path in self._folder.rglob("*"))
        found = Dropped(files, "", "", [], [])
        if not files:
            return found
        manifest = self._manifest
        try:
            recordings, selection = self._read()
            _, unclear = self._known(recordings)
            places = self._places(recordings, selection)
            inspection = inspect(
                selection, Preprocessing(manifest.format.dt), manifest.robot, manifest.gate
            )
        except PriorReinforceError as error:
            return structs.replace(found, problem=str(error))
        unclear += recordings.ambiguities + selection.ambiguities
        return Dropped(
            files,
            inspection.text,
            "",
            [one.what for one in unclear],
            [
                Episode(name, [*places[name][:-1]] if name in places else None)
                for name in selection.episodes
            ],
        )

"""The command that brings recorded demonstrations into a workspace."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from prior_reinforce.commands.outcome_questions import ask_for_outcomes, keep_typed
from prior_reinforce.commands.workspace import Folder, print_next
from prior_reinforce.errors import UnclearUnitsError
from prior_reinforce.files import named_disk_errors
from prior_reinforce.importing import (
    FORMATS,
    HowToRead,
    ImportResult,
    Preprocessing,
    import_demonstrations,
    read_recordings,
)
from prior_reinforce.workspace.workspace import Workspace

_PICTURE = "demonstrations.png"


@dataclass(frozen=True)
class Import:
    """Bring recorded demonstrations into a workspace, and look at them."""

    folder: Folder
    """Workspace."""
    source: Annotated[Path, tyro.conf.Positional]
    """Recordings, a file or a folder: NPZ, NPY, CSV, a workbook, LeRobot, robomimic or DROID HDF5,
    ROS 1, ROS 2 or MCAP, or a replay buffer in zarr."""
    format: Annotated[
        str | None,
        tyro.conf.arg(help=f"What it is, one of {', '.join(FORMATS)}; detected if not given."),
    ] = None
    outcomes: Path | None = None
    """CSV `episode,x,y` with where each object landed; if not given, `outcomes.csv` beside the
    source, and what it lacks is asked for on a terminal."""
    outcome_unit: Literal["m", "cm", "mm", "rad", "deg"] | None = None
    """Unit of the outcomes in that table, where its columns do not say it (`x_cm`)."""
    key: str | None = None
    """Where the motion is within the source (HDF5 data set, topic, column)."""
    rate: float | None = None
    """Frames a second, where the source has no times."""
    time_unit: Literal["s", "ms", "us", "ns", "frame"] | None = None
    """Unit of the recorded times, where their name does not say it (`t_ms`); `frame` for a column
    that counts frames."""
    time_column: str | None = None
    """Column or array of the times: its name, or its number from 1; none leaves all unread."""
    episode_column: str | None = None
    """Column that says which episode a row is of."""
    delimiter: str | None = None
    """What stands between two cells of a CSV: comma, semicolon, tab, space; found out if not
    given."""
    decimal: Literal[".", ","] | None = None
    """Decimal sign of a CSV; found out if not given."""
    episodes: tuple[str, ...] | None = None
    """Episodes to keep, in order; all if not given."""
    leave_out: tuple[str, ...] | None = None
    """Episodes to leave out."""
    joints: tuple[str, ...] | None = None
    """Recorded names of the channels to keep, in order; the manifest's action names if
    not given."""
    units: tuple[str, ...] | None = None
    """Recorded units of those channels: rad, deg, m, cm, mm; a single one holds for all. If not
    given, what the source says, and the manifest's where it says nothing."""
    horizon: int | None = None
    """Frames of every plan; the longest recording's if not given."""
    trim: bool = True
    """Drop the still ends of each recording."""
    smooth: float | None = None
    """Take out what is faster than so many Hz, such as an encoder's noise; says what it changed."""

    def run(self) -> None:
        """Read, preview, take in."""
        with Workspace(self.folder) as workspace:
            workspace.session().refuse_open_trial("importing demonstrations")
            try:
                result = self._read(workspace, take_guesses=False)
            except UnclearUnitsError as unclear:
                if not _agrees(unclear):
                    raise
                result = self._read(workspace, take_guesses=True)
            workspace.import_demonstrations(result.demonstrations, str(self.source))
            print(result.preview.text)
            with named_disk_errors(self.folder):
                result.preview.draw(self.folder / _PICTURE)
            print(f"picture: {self.folder / _PICTURE}  (look at it before you learn)")
            print_next(workspace)

    def _read(self, workspace: Workspace, *, take_guesses: bool) -> ImportResult:
        manifest = workspace.manifest
        return import_demonstrations(
            self.source,
            outcomes=self._outcomes(workspace, take_guesses),
            outcome_names=manifest.outcome_names,
            outcome_units=manifest.outcome_units,
            outcome_unit=self.outcome_unit,
            names=manifest.format.names,
            units=self.units,
            plan_units=manifest.format.units,
            preprocessing=Preprocessing(
                dt=manifest.format.dt,
                horizon=self.horizon,
                trim=self.trim,
                smooth=self.smooth,
            ),
            take_guesses=take_guesses,
            **self._how(workspace),
        )

    def _how(self, workspace: Workspace) -> HowToRead:
        return HowToRead(
            format=self.format,
            key=self.key,
            rate=self.rate,
            time_unit=self.time_unit,
            time_column=self.time_column,
            episode_column=self.episode_column,
            delimiter=self.delimiter,
            decimal=self.decimal,
            episodes=self.episodes,
            leave_out=self.leave_out,
            joints=self.joints or workspace.manifest.format.names,
        )

    def _outcomes(
        self, workspace: Workspace, take_guesses: bool
    ) -> Path | Mapping[str, tuple[float, ...]] | None:
        """What was given; on a terminal, with what a person types for the rest."""
        if not sys.stdin.isatty():
            return self.outcomes
        recordings = read_recordings(self.source, take_guesses=take_guesses, **self._how(workspace))
        typed = ask_for_outcomes(self.source, self.outcomes, recordings, workspace.manifest)
        if not typed:
            return self.outcomes
        kept = keep_typed(workspace.folder, typed, workspace.manifest.outcome_names)
        print(f"outcomes kept in {kept}; to import again: --outcomes {kept}")
        return kept


def _agrees(unclear: UnclearUnitsError) -> bool:
    """Whether a person at the terminal says that it is as it looks."""
    if not (sys.stdin.isatty() and unclear.options):
        return False
    print(unclear)
    try:
        return input("is it so? (yes/no) ").strip().lower() in {"y", "yes"}
    except EOFError:
        return False

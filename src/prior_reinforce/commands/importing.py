"""The command that brings recorded demonstrations into a workspace."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from prior_reinforce.commands.outcome_questions import ask_for_outcomes, keep_typed
from prior_reinforce.commands.workspace import Folder, print_next
from prior_reinforce.files import named_disk_errors
from prior_reinforce.importing import (
    FORMATS,
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
    """Recordings, a file or a folder: NPZ, CSV, LeRobot, robomimic or DROID HDF5, ROS 1, ROS 2 or
    MCAP, or a replay buffer in zarr."""
    format: Annotated[
        str | None,
        tyro.conf.arg(help=f"What it is, one of {', '.join(FORMATS)}; detected if not given."),
    ] = None
    outcomes: Path | None = None
    """CSV `episode,x,y` with where each object landed; if not given, `outcomes.csv` beside the
    source, and what it lacks is asked for on a terminal."""
    key: str | None = None
    """Where the motion is within the source (HDF5 data set, topic, column)."""
    rate: float | None = None
    """Frames a second, where the source does not say."""
    episodes: tuple[str, ...] | None = None
    """Episodes to keep, in order; all if not given."""
    joints: tuple[str, ...] | None = None
    """Recorded names of the channels to keep, in order; the manifest's action names if
    not given."""
    units: tuple[str, ...] | None = None
    """Recorded units of those channels, `deg` is converted; a single one holds for all; the
    manifest's if not given."""
    horizon: int | None = None
    """Frames of every plan; the longest recording's if not given."""
    trim: bool = True
    """Drop the still ends of each recording."""

    def run(self) -> None:
        """Read, preview, take in."""
        with Workspace(self.folder) as workspace:
            manifest = workspace.manifest
            workspace.session().refuse_open_trial("importing demonstrations")
            names = manifest.format.names
            result = import_demonstrations(
                self.source,
                format=self.format,
                key=self.key,
                rate=self.rate,
                episodes=self.episodes,
                outcomes=self._outcomes(workspace),
                outcome_names=manifest.outcome_names,
                outcome_units=manifest.outcome_units,
                joints=self.joints or names,
                names=names,
                units=self._units(manifest.format.units),
                preprocessing=Preprocessing(
                    dt=manifest.format.dt, horizon=self.horizon, trim=self.trim
                ),
            )
            workspace.import_demonstrations(result.demonstrations, str(self.source))
            print(result.preview.text)
            with named_disk_errors(self.folder):
                result.preview.draw(self.folder / _PICTURE)
            print(f"picture: {self.folder / _PICTURE}  (look at it before you learn)")
            print_next(workspace)

    def _units(self, of_manifest: tuple[str, ...]) -> tuple[str, ...]:
        if self.units is None:
            return of_manifest
        return self.units * len(of_manifest) if len(self.units) == 1 else self.units

    def _outcomes(self, workspace: Workspace) -> Path | Mapping[str, tuple[float, ...]] | None:
        """What was given; on a terminal, with what a person types for the rest."""
        if not sys.stdin.isatty():
            return self.outcomes
        recordings = read_recordings(
            self.source,
            format=self.format,
            key=self.key,
            rate=self.rate,
            episodes=self.episodes,
            joints=self.joints or workspace.manifest.format.names,
        )
        typed = ask_for_outcomes(self.source, self.outcomes, recordings, workspace.manifest)
        if not typed:
            return self.outcomes
        kept = keep_typed(workspace.folder, typed, workspace.manifest.outcome_names)
        print(f"outcomes kept in {kept}; to import again: --outcomes {kept}")
        return kept

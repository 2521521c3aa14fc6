"""The command that brings recorded demonstrations into a workspace."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from prior_reinforce.bench.importing import (
    FORMATS,
    HowToRead,
    ImportResult,
    Inspection,
    Preprocessing,
    Recording,
    appended,
    import_demonstrations,
    inspect_recordings,
    outcome_places,
    read_recordings,
)
from prior_reinforce.bench.importing.outcomes import (
    OUTCOMES_FILE,
    Outcomes,
    find_outcomes,
    in_order,
    in_units,
    missing_outcomes,
    read_outcomes,
    table_beside,
    write_outcome_table,
)
from prior_reinforce.bench.importing.units import Doubt, refuse_doubts
from prior_reinforce.bench.workspace.manifest import Manifest
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands.outcome_questions import Answers, ask_for_outcomes
from prior_reinforce.commands.workspace import Folder, print_next
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    UnclearUnitsError,
)
from prior_reinforce.files import named_disk_errors
from prior_reinforce.wording import plain

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
    """Unit of the outcomes in that table, where its columns do not say it (`x_cm`), or where what
    they say is doubted."""
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

    append: bool = False
    """Keep the demonstrations in use and add these to them."""
    inspect: bool = False
    """Only say what is in the recordings and what an import would make of it; write a table of
    outcomes to fill in where there is none."""

    def run(self) -> None:
        """Read, show, take in."""
        try:
            self._run()
        except UnclearUnitsError as unclear:
            also = f"{unclear.also}; and " if unclear.also else ""
            command = self._command(unclear.options)
            raise ConfigurationError(f"{also}{unclear.what}; if so: {command}") from unclear

    def _run(self) -> None:
        with Workspace(self.folder) as workspace:
            if self.inspect:
                self._inspect(workspace)
                return
            workspace.state.refuse_open_trial("importing demonstrations")
            at_terminal = sys.stdin.isatty()
            guesses = at_terminal and self._agreed(workspace)
            answers = self._asked(workspace, guesses) if at_terminal else None
            result = self._read(workspace, answers, take_guesses=guesses)
            print(plain(result.preview.text, keep="\n"))
            demonstrations, source = result.demonstrations, str(self.source)
            if self.append:
                before = workspace.demonstrations
                demonstrations = appended(before, demonstrations)
                source = f"{source}, appended to {before.n}"
                print(f"appended    {before.n} demonstrations were there, now {demonstrations.n}")
            workspace.import_demonstrations(demonstrations, source)
            with named_disk_errors(self.folder):
                result.preview.draw(self.folder / _PICTURE)
            print(f"picture: {self.folder / _PICTURE}  (look at it before you learn)")
            remedy = result.preview.found.remedy
            if remedy:
                print(f"next: {self._command(remedy)}")
            else:
                print_next(workspace)

    def _inspection(self, workspace: Workspace) -> Inspection:
        wanted = self._wanted(workspace.manifest)
        return inspect_recordings(self.source, **wanted, **self._how(workspace))

    def _inspect(self, workspace: Workspace) -> None:
        manifest, found = workspace.manifest, self._inspection(workspace)
        print(f"{self.source}: {len(found.recordings)} episodes")
        print(plain(found.text, keep="\n"))
        print()
        places = outcome_places(self.source, self.format)
        table = self.outcomes or table_beside(places)
        episodes = [recording.episode for recording in found.recordings]
        if table is not None:
            known = read_outcomes(table, manifest.outcome_names)
            missing = missing_outcomes(episodes, known)
            print(plain(f"outcomes: {table}, {', '.join(missing) or 'none'} missing"))
        elif any(recording.outcome is not None for recording in found.recordings):
            print("outcomes: in the recordings")
        else:
            table = places[0] / OUTCOMES_FILE
            with named_disk_errors(places[0]):
                write_outcome_table(table, episodes, manifest.outcome_names, manifest.outcome_units)
            print(f"outcomes: none yet; fill in {table} (units are in its first line)")
        doubts = [*found.doubts, *self._known(workspace, found.recordings)[1]]
        options = " ".join(dict.fromkeys(doubt.option for doubt in doubts))
        print(f"nothing was taken in; next: {self._command(options, found.remedy)}")

    def _command(self, *options: str) -> str:
        """The whole command with what was given, and options instead of or beside that."""
        more = " ".join(filter(None, options))
        said = ["prior-reinforce import", shlex.quote(str(self.folder))]
        said.append(shlex.quote(str(self.source)))
        for field in fields(self):
            value, option = getattr(self, field.name), f"--{field.name.replace('_', '-')}"
            if field.name in ("folder", "source", "inspect") or value == field.default:
                continue
            if isinstance(value, bool):
                said.append(option if value else option.replace("--", "--no-"))
            elif option not in more.split():
                values = value if isinstance(value, tuple) else (value,)
                said.append(" ".join([option, *(shlex.quote(str(v)) for v in values)]))
        return " ".join([*said, more]).rstrip()

    def _wanted(self, manifest: Manifest) -> dict[str, Any]:
        """What the plans shall be, and what they are held against."""
        form = manifest.format
        return {
            "names": form.names,
            "units": self.units,
            "plan_units": form.units,
            "preprocessing": Preprocessing(form.dt, self.horizon, self.trim, self.smooth),
            "robot": manifest.robot,
            "gate": manifest.gate,
        }

    def _agreed(self, workspace: Workspace) -> bool:
        """Whether something was unclear, and the person at the terminal says it is as it looks.

        Raises:
            UnclearUnitsError: It is not, or nobody says so.
        """
        doubts = [*self._inspection(workspace).doubts, *self._known(workspace, ())[1]]
        try:
            refuse_doubts(doubts)
        except UnclearUnitsError as unclear:
            if not _agrees(unclear):
                raise
            return True
        return False

    def _known(
        self, workspace: Workspace, recordings: Sequence[Recording]
    ) -> tuple[Outcomes, tuple[Doubt, ...]]:
        """The outcomes that a table or the recordings have, in the manifest's units."""
        names, units = workspace.manifest.outcome_names, workspace.manifest.outcome_units
        places = outcome_places(self.source, self.format)
        try:
            found = find_outcomes(places, recordings, self.outcomes, names)
        except InvalidDemonstrationsError:
            found = Outcomes("nothing", names, {}, (None,) * len(names))
        return in_units(in_order(found, names), units, self.outcome_unit)

    def _asked(self, workspace: Workspace, guesses: bool) -> Answers | None:
        """What a person types where no table says it; None where nothing is missing."""
        recordings = read_recordings(self.source, take_guesses=guesses, **self._how(workspace))
        known, _ = self._known(workspace, recordings)
        manifest = workspace.manifest
        answers = ask_for_outcomes(workspace.folder, self.source, known, recordings, manifest)
        if answers is not None:
            print(f"outcomes kept in {answers.table}; to import again: --outcomes {answers.table}")
        return answers

    def _read(
        self, workspace: Workspace, answers: Answers | None, *, take_guesses: bool
    ) -> ImportResult:
        manifest, how = workspace.manifest, self._how(workspace)
        if answers is not None:
            how["leave_out"] = (*(self.leave_out or ()), *answers.skipped) or None
        return import_demonstrations(
            self.source,
            outcomes=self.outcomes if answers is None else answers.table,
            outcome_names=manifest.outcome_names,
            outcome_units=manifest.outcome_units,
            outcome_unit=self.outcome_unit if answers is None else None,
            take_guesses=take_guesses,
            **self._wanted(manifest),
            **how,
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


def _agrees(unclear: UnclearUnitsError) -> bool:
    """Whether a person at the terminal says that it is as it looks."""
    if not sys.stdin.isatty() or unclear.also:
        return False
    print(plain(unclear.what))
    try:
        return input("is it so? (yes/no) ").strip().lower() in {"y", "yes"}
    except EOFError:
        return False

"""The command that brings recorded demonstrations into a workspace."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

import tyro

from prior_reinforce.arm.recordings import (
    Preprocessing,
    ReadOptions,
    Recordings,
    Wanted,
    inspect,
    read,
)
from prior_reinforce.arm.recordings.outcomes import (
    OUTCOMES_FILE,
    missing_outcomes,
    table_beside,
    write_outcome_table,
)
from prior_reinforce.arm.recordings.selection import Selection
from prior_reinforce.arm.recordings.units import Ambiguity, raise_if_ambiguous
from prior_reinforce.arm.workspace.view import InspectView
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands import warn
from prior_reinforce.commands.base import (
    Json,
    OnWorkspace,
    Words,
    options_of,
    print_checked,
    print_json,
    print_next,
)
from prior_reinforce.commands.outcome_questions import ask_for_outcomes
from prior_reinforce.commands.questions import agrees
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    UnclearUnitsError,
    WorkspaceError,
)
from prior_reinforce.files import check_path, named_disk_errors
from prior_reinforce.terminal import plain
from prior_reinforce.wording import say_count

Unclear = tuple[Ambiguity, ...]
"""What is only guessed of units, times and names."""


@dataclass(frozen=True)
class Import(OnWorkspace):
    """Bring recorded demonstrations into a workspace, and look at them.

    For example:
        prior-reinforce import hoop recordings/ --inspect
        prior-reinforce import hoop log.csv --units deg --outcomes landed.csv
    """

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] RECORDINGS")] = ()
    """The workspace (the current folder's if not given) and the recordings, a file or a folder:
    NPZ, NPY, CSV, LeRobot, HDF5, ROS 1, ROS 2 or MCAP, or a replay
    buffer in zarr."""
    outcomes: Path | None = None
    """CSV `episode,x,y` with where each object landed; if not given, `outcomes.csv` beside the
    source; on a terminal, missing entries are prompted for."""
    outcome_unit: Literal["m", "cm", "mm", "in", "rad", "deg"] | None = None
    """Unit of the outcomes in that table, if its columns do not name one (`x_cm`), or an
    implausible one."""
    options: Annotated[ReadOptions, tyro.conf.arg(name="")] = field(default_factory=ReadOptions)
    horizon: int | None = None
    """Frames of every plan; the longest recording's if not given."""
    trim: bool = True
    """`--no-trim` keeps the still ends of each recording, which are else dropped."""
    smooth: float | None = None
    """Low-pass frequency in Hz, against encoder noise; the preview reports what it changed."""

    append: bool = False
    """Keep the demonstrations in use and add these to them."""
    inspect: bool = False
    """Only report what the recordings hold and what an import would make of them; write a table of
    outcomes to fill in if there is none."""
    json: Json = False

    takes_words = True

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        if len(words) != 1:
            raise ConfigurationError("say which recordings to import: one file or folder")
        if self.json and not self.inspect:
            raise ConfigurationError("--json is of --inspect; add it, or drop --json")
        if not self.inspect:
            workspace.state.refuse_open_trial("importing demonstrations")
        self.read_into(workspace, check_path(Path(words[0])))

    def read_into(self, workspace: Workspace, source: Path) -> None:
        """Read recordings, and take them in or say what would be."""
        how = Preprocessing(None, self.horizon, self.trim, self.smooth)
        wanted = workspace.wanted(how, append=self.append)
        try:
            try:
                options = replace(self.options, joints=self.options.joints or wanted.names)
                recordings = read(source, options)
                selection = recordings.select(wanted)
            except InvalidDemonstrationsError as error:
                if not self.inspect or self.options.joints is not None or not wanted.names:
                    raise
                recordings = read(source, self.options)  # what is there, by its own names
                selection = recordings.select(replace(wanted, names=None, plan_units=None))
                doubt = Ambiguity(str(error), "--joints COLUMN ...")
                selection = replace(selection, ambiguities=(*recordings.ambiguities, doubt))
            if self.options.joints is not None:  # said, though they are the plan's own
                others = [a for a in selection.ambiguities if not a.option.startswith("--joints")]
                selection = replace(selection, ambiguities=tuple(others))
            if self.inspect:
                self._inspect(wanted, recordings, selection)
            else:
                self._import(workspace, wanted, recordings, selection)
        except UnclearUnitsError as error:
            also = f"{error.also}; and " if error.also else ""
            command = self.as_typed(error.options)
            raise ConfigurationError(f"{also}{error.problem}; if so: {command}") from error

    def _import(
        self, workspace: Workspace, wanted: Wanted, recordings: Recordings, selection: Selection
    ) -> None:
        form, at_terminal = workspace.manifest.outcome_format, sys.stdin.isatty()
        given = self.outcomes, self.outcome_unit
        known, unclear = recordings.outcomes(selection, wanted, *given, may_lack=at_terminal)
        _settle(unclear, at_terminal=at_terminal)
        if at_terminal:
            source = recordings.source
            answers = ask_for_outcomes(workspace.folder, source, known, selection, form)
            if answers is not None:
                known, skipped = answers, missing_outcomes(selection.episodes, answers)
                again = f"--outcomes {shlex.quote(str(answers.where))}"
                left = [*(self.options.leave_out or ()), *skipped]
                left_out = f"--leave-out {shlex.join(left)}" * bool(left)
                print(f"outcomes kept in {answers.where}; again: {self.as_typed(again, left_out)}")
                selection = selection.without(skipped)
                if not selection.recordings:
                    raise InvalidDemonstrationsError("no episode is left; import again")
        result = recordings.demonstrations(selection, known, wanted)
        print_checked(result.preview.text)
        remedy = result.preview.inspection.remedy
        if remedy and self.append:  # kept, it would stay beside what the remedy makes of it
            raise InvalidDemonstrationsError(
                f"the gate refuses all of these, and nothing was appended; run: "
                f"{self.as_typed(remedy)}"
            )
        n_before = workspace.take_in(result, str(recordings.source), append=self.append)
        if n_before:
            n = n_before + result.demonstrations.n
            print(f"appended    {n_before} demonstrations were there, now {n}")
        try:
            print(
                f"picture: {result.preview.save(workspace.folder)}  (look at it before you learn)"
            )
        except WorkspaceError as error:  # the demonstrations are taken in without it
            warn(f"no picture: {error}")
        if remedy:
            print(f"next: {self.as_typed(remedy)}")
        else:
            print_next(workspace)

    def _inspect(self, wanted: Wanted, recordings: Recordings, selection: Selection) -> None:
        found = inspect(selection, wanted)
        places, episodes = recordings.outcome_places, selection.episodes
        table = self.outcomes or table_beside(places)
        given = self.outcomes, self.outcome_unit
        known, unclear = recordings.outcomes(selection, wanted, *given, may_lack=True)
        found = replace(found, selection=replace(found.selection, ambiguities=unclear))
        missing = missing_outcomes(episodes, known)
        said = f"{known.where}, {', '.join(missing) or 'none'} missing"
        if table is None and not known.episodes:
            table = places[0] / OUTCOMES_FILE
            rows: dict[str, tuple[object, ...]] = dict.fromkeys(episodes, ())
            names, units = wanted.outcome_names or (), wanted.outcome_units or ()
            with named_disk_errors(places[0]):
                write_outcome_table(table, rows, names, units)
            said = f"none yet; fill in {table} (units are in its first line)"
        options = " ".join(dict.fromkeys(one.option for one in unclear))
        command = self.as_typed(options, found.remedy)
        if self.json:
            record = InspectView(
                source=str(recordings.source),
                format=recordings.format,
                episodes=[*episodes],
                findings=found.rows,
                remarks=[*found.remarks],
                unclear=[one.what for one in unclear],
                outcomes=None if table is None else str(table),
                outcomes_missing=missing,
                next=command,
            )
            print_json(record)
            return
        print(f"{recordings.source}: {say_count(len(found.recordings), 'episode')}")
        print_checked(found.text)
        print(plain(f"\noutcomes: {said}", keep="\n"))
        print(f"nothing was taken in; next: {command}")

    def as_typed(self, *options: str) -> str:
        """The whole command as given, with further options that replace or join those given."""
        more = " ".join(filter(None, options))
        own = options_of(self, without=("words", "inspect", "json", "options"))
        given = [*options_of(self.options), *own]
        kept = [option for option in given if option.split()[0] not in more.split()]
        said = ["prior-reinforce import", shlex.join(self.words), *kept, more]
        return " ".join(filter(None, said))


def _settle(ambiguities: Unclear, *, at_terminal: bool) -> None:
    """Let a person at the terminal confirm the guesses.

    UnclearUnitsError if they are not confirmed, or there is no terminal.
    """
    try:
        raise_if_ambiguous(ambiguities)
    except UnclearUnitsError as unclear:
        can_agree = all(one.guessed for one in ambiguities)
        if at_terminal and can_agree and agrees(f"{plain(unclear.problem)}; is it so?"):
            return
        raise

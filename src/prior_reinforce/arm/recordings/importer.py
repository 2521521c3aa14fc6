"""From a recording on disk to `Demonstrations` and a preview.

A format is a file beside this one and a line of `FORMATS`.
"""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from prior_reinforce.arm.recordings import csv, hdf5, lerobot, npz, ros, zarr
from prior_reinforce.arm.recordings.bounds import check_numbers
from prior_reinforce.arm.recordings.inspection import Inspection, Wanted, inspect
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.outcome_units import in_units
from prior_reinforce.arm.recordings.outcomes import (
    OUTCOMES_FILE,
    Outcomes,
    beside_tables,
    check_rows,
    in_order,
    missing_outcomes,
    outcomes_of,
    read_outcomes,
    table_beside,
)
from prior_reinforce.arm.recordings.preprocessing import Preprocessing, at_rests
from prior_reinforce.arm.recordings.preview import Preview
from prior_reinforce.arm.recordings.recording import Episodes, Recording, has_files
from prior_reinforce.arm.recordings.selection import Selection, select
from prior_reinforce.arm.recordings.takes import (
    ambiguities_of_times,
    ask_about_increments,
    ask_about_several_throws,
    pauses,
    ways_back,
)
from prior_reinforce.arm.recordings.units import Ambiguity, raise_if_ambiguous
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.limits import RobotLimits
from prior_reinforce.errors import ConfigurationError, FileFormatError, InvalidDemonstrationsError
from prior_reinforce.extras import check_installed
from prior_reinforce.files import refuse_pointers
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.wording import as_html, listed


@dataclass(frozen=True)
class Format:
    """How recordings of one format are recognised and read."""

    read: Callable[[Path, ReadOptions], Episodes]
    recognises: Callable[[Path], bool]
    """From names and layout alone; nothing large is opened."""
    library: str = ""
    """Optional library that reading needs, one of `extras.EXTRA_OF`."""
    options: frozenset[str] = frozenset()
    """Fields of `ReadOptions` that apply to this format, beside those that apply to all."""
    whole: bool = False
    """A folder laid out like this is this format, whatever else lies in it."""


GivenOutcomes = str | os.PathLike[str] | Mapping[str, Sequence[float]] | None
"""A table of outcomes, numbers by episode in the wanted units, or what is found beside."""
_OF_TABLES = frozenset({"episode_column", "delimiter", "decimal"})
FORMATS: Mapping[str, Format] = {
    "npz": Format(npz.read, partial(has_files, suffixes=npz.SUFFIXES)),
    "csv": Format(csv.read, partial(has_files, suffixes=csv.SUFFIXES), options=_OF_TABLES),
    "lerobot": Format(lerobot.read, lerobot.recognises, "pyarrow", whole=True),
    "hdf5": Format(hdf5.read, partial(has_files, suffixes=hdf5.SUFFIXES), "h5py"),
    "ros": Format(ros.read, ros.recognises, "rosbags"),
    "zarr": Format(zarr.read, zarr.recognises, "zarr", whole=True),
}
"""What can be read. `hdf5` covers robomimic, ManiSkill and ALOHA; `ros` ROS 1 bags, ROS 2 sqlite
bags and MCAP; `zarr` is the replay buffer of Diffusion Policy."""


@dataclass(frozen=True, eq=False)
class ImportResult:
    """What an import gives; nothing is on disk yet."""

    demonstrations: Demonstrations
    """Ready to be learned from: `demonstrations.save(path)`."""
    episodes: tuple[str, ...]
    """Name of each demonstration in its source, in order."""
    preview: Preview
    """`preview.text` to print, `preview.draw(path)` to look at."""

    def __repr__(self) -> str:
        """What was made of the recordings."""
        return f"ImportResult({self.demonstrations.n} of {self.preview.source})"

    def _repr_html_(self) -> str:
        return as_html(self.preview.text)


def import_demonstrations(
    source: str | os.PathLike[str],
    *,
    outcomes: GivenOutcomes = None,
    outcome_names: Sequence[str] | None = None,
    outcome_units: Sequence[str] | None = None,
    outcome_unit: str | None = None,
    names: Sequence[str] | None = None,
    plan_units: Sequence[str] | None = None,
    preprocessing: Preprocessing | None = None,
    robot: RobotLimits | None = None,
    gate: GateSettings | None = None,
    take_guesses: bool = False,
    **options: Any,
) -> ImportResult:
    """Read, join with the outcomes, select joints, trim, resample, and preview.

    Args:
        source: A file, or the folder that holds the recording.
        outcomes: Where each demonstration's object landed: a CSV `episode,x,y[,z][,sd]`, or numbers
            by episode name. None takes `outcomes.csv` beside or inside the source.
        outcome_names: Names of the k components, in order, matched to the CSV's columns; None
            takes those as they stand.
        outcome_units: Unit of each component; None takes those in the table's head, or metres.
        outcome_unit: Unit of the table's columns that name none (`x_cm` does); None takes the
            component's own, and is an error where no arm could have reached the outcomes.
        names: What to call the joints in the plan format; None keeps the recorded names.
        plan_units: Unit of each joint in the plan; None is radians for angles, metres for lengths.
        preprocessing: Time step, horizon and trimming; None takes the defaults.
        robot: Limits that every demonstration is checked against; None checks none.
        gate: The gate's settings for that check.
        take_guesses: Infer missing or implausible units, times and names instead of raising.
        options: Fields of `ReadOptions`.

    Raises:
        FileFormatError: As in `read_recordings`, or a damaged `outcomes.csv`.
        InvalidDemonstrationsError: Missing outcomes or joints, or motions that teach nothing.
        UnclearUnitsError: Units, times or names that are unclear, with the options that settle it.
        ConfigurationError: Settings that contradict each other.
        MissingExtraError: The format's optional library is not installed.
    """
    called = None if names is None else tuple(names)
    form = called, plan_units, outcome_names, outcome_units
    wanted = Wanted(*form, preprocessing, robot, gate)
    recordings = read(source, ReadOptions(**options))
    return recordings.imported(wanted, outcomes, outcome_unit, take_guesses=take_guesses)


def inspect_recordings(
    source: str | os.PathLike[str],
    *,
    names: Sequence[str] | None = None,
    plan_units: Sequence[str] | None = None,
    preprocessing: Preprocessing | None = None,
    robot: RobotLimits | None = None,
    gate: GateSettings | None = None,
    **options: Any,
) -> Inspection:
    """Report what recordings hold, and what an import would make of them; no outcomes are needed.

    Missing or implausible units, times and names are inferred, and listed as ambiguous. Arguments
    and errors are those of `import_demonstrations`.
    """
    called = None if names is None else tuple(names)
    wanted = Wanted(called, plan_units, preprocessing=preprocessing, robot=robot, gate=gate)
    recordings = read(source, ReadOptions(**options))
    return inspect(recordings.select(wanted), wanted)


def read_recordings(
    source: str | os.PathLike[str], *, take_guesses: bool = False, **options: Any
) -> list[Recording]:
    """Read every episode as recorded, for instance to ask for each one's outcome.

    Args:
        source: A file, or the folder that holds the recording.
        take_guesses: Infer a missing or implausible unit of the times instead of raising.
        options: Fields of `ReadOptions`.

    Raises:
        ConfigurationError: An unknown format, an option that the format has no use for, or one
            that contradicts the recording.
        UnclearUnitsError: The times name no unit, and cannot be seconds.
        FileFormatError: Missing, truncated, too large, of another format, or ambiguous without
            `key`.
        InvalidDemonstrationsError: An episode that cannot be used, or one asked for that is not
            there.
        MissingExtraError: The format's optional library is not installed.
    """
    recordings = read(source, ReadOptions(**options))
    raise_if_ambiguous(() if take_guesses else recordings.ambiguities)
    return list(recordings.episodes)


@dataclass(frozen=True, eq=False)
class Recordings:
    """The episodes of a source, read once: to be inspected, and turned into demonstrations."""

    source: Path
    format: str
    """A name of `FORMATS`."""
    options: ReadOptions
    episodes: tuple[Recording, ...]
    """The episodes to use, in order."""
    there: tuple[str, ...]
    """Names of all episodes of the source."""

    @property
    def ambiguities(self) -> tuple[Ambiguity, ...]:
        """Doubts about the times, one for each remedy; or whether one recording is several."""
        doubts = tuple(ambiguities_of_times(self.episodes))
        chosen = {"rests", "episodes", "leave_out"} & self.options.given.keys()
        if doubts or chosen or len(self.episodes) > 1:
            return doubts
        return ask_about_several_throws(self.episodes[0])

    @property
    def outcome_places(self) -> list[Path]:
        """Folders in which a table of outcomes may stand; a new one is written to the first.

        A folder of recordings has it inside; a file, or a data set that is a folder, beside it.
        """
        if self.source.is_file():
            return [self.source.parent]
        alone = FORMATS[self.format].whole or (self.source / "metadata.yaml").is_file()
        return [self.source.parent, self.source] if alone else [self.source]

    def select(self, wanted: Wanted) -> Selection:
        """Return the channels of the plan, as in `selection.select`, and what is only guessed."""
        joints, names = self.options.joints, wanted.names
        if (joints, names) == (None, None) and wanted.robot and not self.episodes[0].named:
            joints = names = wanted.robot.joint_names  # `select` asks whether it is these
        units, shares = (self.options.units, wanted.plan_units), self.format == "lerobot"
        selection = select(self.episodes, joints, names, *units, normalised=shares)
        unclear = self.ambiguities + selection.ambiguities
        if names is None:
            unclear += ask_about_increments(selection.recordings, self.options.key)
        rests = pauses(selection.recordings) if self.options.rests is None else ()
        return replace(selection, ambiguities=unclear, remarks=(*selection.remarks, *rests))

    def imported(
        self,
        wanted: Wanted,
        given: GivenOutcomes = None,
        unit: str | None = None,
        *,
        take_guesses: bool = False,
    ) -> ImportResult:
        """Make demonstrations of them, without a question; `import_demonstrations` says how."""
        selection = self.select(wanted)
        known, unclear = self.outcomes(selection, wanted, given, unit, take_guesses=take_guesses)
        raise_if_ambiguous(unclear, take_guesses=take_guesses)
        return self.demonstrations(selection, known, wanted)

    def outcomes(
        self,
        selection: Selection,
        wanted: Wanted,
        given: GivenOutcomes = None,
        unit: str | None = None,
        *,
        may_lack: bool = False,
        take_guesses: bool = False,
    ) -> tuple[Outcomes, tuple[Ambiguity, ...]]:
        """Return the outcomes in their wanted units, and all ambiguities, the selection's too.

        They are those `given` (a table, or numbers by episode in the wanted units), a table beside
        the recordings, or the recordings' own; `unit` is of columns that name none.
        ConfigurationError if the given outcomes are not numbers; InvalidDemonstrationsError, or
        UnclearUnitsError beside ambiguities, if there are none (unless they `may_lack`), a
        component is missing, or a row is of no episode; FileFormatError if the table is missing or
        damaged.
        """
        others = [] if given is not None else csv.tables_of_outcomes(self.source, self.there)
        own = table_beside(self.outcome_places)
        if own is None and len(others) == 1:
            given = others[0]
        try:
            found = self._outcomes(given, wanted.outcome_names, may_lack=may_lack)
        except InvalidDemonstrationsError as missing:
            also = str(missing)
            raise_if_ambiguous(selection.ambiguities, also, take_guesses=take_guesses)
            raise
        if isinstance(given, Mapping):
            return found, selection.ambiguities
        found, doubts = beside_tables(found, own, others)
        chosen = [recording.episode for recording in self.episodes]
        if not missing_outcomes(chosen, found):  # rows of others may be anything
            found = found.of(chosen)
        found, more = in_units(found, wanted.outcome_units, unit)
        return found, selection.ambiguities + doubts + more

    def _outcomes(
        self, given: GivenOutcomes, names: Sequence[str] | None, *, may_lack: bool
    ) -> Outcomes:
        """Return the outcomes, in the units that their source states."""
        if isinstance(given, Mapping):
            try:
                numbers = {str(name): tuple(map(float, value)) for name, value in given.items()}
            except (TypeError, ValueError) as error:
                raise ConfigurationError(
                    f"outcomes must be numbers by episode, such as {{'0': (0.9, 0.1)}}: {error}"
                ) from error
            return self._in_order(Outcomes.of_numbers("the given outcomes", numbers))
        places = self.outcome_places
        path = Path(given) if given is not None else table_beside(places)
        if path is not None:
            found = self._in_order(read_outcomes(path, names))
            return found if names is None else found.only(names)
        own = {r.episode: r.outcome.tolist() for r in self.episodes if r.outcome is not None}
        if own:
            return Outcomes.of_numbers("the recording itself", own)
        if may_lack:
            return Outcomes.of_numbers("nothing", {})
        above = table_beside([place.parent for place in places])
        hint = f" ({above} is not beside them: name it with --outcomes if it is theirs)"
        raise InvalidDemonstrationsError(
            f"no outcomes for episodes {listed([r.episode for r in self.episodes])}, and no "
            "recording format says where the object landed; write "
            f"{places[0] / OUTCOMES_FILE} with the columns episode,x,y (import --inspect writes "
            f"one to fill in), or name a table with --outcomes{hint if above else ''}"
        )

    def _in_order(self, found: Outcomes) -> Outcomes:
        """Match rows to motions by name; by their order if one file was cut and none is named."""
        motions = [recording.episode for recording in self.episodes]
        if self.options.rests and {*motions}.isdisjoint(found.episodes):
            return in_order(self.source, motions, found, ways_back(self.episodes))
        # Where some are asked for, the table may be of other sources, too.
        return check_rows(found, motions, self.there, others=self.options.episodes is not None)

    def demonstrations(
        self, selection: Selection, outcomes: Outcomes, wanted: Wanted
    ) -> ImportResult:
        """Make plans of these recordings, or of some of them, and join them with their outcomes.

        InvalidDemonstrationsError as in `outcomes_of` and `inspect`, or if a motion comes twice.
        """
        back = partial(ways_back, selection.recordings)
        seen, sd = outcomes_of(selection.episodes, outcomes, back)  # first, as the rest is slow
        remarks = (*selection.remarks, *outcomes.remarks)
        inspection = inspect(replace(selection, remarks=remarks), wanted)
        if inspection.copies:
            raise InvalidDemonstrationsError(inspection.copies)
        units = tuple(wanted.outcome_units or [unit or "m" for unit in outcomes.units])
        names = wanted.outcome_names
        if names is None:
            names = outcomes.names if outcomes.named else OutcomeFormat.metres(len(units)).names
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the preview's remarks say it, with the option to give
            demonstrations = Demonstrations(
                inspection.processed.plans,
                seen,
                inspection.format,
                OutcomeFormat(tuple(names), units),
                sd,
                symmetry=wanted.declared(inspection.format),
            )
        title = f"{self.source.name} ({self.format})"
        preview = Preview(title, inspection, demonstrations, outcomes.where)
        return ImportResult(demonstrations, preview.episodes, preview)


def read(source: str | os.PathLike[str], options: ReadOptions | None = None) -> Recordings:
    """Read the episodes of a source once; left-out episodes are not read.

    As `read_recordings`, but ambiguous times are inferred, and never raise UnclearUnitsError.
    """
    source, options = Path(source), options or ReadOptions()
    if options.format not in (None, *FORMATS):
        raise ConfigurationError(
            f"unknown format {options.format!r}; give one of {', '.join(FORMATS)}"
        )
    if not source.exists():
        raise FileFormatError(f"no recording at {source}; give the path of a file or a folder")
    refuse_pointers(source)
    kind = options.format or detect_format(source)
    for name in sorted(_OF_TABLES & options.given.keys() - FORMATS[kind].options):
        option = name.replace("_", "-")
        raise ConfigurationError(f"--{option} {options.given[name]} has no use for {kind}; drop it")
    if FORMATS[kind].library:
        check_installed(FORMATS[kind].library)
    episodes = FORMATS[kind].read(source, options)
    if options.rests:
        every = FORMATS[kind].read(source, replace(options, episodes=None, leave_out=None))
        parts = (part for _, episode in every for part in at_rests(episode(), options.rests))
        episodes = ((part.episode, partial(replace, part)) for part in parts)
    there: list[str] = []
    read_ones: dict[str, Recording] = {}
    numbers = 0
    for name, episode in episodes:
        there.append(name)
        if not options.leaves_out(name):
            read_ones[name] = episode()
            numbers += read_ones[name].positions.size
            check_numbers(source, "all of it", (numbers,))
    twice = sorted(name for name, n in Counter(there).items() if n > 1)
    if twice:
        raise InvalidDemonstrationsError(
            f"{source} holds more than one episode named {', '.join(twice)}; rename their files"
        )
    if not there:
        raise FileFormatError(f"{source} holds no episode of format {kind}; {_how_to_save()}")
    wanted = there if options.episodes is None else options.episodes
    missing = [e for e in (*wanted, *(options.leave_out or ())) if e not in there]
    if missing or not read_ones:
        what = f"no episode {', '.join(missing)}" if missing else "no episode is left"
        raise InvalidDemonstrationsError(f"{what} in {source}; it has {listed(there)}: name those")
    chosen = tuple(read_ones[name] for name in wanted if name in read_ones)
    return Recordings(source, kind, options, chosen, tuple(there))


def _how_to_save() -> str:
    return (
        "save each episode as CSV (a line of names, a row a frame, the time in a column) or NPZ; "
        f"what is read is {', '.join(FORMATS)} (--format, where a name does not tell)"
    )


def detect_format(source: Path) -> str:
    """Return the one of `FORMATS` that a file or a folder looks like, or raise FileFormatError."""
    found = [name for name, format in FORMATS.items() if format.recognises(source)]
    found = [name for name in found if FORMATS[name].whole] or found
    if not found and has_files(source, csv.IN_TEXT):
        return "csv"
    if len(found) == 1:
        return found[0]
    if found:
        raise FileFormatError(
            f"{source} looks like {' and '.join(found)}: say which with --format, or name one file"
        )
    folders = [path for path in source.iterdir() if path.is_dir()] if source.is_dir() else []
    for folder in sorted(folders):
        if within := [name for name in FORMATS if FORMATS[name].recognises(folder)]:
            join = ", or put the files of all into one folder, named as theirs" * (len(folders) > 1)
            raise FileFormatError(
                f"{source} itself holds no recordings; name {folder}, which looks like "
                f"{' or '.join(within)}{join}"
            )
    raise FileFormatError(f"{source} holds nothing that can be read; {_how_to_save()}")

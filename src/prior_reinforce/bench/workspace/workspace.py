"""A task's folder on disk: a manifest, a journal and a store. Its trials are a `Session` over them.

    workspace.toml     manifest, written by a person
    journal.sqlite     everything that happened
    demonstrations/    what was imported      files that events name, written
    models/            what was learned       once and never changed (`store.py`)
    plans/             what was executed
    executions/        what commands wrote while they executed it

Every change is one journal event, appended while no other program may. What stands is a fold over
the events, so closing the program, or a power cut, loses nothing. Here are the events that are not
a session's: demonstrations imported, a model trained.
"""

from __future__ import annotations

import dataclasses
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn

from msgspec.structs import replace
from numpy.typing import ArrayLike
from typing_extensions import Self

from prior_reinforce.adapters import ADAPTERS, DEFAULT_ADAPTER, make_adapter
from prior_reinforce.arrays import Frames
from prior_reinforce.bench.robots.executors.arguments import (
    check_command,
    split_command,
    without_arguments,
)
from prior_reinforce.bench.robots.executors.base import ArmSettings, Motion
from prior_reinforce.bench.robots.executors.command import (
    CommandResult,
    execute_command,
    read_ended,
    was_executed,
)
from prior_reinforce.bench.robots.executors.drive import Look, Request, drive_command, read_look
from prior_reinforce.bench.robots.executors.lock import executing_lock
from prior_reinforce.bench.robots.executors.pose import ask_arm
from prior_reinforce.bench.robots.executors.result import measure_tracking
from prior_reinforce.bench.robots.executors.supervision import Interruptions
from prior_reinforce.bench.robots.gate import check_plan
from prior_reinforce.bench.robots.plan_files import PlanFile, write_plan
from prior_reinforce.bench.workspace.journal import JOURNAL_FILE, Journal
from prior_reinforce.bench.workspace.log import (
    DemonstrationsImported,
    Executed,
    Executing,
    ModelTrained,
    Moved,
    Moving,
    NotExecuted,
    WorkspaceState,
)
from prior_reinforce.bench.workspace.manifest import (
    MANIFEST_FILE,
    UNKNOWN,
    Manifest,
    NewWorkspace,
    parse_manifest,
    read_manifest,
    with_columns,
)
from prior_reinforce.bench.workspace.store import Store
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    PriorReinforceError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.files import named_disk_errors, require_inside, sweep, write, write_once
from prior_reinforce.plans.motions import Demonstrations, Plan, PlanFormat
from prior_reinforce.registry import own_class
from prior_reinforce.session.events import Entry
from prior_reinforce.session.session import Session
from prior_reinforce.session.trials import Goal, Stage, Trial
from prior_reinforce.wording import as_html

if TYPE_CHECKING:
    from prior_reinforce.adapters.base import Adapter
    from prior_reinforce.bench.importing import ImportResult, Preprocessing
    from prior_reinforce.bench.robots.report import LimitReport
    from prior_reinforce.bench.workspace.records import StatusRecord
    from prior_reinforce.generators.base import FitProgress, Generator


_OWN = (
    *(MANIFEST_FILE, JOURNAL_FILE, "demonstrations", "models", "plans", "executions", "report"),
    *("demonstrations.png", "outcomes.csv"),
)
"""What is read and written in the folder."""
_LOOK_LIMIT = 60.0
"""How long an arm may take to say where it stands, in [s]; ours: to start a program and connect.
LeRobot imports for 6 s, and for 40 on a computer that is busy."""


def workspace_around(folder: Path, *, above: bool = True) -> Path | None:
    """Return the workspace that a folder is, or is in; None where it is in none.

    Args:
        folder: For instance the current one, `Path()`; what is returned is relative to it.
        above: Whether folders above it count, as far as they have the same owner: what somebody
            else put into a shared folder is nobody's workspace.
    """
    owner = folder.stat().st_uid if above else None
    for up in ("", *([".."] * len(folder.resolve().parts) if above else ())):
        folder = folder / up
        if above and folder.stat().st_uid != owner:
            return None
        if os.path.isfile(folder / MANIFEST_FILE):  # False for a name that is too long
            return folder
    return None


class Workspace:
    """Trials of one task, on disk.

    Opening one raises these, and so may every method, beside those that it names.

    Raises:
        WorkspaceError: There is no workspace; its journal is damaged, held by another program, or
            of another version; or the disk refuses.
        FileFormatError: A file that the journal names is missing, or not what was written; the
            manifest is no TOML; or a part of the workspace is a link out of it.
        ConfigurationError: The manifest holds a wrong value, or has another number of outcomes than
            the goals so far.
        InvalidDemonstrationsError: The manifest says otherwise since they were imported.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        """Open a workspace that `create` made."""
        self.folder = folder = Path(folder)
        for name in _OWN:
            require_inside(folder / name, folder)
        if not (folder / MANIFEST_FILE).is_file():
            raise WorkspaceError(
                f"{folder} is not a workspace (it has no {MANIFEST_FILE}); make one with: "
                f"prior-reinforce new {folder}"
            )
        self._read_manifest()
        self.store = Store(folder)
        self.log = Journal(folder, self.store)
        self._read: dict[str, Demonstrations] = {}

    @classmethod
    def create(
        cls, folder: str | os.PathLike[str], manifest: str | None = None, **settings: Any
    ) -> Self:
        """Make a workspace, as `prior-reinforce new` does; nothing is made if a value is wrong.

        Args:
            folder: Folder to make.
            manifest: Text of its manifest, in place of settings.
            settings: Fields of `NewWorkspace`: `robot="ur5e"`, `dt=0.01`, ...

        Raises:
            WorkspaceError: The folder holds something already, or cannot be written.
            FileFormatError: The manifest is no TOML, or the URDF cannot be read.
            ConfigurationError: A wrong value.
        """
        folder = Path(folder)
        text = manifest or NewWorkspace(**settings).manifest(folder.resolve().name)
        parse_manifest(text, folder / MANIFEST_FILE)
        with named_disk_errors(folder):
            sweep(folder)
            if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
                raise WorkspaceError(f"{folder} exists and is not empty; choose a new folder")
            folder.mkdir(parents=True, exist_ok=True)
            write(folder / MANIFEST_FILE, text)
        return cls(folder)

    def _read_manifest(self) -> None:
        """Know what the manifest says now."""
        path = self.folder / MANIFEST_FILE
        self.manifest: Manifest = parse_manifest(read_manifest(path), path)

    def __repr__(self) -> str:
        try:
            state = self.state
        except PriorReinforceError as error:
            return f"Workspace({str(self.folder)!r}: {error})"
        goal = f"goal {len(state.goals)}" if state.goals else "no goal"
        return f"Workspace({str(self.folder)!r}: {goal}, trial {len(state.trials)})"

    def _repr_html_(self) -> str:
        return as_html(self.status().text)

    def __reduce__(self) -> NoReturn:
        self.log.__reduce__()

    def close(self) -> None:
        """Close the journal."""
        self.log.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Close the journal; an error that ends the block says whether something was recorded."""
        if self.log.appended and isinstance(error, (PriorReinforceError, OSError)):
            error.changed = True  # type: ignore[union-attr]
        elif self.log.appended and isinstance(error, KeyboardInterrupt):
            error.args = error.args or ("what was recorded before stays",)
        self.close()

    @property
    def events(self) -> Sequence[Entry]:
        """The journal."""
        return self.log.entries()

    @property
    def state(self) -> WorkspaceState:
        """What the journal adds up to."""
        state, k = self.log.state(), len(self.manifest.outcome_names)
        if any(goal.goal.size != k for goal in state.goals):
            raise ConfigurationError(
                f"{self.folder / MANIFEST_FILE} names {k} outcomes, but goals were set with "
                f"{state.goals[0].goal.size}; put it back, or make another workspace"
            )
        return state

    @property
    def demonstrations(self) -> Demonstrations:
        """The demonstrations in use; a WorkspaceError if none were imported yet."""
        sha256 = self.state.demonstrations
        if sha256 is None:
            raise WorkspaceError(
                f"{self.folder} has no demonstrations yet; bring them in with: prior-reinforce "
                f"import {self.folder} RECORDINGS"
            )
        return self._demonstrations(sha256)

    def demonstrations_of(self, model: str) -> Demonstrations:
        """The demonstrations that a model was fitted to."""
        return self._demonstrations(self.state.trainings[model].demonstrations_sha256)

    def session(self, own: str | None = None, own_adapter: str | None = None) -> Session:
        """The trials of this workspace. Telling needs no model; asking loads it.

        Args:
            own: `module:Class` that the model was learned by, where it is one's own: nothing in the
                folder may start code.
            own_adapter: `module:Class` that the goal was set with, likewise.
        """
        goals = self.state.goals
        return Session(
            lambda: self._generator(own),
            lambda: self._adapter(goals[-1].adapter if goals else "", own_adapter),
            lambda: self.demonstrations,
            tolerance=self.manifest.tolerance,
            log=self.log,
            gate=self.gate,
        )

    def set_goal(
        self,
        goal: ArrayLike,
        *,
        carry_over: bool | None = None,
        adapter: str = DEFAULT_ADAPTER,
        new_hardware: str | None = None,
    ) -> Goal:
        """Set the goal that the next trials are for; arguments and errors as `Session.set_goal`.

        `adapter` is any choice, for instance `gp` or `proportional,gain=0.6`; a ConfigurationError
        if there is none.
        """
        ADAPTERS.check(adapter)
        return self.session().set_goal(
            goal, carry_over=carry_over, adapter=adapter, new_hardware=new_hardware
        )

    def gate(self, frames: Frames) -> LimitReport | None:
        """Hold a plan against the robot's limits of now; None where the manifest names no robot.

        The manifest is read again: a person may have narrowed the limits while this program waits.
        """
        self._read_manifest()
        if self.manifest.robot is None:
            return None
        training = self.state.training
        shown = self.demonstrations if training is None else self.demonstrations_of(training.model)
        plan = Plan(frames, shown.format)
        return check_plan(plan, self.manifest.robot, shown, self.manifest.gate)

    def plan_path(self, trial: Trial) -> Path:
        """Where a trial's plan file is."""
        return self.store.plan_file(trial).path

    def plan(self, trial: Trial) -> Plan:
        """A trial's plan, checked against the hash in the journal."""
        return self.store.plan(trial)

    def export(
        self, number: int, path: str | os.PathLike[str], *, rate: float | None = None
    ) -> PlanFile:
        """Write a trial's plan as NPZ, CSV, or JSON in ROS 2's JointTrajectory order.

        Args:
            number: The trial's.
            path: Where to: .npz, .csv or .json; no file is written over.
            rate: Samples a second; the plan's own frames if not given.

        Raises:
            RobotLimitError: The plan breaks a limit of now.
            TrialStateError: There is no such trial.
            FileFormatError: The file is there already.
            ConfigurationError: Another kind of file, or an impossible rate.
        """
        plan = self.plan(self.state.trial(number))
        verdict = self.gate(plan.actions)
        if verdict is not None:
            verdict.require()
        return write_plan(plan, Path(path), rate=rate)

    def pack(self, path: str | os.PathLike[str]) -> str:
        """Write the workspace into one file, without what is this machine's own ([arm], outputs).

        Args:
            path: The file; none is written over.

        Returns:
            Its SHA-256, for whoever gets it to compare.

        Raises:
            FileFormatError: The file is there already.
            WorkspaceError: A trial is executing.
        """
        from prior_reinforce.bench.workspace.packing import pack

        return pack(self, Path(path))

    @classmethod
    def unpack(cls, path: str | os.PathLike[str], folder: str | os.PathLike[str]) -> Self:
        """Make a workspace of what `pack` wrote, and open it; nothing in it runs code.

        Raises:
            FileFormatError: It is damaged, was changed, or holds what `pack` does not write.
            WorkspaceError: The folder exists.
        """
        from prior_reinforce.bench.workspace.packing import unpack

        unpack(Path(path), Path(folder))
        return cls(folder)

    def status(self) -> StatusRecord:
        """Where the workspace stands, as `prior-reinforce status --json`; printed, in ten lines."""
        from prior_reinforce.bench.workspace.records import status_record

        return status_record(self)

    def report(
        self,
        folder: str | os.PathLike[str] | None = None,
        *,
        progress: Callable[[int, int], None] | None = None,
    ) -> Path:
        """Write a page with every goal, its trials and plans, and return its path.

        Args:
            folder: For the page and its pictures; `report` in the workspace if not given.
            progress: Called with the number of goals drawn and of all goals.

        Raises:
            WorkspaceError: There is nothing to report yet.
        """
        from prior_reinforce.bench.workspace.report import report_workspace

        return report_workspace(self, Path(folder or self.folder / "report"), progress)

    def import_recordings(
        self,
        source: str | os.PathLike[str],
        *,
        outcomes: str | os.PathLike[str] | Mapping[str, Sequence[float]] | None = None,
        outcome_unit: str | None = None,
        preprocessing: Preprocessing | None = None,
        append: bool = False,
        take_guesses: bool = False,
        **options: Any,
    ) -> ImportResult:
        """Take in recordings, as `prior-reinforce import` does.

        Args:
            source: A file or a folder.
            outcomes: Where each demonstration's object ended: a table, or numbers by episode;
                `outcomes.csv` beside the source if not given.
            outcome_unit: Unit of that table's columns that name none.
            preprocessing: Horizon, trimming, smoothing; its time step is the manifest's.
            append: Keep the demonstrations in use and add these.
            take_guesses: Infer missing or implausible units, times and names instead of raising.
            options: Fields of `ReadOptions`: `units=["deg"]`, `rate=100`, ...

        Returns:
            What was made of them: print `preview.text`, look at `preview.draw()`.

        Raises:
            InvalidDemonstrationsError, UnclearUnitsError, FileFormatError: See
                `import_demonstrations`.
            TrialStateError: A trial waits to be told.
        """
        from prior_reinforce.bench.importing import Preprocessing, import_demonstrations

        self.state.refuse_open_trial("importing demonstrations")
        manifest, form = self.manifest, self.manifest.format
        if form.names != UNKNOWN:
            meant = {"names": form.names, "plan_units": form.units}
            options = {"joints": form.names, **options, **meant}
        result = import_demonstrations(
            source,
            outcomes=outcomes,
            outcome_names=manifest.outcome_names,
            outcome_units=manifest.outcome_units,
            outcome_unit=outcome_unit,
            preprocessing=dataclasses.replace(preprocessing or Preprocessing(), dt=form.dt),
            robot=manifest.robot,
            gate=manifest.gate,
            take_guesses=take_guesses,
            **options,
        )
        self.take_in(result, str(source), append=append)
        return result

    def take_in(self, result: ImportResult, source: str, *, append: bool = False) -> int:
        """Take in what an import made, in place of earlier demonstrations or beside them.

        Returns:
            The number of demonstrations that were there and stay.

        Raises:
            InvalidDemonstrationsError, TrialStateError: As in `import_demonstrations`.
        """
        from prior_reinforce.bench.importing import appended

        demonstrations, n_before = result.demonstrations, 0
        if left_out := result.preview.inspection.selection.left_out:
            source = f"{source}, without what moves as well: {left_out}"
        if append:
            before = self.demonstrations
            demonstrations, n_before = appended(before, demonstrations), before.n
            source = f"{source}, appended to {n_before}"
        self.import_demonstrations(demonstrations, source)
        return n_before

    def import_demonstrations(self, demonstrations: Demonstrations, source: str) -> None:
        """Take in demonstrations, in place of earlier ones.

        Raises:
            InvalidDemonstrationsError: They do not fit the manifest, or the trials so far.
            TrialStateError: A trial waits to be told.
        """
        if self.manifest.format.names == UNKNOWN:
            self._take_columns(demonstrations.format)
        self._check_fit(demonstrations, source)
        with self.log.exclusive():
            self.state.refuse_open_trial("importing demonstrations")
            names = self._names_of_plans()
            if names not in (None, demonstrations.format.names):
                raise InvalidDemonstrationsError(
                    f"trials were made with {names}, but {source} has "
                    f"{demonstrations.format.names}; make another workspace for it"
                )
            self.store.save_demonstrations(demonstrations)
            self.log.append(
                DemonstrationsImported(
                    n=demonstrations.n, sha256=demonstrations.sha256, source=source
                )
            )

    def _take_columns(self, form: PlanFormat) -> None:
        """Write the names and units of recorded columns into the manifest, which knew none."""
        path = self.folder / MANIFEST_FILE
        with named_disk_errors(self.folder):
            write(path, with_columns(read_manifest(path), form.names, form.units))
        self._read_manifest()

    def learn(
        self,
        generator: str = "auto",
        *,
        seed: int = 0,
        device: str = "cpu",
        progress: Callable[[FitProgress], None] | None = None,
    ) -> ModelTrained:
        """Fit a generator to the demonstrations and put it in use.

        Args:
            generator: Choice of the generator, for instance `auto`, `diffusion`,
                `interpolation,timing=align` or `module:Class`.
            seed: Of the fit.
            device: Where torch computes while it learns, `cpu` or `cuda`.
            progress: Called now and then while fitting.

        Raises:
            ConfigurationError: There is no such generator.
            TrialStateError: A trial waits to be told.
            WorkspaceError: No demonstrations were imported yet.
            InvalidDemonstrationsError: They cannot be learned from.
        """
        from prior_reinforce.generators import make_generator

        self.state.refuse_open_trial("learning")
        demonstrations, known_as = self.demonstrations, self.state.demonstrations
        assert known_as is not None
        made = make_generator(generator, device=device, states=self.store.path(".training"))
        made.check_savable()
        fitted = made.fit(demonstrations, seed=seed, progress=progress)
        trained = ModelTrained(
            model=self.store.save_model(fitted),
            generator=generator,
            seed=seed,
            demonstrations_sha256=known_as,
            remarks=tuple(fitted.remarks),
        )
        with self.log.exclusive():
            self.state.refuse_open_trial("learning")
            self.log.append(trained)
        return trained

    def execute(
        self,
        number: int,
        command: str | ArmSettings,
        *,
        time_limit: float,
        motion: Motion = "trial",
        speed: float = 1.0,
        show: Callable[[str], None] | None = None,
        stop_seen: int | None = None,
    ) -> CommandResult:
        """Execute a trial's plan by a command or by the manifest's arm, once.

        The journal says `executing` before the command starts and `executed` after all that it
        started ended, so a program that dies in between leaves a trial of which only a person knows
        what moved (or `recover`). While what it left behind goes on, the trial still counts as
        executing. A motion that is no trial is noted likewise, by `moving` and `moved`, and the
        plan may be executed afterwards.

        Args:
            number: The open trial.
            command: For instance `mycontroller {plan} {result}`; or the arm, as a person saw it.
            time_limit: Of the command, in [s]; of an arm, beyond the plan's own duration.
            motion: An arm may also approach the plan's first frame, or rehearse it.
            speed: Share of the plan's own speed, of a rehearsal.
            show: Called with the command's output as it comes.
            stop_seen: `last_stop` when it was asked for; after a stop since then, nothing begins.
                Now if not given.

        Raises:
            TrialStateError: It was stopped since, executed already, is not open, or another program
                executes one.
            RobotLimitError: The plan breaks a limit of now; nothing moved.
            ConfigurationError: The command could not be started; nothing moved, and the journal
                says so.
            KeyboardInterrupt: Interrupted; the command was stopped, and the journal says so.
        """
        if (speed != 1.0) != (motion == "rehearsal") or not 0 < speed <= 1:
            raise ConfigurationError(
                f"a rehearsal has a share of the plan's speed above 0 and below 1, and nothing "
                f"else has; got {motion} at {speed}"
            )
        text = self._command(command, motion, speed)
        check_command(text, time_limit=time_limit)
        self._read_manifest()
        arm = self.manifest.arm
        with (
            executing_lock(self.folder, arm, stop_seen) as lock,
            Interruptions() as interruptions,
        ):
            self._note_unknown_execution(self.state.trial(number))
            trial = self.to_execute(number)
            plan, file = self.plan(trial), self.store.plan_file(trial)
            verdict = self.gate(plan.actions)
            if verdict is not None:
                verdict.require()
            if isinstance(command, ArmSettings):
                time_limit += float(plan.times[-1]) / speed
            # The gate has read it again; a person said yes to what it said before.
            if self.manifest.arm != arm or text != self._command(command, motion, speed):
                raise ConfigurationError(
                    f"{self.folder / MANIFEST_FILE} names another arm since; ask again"
                )
            if lock.revoked():
                raise TrialStateError(
                    f"somebody pressed Stop since this was asked for: no {motion} began; ask again"
                )
            folder = self.store.make_execution_folder(
                file.path.name if motion == "trial" else f"{motion}-{file.path.name}"
            )
            who = command.executor if isinstance(command, ArmSettings) else without_arguments(text)
            self._begin(
                Executing(number, who, folder.name)
                if motion == "trial"
                else Moving(number, motion, speed, who, folder.name)
            )
            try:
                result, raised = execute_command(
                    text,
                    file,
                    folder,
                    time_limit=time_limit,
                    lock=lock,
                    interruptions=interruptions,
                    show=show,
                )
            except (PriorReinforceError, KeyboardInterrupt):
                never = NotExecuted if motion == "trial" else Moved
                self._end(never(trial=number, outcome="not_moved"))
                raise
            if result.outcome != "unknown":
                result = self._record(result, trial, folder, motion, speed)
        if raised is not None:
            raise raised
        if interruptions.came:
            which = f"trial {number}" if motion == "trial" else f"the {motion} of trial {number}"
            raise KeyboardInterrupt(f"{which}: {result.outcome} ({result.reason})")
        return result

    def to_execute(self, number: int) -> Trial:
        """A trial whose plan was not executed yet.

        Raises:
            TrialStateError: It was, or the trial is closed.
        """
        trial = self.state.trial(number)
        if trial.stage is not Stage.ASKED:
            raise TrialStateError(
                f"trial {number} is {trial.stage.value} already; a plan runs once: tell it or "
                "void it, then ask for the next"
            )
        return trial

    def look_at_arm(self, number: int, arm: ArmSettings, *, speed: float = 1.0) -> Look:
        """Ask the manifest's arm how it stands to a trial's plan, and whether it takes it.

        Nothing moves, and nothing is written down.

        Raises:
            TrialStateError: It is moved or recorded right now: two programs on one bus clash.
            ConfigurationError: The arm does not answer, or is another one since.
        """
        text = self._command(arm, "look", speed)
        plan = self.store.plan_file(self.state.trial(number))
        with executing_lock(arm=self.manifest.arm), tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            copy = write_once(folder / plan.path.name, plan.verify())
            words = split_command(text, copy, folder)
            ask_arm(arm.executor, words, folder, time_limit=_LOOK_LIMIT)
            return read_look(folder)

    def _command(
        self, command: str | ArmSettings, motion: Motion | Literal["look"], speed: float
    ) -> str:
        """The text of a command, or of the program that lets an arm's executor move it."""
        if isinstance(command, str):
            if motion != "trial":
                raise ConfigurationError(f"a command makes no {motion}; name the arm in [arm]")
            return command
        if self.manifest.driven_by != command:
            raise ConfigurationError(
                f"{self.folder / MANIFEST_FILE} names another arm since; ask again"
            )
        return drive_command(
            Request(command, self.manifest.gate, motion, speed, self.manifest.robot)
        )

    def recover(self) -> Trial | None:
        """Note how an execution ended whose program was killed, where its supervisor wrote it down.

        Returns:
            The trial as it stands now; None where there is nothing to recover.
        """
        trial = self.state.open_trial
        if trial is None or self.log.is_executing():
            return None
        self._note_unknown_execution(trial)
        began = self.state.executions.get(trial.number)
        if not isinstance(began, Executing) or not began.command or not began.folder:
            return None  # a person has to say
        folder = self.store.execution_folder(began.folder)
        result = read_ended(folder, began.command, self.store.plan_file(trial))
        if result is None:
            return None
        self._record(result, trial, folder)
        return self.state.trial(trial.number)

    def _begin(self, event: Executing | Moving) -> None:
        """Note that a trial's plan is given to a command now: a plan is executed once."""
        with self.log.exclusive():
            self.to_execute(event.trial)
            self.log.append(event)

    def _end(self, event: Executed | Moved) -> None:
        """Note how the command ended, unless the trial was told meanwhile."""
        with self.log.exclusive():
            if isinstance(event, Moved) or (self.state.trial(event.trial).stage is Stage.EXECUTING):
                self.log.append(event)

    def _note_unknown_execution(self, trial: Trial) -> None:
        """Note where a trial's plan was given to a command and no event says so.

        Such a journal was restored from a copy; a person has to say whether that was this trial.
        """
        if trial.stage is Stage.ASKED:
            known = {e.event.folder for e in self.events if isinstance(e.event, Executing)}
            for folder in self.store.execution_folders(self.plan_path(trial).name):
                if folder.name not in known and was_executed(folder):
                    self._begin(Executing(trial=trial.number, command="", folder=folder.name))
                    return

    def _record(
        self,
        result: CommandResult,
        trial: Trial,
        folder: Path,
        motion: Motion = "trial",
        speed: float = 1.0,
    ) -> CommandResult:
        """Record how a command ended, with its tracking error where the driver measured its path.

        Returns:
            The result with that error.
        """
        try:
            plan = self.plan(trial)
            slow = dataclasses.replace(plan.format, dt=plan.format.dt / speed)
            if motion != "approach":
                result = replace(result, **measure_tracking(folder, Plan(plan.actions, slow)))
        except FileFormatError as error:
            reasons = filter(None, [result.reason, str(error)])
            result = replace(result, reason="; ".join(reasons))
        event: type[Executed | Moved] = NotExecuted if result.outcome == "not_moved" else Executed
        self._end((event if motion == "trial" else Moved)(trial=trial.number, **result.as_json()))
        return result

    def _names_of_plans(self) -> tuple[str, ...] | None:
        """Names of the columns of earlier trials' plans; None where none can be read."""
        for trial in self.state.trials:
            with suppress(FileFormatError):
                return self.plan(trial).format.names
        return None

    def _generator(self, own: str | None) -> Generator:
        """The model in use."""
        self.demonstrations  # noqa: B018  (whether there are any that fit the manifest)
        training = self.state.training
        if training is None or self.state.stale:
            why = "other demonstrations were imported since the model was learned"
            why = why if training is not None else "nothing is learned yet"
            raise WorkspaceError(f"{why}; run: prior-reinforce learn {self.folder}")
        said = "the model was learned by"
        _require_own(own, training.generator, "generator", said, "learn again")
        return self.store.model(training.model, own)

    def _adapter(self, choice: str, own: str | None) -> Adapter:
        """The adapter that a goal was set with."""
        choice = choice or DEFAULT_ADAPTER
        _require_own(own, choice, "adapter", "the goal was set with", "set the goal again")
        return make_adapter(choice)

    def _demonstrations(self, sha256: str) -> Demonstrations:
        if sha256 not in self._read:
            self._read[sha256] = self.store.demonstrations(sha256)
        self._check_fit(self._read[sha256], "what was imported")
        return self._read[sha256]

    def _check_fit(self, demonstrations: Demonstrations, source: str) -> None:
        manifest = self.manifest
        form, expected = demonstrations.format, manifest.format
        for what, given, wanted in (
            ("action names", form.names, expected.names),
            ("action units", form.units, expected.units),
            ("outcome names", demonstrations.outcome_names, manifest.outcome_names),
            ("outcome units", demonstrations.outcome_units, manifest.outcome_units),
            # A picosecond is rounding; anything more is another tempo.
            ("dt", round(form.dt, 12), round(expected.dt, 12)),
        ):
            if given != wanted:
                raise InvalidDemonstrationsError(
                    f"{source} has {what} {given}, but {self.folder / MANIFEST_FILE} says "
                    f"{wanted}; change the manifest, or import again"
                )


def _require_own(given: str | None, choice: str, family: str, said: str, again: str) -> None:
    """Refuse to start code that only the journal names, and a class that it does not name."""
    own = own_class(choice)
    if given != own:
        remedy = f"drop --{family}, or {again}"
        if own is not None:
            remedy = f"name it, for the journal starts no code: --{family} {own}"
        raise ConfigurationError(f"{said} {choice}; {remedy}")

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
import functools
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from numpy.typing import ArrayLike
from typing_extensions import Self

from prior_reinforce.adapters import ADAPTERS, DEFAULT_ADAPTER, make_adapter
from prior_reinforce.arm.robots.gate import check_plan
from prior_reinforce.arm.robots.plan_files import PlanFile, resample_plan, write_plan
from prior_reinforce.arm.workspace.events import DemonstrationsImported, ModelTrained
from prior_reinforce.arm.workspace.folder import check_folder, make_folder
from prior_reinforce.arm.workspace.journal import Journal
from prior_reinforce.arm.workspace.manifest import (
    MANIFEST_FILE,
    UNKNOWN,
    Manifest,
    parse_manifest,
    read_text,
)
from prior_reinforce.arm.workspace.reaching import axis_of, require_reach
from prior_reinforce.arm.workspace.state import Standing, WorkspaceState
from prior_reinforce.arm.workspace.store import Store
from prior_reinforce.arm.workspace.template import NewWorkspace, with_columns
from prior_reinforce.arm.workspace.text import check_open
from prior_reinforce.arm.workspace.view import StatusView, status_view
from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    OutOfReachError,
    PriorReinforceError,
)
from prior_reinforce.files import named_disk_errors, write
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.session.events import Entry
from prior_reinforce.session.session import Session
from prior_reinforce.session.trials import Goal, Trial
from prior_reinforce.wording import as_html

if TYPE_CHECKING:
    from prior_reinforce.arm.recordings import ImportResult, Preprocessing, Wanted
    from prior_reinforce.arm.robots.report import LimitReport
    from prior_reinforce.generators.base import FitProgress, Generator


class Workspace:
    """Trials of one task, on disk.

    Opening one raises these, and so may every method, beside those that it names.

    Raises:
        WorkspaceError: There is no workspace; its journal is damaged, held by another program, or
            of another version; or the disk refuses.
        FileFormatError: A file that the journal names is missing, or not what was written; the
            manifest is no TOML; or a part of the workspace is a link out of it.
        ConfigurationError: The manifest holds a wrong value, or has other names or units of
            outcomes than the goals so far.
        InvalidDemonstrationsError: The manifest says otherwise since they were imported.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        """Open a workspace that `create` made."""
        self.folder = folder = Path(folder)
        check_folder(folder)
        self._manifest_text: str | None = None
        self.read_manifest()
        self.store = Store(folder)
        self.log = Journal(folder, self.store)
        self._stored = functools.cache(self.store.demonstrations)

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
            FileFormatError, ConfigurationError: See `NewWorkspace.manifest` and `parse_manifest`.
        """
        folder = Path(folder)
        text = manifest or NewWorkspace(**settings).manifest(folder.resolve().name)
        make_folder(folder, text)
        return cls(folder)

    def read_manifest(self) -> None:
        """Know what the manifest says now."""
        path = self.folder / MANIFEST_FILE
        text = read_text(path)
        if text != self._manifest_text:
            self.manifest: Manifest = parse_manifest(text, path)
            self._manifest_text = text

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
        state = self.log.state()
        self._check_outcomes(state)
        return state

    @property
    def standing(self) -> Standing:
        """The workspace at this moment, to be read once and handed down."""
        return Standing(self.folder, self.manifest, self.state)

    @property
    def demonstrations(self) -> Demonstrations:
        """The demonstrations in use, read once; they fit the manifest of now."""
        return self._demonstrations(self.standing.imported.sha256)

    @property
    def model(self) -> Generator:
        """The model in use; a WorkspaceError where there is none, or it is stale."""
        return self.store.model(self.standing.trained.model)

    def _check_outcomes(self, state: WorkspaceState) -> None:
        """ConfigurationError if goals were set in other outcomes than the manifest's of now."""
        form = self.manifest.outcome_format
        known = state.goals[-1].format if state.goals else form
        if (form.names, form.units) != (known.names, known.units):
            raise ConfigurationError(
                f"{self.folder / MANIFEST_FILE} says that outcomes are {form}, but goals were set "
                f"in {known}; put it back, or make another workspace"
            )

    def session(self) -> Session:
        """The trials of this workspace. Telling needs no model; asking loads it."""
        self._check_outcomes(self.log.state())  # a reading means the manifest's outcomes
        return Session(
            lambda: self.model,
            lambda: make_adapter(getattr(self.state.goal, "adapter", DEFAULT_ADAPTER)),
            lambda: self.demonstrations,
            tolerance=self.manifest.outcome_format.tolerance,
            log=self.log,
            gate=self.gate,
            check_open=lambda trial, verb: check_open(self.standing, trial, verb),
        )

    def set_goal(
        self,
        goal: ArrayLike | str,
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
        require_reach(self, goal)
        if carry_over is None:
            carry_over = ADAPTERS.resolve(adapter).carries_over
        return self.session().set_goal(
            goal, carry_over=carry_over, adapter=adapter, new_hardware=new_hardware
        )

    def gate(self, frames: Frames, condition: Point, dt: float | None = None) -> LimitReport | None:
        """Hold a plan against the robot's limits of now; None where the manifest names no robot.

        `condition` is what it was generated for; `dt` is the time between two frames, in [s], where
        it is not the demonstrations'. The manifest is read again: a person may have narrowed the
        limits while this program waits.
        """
        self.read_manifest()
        if self.manifest.robot is None:
            return None
        training = self.state.training
        sha256 = training.demonstrations_sha256 if training else self.standing.imported.sha256
        shown = self._demonstrations(sha256)
        form = shown.format if dt is None else dataclasses.replace(shown.format, dt=dt)
        plan = Plan(frames, form)
        return check_plan(plan, self.manifest.robot, shown, self.manifest.gate, condition)

    def plan_file(self, trial: Trial) -> PlanFile:
        """The file of a trial's plan, and its hash in the journal."""
        return self.store.plan_file(self.log.state().plan_files[trial.number])

    def plan(self, trial: Trial) -> Plan:
        """A trial's plan, checked against the hash in the journal."""
        return self.store.plan(self.log.state().plan_files[trial.number])

    def export(
        self, number: int, path: str | os.PathLike[str], *, rate: float | None = None
    ) -> PlanFile:
        """Write a trial's plan as NPZ, CSV, or JSON in ROS 2's JointTrajectory order.

        Args:
            number: The trial's.
            path: Where to: .npz, .csv or .json; no file is written over.
            rate: Samples a second; the plan's own frames if not given.

        Raises:
            RobotLimitError: The plan breaks a limit of now, as the file has it.
            InvalidPlanError: A rate at which it is another motion.
            TrialStateError: There is no such trial.
            FileFormatError: The file is there already.
            ConfigurationError: Another kind of file, or an impossible rate.
        """
        trial = self.state.trial(number)
        plan = self.plan(trial)
        if rate is not None:
            plan = resample_plan(plan, rate)
        verdict = self.gate(plan.actions, trial.condition, plan.format.dt)
        if verdict is not None:
            verdict.require()
        return write_plan(plan, Path(path))

    def status(self) -> StatusView:
        """Where the workspace stands, as `prior-reinforce status --json`; printed, in ten lines."""
        return status_view(self.standing)

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
        from prior_reinforce.arm.workspace.report import report_workspace

        out = Path(folder or self.folder / "report")
        return report_workspace(self.standing, self.events, out, progress)

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
            InvalidDemonstrationsError, UnclearUnitsError, FileFormatError: As it says there.
            TrialStateError: A trial waits to be told.
        """
        from prior_reinforce.arm.recordings import ReadOptions, read

        self.state.refuse_open_trial("importing demonstrations")
        wanted = self.wanted(preprocessing, append=append)
        recordings = read(source, ReadOptions(**{"joints": wanted.names, **options}))
        result = recordings.imported(wanted, outcomes, outcome_unit, take_guesses=take_guesses)
        self.take_in(result, str(source), append=append)
        return result

    def wanted(self, preprocessing: Preprocessing | None = None, *, append: bool = False) -> Wanted:
        """Return what recordings are to become here; the time step is the manifest's."""
        from prior_reinforce.arm.recordings import Preprocessing, Wanted

        manifest, form = self.manifest, self.manifest.format
        names, units = (None, None) if form.names == UNKNOWN else (form.names, form.units)
        if names is None and form.units != ("rad",):  # which `new` was told
            units = form.units
        outcome, before = manifest.outcome_format, self.demonstrations if append else None
        how = dataclasses.replace(preprocessing or Preprocessing(), dt=form.dt)
        checks = manifest.robot, manifest.gate, manifest.declared
        return Wanted(names, units, outcome.names, outcome.units, how, *checks, before)

    def take_in(self, result: ImportResult, source: str, *, append: bool = False) -> int:
        """Take in what an import made, in place of earlier demonstrations or beside them.

        Returns:
            The number of demonstrations that were there and stay.

        Raises:
            InvalidDemonstrationsError, TrialStateError: As in `import_demonstrations`.
        """
        from prior_reinforce.arm.recordings.appending import appended

        demonstrations, n_before = result.demonstrations, 0
        if left_out := result.preview.inspection.selection.left_out:
            source = f"{source}, without what moves as well: {left_out}"
        if append:
            before, n_before = self.demonstrations, self.demonstrations.n
            demonstrations = appended(before, demonstrations, result.episodes)
            source = f"{source}, appended to {n_before}"
        self.import_demonstrations(demonstrations, source)
        return n_before

    def import_demonstrations(self, demonstrations: Demonstrations, source: str) -> None:
        """Take in demonstrations, in place of earlier ones.

        Raises:
            InvalidDemonstrationsError: They do not fit the manifest, or the trials so far.
            TrialStateError: A trial waits to be told.
        """
        path, form = self.folder / MANIFEST_FILE, demonstrations.format
        declared = self.manifest.declared(form)
        if declared is not None:
            demonstrations = demonstrations.with_symmetry(declared)
        if self.manifest.format.names == UNKNOWN:
            with named_disk_errors(self.folder):
                write(path, with_columns(read_text(path), form.names, form.units))
            self.read_manifest()
        self.manifest.check_fit(demonstrations, source, path)
        with self.log.exclusive():
            self.state.refuse_open_trial("importing demonstrations")
            names = self.store.names_of_plans(self.state.plan_files.values())
            if names not in (None, form.names):
                raise InvalidDemonstrationsError(
                    f"trials were made with {names}, but {source} has {form.names}; make another "
                    "workspace for it"
                )
            self.store.save_demonstrations(demonstrations)
            n, sha256 = demonstrations.n, demonstrations.sha256
            self.log.append(DemonstrationsImported(n=n, sha256=sha256, source=source))

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
                `interpolation,timing=align`.
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
        imported = self.standing.imported
        stored = self.store.demonstrations(imported.sha256)
        if not self.manifest.agrees(stored, in_range=True):
            self.import_demonstrations(stored, imported.source)
            imported = self.standing.imported
        demonstrations = self.demonstrations
        made = make_generator(generator, device=device)
        made.check_savable()
        axis = axis_of(demonstrations, self.manifest.robot)
        try:
            fitted = made.fit(demonstrations, seed=seed, progress=progress)
        except OutOfReachError as error:  # turned about a wrong axis, motions leave the arm's reach
            raise OutOfReachError("; ".join([str(error), *axis])) from error
        trained = ModelTrained(
            model=self.store.save_model(fitted),
            generator=generator,
            seed=seed,
            demonstrations_sha256=imported.sha256,
            remarks=(*fitted.remarks, *axis),
        )
        with self.log.exclusive():
            self.state.refuse_open_trial("learning")
            self.log.append(trained)
        return trained

    def _demonstrations(self, sha256: str) -> Demonstrations:
        found = self._stored(sha256)
        self.manifest.check_fit(found, "what was imported", self.folder / MANIFEST_FILE)
        return found

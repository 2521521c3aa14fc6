"""A task's folder on disk: what stands in it, and what is learned from.

    workspace.toml     manifest, written by a person
    journal.sqlite     everything that happened
    demonstrations/    what was imported      files that events name, written
    models/            what was learned       once and never changed (`store.py`)
    plans/             what was handed out

Every change is one journal event, appended while no other program may. What stands is a fold over
the events, made anew each time, so closing the program, or a power cut, loses nothing.
"""

from __future__ import annotations

import os
from numbers import Integral
from pathlib import Path

from numpy.typing import ArrayLike

from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.generators import Generator
from prior_reinforce.generators.by_name import name_of
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.robots import LimitReport, check_plan
from prior_reinforce.session import Session
from prior_reinforce.workspace.history import GoalRecord, History, TrialRecord, fold
from prior_reinforce.workspace.journal import JOURNAL_FILE, Event, Journal
from prior_reinforce.workspace.manifest import (
    MANIFEST_FILE,
    Manifest,
    load_manifest,
    parse_manifest,
)
from prior_reinforce.workspace.sessions import build_session
from prior_reinforce.workspace.store import Store

MEMORIES = ("goal", "workspace")


class Workspace:
    """Trials of one task, on disk."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        """Open a workspace that `create` made.

        Raises:
            WorkspaceError: There is none, or its journal cannot be used.
            FileFormatError: Its manifest is no TOML.
            ConfigurationError: Its manifest holds a wrong value.
        """
        self.folder = folder = Path(folder)
        if not (folder / MANIFEST_FILE).is_file():
            raise WorkspaceError(
                f"{folder} is not a workspace (it has no {MANIFEST_FILE}); make one with: "
                f"prior-reinforce new {folder}"
            )
        self.manifest: Manifest = load_manifest(folder / MANIFEST_FILE)
        self.journal = Journal(folder / JOURNAL_FILE)
        self.store = Store(folder)

    @classmethod
    def create(cls, folder: str | os.PathLike[str], manifest: str) -> Workspace:
        """Make a workspace from the text of its manifest; nothing is made if that is wrong.

        Raises:
            WorkspaceError: The folder holds something already, or cannot be written.
            FileFormatError: The manifest is no TOML.
            ConfigurationError: The manifest holds a wrong value.
        """
        folder = Path(folder)
        parse_manifest(manifest, folder / MANIFEST_FILE)
        try:
            if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
                raise WorkspaceError(f"{folder} exists and is not empty; choose a new folder")
            folder.mkdir(parents=True, exist_ok=True)
            (folder / MANIFEST_FILE).write_text(manifest, encoding="utf-8")
        except OSError as error:
            raise WorkspaceError(
                f"cannot write to {folder} ({error.strerror}); choose a folder that is yours"
            ) from error
        return cls(folder)

    def close(self) -> None:
        """Close the journal."""
        self.journal.close()

    @property
    def events(self) -> list[Event]:
        """The journal."""
        return self.journal.events()

    @property
    def history(self) -> History:
        """What the journal adds up to.

        Raises:
            WorkspaceError: The journal is damaged.
            ConfigurationError: The manifest has another number of outcomes than the goals so far.
        """
        history = fold(self.journal.events())
        k = len(self.manifest.outcome_names)
        if any(goal.goal.size != k for goal in history.goals):
            raise ConfigurationError(
                f"{self.folder / MANIFEST_FILE} names {k} outcomes, but goals were set with "
                f"{history.goals[0].goal.size}; put it back, or make another workspace"
            )
        return history

    def record(self, number: int) -> TrialRecord:
        """A trial as it stands.

        Raises:
            TrialStateError: There is no such trial.
        """
        if not isinstance(number, Integral) or isinstance(number, bool):
            raise TrialStateError(
                f"a trial's number is a whole number, got {number!r}; give .number"
            )
        trials = self.history.trials
        if not 1 <= number <= len(trials):
            known = f"trials are 1 to {len(trials)}" if trials else "none was asked for yet"
            raise TrialStateError(
                f"there is no trial {number}; {known}, see: prior-reinforce status {self.folder}"
            )
        return trials[number - 1]

    @property
    def demonstrations(self) -> Demonstrations:
        """The demonstrations in use.

        Raises:
            WorkspaceError: None were imported yet.
            FileFormatError: The file is damaged.
            InvalidDemonstrationsError: The manifest says otherwise since they were imported.
        """
        sha256 = self.history.demonstrations
        if sha256 is None:
            raise WorkspaceError(
                f"{self.folder} has no demonstrations yet; bring them in with: prior-reinforce "
                f"import {self.folder} RECORDINGS"
            )
        demonstrations = self.store.demonstrations(sha256)
        self._check_fit(demonstrations, "what was imported")
        return demonstrations

    def demonstrations_of(self, model: str) -> Demonstrations:
        """The demonstrations that a model was fitted to, aligned if it was learned so.

        Raises:
            FileFormatError: The file is missing or damaged.
        """
        return self.store.demonstrations(self.history.models[model].fitted_to)

    def generator(self, own: Generator | None = None) -> Generator:
        """The model in use.

        Args:
            own: A generator of the class that the model was learned by, where it is none of ours.

        Raises:
            ConfigurationError: `own` is missing, or of another class.
            WorkspaceError: Nothing is learned yet, or it was learned from other demonstrations.
            FileFormatError: The model or the demonstrations are damaged.
        """
        history = self.history
        demonstrations = self.demonstrations
        if history.model is None:
            raise WorkspaceError(
                f"nothing is learned yet; run: prior-reinforce learn {self.folder}"
            )
        training = history.models[history.model]
        if training.demonstrations != demonstrations.sha256:
            raise WorkspaceError(
                "other demonstrations were imported since the model was learned; run: "
                f"prior-reinforce learn {self.folder}"
            )
        expected = training.generator if training.own else None
        if (None if own is None else name_of(own)) != expected:
            raise ConfigurationError(
                f"the model was learned by {training.generator}; "
                + (
                    f"name it, for the journal starts no code: --generator {training.generator}"
                    if training.own
                    else "drop --generator, or learn anew"
                )
            )
        return self.store.model(history.model, None if own is None else type(own))

    def session(self, own: Generator | None = None) -> Session:
        """The session of the goal that is worked on, built from what happened.

        Args:
            own: As `generator` takes it.

        Raises:
            WorkspaceError: No goal was set, or what `generator` raises.
            ConfigurationError: See `generator`.
            FileFormatError: See `generator`.
        """
        generator = self.generator(own)
        history = self.history
        if history.goal is None:
            raise WorkspaceError(f"no goal is set; run: prior-reinforce goal {self.folder} X Y")
        return build_session(history, history.goal, generator, self.demonstrations)

    def plan_path(self, trial: TrialRecord) -> Path:
        """Where a trial's plan file is."""
        return self.store.plan_path(trial.plan_file)

    def plan(self, trial: TrialRecord) -> Plan:
        """A trial's plan, checked against the hash in the journal.

        Raises:
            FileFormatError: The file is missing, or not what was handed out.
        """
        return self.store.plan(trial.plan_file, trial.plan_sha256)

    def gate(self, plan: Plan) -> LimitReport | None:
        """Hold a plan against the robot's limits; None where the manifest names no robot.

        Raises:
            InvalidDemonstrationsError: The manifest says otherwise since they were imported.
        """
        if self.manifest.robot is None:
            return None
        model = self.history.model
        shown = self.demonstrations if model is None else self.demonstrations_of(model)
        self._check_fit(shown, "what was imported")
        return check_plan(plan, self.manifest.robot, shown, self.manifest.gate)

    def import_demonstrations(self, demonstrations: Demonstrations, source: str) -> None:
        """Take in demonstrations, in place of earlier ones.

        Raises:
            InvalidDemonstrationsError: They do not fit the manifest, or the trials so far.
            TrialStateError: A trial waits to be told.
        """
        self._check_fit(demonstrations, source)
        with self.journal.exclusive():
            self.refuse_open_trial("importing demonstrations")
            history = self.history
            if history.trials and history.demonstrations is not None:
                before = self.store.demonstrations(history.demonstrations).format.names
                if before != demonstrations.format.names:
                    raise InvalidDemonstrationsError(
                        f"trials were made with {before}, but {source} has "
                        f"{demonstrations.format.names}; make another workspace for it"
                    )
            self.store.save_demonstrations(demonstrations)
            self.journal.append(
                "demonstrations_imported",
                {"n": demonstrations.n, "sha256": demonstrations.sha256, "source": source},
            )

    def set_goal(self, goal: ArrayLike, *, memory: str = "goal") -> GoalRecord:
        """Set the goal that the next trials are for.

        Args:
            goal: g, shape (k,), in the outcome's units.
            memory: `goal`, or `workspace` to let earlier goals' trials serve this one.

        Raises:
            InvalidGoalError: Wrong shape, or not finite.
            ConfigurationError: An unknown memory.
            TrialStateError: A trial for the goal before waits to be told.
        """
        if memory not in MEMORIES:
            raise ConfigurationError(f"memory must be one of {MEMORIES}, got {memory!r}")
        checked = self.demonstrations.check_goal(goal)
        tolerance = self.manifest.tolerance
        with self.journal.exclusive():
            self.refuse_open_trial("setting a goal")
            self.journal.append(
                "goal_set", {"goal": checked.tolist(), "tolerance": tolerance, "memory": memory}
            )
            return self.history.goals[-1]

    def refuse_open_trial(self, doing: str) -> None:
        """Do nothing unless a trial waits to be told.

        Raises:
            TrialStateError: One does.
        """
        trial = self.history.open_trial
        if trial is not None:
            raise TrialStateError(
                f"trial {trial.number} waits to be told; tell or void it before {doing}"
            )

    def _check_fit(self, demonstrations: Demonstrations, source: str) -> None:
        manifest = self.manifest
        pairs = [
            ("action names", demonstrations.format.names, manifest.format.names),
            ("action units", demonstrations.format.units, manifest.format.units),
            ("outcome names", demonstrations.outcome_names, manifest.outcome_names),
            ("outcome units", demonstrations.outcome_units, manifest.outcome_units),
            # A picosecond is rounding; anything more is another tempo.
            ("dt", round(demonstrations.format.dt, 12), round(manifest.format.dt, 12)),
        ]
        for what, given, expected in pairs:
            if given != expected:
                raise InvalidDemonstrationsError(
                    f"{source} has {what} {given}, but {self.folder / MANIFEST_FILE} says "
                    f"{expected}; change the manifest, or import again"
                )

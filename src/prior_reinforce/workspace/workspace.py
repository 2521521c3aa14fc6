"""A task's folder on disk, and the trials that are worked through in it.

    workspace.toml      manifest, written by a person
    demonstrations.npz  what was imported
    models/<hash>/      generators, one folder a training, never changed
    plans/              plan files, one a trial, never changed, hashed in the journal
    journal.sqlite      everything that happened

Every change is one or more journal events, appended while no other program may; the current
session is built from them each time, so closing the program, or a power cut, loses nothing.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.adapters import GaussianProcessAdapter
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    RobotLimitError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.generators import (
    DiffusionConfig,
    DiffusionGenerator,
    Generator,
    load_generator,
)
from prior_reinforce.generators.base import FitProgress
from prior_reinforce.motions import Demonstrations, Plan
from prior_reinforce.robots import LimitReport, check_plan
from prior_reinforce.session import Session, Trial, TrialState
from prior_reinforce.workspace.history import GoalRecord, History, TrialRecord, TrialStage, fold
from prior_reinforce.workspace.journal import JOURNAL_FILE, Event, Journal
from prior_reinforce.workspace.manifest import MANIFEST_FILE, Manifest, load_manifest
from prior_reinforce.workspace.plan_files import HandOver, read_plan, run_with_plan, write_plan

DEMONSTRATIONS_FILE = "demonstrations.npz"
MEMORIES = ("goal", "workspace")


class Workspace:
    """Trials of one task, on disk."""

    def __init__(self, folder: Path) -> None:
        """Open a workspace that `create` made.

        Raises:
            WorkspaceError: There is none, or its journal cannot be used.
            FileFormatError: Its manifest is no TOML.
            ConfigurationError: Its manifest holds a wrong value.
        """
        self.folder = folder
        if not (folder / MANIFEST_FILE).is_file():
            raise WorkspaceError(
                f"{folder} is not a workspace (it has no {MANIFEST_FILE}); make one with: "
                f"prior-reinforce new {folder}"
            )
        self.manifest: Manifest = load_manifest(folder / MANIFEST_FILE)
        self._journal = Journal(folder / JOURNAL_FILE)

    @classmethod
    def create(cls, folder: Path, manifest: str) -> Workspace:
        """Make a workspace from the text of its manifest.

        Raises:
            WorkspaceError: The folder holds something already, or cannot be written.
        """
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise WorkspaceError(f"{folder} exists and is not empty; choose a new folder")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / MANIFEST_FILE).write_text(manifest, encoding="utf-8")
        except OSError as error:
            raise WorkspaceError(
                f"cannot write to {folder} ({error.strerror}); choose a folder that is yours"
            ) from error
        return cls(folder)

    def close(self) -> None:
        """Close the journal."""
        self._journal.close()

    # What stands

    @property
    def events(self) -> list[Event]:
        """The journal."""
        return self._journal.events()

    @property
    def history(self) -> History:
        """What the journal adds up to."""
        return fold(self._journal.events())

    @property
    def demonstrations(self) -> Demonstrations:
        """The imported demonstrations.

        Raises:
            WorkspaceError: None were imported yet.
            FileFormatError: The file is damaged.
        """
        path = self.folder / DEMONSTRATIONS_FILE
        if not path.is_file():
            raise WorkspaceError(
                f"{self.folder} has no demonstrations yet; bring them in with: prior-reinforce "
                f"import {self.folder} RECORDING"
            )
        return Demonstrations.load(path)

    def generator(self, history: History, demonstrations: Demonstrations) -> Generator:
        """Load the model in use.

        Raises:
            WorkspaceError: There is none, or it was learned from other demonstrations.
            FileFormatError: Its files are missing or damaged.
        """
        if history.model is None:
            raise WorkspaceError(
                f"nothing is learned yet; run: prior-reinforce learn {self.folder}"
            )
        trained = [e for e in self.events if e.kind == "model_trained"][-1]
        if trained.data["demonstrations_sha256"] != demonstrations.sha256:
            raise WorkspaceError(
                "the demonstrations changed since the model was learned; run: prior-reinforce "
                f"learn {self.folder}"
            )
        folder = self.folder / "models" / history.model
        if _hash_folder(folder) != history.model:
            raise FileFormatError(
                f"the model in {folder} is not the one that was learned; restore it, or learn anew"
            )
        return load_generator(folder)

    def session(self, history: History, goal_number: int | None = None) -> Session:
        """Build the session of one goal, the latest unless named, from what happened.

        Trials that another model planned are left out: their conditions mean other motions.

        Raises:
            WorkspaceError: No goal was set, or what a session needs is missing.
        """
        if history.goal is None:
            raise WorkspaceError(f"no goal is set; run: prior-reinforce goal {self.folder} X Y")
        demonstrations = self.demonstrations
        record = history.goals[(goal_number or history.goal.number) - 1]
        trials = [
            self._trial(history, number, trial)
            for number, trial in enumerate(history.trials_of(record.number), start=1)
        ]
        return Session(
            self.generator(history, demonstrations),
            GaussianProcessAdapter(),
            demonstrations,
            record.goal,
            record.tolerance,
            trials=trials,
            earlier=_earlier(history, record),
        )

    # What changes

    def import_demonstrations(self, demonstrations: Demonstrations, source: str) -> None:
        """Take in demonstrations, in place of earlier ones.

        Raises:
            InvalidDemonstrationsError: They do not fit the manifest.
            TrialStateError: A trial waits to be told.
        """
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
                    f"{expected}; change the manifest, or select and rename on import"
                )
        with self._journal.exclusive():
            self._refuse_open_trial(self.history, "importing demonstrations")
            temporary = self.folder / f".{DEMONSTRATIONS_FILE}.part"
            with _named_disk_errors(self.folder):
                demonstrations.save(temporary)
                os.replace(temporary, self.folder / DEMONSTRATIONS_FILE)
            self._journal.append(
                "demonstrations_imported",
                {"n": demonstrations.n, "sha256": demonstrations.sha256, "source": source},
            )

    def learn(
        self,
        config: DiffusionConfig,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> str:
        """Learn a generator from the demonstrations and put it in use.

        Returns:
            The model's hash, the name of its folder.

        Raises:
            TrialStateError: A trial waits to be told.
        """
        self._refuse_open_trial(self.history, "learning")
        demonstrations = self.demonstrations
        generator = DiffusionGenerator(config).fit(demonstrations, seed=seed, progress=progress)
        temporary = self.folder / "models" / ".part"
        with _named_disk_errors(self.folder):
            shutil.rmtree(temporary, ignore_errors=True)
            generator.save(temporary)
            model = _hash_folder(temporary)
            if not (temporary.parent / model).exists():
                os.replace(temporary, temporary.parent / model)
        with self._journal.exclusive():
            self._refuse_open_trial(self.history, "learning")
            self._journal.append(
                "model_trained",
                {
                    "model": model,
                    "seed": seed,
                    "demonstrations_sha256": demonstrations.sha256,
                },
            )
        return model

    def set_goal(self, goal: ArrayLike, *, memory: str = "goal") -> GoalRecord:
        """Set the goal that the next trials are for.

        Args:
            goal: g, shape (k,), in the outcome's units.
            memory: `goal`, or `workspace` to let earlier goals' trials serve this one.

        Raises:
            InvalidGoalError: Wrong shape, or not finite.
            TrialStateError: A trial for the goal before waits to be told.
        """
        if memory not in MEMORIES:
            raise ConfigurationError(f"memory must be one of {MEMORIES}, got {memory!r}")
        checked = self.demonstrations.check_goal(goal)
        with self._journal.exclusive():
            self._refuse_open_trial(self.history, "setting a goal")
            self._journal.append(
                "goal_set",
                {
                    "goal": checked.tolist(),
                    "tolerance": self.manifest.tolerance,
                    "memory": memory,
                },
            )
            history = self.history
        assert history.goal is not None
        return history.goal

    def ask(self, *, arm_did_not_move: bool = False) -> TrialRecord:
        """Return the trial to execute: the open one, or a new one that passed the gate.

        Args:
            arm_did_not_move: What a person saw of a trial that was executing when the program
                died: nothing moved, it may be executed after all.

        Raises:
            WorkspaceError: A trial was executing when the program died, and nobody said yet
                whether the arm moved.
            RobotLimitError: The plan breaks a limit; nothing is handed out.
        """
        with self._journal.exclusive():
            history = self.history
            trial = history.open_trial
            if trial is not None and trial.stage is TrialStage.EXECUTING:
                if not arm_did_not_move:
                    raise WorkspaceError(
                        f"trial {trial.number} was executing when the program stopped; did the "
                        f"arm move? If it did, tell or void trial {trial.number}; if it did not, "
                        "ask again with --arm-did-not-move"
                    )
                self._journal.append("not_executed", {"trial": trial.number})
            elif trial is None:
                self._ask_new(history)
            history = self.history
        assert history.open_trial is not None
        read_plan(self.plan_path(history.open_trial), sha256=history.open_trial.plan_sha256)
        return history.open_trial

    def execute(self, number: int, command: str, *, time_limit: float) -> HandOver:
        """Give an asked trial's plan to a command, once.

        Args:
            number: The open trial.
            command: For instance `mycontroller {plan}`.
            time_limit: Of the command, in [s].

        Raises:
            TrialStateError: The trial was executed already, or is not open.
        """
        with self._journal.exclusive():
            trial = self._record(self.history, number)
            if trial.stage is not TrialStage.ASKED:
                raise TrialStateError(
                    f"trial {number} is {trial.stage.value} already; a plan runs once: tell it or "
                    "void it, then ask for the next"
                )
            self._journal.append("executing", {"trial": number, "command": command})
        plan_file = write_plan(self.plan(trial), self.plan_path(trial))
        try:
            hand_over = run_with_plan(command, plan_file, time_limit=time_limit)
        except ConfigurationError:
            with self._journal.exclusive():  # the program was never started: nothing moved
                self._journal.append("not_executed", {"trial": number})
            raise
        with self._journal.exclusive():
            if self._record(self.history, number).stage is TrialStage.EXECUTING:
                self._journal.append("executed", {"trial": number, **hand_over.as_json()})
        return hand_over

    def tell(self, number: int, error_seen: ArrayLike, *, hit: bool | None = None) -> TrialRecord:
        """Report what was seen of the open trial; see `Session.tell`."""
        return self._change("told", number, lambda s, n: s.tell(n, error_seen, hit=hit))

    def amend(self, number: int, error_seen: ArrayLike, *, hit: bool | None = None) -> TrialRecord:
        """Correct what was told; see `Session.amend`."""
        return self._change("amended", number, lambda s, n: s.amend(n, error_seen, hit=hit))

    def void(self, number: int, reason: str) -> TrialRecord:
        """Declare that a trial is not data; see `Session.void`."""
        return self._change("voided", number, lambda s, n: s.void(n, reason))

    def plan_path(self, trial: TrialRecord) -> Path:
        """Where a trial's plan file is."""
        return self.folder / "plans" / trial.plan_file

    def plan(self, trial: TrialRecord) -> Plan:
        """A trial's plan, checked against the hash in the journal.

        Raises:
            FileFormatError: The file is missing, or not what was handed out.
        """
        return read_plan(self.plan_path(trial), sha256=trial.plan_sha256)

    def gate(self, plan: Plan) -> LimitReport | None:
        """Hold a plan against the robot's limits; None where the manifest names no robot."""
        if self.manifest.robot is None:
            return None
        return check_plan(plan, self.manifest.robot, self.demonstrations, self.manifest.gate)

    def _ask_new(self, history: History) -> None:
        session = self.session(history)
        pending = session.ask()
        plan = Plan(pending.plan, self.manifest.format)
        report = self.gate(plan)
        if report is not None and report.refused:
            raise RobotLimitError(
                f"the plan for condition {np.round(pending.condition, 4).tolist()} is refused by "
                f"{report.robot}'s limits:\n{report.text()}\nnothing was handed out; choose "
                "another goal, or demonstrate with more margin and learn anew"
            )
        number = len(history.trials) + 1
        digest = hashlib.sha256(pending.plan.tobytes()).hexdigest()[:8]
        with _named_disk_errors(self.folder):
            (self.folder / "plans").mkdir(exist_ok=True)
        plan_file = write_plan(plan, self.folder / "plans" / f"trial-{number:03d}-{digest}.npz")
        assert history.goal is not None
        self._journal.append(
            "asked",
            {
                "trial": number,
                "goal": history.goal.number,
                "condition": pending.condition.tolist(),
                "plan_file": plan_file.path.name,
                "plan_sha256": plan_file.sha256,
                "model": history.model,
                "gate": None if report is None else report.as_json(),
            },
        )

    def _change(
        self, kind: str, number: int, change: Callable[[Session, int], Trial]
    ) -> TrialRecord:
        with self._journal.exclusive():
            history = self.history
            record = self._record(history, number)
            of_goal = [trial.number for trial in history.trials_of(record.goal_number)]
            session = self.session(history, record.goal_number)
            try:
                trial = change(session, of_goal.index(number) + 1)
            except TrialStateError as error:
                raise TrialStateError(
                    f"trial {number} is {record.stage.value}: it cannot be {kind}; "
                    "see prior-reinforce status"
                ) from error
            data: dict[str, Any] = {"trial": number}
            if kind == "voided":
                data["reason"] = trial.note
            else:
                assert trial.error_seen is not None
                data |= {"error_seen": trial.error_seen.tolist(), "hit": trial.hit}
            self._journal.append(kind, data)
            return self._record(self.history, number)

    def _record(self, history: History, number: int) -> TrialRecord:
        if not 1 <= number <= len(history.trials):
            known = f"trials are 1 to {len(history.trials)}" if history.trials else "ask for one"
            raise TrialStateError(f"there is no trial {number}; {known}")
        return history.trials[number - 1]

    def _refuse_open_trial(self, history: History, doing: str) -> None:
        trial = history.open_trial
        if trial is not None:
            raise TrialStateError(
                f"trial {trial.number} waits to be told; tell or void it before {doing}"
            )

    def _trial(self, history: History, number: int, record: TrialRecord) -> Trial:
        stages = {TrialStage.TOLD: TrialState.TOLD, TrialStage.VOIDED: TrialState.VOIDED}
        state = stages.get(record.stage, TrialState.PENDING)
        if record.model != history.model and state is TrialState.TOLD:
            state = TrialState.VOIDED
        return Trial(
            number,
            record.condition,
            # What was seen needs no frames; `plan` reads them where they are wanted, so that a
            # trial whose file was damaged can still be voided.
            np.empty((0, self.manifest.format.action_dim)),
            state,
            record.error_seen if state is TrialState.TOLD else None,
            record.hit and state is TrialState.TOLD,
            record.note,
        )


def _earlier(history: History, goal: GoalRecord) -> list[tuple[np.ndarray, np.ndarray]]:
    """Told trials of earlier goals with the same model, oldest first, where the goal wants them."""
    if goal.memory == "goal":
        return []
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    for trial in history.trials:
        earlier = trial.goal_number < goal.number and trial.model == history.model
        if earlier and trial.stage is TrialStage.TOLD and trial.error_seen is not None:
            aimed_at = history.goals[trial.goal_number - 1].goal
            pairs.append((trial.condition, aimed_at + trial.error_seen))
    return pairs


def _hash_folder(folder: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(folder.glob("*")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@contextmanager
def _named_disk_errors(folder: Path) -> Iterator[None]:
    """Turn a full disk or a read-only folder into one line."""
    try:
        yield
    except OSError as error:
        raise WorkspaceError(
            f"cannot write to {folder} ({error.strerror}); free some disk space, or make the "
            "folder writable; what was told before is safe"
        ) from error

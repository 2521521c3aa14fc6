"""The journal and the store as one log: the events of trials, and of what is learned from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from prior_reinforce.arrays import Frames
from prior_reinforce.bench.workspace.journal import JOURNAL_FILE, Journal
from prior_reinforce.bench.workspace.store import Store
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.plans.motions import Plan, PlanFormat
from prior_reinforce.registry import parse_choice
from prior_reinforce.session.trials import KINDS, Event, Trial

_KINDS = KINDS | {"demonstrations_imported", "model_trained"}


class _Imported(msgspec.Struct):
    n: int
    sha256: str


class _Trained(msgspec.Struct):
    model: str
    demonstrations_sha256: str
    fitted_to_sha256: str = ""
    generator: str = ""
    remarks: list[str] = []


class _Asked(msgspec.Struct):
    trial: int
    goal: int
    condition: list[float]
    plan_file: str
    plan_sha256: str
    model: str = ""


class _GoalSet(msgspec.Struct):
    goal: list[float]
    tolerance: float
    adapter: str = ""


class _Executing(msgspec.Struct):
    trial: int
    command: str
    folder: str = ""


class _Ended(msgspec.Struct):
    trial: int
    outcome: str = ""
    reason: str = ""
    start_error: float | None = None
    tracking_rms: float | None = None


_SHAPES: Mapping[str, Any] = {
    "goal_set": _GoalSet,
    "executing": _Executing,
    "executed": _Ended,
    "not_executed": _Ended,
    "voided": _Ended,
    "demonstrations_imported": _Imported,
    "model_trained": _Trained,
    "asked": _Asked,
}
"""What is read of events here; the others are the session's (`trials.py`)."""


@dataclass(frozen=True)
class Training:
    """One training."""

    model: str
    """Hash of the model, the name of its folder."""
    demonstrations: str
    """SHA-256 of the demonstrations as they were imported."""
    fitted_to: str
    """SHA-256 of what the generator was fitted to; the first journals name aligned copies here."""
    generator: str
    """Its choice, for instance `diffusion`, or `module:Class` of one's own."""
    remarks: tuple[str, ...] = ()
    """What the fit could not do."""

    @property
    def own(self) -> str | None:
        """`module:Class` where the generator is one's own; None where it is ours."""
        name, _ = parse_choice(self.generator)
        return name if ":" in name else None


class WorkspaceLog:
    """The `Log` of a workspace's session (see `trials.Log`), and what else its journal says."""

    def __init__(self, folder: Path, store: Store, format: PlanFormat) -> None:
        """Open the journal in a folder; plans are kept in the store, in that format.

        Raises:
            WorkspaceError: The journal cannot be used.
        """
        self._folder, self._store, self._format = folder, store, format
        self._checked = 0
        path = folder / JOURNAL_FILE
        # A new workspace's journal is empty until the first import has ended.
        if not path.exists() or path.stat().st_size == 0:
            self._refuse_files(("demonstrations", "models", "plans"))
        self.journal = Journal(path)
        if self.journal.empty:
            self._refuse_files(("models", "plans"))

    def _refuse_files(self, parts: Sequence[str]) -> None:
        """Refuse to begin anew beside what an earlier journal named."""
        for part in parts:
            folder = self._folder / part
            if folder.is_dir() and any(path.name[0] != "." for path in folder.iterdir()):
                raise WorkspaceError(
                    f"{self._folder / JOURNAL_FILE} is missing or empty, but {folder} holds files "
                    "that it named; restore the journal from a copy, or make another workspace"
                )

    def events(self) -> Sequence[Event]:
        """The journal.

        Raises:
            WorkspaceError: The journal is damaged, or a newer version wrote it.
        """
        events = self.journal.events()
        for event in events[self._checked :]:
            if event.kind not in _KINDS:
                raise WorkspaceError(
                    f"event {event.id} is a {event.kind!r}, which this version does not know; use "
                    "the version that wrote it, or restore the journal from a copy"
                )
            try:
                msgspec.convert(event.data, _SHAPES.get(event.kind, dict))
            except msgspec.ValidationError as error:
                raise WorkspaceError(
                    f"event {event.id} ({event.kind}) does not say what it should ({error}); "
                    "restore the journal from a copy"
                ) from error
            self._checked += 1
        return events

    def exclusive(self) -> AbstractContextManager[None]:
        """See `Journal.exclusive`."""
        return self.journal.exclusive()

    def append(self, kind: str, data: Mapping[str, Any]) -> None:
        """See `Journal.append`."""
        self.journal.append(kind, data)

    def keep_plan(self, number: int, plan: Frames) -> Mapping[str, Any]:
        """Write the plan's file, before the event that names it."""
        named = {event.data["plan_file"] for event in self.events() if event.kind == "asked"}
        file = self._store.save_plan(Plan(plan, self._format), number, named)
        return {"plan_file": file.path.name, "plan_sha256": file.sha256}

    def plan(self, trial: Trial) -> Frames:
        """Read a trial's plan, checked against the hash in the journal."""
        return self._store.plan(trial.kept["plan_file"], trial.kept["plan_sha256"]).actions

    def is_executing(self) -> bool:
        """Whether a trial is being executed right now, by any program."""
        from prior_reinforce.bench.robots.executors.lock import is_executing

        return is_executing(self._folder)

    @property
    def demonstrations(self) -> str | None:
        """SHA-256 of the demonstrations in use; None before the first import."""
        imported = [e for e in self.events() if e.kind == "demonstrations_imported"]
        return imported[-1].data["sha256"] if imported else None

    @property
    def trainings(self) -> Mapping[str, Training]:
        """Every training, by the model's hash; the last is in use."""
        trainings: dict[str, Training] = {}
        for event in self.events():
            if event.kind == "model_trained":
                data = event.data
                sha256 = data["demonstrations_sha256"]
                trainings.pop(data["model"], None)  # learned again, it becomes the last
                trainings[data["model"]] = Training(
                    data["model"],
                    sha256,
                    data.get("fitted_to_sha256", sha256),
                    data.get("generator", "diffusion")  # the first journals knew no other
                    + (",timing=align" if data.get("fitted_to_sha256", sha256) != sha256 else ""),
                    tuple(data.get("remarks", ())),
                )
        return trainings

    @property
    def training(self) -> Training | None:
        """The training of the model in use; None before the first."""
        return next(reversed(list(self.trainings.values())), None)

    @property
    def stale(self) -> bool:
        """Whether there is no model, or demonstrations were imported since it was learned."""
        training = self.training
        return training is None or training.demonstrations != self.demonstrations

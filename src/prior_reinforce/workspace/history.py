"""What a workspace's events add up to: goals, their trials, the model. A pure fold."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np

from prior_reinforce.errors import WorkspaceError
from prior_reinforce.workspace.journal import Event


class TrialStage(Enum):
    """Where a trial of a real arm stands; finer than a session's, since a program can die."""

    ASKED = "asked"
    """A plan was handed out; nothing moved yet, as far as is known."""
    EXECUTING = "executing"
    """A command was given the plan. If the program died then, only a person knows what moved."""
    EXECUTED = "executed"
    """The command ended; the error has not been told."""
    TOLD = "told"
    VOIDED = "voided"


@dataclass(frozen=True, eq=False)
class TrialRecord:
    """One trial as the journal knows it."""

    number: int
    """From 1, over all goals of the workspace: what an operator names it by."""
    goal_number: int
    """Goal it was asked for."""
    condition: np.ndarray
    """c, shape (k,)."""
    plan_file: str
    """File name of the plan within the workspace's `plans/`."""
    plan_sha256: str
    """Hash that the file must have."""
    model: str
    """Hash of the model that made the plan."""
    stage: TrialStage = TrialStage.ASKED
    error_seen: np.ndarray | None = None
    hit: bool = False
    note: str = ""

    @property
    def open(self) -> bool:
        """Whether the trial still waits to be told or voided."""
        return self.stage in {TrialStage.ASKED, TrialStage.EXECUTING, TrialStage.EXECUTED}


@dataclass(frozen=True, eq=False)
class GoalRecord:
    """One goal of the workspace."""

    number: int
    """From 1."""
    goal: np.ndarray
    """g, shape (k,)."""
    tolerance: float
    """epsilon when the goal was set."""
    memory: str
    """`goal`: the adapter sees this goal's trials; `workspace`: earlier goals' as well."""


@dataclass(frozen=True)
class ModelRecord:
    """One training."""

    model: str
    """Hash of the model, the name of its folder."""
    demonstrations: str
    """SHA-256 of the demonstrations as they were imported."""
    fitted_to: str
    """SHA-256 of what the generator was fitted to: the same, or those aligned in time."""
    generator: str = "diffusion"
    """Its name, or `module:Class` of one's own."""

    @property
    def aligned(self) -> bool:
        """Whether the demonstrations were aligned in time first."""
        return self.fitted_to != self.demonstrations

    @property
    def own(self) -> bool:
        """Whether the generator is none of ours."""
        return ":" in self.generator


@dataclass(frozen=True, eq=False)
class History:
    """All that happened."""

    goals: tuple[GoalRecord, ...] = ()
    trials: tuple[TrialRecord, ...] = ()
    demonstrations: str | None = None
    """SHA-256 of the demonstrations in use; None before the first import."""
    model: str | None = None
    """Hash of the model in use; None before the first training."""
    models: Mapping[str, ModelRecord] = field(default_factory=dict)
    """Every training, by the model's hash."""

    @property
    def goal(self) -> GoalRecord | None:
        """The goal that is worked on: the latest."""
        return self.goals[-1] if self.goals else None

    @property
    def training(self) -> ModelRecord | None:
        """The training of the model in use."""
        return None if self.model is None else self.models[self.model]

    @property
    def stale(self) -> bool:
        """Whether there is no model, or demonstrations were imported since it was learned."""
        return self.training is None or self.training.demonstrations != self.demonstrations

    @property
    def open_trial(self) -> TrialRecord | None:
        """The trial that waits to be told, if any."""
        return next((trial for trial in self.trials if trial.open), None)

    def trials_of(self, goal_number: int) -> tuple[TrialRecord, ...]:
        """Trials of one goal, in order."""
        return tuple(trial for trial in self.trials if trial.goal_number == goal_number)


def fold(events: Iterable[Event]) -> History:
    """Add up events.

    Raises:
        WorkspaceError: An event that this version does not know, or that cannot follow the others.
    """
    history = History()
    for event in events:
        try:
            history = _apply(history, event.kind, dict(event.data))
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise WorkspaceError(
                f"event {event.id} ({event.kind}) does not fit the ones before it: {error!r}; "
                "restore the journal from a copy"
            ) from error
    return history


def _apply(history: History, kind: str, data: dict[str, Any]) -> History:
    if kind == "demonstrations_imported":
        return replace(history, demonstrations=data["sha256"])
    if kind == "model_trained":
        sha256 = data["demonstrations_sha256"]
        # The first journals name neither: all was diffusion on demonstrations as recorded.
        training = ModelRecord(
            model=data["model"],
            demonstrations=sha256,
            fitted_to=data.get("fitted_to_sha256", sha256),
            generator=data.get("generator", "diffusion"),
        )
        models = {**history.models, training.model: training}
        return replace(history, model=training.model, models=models)
    if kind == "goal_set":
        goal = GoalRecord(
            len(history.goals) + 1, np.array(data["goal"]), data["tolerance"], data["memory"]
        )
        return replace(history, goals=(*history.goals, goal))
    if kind == "asked":
        trial = TrialRecord(
            number=data["trial"],
            goal_number=data["goal"],
            condition=np.array(data["condition"]),
            plan_file=data["plan_file"],
            plan_sha256=data["plan_sha256"],
            model=data["model"],
        )
        if trial.number != len(history.trials) + 1 or history.open_trial is not None:
            raise ValueError(f"trial {trial.number} after {len(history.trials)}")
        return replace(history, trials=(*history.trials, trial))
    changes: dict[str, dict[str, Any]] = {
        "executing": {"stage": TrialStage.EXECUTING},
        "executed": {"stage": TrialStage.EXECUTED},
        "not_executed": {"stage": TrialStage.ASKED},
        "told": {"stage": TrialStage.TOLD},
        "amended": {"stage": TrialStage.TOLD},
        "voided": {"stage": TrialStage.VOIDED, "error_seen": None, "hit": False},
    }
    change = changes[kind]
    if kind in {"told", "amended"}:
        change = change | {"error_seen": np.array(data["error_seen"]), "hit": data["hit"]}
    if kind == "voided":
        change = change | {"note": data["reason"]}
    index = data["trial"] - 1
    if index < 0:
        raise IndexError(f"trial {data['trial']}")
    trials = list(history.trials)
    trials[index] = replace(trials[index], **change)
    return replace(history, trials=tuple(trials))

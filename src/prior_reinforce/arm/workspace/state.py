"""What the events of a workspace add up to, and what comes next.

`WorkspaceState` is the fold of the journal. `Standing` is the workspace at one moment: a verb reads
it once and hands it down; `view` and `text` render it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from msgspec import structs

from prior_reinforce.adapters import DEFAULT_ADAPTER
from prior_reinforce.arm.executing.lock import is_executing
from prior_reinforce.arm.workspace.events import (
    DemonstrationsImported,
    KeptPlan,
    ModelTrained,
    Moved,
    Moving,
    PlanAsked,
)
from prior_reinforce.arm.workspace.manifest import Manifest
from prior_reinforce.arm.workspace.store import Store
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.session.events import Event, GoalSet
from prior_reinforce.session.trials import Goal, SessionState, Trial

Stage = Literal["asked", "executing", "executed", "told", "voided"]
"""Where a trial of a workspace stands. `executing`: a command was given the plan; if the program
died then, only a person knows what moved. `executed`: it ended, and the arm moved or may have."""
Step = Literal[
    "import", "learn", "goal", "ask", "execute", "executing", "settle", "tell", "reached"
]
"""What comes next: a verb; waiting for a motion (`executing`); a person's word on whether the arm
moved (`settle`); nothing, since the goal is reached."""


class WorkspaceState(SessionState):
    """What the events of a workspace add up to."""

    def __init__(self) -> None:
        super().__init__()
        self.imports: dict[str, DemonstrationsImported] = {}
        """The latest import of all demonstrations by their hash; the last is in use."""
        self.trainings: dict[str, ModelTrained] = {}
        """The latest training of every model by its hash; the last is in use."""
        self.plan_files: dict[int, KeptPlan] = {}
        """File of each trial's plan, by the trial's number."""
        self.executions: dict[int, Moving | Moved] = {}
        """The latest event of each trial that a command executed, by its number."""
        self.moves: dict[int, Moving | Moved] = {}
        """The latest event of each trial that the arm moved for, executed or not."""
        self.cut_off: dict[int, Moving] = {}
        """The motion before each trial that was not made to its end, as far as anybody knows."""

    @property
    def demonstrations(self) -> DemonstrationsImported | None:
        """The latest import; None before the first."""
        return next(reversed(self.imports.values()), None)

    def shown_for(self, goal: Goal) -> DemonstrationsImported | None:
        """What the model learned from that reached a goal, or was tried last; else the latest."""
        trials = self.trials_of(goal.number)
        last = next((trial for trial in trials if trial.hit), trials[-1] if trials else None)
        if last is None:
            return self.demonstrations
        return self.imports[self.trainings[last.model].demonstrations_sha256]

    @property
    def training(self) -> ModelTrained | None:
        """The training of the model in use; None before the first."""
        return next(reversed(self.trainings.values()), None)

    @property
    def stale(self) -> bool:
        """Whether there is no model, or demonstrations were imported since it was learned."""
        training, in_use = self.training, self.demonstrations
        return training is None or in_use is None or training.demonstrations_sha256 != in_use.sha256

    @property
    def in_use(self) -> tuple[str, ...]:
        """The model and the demonstrations of now."""
        training, imported = self.training, self.demonstrations
        return (
            "" if training is None else training.model,
            "" if imported is None else imported.sha256,
        )

    def stage(self, trial: Trial) -> Stage:
        """Where a trial stands."""
        latest = self.executions.get(trial.number) if trial.open else None
        if isinstance(latest, Moving):
            return "executing"
        if latest is not None and latest.outcome != "not_moved":
            return "executed"
        return trial.stage.value

    def _apply(self, event: Event, time: str) -> None:
        match event:
            case GoalSet(adapter=""):  # by a session in Python, which makes it by default
                super()._apply(structs.replace(event, adapter=DEFAULT_ADAPTER), time)
            case DemonstrationsImported():
                self.imports.pop(event.sha256, None)
                self.imports[event.sha256] = event
            case ModelTrained():
                self.trainings.pop(event.model, None)  # learned again, it becomes the last
                self.trainings[event.model] = event
            case Moving() | Moved():
                self._move(event)
            case PlanAsked():
                super()._apply(event, time)
                self.plan_files[event.trial] = event.plan
            case _:
                super()._apply(event, time)

    def _move(self, event: Moving | Moved) -> None:
        number = self.trial(event.trial).number
        if event.motion == "trial":
            if isinstance(event, Moving) and not self.trial(number).open:
                raise ValueError(f"trial {number} is not open")
            self.executions[number] = event
        self.moves[number] = event
        if isinstance(event, Moving) and event.motion != "trial":
            self.cut_off[number] = event
        elif isinstance(event, Moving) or (event.motion != "trial" and event.outcome == "done"):
            self.cut_off.pop(number, None)


@dataclass(frozen=True)
class Standing:
    """A workspace at one moment."""

    folder: Path
    manifest: Manifest
    state: WorkspaceState

    @cached_property
    def store(self) -> Store:
        """The files that events name."""
        return Store(self.folder)

    @cached_property
    def moving(self) -> bool:
        """Whether any program makes a motion for this workspace right now."""
        return is_executing(self.folder)

    @property
    def step(self) -> Step:
        """What comes next."""
        state, trial = self.state, self.state.open_trial
        if state.demonstrations is None:
            return "import"
        if state.stale:
            return "learn"
        if state.goal is None:
            return "goal"
        if trial is None:
            return "reached" if state.solved else "ask"
        stage, latest = state.stage(trial), state.moves.get(trial.number)
        if isinstance(latest, Moving) and self.moving:
            return "executing"
        if stage == "asked":
            return "execute"
        return "settle" if self.ended_badly(trial) else "tell"

    @property
    def imported(self) -> DemonstrationsImported:
        """The demonstrations in use; WorkspaceError if none were imported yet."""
        if self.state.demonstrations is None:
            raise WorkspaceError(
                f"{self.folder} has no demonstrations yet; bring them in with: prior-reinforce "
                f"import {self.folder} RECORDINGS"
            )
        return self.state.demonstrations

    @property
    def trained(self) -> ModelTrained:
        """The training of the model in use.

        WorkspaceError if there is none, or other demonstrations were imported since.
        """
        imported, training = self.imported, self.state.training
        if training is None or training.demonstrations_sha256 != imported.sha256:
            why = "other demonstrations were imported since the model was learned"
            why = why if training is not None else "nothing is learned yet"
            raise WorkspaceError(f"{why}; run: prior-reinforce learn {self.folder}")
        return training

    @property
    def executing(self) -> Trial | None:
        """The trial that waits, if the journal's last word is that it executes."""
        trial = self.state.open_trial
        return trial if trial is not None and self.state.stage(trial) == "executing" else None

    def ended_badly(self, trial: Trial) -> bool:
        """Whether nobody wrote down how a trial's execution ended, or it was aborted."""
        latest = self.state.executions.get(trial.number)
        return isinstance(latest, Moving) or (latest is not None and latest.outcome == "aborted")

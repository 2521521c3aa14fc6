"""What can happen in a workspace: trials, learning and executing; and what it adds up to."""

from __future__ import annotations

from dataclasses import replace

from prior_reinforce.bench.robots.executors.base import Motion
from prior_reinforce.bench.robots.executors.result import MotionResult, Outcome
from prior_reinforce.registry import own_class
from prior_reinforce.session.events import Event, SessionEvent
from prior_reinforce.session.trials import Stage, State


class DemonstrationsImported(Event, frozen=True):
    """Demonstrations were imported, in place of earlier ones."""

    n: int
    sha256: str
    source: str


class ModelTrained(Event, frozen=True):
    """A generator was fitted to the demonstrations, and is in use from now on."""

    model: str
    """Hash of the model, the name of its folder."""
    generator: str
    """Its choice, for instance `diffusion`, or `module:Class` of one's own."""
    seed: int
    demonstrations_sha256: str
    """Of the demonstrations that it was fitted to."""
    remarks: tuple[str, ...] = ()
    """What the fit could not do."""

    @property
    def own(self) -> str | None:
        """`module:Class` where the generator is one's own; None where it is ours."""
        return own_class(self.generator)


class Executing(Event, frozen=True):
    """A trial's plan is about to be given to a command."""

    trial: int
    command: str
    """Its program without its arguments, or the name of an executor; empty where the execution was
    found in `folder` only."""
    folder: str
    """Name of the folder for what it writes; empty if it was never made."""


class Executed(Event, MotionResult, frozen=True, kw_only=True):
    """The command ended, and all that it started."""

    trial: int


class NotExecuted(Executed, frozen=True, kw_only=True):
    """Nothing moved: the trial may be executed after all."""

    outcome: Outcome = "not_moved"


class Moving(Event, frozen=True):
    """The arm is about to move for a trial without executing it: to its start, or to rehearse."""

    trial: int
    motion: Motion
    speed: float
    """Share of the plan's own speed."""
    executor: str
    folder: str
    """As `Executing.folder`."""


class Moved(Event, MotionResult, frozen=True, kw_only=True):
    """That motion ended. It is no trial: nothing is learned from it."""

    trial: int


WorkspaceEvent = (
    SessionEvent
    | DemonstrationsImported
    | ModelTrained
    | Executing
    | Executed
    | NotExecuted
    | Moving
    | Moved
)


class WorkspaceState(State):
    """What the events of a workspace add up to."""

    def __init__(self) -> None:
        super().__init__()
        self.demonstrations: str | None = None
        """SHA-256 of the demonstrations in use; None before the first import."""
        self.demonstrations_source = ""
        """What they were imported from, and what was left out of it."""
        self.trainings: dict[str, ModelTrained] = {}
        """The latest training of every model by its hash; the last is in use."""
        self.executions: dict[int, Executing | Executed] = {}
        """The latest event of each trial that a command executed, by its number."""

    @property
    def training(self) -> ModelTrained | None:
        """The training of the model in use; None before the first."""
        return next(reversed(self.trainings.values()), None)

    @property
    def stale(self) -> bool:
        """Whether there is no model, or demonstrations were imported since it was learned."""
        training = self.training
        return training is None or training.demonstrations_sha256 != self.demonstrations

    @property
    def in_use(self) -> tuple[str, ...]:
        """The model and the demonstrations of now."""
        training = self.training
        return "" if training is None else training.model, self.demonstrations or ""

    def _apply(self, event: Event) -> None:
        match event:
            case DemonstrationsImported():
                self.demonstrations = event.sha256
                self.demonstrations_source = event.source
            case ModelTrained():
                self.trainings.pop(event.model, None)  # learned again, it becomes the last
                self.trainings[event.model] = event
            case Executing():
                self._executed(event, Stage.EXECUTING)
            case NotExecuted():
                self._executed(event, Stage.ASKED)
            case Executed():
                self._executed(event, Stage.EXECUTED)
            case Moving() | Moved():
                self.trial(event.trial)  # which must be there
            case _:
                super()._apply(event)

    def _executed(self, event: Executing | Executed, stage: Stage) -> None:
        trial = self.trial(event.trial)
        self.trials[event.trial - 1] = replace(trial, stage=stage)
        self.executions[event.trial] = event

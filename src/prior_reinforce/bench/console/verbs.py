"""What the page can do: the verbs of the command line, each meant for the workspace as it was seen.

Whoever presses a button has seen a state. Where the journal went on since, by another tab, another
person, the command line or the same press sent twice, the verb is refused with what happened. A
verb is one call of `Session` or `Workspace`; only what runs on, an execution or a training, is
remembered here, and what remains of it when this program dies is the journal's to say.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct, to_builtins

from prior_reinforce.adapters import DEFAULT_ADAPTER
from prior_reinforce.bench.console.view import (
    MotionView,
    State,
    motion_of,
    output_of,
    state_of,
    step_of,
)
from prior_reinforce.bench.robots.executors.base import Motion
from prior_reinforce.bench.robots.executors.lock import stop_executing
from prior_reinforce.bench.workspace.report import report_workspace
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import InvalidFeedbackError, PriorReinforceError, TrialStateError
from prior_reinforce.generators.base import FitProgress
from prior_reinforce.readings import Reading
from prior_reinforce.session.session import Session
from prior_reinforce.session.trials import Stage, Trial

_LOOK = 0.05
"""How often the journal is looked at for what others did, in [s]."""
_SOMETIMES = 0.5
"""How often to look whether what executes has ended, in [s]: that reads all of /proc."""


class Seen(Struct, forbid_unknown_fields=True):
    """What every verb says."""

    seen: int
    """`State.id` of the state that the person saw."""


class SetGoal(Seen):
    """Set the goal that the next trials are for."""

    goal: list[float]
    """g, in the outcomes' units."""
    new_hardware: str | None = None
    """What was changed since the last trial; what was known is then believed less."""


class Ask(Seen):
    """Get the next plan."""

    arm_did_not_move: bool = False
    """A person saw that the execution that was cut off moved nothing."""


class Execute(Seen):
    """Execute a plan, once."""

    trial: int
    plan: str
    """SHA-256 of the plan that the person saw."""
    motion: Motion = "trial"
    """An arm of the manifest may also approach its start, or rehearse it."""
    speed: float = 1.0
    """Share of the plan's own speed, of a rehearsal."""


class Tell(Seen):
    """Say what was seen of a trial, or correct what was said: one of outcome, words and hit."""

    trial: int
    outcome: list[float] | None = None
    """Where the object ended, in the outcomes' units."""
    sd: float | None = None
    """Standard deviation of each component of a measured outcome; without it, it is an estimate."""
    words: str | None = None
    """For instance `5cm long, 2cm left`."""
    hit: bool | None = None


class Void(Seen):
    """Declare that a trial is not data."""

    trial: int
    reason: str = ""


class Learning(Struct):
    """How far a training is."""

    done: float
    """Share, 0 to 1."""
    seconds_left: float


class Console(State):
    """What the page shows: the workspace, and what this program is doing."""

    executor: str
    """What executes a plan; empty where the plan is to be downloaded."""
    approaches: bool
    """Whether it can also go to the plan's start, and rehearse."""
    learning: Learning | None
    report: str
    """Path of the report; empty before the first trial."""


@dataclass
class Execution:
    """What executes, in a thread of its own."""

    body: Execute
    ended: Future[None]
    stopped: bool = False


class Verbs:
    """A workspace that several tabs work on. Threads may share it."""

    def __init__(
        self,
        folder: Path,
        *,
        execute: Callable[[Workspace, Execute], object] | None = None,
        executor: str = "",
        approaches: bool = False,
        own: str | None = None,
        own_adapter: str | None = None,
        report: str = "",
        publish: Callable[[dict[str, Any]], None] = lambda message: None,
    ) -> None:
        """Open the workspace.

        Args:
            folder: Of the workspace.
            execute: Executes a trial's plan; None where nothing can.
            executor: What that is called.
            approaches: See `Console`.
            own: See `Workspace.session`.
            own_adapter: Likewise.
            report: Path at which the report is read.
            publish: Called, in any thread, with what all tabs should hear.

        Raises:
            WorkspaceError, FileFormatError, ConfigurationError: See `Workspace`.
        """
        self.folder = folder
        self.workspace = Workspace(folder)
        self._session: Session = self.workspace.session(own, own_adapter)
        self._lock = threading.RLock()
        self._execute, self._executor = execute, executor
        self.publish = publish
        """Tells all tabs something, in any thread."""
        self._approaches, self._report = approaches, report
        self._execution: Execution | None = None
        self._learning: Learning | None = None
        self._shown_for: tuple[int, str] = (-1, "")
        self._shown: State
        self._closed = threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="journal", daemon=True)
        self._watcher.start()

    def close(self) -> None:
        """Stop what this program started, as Ctrl-C does on the command line."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._watcher.join()
        if self._execution is not None and not self._execution.ended.done():
            self.stop()
            self._execution.ended.exception()
        self.workspace.close()

    def state(self) -> Console:
        """What the page shows."""
        with self._lock:
            state = self._state()
            return Console(
                **{name: getattr(state, name) for name in State.__struct_fields__},
                executor=self._executor,
                approaches=self._approaches,
                learning=self._learning,
                report=self._report if state.trials else "",
            )

    def set_goal(self, body: SetGoal) -> Console:
        """Set a goal, and get its first plan."""
        with self.as_seen(body.seen):
            goals = self.workspace.state.goals
            self.workspace.set_goal(
                body.goal,
                adapter=goals[-1].adapter if goals else DEFAULT_ADAPTER,
                carry_over=goals[-1].carry_over if goals else None,
                new_hardware=body.new_hardware,
            )
        return self.state()

    def ask(self, body: Ask) -> Console:
        """Get the next plan; the same one until it is told."""
        with self.as_seen(body.seen):
            self.workspace.recover()
            self._session.ask(arm_did_not_move=body.arm_did_not_move)
        return self.state()

    def execute(self, body: Execute) -> Console:
        """Begin to execute the plan that was seen; returns once the journal says so."""
        with self.as_seen(body.seen):
            trial = self.workspace.state.trial(body.trial)
            if self._execute is None:
                raise TrialStateError("nothing executes plans here; download it instead")
            if trial.kept is None or trial.kept.sha256 != body.plan:
                raise TrialStateError(f"trial {trial.number} has another plan; look again")
            if trial.stage is not Stage.ASKED or self._is_running():
                raise TrialStateError(f"trial {trial.number} is {trial.stage.value} already")
            running = self._execution = Execution(body, Future())
            threading.Thread(target=self._run, args=(running,), name="execution").start()
            began = len(self.workspace.events)
        while not running.ended.done():
            with self._lock:
                if len(self.workspace.events) > began:
                    break
            time.sleep(_LOOK / 5)
        else:
            running.ended.result()
        return self.state()

    def stop(self) -> Console:
        """Stop what moves the arm for this workspace, whoever started it; it may be nothing."""
        running = self._execution
        if running is not None:
            running.stopped = True
        while True:  # what is about to be started, too
            stop_executing(self.folder)
            if running is None or running.ended.done():
                break
            time.sleep(_LOOK)
        return self.state()

    def tell(self, body: Tell) -> Console:
        """Say what was seen of a trial."""
        with self.as_seen(body.seen):
            self._session.tell(body.trial, self._reading(body), hit=body.hit)
        return self.state()

    def amend(self, body: Tell) -> Console:
        """Correct what was said of a trial."""
        with self.as_seen(body.seen):
            self._session.amend(body.trial, self._reading(body), hit=body.hit)
        return self.state()

    def void(self, body: Void) -> Console:
        """Declare that a trial is not data."""
        with self.as_seen(body.seen):
            self._session.void(body.trial, body.reason)
        return self.state()

    def learn(self, body: Seen) -> Console:
        """Begin to learn from the demonstrations in use; an error of it goes to all tabs."""
        with self.as_seen(body.seen):
            if self._learning is not None:
                raise TrialStateError("it is learning already; wait for it")
            self.workspace.state.refuse_open_trial("learning")
            self.workspace.demonstrations  # noqa: B018  (there are some)
            self._learning = Learning(0.0, 0.0)
            threading.Thread(target=self._learn, name="learning", daemon=True).start()
        return self.state()

    def motion(self, number: int) -> MotionView:
        """Return a trial's plan, to be played."""
        with self._lock:
            return motion_of(self.workspace, number)

    def plan_file(self, number: int) -> Path:
        """Return a trial's plan file, if its plan may still be executed."""
        with self._lock:
            trial = self.workspace.state.trial(number)
            verdict = self.workspace.gate(self.workspace.plan(trial).actions)
            if verdict is not None:
                verdict.require()
            return self.workspace.plan_path(trial)

    def write_report(self) -> Path:
        """Write the report of now; return its page."""
        with Workspace(self.folder) as workspace:
            return report_workspace(workspace, self.folder / "report")

    def _state(self) -> State:
        """The workspace; computed once for all tabs that ask after an event."""
        entries, step = self.workspace.events, step_of(self.workspace)
        now = (len(entries), step)
        if now != self._shown_for or step == "executing" or not entries:
            self._shown, self._shown_for = state_of(self.workspace), now
        return self._shown

    @contextmanager
    def as_seen(self, seen: int) -> Iterator[None]:
        """Hold the workspace, if it is still as it was seen.

        Raises:
            TrialStateError: It is not; the message says what happened.
        """
        with self._lock:
            entries = self.workspace.events
            if seen > (entries[-1].id if entries else 0):
                raise TrialStateError("the journal has fewer events than the page; look again")
            since = [entry for entry in entries if entry.id > seen]
            if since:
                said = ", ".join(_say(to_builtins(entry.event)) for entry in since[-3:])
                raise TrialStateError(f"not done, since meanwhile: {said}; look again")
            yield

    def _reading(self, body: Tell) -> Reading | str | np.ndarray | None:
        if body.words is not None and body.outcome is not None:
            raise InvalidFeedbackError("give words or an outcome, not both")
        if body.outcome is None:
            return body.words
        goal = self.workspace.state.goal_of(self.workspace.state.trial(body.trial)).goal
        if len(body.outcome) != goal.size:
            raise InvalidFeedbackError(f"an outcome is {goal.size} numbers")
        error = np.array(body.outcome) - goal
        return error if body.sd is None else Reading.measured(error, body.sd)

    def _is_running(self) -> bool:
        return self._execution is not None and not self._execution.ended.done()

    def _run(self, running: Execution) -> None:
        """Execute in a workspace of its own, so that everything else goes on."""
        try:
            with Workspace(self.folder) as workspace:
                if not running.stopped:
                    assert self._execute is not None
                    self._execute(workspace, running.body)
        except BaseException as error:
            running.ended.set_exception(error)
            self.publish({"error": f"trial {running.body.trial}: {error}"})
        else:
            running.ended.set_result(None)

    def _learn(self) -> None:
        def progress(fit: FitProgress) -> None:
            self._learning = Learning(fit.step / max(fit.n_steps, 1), fit.seconds_left)
            self.publish({"learning": to_builtins(self._learning)})

        try:
            with Workspace(self.folder) as workspace:
                workspace.learn(progress=progress)
        except PriorReinforceError as error:
            self.publish({"error": str(error)})
        finally:
            self._learning = None
            self.publish({"learning": None})

    def _watch(self) -> None:
        """Tell all tabs what happens in the journal, whoever writes it, and what executions say."""
        last, shown, looked = -1, "", 0.0
        while not self._closed.wait(_LOOK):
            try:
                with self._lock:
                    entries, trial = self.workspace.events, self.workspace.state.open_trial
                    output = "" if trial is None else self._output(trial)
                    left = trial is not None and trial.stage is Stage.EXECUTING
                    left = left and not self._is_running()
                    if left and time.monotonic() > looked + _SOMETIMES:
                        looked = time.monotonic()
                        self.workspace.recover()
            except PriorReinforceError as error:
                self.publish({"error": str(error)})
                self._closed.wait(1.0)
                continue
            if len(entries) != last:
                last = len(entries)
                self.publish({"id": entries[-1].id if entries else 0})
            if output != shown:
                shown = output
                self.publish({"output": output})

    def _output(self, trial: Trial) -> str:
        with suppress(OSError):
            return output_of(self.workspace, trial)
        return ""


def _say(event: dict[str, Any]) -> str:
    """What happened, in a few words."""
    trial = f" trial {event['trial']}" if "trial" in event else ""
    return f"{event['kind'].replace('_', ' ')}{trial}"

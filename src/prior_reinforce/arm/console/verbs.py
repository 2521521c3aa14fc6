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
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import NoneType
from typing import Any

from msgspec import Struct, structs

from prior_reinforce.adapters import DEFAULT_ADAPTER
from prior_reinforce.arm.console import view
from prior_reinforce.arm.console.view import ConsoleState, MotionView, Mover
from prior_reinforce.arm.executing.base import ArmSettings, Motion
from prior_reinforce.arm.executing.lock import is_executing, last_stop, stop_executing
from prior_reinforce.arm.workspace.execute import (
    ask_to_move,
    execute,
    is_fast,
    look_at_arm,
    note_not_moved,
    recover,
    say_look,
)
from prior_reinforce.arm.workspace.reaching import region_of
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import PriorReinforceError, TrialStateError, WorkspaceError
from prior_reinforce.generators.base import FitProgress
from prior_reinforce.readings import Reading
from prior_reinforce.session.trials import Trial

_KIND: dict[type, Mover] = {NoneType: "", str: "command", ArmSettings: "arm"}
_LOOK = 0.05
"""How often the journal is looked at for what others did, in [s]."""
_SOMETIMES = 0.5
"""How often to look whether what executes has ended, in [s]: that reads all of /proc."""
_STARTING = 10.0
"""For what another program is about to start, in [s]; ours: what a busy computer takes for it."""


class Seen(Struct, forbid_unknown_fields=True):
    """What every verb says."""

    seen: int
    """`ConsoleState.id` of the state that the person saw."""


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
    sha256: str
    """Of the plan that the person saw."""
    stopped: str
    """`ConsoleState.stopped` of that state: after a Stop since then, nothing begins."""
    motion: Motion = "trial"
    """What a person was asked for (`Question.motion`)."""
    speed: float = 1.0
    """Share of the plan's own speed, of a rehearsal."""
    stood: dict[str, float] = {}
    """`Question.stood`: where the arm stood when a person was asked."""


class Question(Struct):
    """What a person is asked before the arm moves."""

    question: str
    """How it will move, and what nobody checked."""
    arm: str = ""
    """Which arm it is, and where it stands; empty where a command moves it, which is not asked."""
    motion: Motion = "trial"
    """What it is asked for: an arm that stands elsewhere approaches the plan's start first."""
    fast: bool = True
    """See `is_fast`."""
    refused: str = ""
    """Why the arm refuses the plan; empty if it does not."""
    stood: dict[str, float] = {}
    """Where each of the arm's channels stands."""


class Reached(Struct):
    """Goals to which motions may be moved."""

    goals: list[list[float]]
    """Those within the arm's limits."""
    refused: list[list[float]]
    """The others."""


class Measured(Struct, forbid_unknown_fields=True):
    """An error that was measured, and the standard deviation of each component."""

    error: list[float]
    sd: float


class Tell(Seen):
    """Say what was seen of a trial, or correct what was said."""

    trial: int
    error: list[float] | str | Measured | None = None
    """Outcome minus goal: as estimated by eye, in words (`5cm long, 2cm left`), or as measured."""
    hit: bool | None = None

    @property
    def reading(self) -> Reading | str | list[float] | None:
        """The error for the session."""
        if isinstance(self.error, Measured):
            return Reading.measured(self.error.error, self.error.sd)
        return self.error


class Void(Seen):
    """Declare that a trial is not data."""

    trial: int
    reason: str = ""


class Verbs:
    """A workspace that several tabs work on. Threads may share it."""

    def __init__(
        self,
        folder: Path,
        *,
        moved_by: str | ArmSettings | None = None,
        time_limit: float = 120.0,
        report: str = "",
        publish: Callable[[dict[str, Any]], None] = lambda message: None,
    ) -> None:
        """Open the workspace.

        `moved_by` is the command or the arm that executes plans, None where nothing can,
        `time_limit` how long that may take, in [s], `report` the path at which the report is read.
        `publish` is called, in any thread, with what all tabs should hear. Errors as of
        `Workspace`.
        """
        self.folder = folder
        self.workspace = Workspace(folder)
        self._session = self.workspace.session()
        self._lock = threading.RLock()
        self._moved_by, self._time_limit, self._report = moved_by, time_limit, report
        self.publish = publish
        """Tells all tabs something, in any thread."""
        self._threads = ThreadPoolExecutor(thread_name_prefix="execution")
        self._execution: Future[None] | None = None
        self._learning: tuple[float, float] | None = None
        self._shown_for: tuple[object, ...] = ()
        self._shown: ConsoleState
        self._closed = threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="journal", daemon=True)
        self._watcher.start()

    def close(self) -> None:
        """Stop what this program started, as Ctrl-C does on the command line."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._watcher.join()
        if self._is_running():
            self._halt()
        self._threads.shutdown()
        self.workspace.close()

    def state(self) -> ConsoleState:
        """What the page shows."""
        with self._lock:
            step, entries = self.workspace.standing.step, self.workspace.events
            now = (len(entries), step, last_stop(self.folder))
            if now != self._shown_for or step == "executing" or not entries:
                self._shown, self._shown_for = view.state_of(self.workspace), now
            return structs.replace(
                self._shown,  # computed once for all tabs that ask after an event
                moved_by=_KIND[type(self._moved_by)],
                learning=self._learning,
                report=self._report if self._shown.trials else "",
            )

    def goal(self, body: SetGoal) -> ConsoleState:
        """Set a goal, as the one before was set."""
        with self.as_seen(body.seen):
            goals = self.workspace.state.goals
            self.workspace.set_goal(
                body.goal,
                adapter=goals[-1].adapter if goals else DEFAULT_ADAPTER,
                carry_over=goals[-1].carry_over if goals else None,
                new_hardware=body.new_hardware,
            )
        return self.state()

    def ask(self, body: Ask) -> ConsoleState:
        """Get the next plan; the same one until it is told."""
        with self.as_seen(body.seen):
            recover(self.workspace)
            if body.arm_did_not_move:
                note_not_moved(self.workspace)
            self._session.ask()
        return self.state()

    def question(self, body: Execute) -> Question:
        """Say what nobody checked of a motion, and where the arm stands; nothing moves."""
        with self.as_seen(body.seen):
            trial, by = self._seen_trial(body)
        with Workspace(self.folder) as workspace:  # an arm may take long to answer
            if isinstance(by, str):
                return Question(ask_to_move(workspace, trial))
            look = look_at_arm(workspace, trial.number, by, speed=body.speed)
            motion = body.motion if look.there else "approach"
            question = ask_to_move(workspace, trial, look, motion, body.speed)
            refused = look.refused or (look.approach_refused if motion == "approach" else "")
            fast = is_fast(motion, body.speed)
            return Question(question, say_look(look), motion, fast, refused, look.pose)

    def execute(self, body: Execute) -> ConsoleState:
        """Begin to execute the plan that was seen; returns once the journal says so."""
        with self.as_seen(body.seen):
            trial, by = self._seen_trial(body)
            stage = self.workspace.state.stage(trial)
            if stage != "asked" or self._is_running():
                raise TrialStateError(f"trial {trial.number} is {stage} already")
            if isinstance(by, ArmSettings) and not body.stood:
                raise TrialStateError("nobody was asked where the arm stands; prepare it again")
            stop_seen, began = last_stop(self.folder), len(self.workspace.events)
            if body.stopped != str(stop_seen):
                raise TrialStateError("somebody pressed Stop since; look again")
            running = self._execution = self._threads.submit(self._run, body, by, stop_seen)
        while not running.done():
            with self._lock:
                if len(self.workspace.events) > began:
                    break
            time.sleep(_LOOK / 5)
        else:
            running.result()
        return self.state()

    def stop(self) -> ConsoleState:
        """Stop what moves the arm for this workspace, whoever started it; it may be nothing."""
        self._halt()
        try:
            return self.state()
        except PriorReinforceError as error:
            raise WorkspaceError(f"stopped, whatever moved; but {error}") from error

    def tell(self, body: Tell) -> ConsoleState:
        """Say what was seen of a trial."""
        with self.as_seen(body.seen):
            self._session.tell(body.trial, body.reading, hit=body.hit)
        return self.state()

    def amend(self, body: Tell) -> ConsoleState:
        """Correct what was said of a trial."""
        with self.as_seen(body.seen):
            self._session.amend(body.trial, body.reading, hit=body.hit)
        return self.state()

    def void(self, body: Void) -> ConsoleState:
        """Declare that a trial is not data."""
        with self.as_seen(body.seen):
            self._session.void(body.trial, body.reason)
        return self.state()

    def learn(self, body: Seen) -> ConsoleState:
        """Begin to learn from the demonstrations in use; an error of it goes to all tabs."""
        with self.as_seen(body.seen):
            if self._learning is not None:
                raise TrialStateError("it is learning already; wait for it")
            state = self.workspace.state
            state.refuse_open_trial("learning")
            if state.demonstrations is None:
                raise TrialStateError("nothing to learn from is here yet; bring in recordings")
            self._learning = (0.0, 0.0)
            threading.Thread(target=self._learn, name="learning", daemon=True).start()
        return self.state()

    def reach(self) -> Reached:
        """Return which goals can be reached with the model in use; none where nothing is moved."""
        with Workspace(self.folder) as workspace:  # some hundred plans are made for it
            trained = workspace.state.training is not None and not workspace.state.stale
            region = region_of(workspace) if trained else None
        if region is None:
            return Reached([], [])
        return Reached(
            region.goals[region.reached].tolist(), region.goals[~region.reached].tolist()
        )

    def motion(self, number: int) -> MotionView:
        """Return a trial's plan, to be played."""
        with self._lock:
            return view.motion_of(self.workspace, number)

    def plan_file(self, number: int) -> Path:
        """Return a trial's plan file, if its plan may still be executed."""
        with self._lock:
            trial = self.workspace.state.trial(number)
            verdict = self.workspace.gate(self.workspace.plan(trial).actions, trial.condition)
            if verdict is not None:
                verdict.require()
            return self.workspace.plan_file(trial).path

    def write_report(self) -> Path:
        """Write the report of now; return its page."""
        with Workspace(self.folder) as workspace:
            return workspace.report()

    @contextmanager
    def as_seen(self, seen: int) -> Iterator[None]:
        """Hold the workspace, if it is still as it was seen.

        TrialStateError, which says what happened, if it is not.
        """
        with self._lock:
            entries = self.workspace.events
            if seen > (entries[-1].id if entries else 0):
                raise TrialStateError("the journal has fewer events than the page; look again")
            since = [entry for entry in entries if entry.id > seen]
            if since:
                last = [
                    (e.kind.replace("_", " "), getattr(e.event, "trial", 0)) for e in since[-3:]
                ]
                said = ", ".join(f"{what} trial {n}" if n else what for what, n in last)
                raise TrialStateError(f"not done: {said}")
            yield

    def _seen_trial(self, body: Execute) -> tuple[Trial, str | ArmSettings]:
        """The trial whose plan was seen, and what executes it."""
        trial = self.workspace.state.trial(body.trial)
        if self._moved_by is None:
            raise TrialStateError("nothing executes plans here; download it instead")
        if self.workspace.plan_file(trial).sha256 != body.sha256:
            raise TrialStateError(f"trial {trial.number} has another plan; look again")
        return trial, self._moved_by

    def _halt(self) -> None:
        deadline = time.monotonic() + _STARTING
        stop_executing(self.folder)
        while is_executing(self.folder) and time.monotonic() < deadline:
            time.sleep(_LOOK)
            stop_executing(self.folder)  # what was about to be started, too

    def _is_running(self) -> bool:
        return self._execution is not None and not self._execution.done()

    def _run(self, body: Execute, by: str | ArmSettings, stop_seen: int) -> None:
        """Execute in a workspace of its own, so that everything else goes on."""
        try:
            with Workspace(self.folder) as workspace:
                execute(
                    workspace,
                    body.trial,
                    by,
                    time_limit=self._time_limit,
                    motion=body.motion,
                    speed=body.speed,
                    stop_seen=stop_seen,
                    stood=body.stood,
                )
        except BaseException as error:
            self.publish({"error": f"trial {body.trial}: {error}"})
            raise

    def _learn(self) -> None:
        def progress(fit: FitProgress) -> None:
            self._learning = (fit.step / max(fit.n_steps, 1), fit.seconds_left)
            self.publish({"learning": self._learning})

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
        shown, looked = dict[str, Any](), 0.0
        while not self._closed.wait(_LOOK):
            try:
                with self._lock:
                    entries, here = self.workspace.events, self.workspace.standing
                    now = {
                        "id": entries[-1].id if entries else 0,
                        "stopped": str(last_stop(self.folder)),
                        "output": view.output_of(self.workspace, here.state),
                    }
                    left = here.executing is not None and not self._is_running()
                    if left and time.monotonic() > looked + _SOMETIMES:
                        looked = time.monotonic()
                        recover(self.workspace)
            except (PriorReinforceError, OSError) as error:
                shown = {}  # read again, it is told again
                self.publish({"unreadable": str(error)})
                self._closed.wait(1.0)
                continue
            if now != shown:
                shown = now
                self.publish(now)

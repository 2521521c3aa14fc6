"""Executing a trial's plan: what a person is asked, the motion, and what is known of it afterwards.

The journal says `moving` before a command is given a plan and `moved` after all that it started has
ended, so a program that dies in between leaves a trial of which only a person knows what moved (or
`recover`). While what it left behind goes on, the trial still counts as executing.
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

from msgspec import structs

from prior_reinforce.arm.executing.arguments import check_command, split_command, without_arguments
from prior_reinforce.arm.executing.base import ArmSettings, Motion
from prior_reinforce.arm.executing.command import (
    ask_arm,
    execute_command,
    read_result,
    was_executed,
)
from prior_reinforce.arm.executing.drive import Look, Request, drive_command, read_look
from prior_reinforce.arm.executing.lock import executing_lock
from prior_reinforce.arm.executing.result import MotionResult, measure_tracking
from prior_reinforce.arm.executing.supervision import Interruptions
from prior_reinforce.arm.workspace.events import Moved, Moving
from prior_reinforce.arm.workspace.manifest import MANIFEST_FILE
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    PriorReinforceError,
    TrialStateError,
)
from prior_reinforce.files import write_once
from prior_reinforce.plans.motions import Plan
from prior_reinforce.session.trials import Trial
from prior_reinforce.terminal import plain

_LOOK_LIMIT = 60.0
"""How long an arm may take to say where it stands, in [s]; ours: to start a program and connect.
LeRobot imports for 6 s, and for 40 on a computer that is busy."""
FULL_SPEED = "FULL SPEED"
_MOTIONS: dict[Motion, str] = {
    "trial": f"Trial {{}} will run at {FULL_SPEED}",
    "rehearsal": "Trial {} will be rehearsed at {:g} % of its speed",
    "approach": "The arm will move slowly to where trial {} begins",
}
_SLOW = 0.25
"""Largest share of a plan's own speed that counts as slow (ours)."""


def execute(
    workspace: Workspace,
    number: int,
    command: str | ArmSettings,
    *,
    time_limit: float,
    motion: Motion = "trial",
    speed: float = 1.0,
    show: Callable[[str], None] | None = None,
    stop_seen: int | None = None,
    stood: Mapping[str, float] | None = None,
) -> MotionResult:
    """Execute a trial's plan by a command or by the manifest's arm, as a person saw it, once.

    A motion that is no trial, which an arm alone makes, is noted likewise, and the plan may be
    executed afterwards. `time_limit` is of a command, of an arm it is beyond the plan's own
    duration, in [s]; `speed`, of a rehearsal, is a share of the plan's own. After a stop since
    `stop_seen` (`last_stop` when it was asked for; now if not given), nothing begins. `stood` is
    where the arm was when a person was asked (`Look.pose`): nothing begins if a channel was moved
    since, for a trial or a rehearsal one that the plan leaves out.

    TrialStateError if it was stopped since, executed already, is not open, or another program
    executes one; RobotLimitError if the plan breaks a limit of now; ConfigurationError if the
    command cannot be started: nothing moved then, and the journal says so. KeyboardInterrupt if it
    was interrupted; the command was stopped, and the journal says so.
    """
    if (speed != 1.0) != (motion == "rehearsal") or not 0 < speed <= 1:
        raise ConfigurationError(
            f"a rehearsal has a share of the plan's speed above 0 and below 1, and nothing "
            f"else has; got {motion} at {speed}"
        )
    text = _command(workspace, command, motion, speed, stood)
    check_command(text, time_limit=time_limit)
    workspace.read_manifest()
    arm = workspace.manifest.arm
    with (
        executing_lock(workspace.folder, arm, stop_seen) as lock,
        Interruptions() as interruptions,
    ):
        _note_unknown_execution(workspace, workspace.state.trial(number))
        trial = to_execute(workspace, number)
        plan, file = workspace.plan(trial), workspace.plan_file(trial)
        verdict = workspace.gate(plan.actions, trial.condition)
        if verdict is not None:
            verdict.require()
        if isinstance(command, ArmSettings):
            time_limit += float(plan.times[-1]) / speed
        # The gate has read it again; a person said yes to what it said before.
        as_now = _command(workspace, command, motion, speed, stood)
        if workspace.manifest.arm != arm or text != as_now:
            raise _another_arm(workspace)
        if lock.revoked():
            raise TrialStateError(
                f"somebody pressed Stop since this was asked for: no {motion} began; ask again"
            )
        folder = workspace.store.make_execution_folder(
            file.path.name if motion == "trial" else f"{motion}-{file.path.name}"
        )
        by = command.executor if isinstance(command, ArmSettings) else without_arguments(text)
        _begin(workspace, Moving(number, motion, by, folder.name, speed))
        try:
            result = execute_command(
                text,
                file,
                folder,
                time_limit=time_limit,
                lock=lock,
                interruptions=interruptions,
                show=show,
            )
        except (PriorReinforceError, KeyboardInterrupt):
            _end(workspace, Moved(trial=number, motion=motion, outcome="not_moved"))
            raise
        if result.outcome != "unknown":
            result = _record(workspace, result, trial, folder, motion, speed)
        which = f"trial {number}" if motion == "trial" else f"the {motion} of trial {number}"
        interruptions.said = f"{which}: {result.outcome} ({result.reason})"
    return result


def to_execute(workspace: Workspace, number: int) -> Trial:
    """A trial whose plan was not executed yet.

    TrialStateError if it was, or the trial is closed.
    """
    state = workspace.state
    trial = state.trial(number)
    if state.stage(trial) != "asked":
        raise TrialStateError(
            f"trial {number} is {state.stage(trial)} already; a plan runs once: tell it or "
            "void it, then ask for the next"
        )
    return trial


def look_at_arm(workspace: Workspace, number: int, arm: ArmSettings, *, speed: float = 1.0) -> Look:
    """Ask the manifest's arm how it stands to a trial's plan, and whether it takes it.

    Nothing moves, and nothing is written down. TrialStateError if it is moved or recorded right
    now, since two programs on one bus clash; ConfigurationError if the arm does not answer, or is
    another one since.
    """
    text = _command(workspace, arm, "look", speed)
    plan = workspace.plan_file(workspace.state.trial(number))
    with executing_lock(arm=workspace.manifest.arm), tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        copy = write_once(folder / plan.path.name, plan.verify())
        words = split_command(text, copy, folder)
        ask_arm(arm.executor, words, folder, time_limit=_LOOK_LIMIT)
        return read_look(folder)


def recover(workspace: Workspace) -> Trial | None:
    """Note how executions ended whose program was killed, where their supervisors wrote it down.

    Those of trials that were told or voided meanwhile too. Returns the open trial as it stands now;
    None where there was nothing to recover of it.
    """
    now = workspace.standing
    if now.moving:
        return None
    waits = now.state.open_trial
    if waits is not None:
        _note_unknown_execution(workspace, waits)
    recovered = False
    for number, began in [*now.state.executions.items()]:
        if not isinstance(began, Moving) or not began.by or not began.folder:
            continue  # it ended, or a person has to say
        trial = now.state.trial(number)
        folder = workspace.store.execution_folder(began.folder)
        result = read_result(folder, workspace.plan_file(trial))
        if result is not None:
            _record(workspace, result, trial, folder)
            recovered = recovered or trial.open
    return workspace.state.open_trial if recovered else None


def note_not_moved(workspace: Workspace) -> None:
    """Note what a person saw of the open trial: the arm did not move, so it may be executed.

    TrialStateError if none is open, or it is executing now, or was executed to its end.
    """
    with workspace.log.exclusive():
        now = workspace.standing
        trial = now.state.open_trial
        if trial is None:
            raise TrialStateError("no trial waits to be executed: ask without --arm-did-not-move")
        if now.state.stage(trial) == "asked":
            return
        if now.moving:
            raise TrialStateError(f"trial {trial.number} is executing now; wait for it")
        if not now.ended_badly(trial):
            raise TrialStateError(
                f"trial {trial.number} was executed to its end, as its command says: tell or void "
                "it"
            )
        workspace.log.append(Moved(trial=trial.number, motion="trial", outcome="not_moved"))


def say_look(look: Look) -> str:
    """Say which arm it is, and where it stands: `fr3, firmware 5.9: the arm is there`."""
    firmware = f", firmware {look.arm.firmware}" if look.arm.firmware else ""
    return plain(f"{look.arm.model}{firmware}: {look.said}")


def is_fast(motion: Motion, speed: float = 1.0) -> bool:
    """Whether a motion is as dangerous as a throw: a trial, or a rehearsal that is not slow."""
    return motion == "trial" or (motion == "rehearsal" and speed > _SLOW)


def ask_to_move(
    workspace: Workspace,
    trial: Trial,
    look: Look | None = None,
    motion: Motion = "trial",
    speed: float = 1.0,
) -> str:
    """What a person is asked before the arm moves: how it will, and what nobody checked.

    `look` is what the arm said before; None where a command moves it.
    """
    plan, said = workspace.plan(trial), _MOTIONS[motion].format(trial.number, 100 * speed)
    gate, verdict = workspace.manifest.gate, workspace.gate(plan.actions, trial.condition)
    seconds = plan.times[-1] / speed
    unchecked, limits = ["where the arm stands"], False
    if look is not None:
        seconds = look.approach if motion == "approach" else seconds
        unchecked = [*look.arm.unchecked]
        limits = any("velocity" in check for check in look.arm.checked)
    if not limits and (verdict is None or "velocity" in verdict.unchecked):
        unchecked.append("the arm's limits")
    unchecked.append("self-collision")
    boxed = gate.box_low is not None and verdict is not None
    unchecked.append("the table, but for the tool tip" if boxed else "the table")
    missing = ", ".join(dict.fromkeys(unchecked))
    return plain(f"{said} ({seconds:.1f} s). NOT checked: {missing}. Is the area clear?")


def _command(
    workspace: Workspace,
    command: str | ArmSettings,
    motion: Motion | Literal["look"],
    speed: float,
    stood: Mapping[str, float] | None = None,
) -> str:
    """The text of a command, or of the program that lets an arm's executor move it."""
    manifest = workspace.manifest
    if isinstance(command, str):
        if motion != "trial":
            raise ConfigurationError(f"a command makes no {motion}; name the arm in [arm]")
        return command
    if manifest.driven_by != command:
        raise _another_arm(workspace)
    request = Request(command, manifest.gate, motion, speed, manifest.robot, dict(stood or {}))
    return drive_command(request)


def _another_arm(workspace: Workspace) -> ConfigurationError:
    path = workspace.folder / MANIFEST_FILE
    return ConfigurationError(
        f"{path} names another arm since; ask again (console: start it again)"
    )


def _begin(workspace: Workspace, event: Moving) -> None:
    """Note that a trial's plan is given to a command now: a plan is executed once."""
    with workspace.log.exclusive():
        to_execute(workspace, event.trial)
        workspace.log.append(event)


def _end(workspace: Workspace, event: Moved) -> None:
    """Note, once, how a motion ended, even if its trial was told or voided meanwhile."""
    with workspace.log.exclusive():
        latest = workspace.state.executions.get(event.trial)
        if event.motion != "trial" or isinstance(latest, Moving):
            workspace.log.append(event)


def _note_unknown_execution(workspace: Workspace, trial: Trial) -> None:
    """Note where a trial's plan was given to a command and no event says so.

    Such a journal was restored from a copy; a person has to say whether that was this trial.
    """
    if workspace.state.stage(trial) == "asked":
        known = {e.event.folder for e in workspace.events if isinstance(e.event, Moving)}
        for folder in workspace.store.execution_folders(workspace.plan_file(trial).path.name):
            if folder.name not in known and was_executed(folder):
                _begin(workspace, Moving(trial.number, "trial", "", folder.name))
                return


def _record(
    workspace: Workspace,
    result: MotionResult,
    trial: Trial,
    folder: Path,
    motion: Motion = "trial",
    speed: float = 1.0,
) -> MotionResult:
    """Record how a motion ended; the result, with its tracking error where a path was measured."""
    try:
        plan = workspace.plan(trial)
        slow = dataclasses.replace(plan.format, dt=plan.format.dt / speed)
        if motion != "approach":
            result = structs.replace(result, **measure_tracking(folder, Plan(plan.actions, slow)))
    except FileFormatError as error:
        reasons = filter(None, [result.reason, str(error)])
        result = structs.replace(result, reason="; ".join(reasons))
    _end(workspace, Moved(trial=trial.number, motion=motion, **structs.asdict(result)))
    return result

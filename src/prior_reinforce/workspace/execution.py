"""Executing a trial's plan by a command, once."""

from __future__ import annotations

from prior_reinforce.errors import ConfigurationError, FileFormatError, TrialStateError
from prior_reinforce.plans.files import PlanFile, run_with_plan
from prior_reinforce.robots.executors.command import HandOver, check_command
from prior_reinforce.robots.executors.lock import executing_lock
from prior_reinforce.workspace.history import TrialStage
from prior_reinforce.workspace.workspace import Workspace


def execute(workspace: Workspace, number: int, command: str, *, time_limit: float) -> HandOver:
    """Give an asked trial's plan to a command, once.

    The journal says `executing` before the command starts and `executed` after it ended, so a
    program that dies in between leaves a trial of which only a person knows what moved. While the
    command it left behind goes on, the trial still counts as executing.

    Args:
        workspace: Whose trial it is.
        number: The open trial.
        command: For instance `mycontroller {plan}`.
        time_limit: Of the command, in [s].

    Raises:
        TrialStateError: The trial was executed already, is not open, or another program executes
            one.
        ConfigurationError: The command could not be started; nothing moved, and the journal says
            so.
        FileFormatError: The plan's file is not what was handed out; nothing moved.
    """
    check_command(command, time_limit=time_limit)
    with executing_lock(workspace.folder) as lock:
        with workspace.journal.exclusive():
            trial = workspace.record(number)
            if trial.stage is not TrialStage.ASKED:
                raise TrialStateError(
                    f"trial {number} is {trial.stage.value} already; a plan runs once: tell it or "
                    "void it, then ask for the next"
                )
            workspace.journal.append("executing", {"trial": number, "command": command})
        plan_file = PlanFile(workspace.plan_path(trial), trial.plan_sha256)
        try:
            hand_over = run_with_plan(command, plan_file, time_limit=time_limit, keep_open=(lock,))
        except (ConfigurationError, FileFormatError):
            with workspace.journal.exclusive():  # the command was never started: nothing moved
                workspace.journal.append("not_executed", {"trial": number})
            raise
        with workspace.journal.exclusive():
            if workspace.record(number).stage is TrialStage.EXECUTING:
                data = {"trial": number, **hand_over.as_json()}
                workspace.journal.append("executed", data)
    return hand_over

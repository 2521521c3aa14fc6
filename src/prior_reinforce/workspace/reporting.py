"""The report of a workspace: every goal with its trials, from the journal and the plan files."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import numpy as np

from prior_reinforce.errors import FileFormatError, WorkspaceError
from prior_reinforce.files import named_disk_errors
from prior_reinforce.report import AdaptationRecord, write_report
from prior_reinforce.session import Trial, TrialState
from prior_reinforce.workspace.history import GoalRecord, History, TrialRecord, TrialStage
from prior_reinforce.workspace.workspace import Workspace


def report_workspace(workspace: Workspace, folder: Path) -> Path:
    """Write the page and its pictures.

    Args:
        workspace: With a goal that a trial was asked for.
        folder: Where to write; made if need be.

    Returns:
        Path of the page.

    Raises:
        WorkspaceError: There is nothing to report yet, or the folder cannot be written.
        FileFormatError: The demonstrations are damaged. A plan that is lost or damaged stops
            nothing: it is not drawn, and named.
    """
    history = workspace.history
    goals = [goal for goal in history.goals if history.trials_of(goal.number)]
    if not goals:
        raise WorkspaceError(
            f"there is no trial to report yet; run: prior-reinforce ask {workspace.folder}"
        )
    records = [_record(workspace, history, goal) for goal in goals]
    robot = workspace.manifest.robot
    with named_disk_errors(folder):
        return write_report(
            folder,
            records,
            title=f"{workspace.manifest.name}: {len(goals)} goal" + "s" * (len(goals) > 1),
            facts={
                "Task": workspace.manifest.name,
                "Demonstrations": str(records[-1].demonstrations.n),
                "Model": _models(history),
                "Robot": "none, no limits checked" if robot is None else robot.robot,
                "Earlier goals' trials used": ", ".join(
                    f"goal {goal.number}" for goal in goals if goal.memory == "workspace"
                )
                or "by no goal",
                "Version": version("prior-reinforce"),
            },
        )


def _models(history: History) -> str:
    """The models that planned trials, in order."""
    return ", ".join(dict.fromkeys(trial.model for trial in history.trials))


def _record(workspace: Workspace, history: History, goal: GoalRecord) -> AdaptationRecord:
    records = history.trials_of(goal.number)
    # The page counts each goal's trials from 1; the title says what the journal calls them.
    trials: list[Trial] = []
    remarks = ["no film: a real arm is not filmed by this program"]
    for number, record in enumerate(records, start=1):
        try:
            plan = workspace.plan(record).actions
        except FileFormatError as error:
            plan = np.empty((0, workspace.manifest.format.action_dim))
            remarks.append(f"the plan of trial {number} is not drawn: {error}")
        trials.append(_trial(record, number, plan))
    return AdaptationRecord(
        demonstrations=workspace.demonstrations_of(records[-1].model),
        goal=goal.goal,
        tolerance=goal.tolerance,
        trials=tuple(trials),
        title=_title(goal, records),
        film_caption="; ".join(remarks),
    )


def _title(goal: GoalRecord, trials: tuple[TrialRecord, ...]) -> str:
    first, last = trials[0].number, trials[-1].number
    if first == 1:
        return f"Goal {goal.number}"
    numbers = f"trial {first}" if first == last else f"trials {first} to {last}"
    return f"Goal {goal.number} ({numbers} in the journal)"


def _trial(record: TrialRecord, number: int, plan: np.ndarray) -> Trial:
    stages = {TrialStage.TOLD: TrialState.TOLD, TrialStage.VOIDED: TrialState.VOIDED}
    return Trial(
        number,
        record.condition,
        plan,
        stages.get(record.stage, TrialState.PENDING),
        record.error_seen,
        record.hit,
        record.note,
    )

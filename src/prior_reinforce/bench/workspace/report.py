"""The report of a workspace: every goal with its trials, from the journal and the plan files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from msgspec import convert

from prior_reinforce.bench.robots.report import LimitLine, LimitReport
from prior_reinforce.bench.workspace.log import WorkspaceState
from prior_reinforce.bench.workspace.status import execution_warning
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import FileFormatError, WorkspaceError
from prior_reinforce.files import claim_folder, named_disk_errors
from prior_reinforce.report import AdaptationRecord, write_report
from prior_reinforce.report.record import CheckRow
from prior_reinforce.session.trials import Goal, Trial


def report_workspace(
    workspace: Workspace, folder: Path, progress: Callable[[int, int], None] | None = None
) -> Path:
    """Write the page and its pictures.

    Args:
        workspace: With a goal that a trial was asked for.
        folder: Where to write; made if need be.
        progress: See `write_report`.

    Returns:
        Path of the page.

    Raises:
        WorkspaceError: There is nothing to report yet, or the folder cannot be written.
        FileFormatError: The demonstrations are damaged. A plan that is lost or damaged stops
            nothing: it is not drawn, and named.
    """
    state = workspace.state
    goals = [goal for goal in state.goals if state.trials_of(goal.number)]
    if not goals:
        raise WorkspaceError(
            f"there is no trial to report yet; run: prior-reinforce ask {workspace.folder}"
        )
    records = [_record(workspace, goal) for goal in goals]
    robot, training = workspace.manifest.robot, state.training
    models = (trial.model for goal in goals for trial in state.trials_of(goal.number))
    facts = {
        "Task": workspace.manifest.name,
        "Demonstrations": str(records[-1].demonstrations.n),
        "Model": ", ".join(dict.fromkeys(models)),
        "Adapter": ", ".join(dict.fromkeys(goal.adapter for goal in goals)),
        "Robot": "none, no limits checked" if robot is None else robot.robot,
        "Earlier goals' trials used": "by "
        + _name_goals(goal.number for goal in goals if _used_earlier(state, goal)),
        "Version": version("prior-reinforce"),
    }
    if training is not None and training.remarks:
        facts["Remarks"] = "; ".join(training.remarks)
    claim_folder(folder)
    title = f"{workspace.manifest.name}: {len(goals)} goal" + "s" * (len(goals) > 1)
    with named_disk_errors(folder):
        return write_report(
            folder, records, title=title, facts=facts, note=_say_without_plan(state),
            progress=progress,
        )  # fmt: skip


def _say_without_plan(state: WorkspaceState) -> str:
    """Name the goals that were set and that no plan was given for."""
    without = [goal.number for goal in state.goals if not state.trials_of(goal.number)]
    return f"No plan was given for {_name_goals(without)}." if without else ""


def _name_goals(numbers: Iterable[int]) -> str:
    *most, last = [str(number) for number in numbers] or [""]
    if not last:
        return "no goal"
    return f"goals {', '.join(most)} and {last}" if most else f"goal {last}"


def _used_earlier(state: WorkspaceState, goal: Goal) -> bool:
    """Whether trials of earlier goals counted for a goal."""
    models = {trial.model for trial in state.trials_of(goal.number)}
    readings = [reading for model in models for reading in state.readings_for(goal, model)]
    return any(reading.goal_number < goal.number for reading in readings)


def _record(workspace: Workspace, goal: Goal) -> AdaptationRecord:
    trials: list[Trial] = []
    remarks: list[str] = []
    for trial in workspace.state.trials_of(goal.number):
        try:
            trials.append(replace(trial, plan=workspace.plan(trial).actions))
        except FileFormatError as error:
            trials.append(replace(trial, plan=np.empty((0, workspace.manifest.format.action_dim))))
            remarks.append(f"the plan of trial {trial.number} is not drawn: {error}")
    return AdaptationRecord(
        demonstrations=workspace.demonstrations_of(trials[-1].model),
        goal=goal.goal,
        tolerance=goal.tolerance,
        trials=tuple(trials),
        number=goal.number,
        warnings={t.number: said for t in trials if (said := execution_warning(workspace, t))},
        checks=_checks(trials),
        film_caption="; ".join(remarks),
    )


def _checks(trials: Sequence[Trial]) -> tuple[CheckRow, ...]:
    """Each check of the gate, with the plan that came nearest to its limit, as it was asked for."""
    gated = [(t.number, convert(t.gate, LimitReport)) for t in trials if t.gate is not None]
    lines = [(number, line) for number, report in gated for line in report.lines]
    rows = []
    for check in dict.fromkeys(line.check for _, line in lines):
        number, line = max((x for x in lines if x[1].check == check), key=lambda x: _worse(x[1]))
        rows.append(CheckRow(check, line.status, number, line.text))
    return tuple(rows)


def _worse(line: LimitLine) -> tuple[int, float]:
    """Orders what the gate said of one check in several plans."""
    rank = ("unchecked", "pass", "warn", "refuse").index(line.status)
    return rank, 0.0 if line.margin is None else -line.margin

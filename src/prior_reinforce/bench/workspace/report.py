"""The report of a workspace: every goal with its trials, from the journal and the plan files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import convert

from prior_reinforce.bench.robots.executors.result import read_path
from prior_reinforce.bench.robots.report import LimitLine, LimitReport
from prior_reinforce.bench.workspace.log import Executed, Executing, WorkspaceState
from prior_reinforce.bench.workspace.status import execution_warning
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import FileFormatError, WorkspaceError
from prior_reinforce.files import claim_folder, named_disk_errors
from prior_reinforce.readings import Reading
from prior_reinforce.report import AdaptationRecord, write_report
from prior_reinforce.report.record import CheckRow
from prior_reinforce.session.events import GoalSet, Told
from prior_reinforce.session.trials import Goal, Trial
from prior_reinforce.wording import say_reading


def report_workspace(
    workspace: Workspace, folder: Path, progress: Callable[[int, int], None] | None = None
) -> Path:
    """Write the page and its pictures; see `Workspace.report`.

    A plan that is lost or damaged stops nothing: it is not drawn, and named.
    """
    state = workspace.state
    goals = [goal for goal in state.goals if state.trials_of(goal.number)]
    without = [goal.number for goal in state.goals if goal not in goals]
    if not goals:
        raise WorkspaceError(
            f"there is no trial to report yet; run: prior-reinforce ask {workspace.folder}"
        )
    records = [_record(workspace, goal) for goal in goals]
    robot, training = workspace.manifest.robot, state.training
    models = (trial.model for goal in goals for trial in state.trials_of(goal.number))
    dates = [entry.time[:10] for entry in workspace.events if entry.kind in ("asked", "told")]
    facts = {
        "Task": workspace.manifest.name,
        "Trials made": " to ".join(dict.fromkeys((dates[0], dates[-1]))),
        "Demonstrations": str(records[-1].demonstrations.n),
        "Model": ", ".join(_say_model(state, model) for model in dict.fromkeys(models)),
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
    note = f"No plan was given for {_name_goals(without)}." if without else ""
    with named_disk_errors(folder):
        return write_report(folder, records, title=title, facts=facts, note=note, progress=progress)


def _say_model(state: WorkspaceState, model: str) -> str:
    training = state.trainings.get(model)
    return model if training is None else f"{model} ({training.generator}, seed {training.seed})"


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
        notes=tuple(_notes(workspace, goal, trials)),
        measured=_measured(workspace, trials, remarks),
        photographs=tuple(_photographs(workspace.folder, trials)),
        film_caption="; ".join(remarks),
    )


def _notes(workspace: Workspace, goal: Goal, trials: Sequence[Trial]) -> Iterator[str]:
    """When a goal was set, what was changed before, what surprised, what was told otherwise."""
    numbers, told = {trial.number for trial in trials}, dict[int, Reading]()
    goals = 0
    for entry in workspace.events:
        match entry.event:
            case GoalSet():
                goals += 1
                if goals == goal.number:
                    changed = goal.new_hardware is not None
                    hardware = f"; new on the hardware: {goal.new_hardware}" if changed else ""
                    yield f"Set on {entry.time[:10]}, adapter {goal.adapter}{hardware}."
            case Told(trial=number, reading=record) if number in numbers:
                if number in told:
                    first = say_reading(told[number], goal.names, goal.units)
                    yield f"Trial {number} was corrected on {entry.time[:10]}; before: {first}."
                told[number] = Reading.from_record(record)
    for trial in trials:
        if trial.surprise:
            yield f"Trial {trial.number} was {trial.surprise}."
        ended = workspace.state.executions.get(trial.number)
        if isinstance(ended, Executed) and ended.tracking_rms:
            off = ", ".join(f"{rms:.3g} {unit}" for unit, rms in ended.tracking_rms.items())
            yield f"Trial {trial.number} went {off} rms off its plan, as measured."


def _measured(
    workspace: Workspace, trials: Sequence[Trial], remarks: list[str]
) -> dict[int, tuple[Any, Any]]:
    """Paths that drivers measured, by trial; what cannot be read is said in `remarks`."""
    numbers, found = {trial.number for trial in trials}, dict[int, tuple[Any, Any]]()
    for entry in workspace.events:
        match entry.event:
            case Executing(trial=number, folder=folder) if number in numbers and folder:
                try:
                    kept = workspace.store.execution_folder(folder)
                    if path := read_path(kept, workspace.manifest.format):
                        found[number] = path
                except FileFormatError as error:
                    remarks.append(f"the path of trial {number} is not drawn: {error}")
    return found


def _photographs(folder: Path, trials: Sequence[Trial]) -> Iterator[tuple[str, Path]]:
    """What `look --workspace` kept of trials."""
    for trial in trials:
        path = folder / "pictures" / f"trial-{trial.number:03d}-seen.png"
        if path.is_file() and not path.is_symlink():
            yield f"Trial {trial.number}, as it was looked at.", path


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

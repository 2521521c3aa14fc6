"""The report of a workspace: every goal with its trials, from the journal and the plan files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from msgspec import convert

import prior_reinforce
from prior_reinforce.arm.executing.result import read_path
from prior_reinforce.arm.robots.report import LimitLine, LimitReport
from prior_reinforce.arm.workspace.events import Moved, Moving
from prior_reinforce.arm.workspace.reaching import reach_picture
from prior_reinforce.arm.workspace.state import Standing, WorkspaceState
from prior_reinforce.arm.workspace.view import TrialView, trial_view
from prior_reinforce.errors import FileFormatError, WorkspaceError
from prior_reinforce.files import claim_folder, named_disk_errors
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading
from prior_reinforce.report import AdaptationRecord, write_report
from prior_reinforce.report.record import CheckRow
from prior_reinforce.session.events import Entry, GoalSet, Told
from prior_reinforce.session.trials import Goal, Trial
from prior_reinforce.wording import say_count, say_reading

_EXECUTED = ("executing", "executed")


def report_workspace(
    now: Standing,
    entries: Sequence[Entry],
    folder: Path,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write the page and its pictures; see `Workspace.report`.

    A plan that is lost or damaged stops nothing: it is not drawn, and named.
    """
    state, manifest = now.state, now.manifest
    goals = [goal for goal in state.goals if state.trials_of(goal.number)]
    without = [goal.number for goal in state.goals if goal not in goals]
    if not goals:
        raise WorkspaceError(
            f"there is no trial to report yet; run: prior-reinforce ask {now.folder}"
        )
    shown = cache(now.store.demonstrations)
    records = [_record(now, entries, goal, shown) for goal in goals]
    robot, training = manifest.robot, state.training
    models = (trial.model for goal in goals for trial in state.trials_of(goal.number))
    dates = [entry.time[:10] for entry in entries if entry.kind in ("asked", "told")]
    facts = {
        "Task": manifest.name,
        "Trials made": " to ".join(dict.fromkeys((dates[0], dates[-1]))),
        "Demonstrations": ", ".join(dict.fromkeys(str(each.demonstrations.n) for each in records)),
        "Model": ", ".join(_say_model(state, model) for model in dict.fromkeys(models)),
        "Adapter": ", ".join(dict.fromkeys(goal.adapter for goal in goals)),
        "Robot": "none, no limits checked" if robot is None else robot.robot,
        "Earlier goals' trials used": "by "
        + _name_goals(goal.number for goal in goals if _used_earlier(state, goal)),
        "Version": prior_reinforce.__version__,
    }
    if training is not None and training.remarks:
        facts["Remarks"] = "; ".join(training.remarks)
    claim_folder(folder)
    title = f"{manifest.name}: {say_count(len(goals), 'goal')}"
    note = f"No plan was given for {_name_goals(without)}." if without else ""
    reach = None if training is None else reach_picture(now.folder, training.model)
    reach = reach if reach is not None and reach.is_file() and not reach.is_symlink() else None
    with named_disk_errors(folder):
        return write_report(
            folder, records, title=title, facts=facts, note=note, reach=reach, progress=progress
        )


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


def _record(
    now: Standing,
    entries: Sequence[Entry],
    goal: Goal,
    shown: Callable[[str], Demonstrations],
) -> AdaptationRecord:
    trials: list[Trial] = []
    remarks: list[str] = []
    for trial in now.state.trials_of(goal.number):
        try:
            plan = now.store.plan(now.state.plan_files[trial.number]).actions
        except FileFormatError as error:
            remarks.append(f"the plan of trial {trial.number} is not drawn: {error}")
        else:
            trial = replace(trial, plan=plan)
        trials.append(trial)
    views = [trial_view(now, trial) for trial in trials]
    learned_from = now.state.shown_for(goal)
    assert learned_from is not None  # it has trials
    return AdaptationRecord(
        demonstrations=shown(learned_from.sha256),
        goal=goal.goal,
        tolerance=goal.tolerance,
        trials=tuple(trials),
        number=goal.number,
        lines={view.number: view.line for view in views if view.stage in _EXECUTED},
        warnings={view.number: view.warning for view in views if view.told and view.warning},
        checks=_checks(trials),
        notes=tuple(_notes(now.state, entries, goal, views)),
        measured=_measured(now, entries, views, remarks),
        photographs=tuple(_photographs(now.folder, trials)),
        film_caption="; ".join(remarks),
    )


def _notes(
    state: WorkspaceState, entries: Sequence[Entry], goal: Goal, views: Sequence[TrialView]
) -> Iterator[str]:
    """When a goal was set, what was changed before, what surprised, what was told otherwise."""
    numbers, told = {view.number for view in views}, dict[int, Reading]()
    goals = 0
    for entry in entries:
        match entry.event:
            case GoalSet():
                goals += 1
                if goals == goal.number:
                    changed = goal.new_hardware is not None
                    hardware = f"; new on the hardware: {goal.new_hardware}" if changed else ""
                    yield f"Set on {entry.time[:10]}, adapter {goal.adapter}{hardware}."
            case Told(trial=number, reading=record) if number in numbers:
                if number in told:
                    first = say_reading(told[number], goal.format)
                    yield f"Trial {number} was corrected on {entry.time[:10]}; before: {first}."
                told[number] = Reading.from_record(record)
    for view in views:
        if view.surprise:
            yield f"Trial {view.number} was {view.surprise}."
        ended = state.executions.get(view.number)
        if isinstance(ended, Moved) and ended.tracking_rms:
            off = ", ".join(f"{rms:.3g} {unit}" for unit, rms in ended.tracking_rms.items())
            yield f"Trial {view.number} went {off} rms off its plan, as measured."


def _measured(
    now: Standing,
    entries: Sequence[Entry],
    views: Sequence[TrialView],
    remarks: list[str],
) -> dict[int, tuple[Any, Any]]:
    """Paths that drivers measured, by trial; what cannot be read is said in `remarks`."""
    numbers, found = {view.number for view in views}, dict[int, tuple[Any, Any]]()
    for entry in entries:
        match entry.event:
            case Moving(trial=n, motion="trial", folder=folder) if folder and n in numbers:
                try:
                    if path := read_path(now.store.execution_folder(folder), now.manifest.format):
                        found[n] = path
                except FileFormatError as error:
                    remarks.append(f"the path of trial {n} is not drawn: {error}")
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

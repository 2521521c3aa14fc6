"""What a workspace says to programs: `--json`, `Workspace.status()` and `Workspace.trials`.

These records are the schema (`msgspec.json.schema(StatusRecord)`): a field is added now and then,
none is renamed or changes its meaning within a major version. Numbers are in the manifest's units;
what is not known is null. The whole reading of a trial, its interval and its sd, is in the journal.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from prior_reinforce.bench.workspace.status import describe, next_step
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.files import as_cell
from prior_reinforce.session.events import Asked, Told
from prior_reinforce.session.trials import Goal, Stage, Trial
from prior_reinforce.wording import as_html

_TIMES = ("asked", "told")


class GoalRecord(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One goal."""

    number: int
    """From 1."""
    goal: list[float]
    tolerance: list[float]
    """Of each component."""
    adapter: str
    earlier_trials: bool
    """Whether the adapter also learns from earlier goals' trials."""
    new_hardware: str | None
    """What was changed before it; null where nothing was."""
    told: int
    """Trials told, voided ones not counted."""
    reached_after: int | None
    """Trials until it was reached; null where it was not."""


class TrialRecord(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One trial."""

    number: int
    """From 1, over all goals."""
    goal: int
    """Number of its goal."""
    stage: str
    """asked, executing, executed, told or voided."""
    condition: list[float]
    """The outcome that the generator was asked for."""
    error: list[float] | None
    """What was seen, outcome minus goal; of a direction alone, what it is taken to be."""
    said: str | None
    """The same in the words that were typed."""
    hit: bool | None
    """Null unless told."""
    reason: str | None
    """Why it was voided."""
    p_hit: float | None
    """Probability that it hits, as expected when it was asked for."""
    expected_trials: float | None
    """Trials until the goal is reached, this one included, likewise."""
    surprise: str | None
    """What is odd about what was told of it."""
    outdated: bool
    """Whether it was planned before a correction."""
    model: str
    plan: str
    """Path of the plan's file."""
    asked: str
    """When its plan was given out, ISO 8601, UTC."""
    told: str | None
    """When its result was told last, likewise."""


class StatusRecord(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where a workspace stands."""

    task: str
    folder: str
    tolerance: list[float]
    outcome_names: list[str]
    outcome_units: list[str]
    action_names: list[str]
    action_units: list[str]
    dt: float
    """Time between two frames of a plan, in [s]."""
    robot: str | None
    """Null where no limits are checked."""
    demonstrations: int
    source: str | None
    """What they were imported from."""
    model: str | None
    generator: str | None
    remarks: list[str]
    """What the fit could not do."""
    stale: bool
    """Whether the model must be learned (again)."""
    goals: list[GoalRecord]
    solved: bool
    """Whether the latest goal is reached."""
    open_trial: TrialRecord | None
    """The trial that waits to be told."""
    next: str
    """The command that comes next."""
    text: str
    """The same for a person, as `status` prints it."""

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return as_html(self.text)


class AskRecord(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The trial that was asked for."""

    trial: TrialRecord
    first_pose: dict[str, float]
    """Where the plan begins, by action name."""
    gate: dict[str, Any] | None
    """The gate's verdict of now; null where the manifest names no robot."""
    written: str | None
    """Where --out put the plan."""
    execution: dict[str, Any] | None
    """How the command of --run ended; null where none was run."""
    next: str


class InspectRecord(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What recordings hold, and what an import would make of them."""

    source: str
    format: str
    episodes: list[str]
    findings: dict[str, str]
    """The essentials by topic, in words."""
    remarks: list[str]
    unclear: list[str]
    """What is only guessed; `next` has the options that settle it."""
    outcomes: str | None
    """The table of outcomes; null where the recordings hold them."""
    outcomes_missing: list[str]
    """Episodes without one."""
    next: str
    """The command to type next."""


class AdviceRecord(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where first throws would hit, and what would teach most."""

    mean_p_hit: float
    """Over the demonstrated region."""
    best: list[float]
    """Where a first throw hits most probably."""
    best_p_hit: float
    worst: list[float]
    worst_p_hit: float
    throw: list[float]
    """The throw that teaches most, and the share of what is unknown that it takes away."""
    throw_teaches: float
    demonstration: list[float] | None
    """The outcome of the demonstration that teaches most; null where none would."""
    demonstration_teaches: float
    picture: str | None


def goal_record(workspace: Workspace, goal: Goal) -> GoalRecord:
    """Return a goal as a record."""
    told = [t for t in workspace.state.trials_of(goal.number) if t.stage is Stage.TOLD]
    hits = [count for count, trial in enumerate(told, start=1) if trial.hit]
    return GoalRecord(
        number=goal.number,
        goal=goal.goal.tolist(),
        tolerance=goal.tolerance.tolist(),
        adapter=goal.adapter,
        earlier_trials=goal.carry_over,
        new_hardware=goal.new_hardware,
        told=len(told),
        reached_after=hits[0] if hits else None,
    )


def trial_records(workspace: Workspace) -> list[TrialRecord]:
    """Return all trials as records, in order."""
    times = {
        ("asked" if isinstance(entry.event, Asked) else "told", entry.event.trial): entry.time
        for entry in workspace.events
        if isinstance(entry.event, Asked | Told)
    }
    return [_trial_record(workspace, trial, times) for trial in workspace.state.trials]


def _trial_record(
    workspace: Workspace, trial: Trial, times: Mapping[tuple[str, int], str]
) -> TrialRecord:
    reading = trial.reading
    return TrialRecord(
        number=trial.number,
        goal=trial.goal_number,
        stage=trial.stage.value,
        condition=trial.condition.tolist(),
        error=reading.error_seen.tolist() if reading is not None else None,
        said=reading.said or None if reading is not None else None,
        hit=trial.hit if reading is not None else None,
        reason=trial.note or None,
        p_hit=trial.p_hit,
        expected_trials=trial.expected_trials,
        surprise=trial.surprise or None,
        outdated=trial.outdated,
        model=trial.model,
        plan=str(workspace.plan_path(trial)),
        asked=times["asked", trial.number],
        told=times.get(("told", trial.number)) if reading is not None else None,
    )


def status_record(workspace: Workspace) -> StatusRecord:
    """Return where a workspace stands."""
    state, manifest = workspace.state, workspace.manifest
    training, form = state.training, manifest.format
    waiting = state.open_trial
    return StatusRecord(
        task=manifest.name,
        folder=str(workspace.folder),
        tolerance=[*manifest.tolerance],
        outcome_names=[*manifest.outcome_names],
        outcome_units=[*manifest.outcome_units],
        action_names=[*form.names],
        action_units=[*form.units],
        dt=form.dt,
        robot=manifest.robot.robot if manifest.robot is not None else None,
        demonstrations=workspace.demonstrations.n if state.demonstrations is not None else 0,
        source=state.demonstrations_source or None,
        model=training.model if training is not None else None,
        generator=training.generator if training is not None else None,
        remarks=[*training.remarks] if training is not None else [],
        stale=state.stale,
        goals=[goal_record(workspace, goal) for goal in state.goals],
        solved=state.solved,
        open_trial=trial_records(workspace)[waiting.number - 1] if waiting is not None else None,
        next=next_step(workspace),
        text=describe(workspace),
    )


def trials_table(workspace: Workspace) -> str:
    """Return all trials as CSV: a row each, vectors a column a component with its unit."""
    names = workspace.manifest.outcome_names
    components = [
        f"{n} [{u}]" for n, u in zip(names, workspace.manifest.outcome_units, strict=True)
    ]
    vectors = [f"{v} {each}" for v in ("goal", "condition", "error") for each in components]
    plainly = ("stage", "hit", "said", "reason", "p_hit", "expected_trials", "model", *_TIMES)
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(map(as_cell, ("trial", "number of goal", *vectors, *plainly)))
    for record in trial_records(workspace):
        goal = workspace.state.goals[record.goal - 1].goal.tolist()
        error = [None] * len(names) if record.error is None else record.error
        row = [record.number, record.goal, *goal, *record.condition, *error]
        row += [getattr(record, name) for name in plainly]
        table.writerow(as_cell(cell) if isinstance(cell, str) else cell for cell in row)
    return text.getvalue()

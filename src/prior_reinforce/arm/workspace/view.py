"""A workspace as plain data, which `--json`, `status`, the console and the report render.

The structs are the JSON schema (`msgspec.json.schema(StatusView)`): a field is added now and then,
none is renamed or changes its meaning within a major version. Numbers are in the manifest's units;
what is not known is null. The whole reading of a trial, its interval and its sd, is in the journal.
"""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np
from msgspec import Struct, structs

from prior_reinforce.arm.workspace.manifest import MANIFEST_FILE, UNKNOWN
from prior_reinforce.arm.workspace.state import Standing, Step, WorkspaceState
from prior_reinforce.arm.workspace.text import (
    goal_step,
    next_step,
    say_left_out,
    say_trial,
    say_warning,
)
from prior_reinforce.errors import FileFormatError, InvalidDemonstrationsError
from prior_reinforce.files import as_cell
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.session.trials import Goal, Trial, told_trials, trials_to_hit
from prior_reinforce.terminal import plain
from prior_reinforce.wording import (
    as_html,
    say_chance,
    say_cost,
    say_count,
    say_place,
    say_reading,
    say_tolerance,
    say_trials,
)

_TRIALS_SHOWN = 3


class View(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What programs are told."""


class GoalView(View, frozen=True):
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
    demonstrations: int
    """Number of those that its model learned from."""


class TrialView(View, frozen=True):
    """One trial."""

    number: int
    """From 1, over all goals."""
    goal: int
    """Number of its goal."""
    stage: str
    """asked, executing, executed, told or voided."""
    line: str
    """What became of it, in words."""
    warning: str | None
    """Why a reading of it might mislead; of one that waits, what its last motion came to."""
    condition: list[float]
    """The outcome that the generator was asked for."""
    outcome: list[float] | None
    """Goal plus `error`."""
    error: list[float] | None
    """What was seen, outcome minus goal; of a direction alone, what it is taken to be; null too
    where nothing but a hit, a miss or a loss was told."""
    vague: bool
    """Whether it stands for a direction alone."""
    seen: str | None
    """The same in words."""
    said: str | None
    """The same in the words that were typed."""
    hit: bool | None
    """Null unless told."""
    reason: str | None
    """Why it was voided."""
    p_hit: float | None
    """Probability that it hits, as expected when it was asked for."""
    chance: str | None
    """The same in a word, which is what it can be trusted to."""
    expected_trials: float | None
    """Trials until the goal is reached, this one included, likewise; null too where a hit is hardly
    possible."""
    to_go: str | None
    """The same in words: `about 2.2`, or `more than 10`, beyond which it is a guess."""
    surprise: str | None
    """What is odd about what was told of it."""
    outdated: bool
    """Whether it was planned before a correction."""
    model: str
    plan: str
    """Path of the plan's file."""
    sha256: str
    """Of the plan's file."""
    asked: str
    """When its plan was given out, ISO 8601, UTC."""
    told: str | None
    """When its result was told last, likewise."""


class StatusView(View, frozen=True):
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
    lost: str | None
    """Why they cannot be used, and what to do; null where they can."""
    model: str | None
    generator: str | None
    remarks: list[str]
    """What the fit could not do."""
    stale: bool
    """Whether the model must be learned (again)."""
    goals: list[GoalView]
    trials: list[TrialView]
    """All of them, of all goals."""
    left_out: str | None
    """How many of them teach the model in use nothing, as others planned them; null if none."""
    solved: bool
    """Whether the latest goal is reached."""
    open_trial: TrialView | None
    """The trial that waits to be told."""
    step: Step
    """What comes next."""
    next: str
    """The command that comes next."""
    nearer: str | None
    """What comes next if the gate refuses it, since the goal lies far outside what was shown."""
    text: str = ""
    """The same for a person, as `status` prints it."""

    @property
    def outcome_format(self) -> OutcomeFormat:
        """What the numbers of an outcome mean, with the tolerance."""
        return OutcomeFormat((*self.outcome_names,), (*self.outcome_units,), (*self.tolerance,))

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return as_html(self.text)


class AskView(View, frozen=True):
    """The trial that was asked for."""

    trial: TrialView
    first_pose: dict[str, float]
    """Where the plan begins, by action name."""
    gate: dict[str, Any] | None
    """The gate's verdict of now; null where the manifest names no robot."""
    written: str | None
    """Where --out put the plan."""
    execution: dict[str, Any] | None
    """How the command of --run ended; null where none was run."""
    next: str


class InspectView(View, frozen=True):
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


class AdviceView(View, frozen=True):
    """Where first throws would hit, and what would teach most."""

    mean_p_hit: float
    """Over the region around what was demonstrated."""
    best: list[float]
    """Where a first throw hits most probably."""
    best_p_hit: float
    worst: list[float]
    worst_p_hit: float
    throw: list[float] | None
    """The throw that teaches most, and the share of what is unknown that it takes away; null where
    demonstrations are moved, for what is learned of a move serves everywhere."""
    throw_teaches: float
    reached: float | None
    """Share of the goals to which motions may be moved that is within the arm's limits; null
    without a symmetry."""
    demonstration: list[float] | None
    """The outcome of the demonstration that teaches most; null where none would."""
    demonstration_teaches: float
    picture: str | None


def trial_view(now: Standing, trial: Trial) -> TrialView:
    """Return a trial as plain data."""
    reading, error, seen = trial.reading, trial.error_seen, None
    p_hit, to_go = trial.expected.p_hit, trial.expected.trials
    file = now.store.plan_file(now.state.plan_files[trial.number])
    if reading is not None:
        seen = say_reading(reading, now.manifest.outcome_format)
    return TrialView(
        number=trial.number,
        goal=trial.goal_number,
        stage=now.state.stage(trial),
        line=say_trial(now, trial),
        warning=say_warning(now, trial) or None,
        condition=trial.condition.tolist(),
        outcome=None if error is None else (now.state.goal_of(trial).goal + error).tolist(),
        error=None if error is None else error.tolist(),
        vague=error is not None and not trial.hit and reading is not None and reading.is_open,
        seen=seen,
        said=reading.said or None if reading is not None else None,
        hit=trial.hit if reading is not None else None,
        reason=trial.note or None,
        p_hit=p_hit,
        chance=None if p_hit is None else say_chance(p_hit),
        expected_trials=to_go,
        to_go=None if to_go is None else say_trials(to_go),
        surprise=trial.surprise or None,
        outdated=trial.outdated,
        model=trial.model,
        plan=str(file.path),
        sha256=file.sha256,
        asked=trial.asked_at,
        told=trial.told_at or None,
    )


def status_view(now: Standing) -> StatusView:
    """Return where a workspace stands."""
    state, manifest, outcomes = now.state, now.manifest, now.manifest.outcome_format
    training, form, imported = state.training, manifest.format, state.demonstrations
    trials = [trial_view(now, trial) for trial in state.trials]
    lost = nearer = shown = None
    try:
        if imported is not None:
            shown = now.store.demonstrations(imported.sha256)
            manifest.check_fit(shown, "what was imported", now.folder / MANIFEST_FILE)
    except (FileFormatError, InvalidDemonstrationsError) as error:
        lost = str(error)
    if shown is not None and now.step == "ask" and not state.current:
        far = np.any(shown.far_outside(state.goals[-1].goal))
        nearer = f"a goal nearer to the demonstrations: {goal_step(now)}" if far else None
    view = StatusView(
        task=manifest.name,
        folder=str(now.folder),
        tolerance=[*outcomes.tolerance],
        outcome_names=[*outcomes.names],
        outcome_units=[*outcomes.units],
        action_names=[*form.names],
        action_units=[*form.units],
        dt=form.dt,
        robot=manifest.robot.robot if manifest.robot is not None else None,
        demonstrations=imported.n if imported is not None else 0,
        source=imported.source if imported is not None else None,
        lost=lost,
        model=training.model if training is not None else None,
        generator=training.generator if training is not None else None,
        remarks=[*training.remarks] if training is not None else [],
        stale=state.stale,
        goals=[_goal_view(state, goal) for goal in state.goals],
        trials=trials,
        left_out="; ".join(say_left_out(state)) or None,
        solved=state.solved,
        open_trial=trials[-1] if state.open_trial is not None else None,
        step=now.step,
        next=next_step(now),
        nearer=nearer,
    )
    return structs.replace(view, text=describe(view))


def _goal_view(state: WorkspaceState, goal: Goal) -> GoalView:
    trials = state.trials_of(goal.number)
    return GoalView(
        number=goal.number,
        goal=goal.goal.tolist(),
        tolerance=goal.tolerance.tolist(),
        adapter=goal.adapter,
        earlier_trials=goal.carry_over,
        new_hardware=goal.new_hardware,
        told=len(told_trials(trials)),
        reached_after=trials_to_hit(trials),
        demonstrations=0 if (shown := state.shown_for(goal)) is None else shown.n,
    )


def describe(view: StatusView) -> str:
    """Say where a workspace stands: ten lines, and one for each earlier goal and remark."""
    columns, n, model = f"{len(view.action_names)} numbers", view.demonstrations, "none yet"
    if tuple(view.action_names) == UNKNOWN:
        columns = "what the first import has"
    if view.model is not None:
        model = f"{view.model}, {view.generator}" + ", of other demonstrations" * view.stale
    robot = view.robot or "none, no limits are checked"
    rows = [
        ("task", f"{view.task}, tolerance {say_tolerance(view.outcome_format)}"),
        ("plans", f"{columns} a frame, a frame every {view.dt * 1000:g} ms; robot: {robot}"),
        ("demonstrations", f"{n} from {view.source}" if n else "none yet"),
        *([("  note", view.lost)] if view.lost else []),
        ("model", model),
        *(("  note", remark) for remark in view.remarks),
        *((f"goal {goal.number}", _say_goal(view, goal)) for goal in view.goals),
    ]
    current = [trial for trial in view.trials if trial.goal == len(view.goals)]
    shown = current[-_TRIALS_SHOWN:]
    if earlier := len(current) - len(shown):
        rows.append((f"  {earlier} more", "before these; all are in the report"))
    rows += [(f"  trial {trial.number}", trial.line) for trial in shown]
    rows += [("  note", view.left_out)] if view.left_out else []
    refused = "" if view.nearer is None else f"; if it refuses, {view.nearer}"
    rows.append(("next", view.next + refused))
    return "\n".join(plain(f"{name:<15} {text}") for name, text in rows)


def _say_goal(view: StatusView, goal: GoalView) -> str:
    form = view.outcome_format
    place, own = say_place(goal.goal, form), form.within(goal.tolerance)
    if say_tolerance(own) != say_tolerance(form):
        place += f", within {say_tolerance(own)} as it was set"
    if (hits := goal.reached_after) is not None:
        cost = say_cost(goal.demonstrations, hits)
        return f"{place}: reached in {say_count(hits, 'trial')} ({cost})"
    if goal.number < len(view.goals):
        if not goal.told:
            return f"{place}: not tried"
        return f"{place}: not reached in {say_count(goal.told, 'trial')}"
    changed = f", new hardware: {goal.new_hardware}" if goal.new_hardware is not None else ""
    carried = ", with earlier goals' trials" if goal.earlier_trials else ""
    so_far = f"not reached yet, {say_count(goal.told, 'trial')} told"
    return f"{place}: {so_far}; adapter {goal.adapter}{carried}{changed}"


def trials_table(view: StatusView) -> str:
    """Return all trials as CSV: a row each, vectors a column a component with its unit."""
    components = [f"{n} [{u}]" for n, u in zip(view.outcome_names, view.outcome_units, strict=True)]
    vectors = [f"{v} {each}" for v in ("goal", "condition", "error") for each in components]
    columns = ["stage", "hit", "said", "reason", "p_hit", "expected_trials", "model"]
    columns += ["asked", "told"]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(map(as_cell, ("trial", "number of goal", *vectors, *columns)))
    for trial in view.trials:
        error = [None] * len(components) if trial.error is None else trial.error
        row = [trial.number, trial.goal, *view.goals[trial.goal - 1].goal, *trial.condition]
        row += [*error, *(getattr(trial, name) for name in columns)]
        table.writerow(as_cell(cell) if isinstance(cell, str) else cell for cell in row)
    return text.getvalue()

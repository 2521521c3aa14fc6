"""Where a workspace stands, in ten lines, and what to do next."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from prior_reinforce.bench.robots.executors.base import Motion
from prior_reinforce.bench.workspace.log import Executed, Executing, NotExecuted, WorkspaceState
from prior_reinforce.bench.workspace.manifest import UNKNOWN
from prior_reinforce.bench.workspace.workspace import Workspace, workspace_around
from prior_reinforce.registry import own_class
from prior_reinforce.session.trials import Goal, Stage, Trial
from prior_reinforce.wording import error_example, plain, say_place, say_reading, say_tolerance

if TYPE_CHECKING:
    from prior_reinforce.bench.robots.executors.drive import Look

_TRIALS_SHOWN = 3
_POOR_TRIALS = 3
_POOR_CHANCE = 0.35
"""Probability of a hit below which another trial like the last ones is no good plan (ours): words
by eye leave a chance of a half where all else is known."""
OUTDATED = "planned before a correction: unless it was thrown, void it and ask again"
"""What to do about a trial whose plan knows nothing of what was amended or voided since."""

_MOTIONS: dict[Motion, str] = {
    "trial": "trial {} at full speed",
    "rehearsal": "a rehearsal of trial {} at {:g} % of its speed",
    "approach": "slowly to where trial {} begins",
}


def describe(workspace: Workspace) -> str:
    """Say where a workspace stands: ten lines, and one for each earlier goal and remark."""
    state, manifest = workspace.state, workspace.manifest
    robot = manifest.robot.robot if manifest.robot is not None else "none, no limits are checked"
    n = 0 if state.demonstrations is None else workspace.demonstrations.n
    names, units = manifest.outcome_names, manifest.outcome_units
    training, columns = state.training, f"{manifest.format.action_dim} numbers"
    if manifest.format.names == UNKNOWN:
        columns = "what the first import has"
    rows = [
        ("task", f"{manifest.name}, tolerance {say_tolerance(manifest.tolerance, names, units)}"),
        (
            "plans",
            f"{columns} a frame, a frame every {manifest.format.dt * 1000:g} ms; robot: {robot}",
        ),
        ("demonstrations", f"{n} from {state.demonstrations_source}" if n else "none yet"),
        ("model", _say_model(workspace)),
        *(("  note", remark) for remark in (training.remarks if training is not None else ())),
    ]
    rows += [(f"goal {goal.number}", _say_goal(workspace, goal, n)) for goal in state.goals]
    if state.goals:
        shown = state.current[-_TRIALS_SHOWN:]
        if earlier := len(state.current) - len(shown):
            rows.append((f"  {earlier} more", "before these; all are in the report"))
        rows += [(f"  trial {trial.number}", say_trial(workspace, trial)) for trial in shown]
    rows.append(("next", next_step(workspace) + _say_nearer(workspace)))
    return "\n".join(plain(f"{name:<15} {text}") for name, text in rows)


def say_trial(workspace: Workspace, trial: Trial) -> str:
    """Say what became of a trial, in a line."""
    return plain(_say_trial(workspace, trial))


def _say_trial(workspace: Workspace, trial: Trial) -> str:
    if trial.reading is not None:
        manifest = workspace.manifest
        seen = say_reading(trial.reading, manifest.outcome_names, manifest.outcome_units)
        seen = f"reached ({seen})" if trial.hit else seen
        return f"{seen}, {trial.surprise}" if trial.surprise else seen
    if trial.stage is Stage.VOIDED:
        return f"void: {trial.note}" if trial.note else "void"
    if trial.stage is Stage.EXECUTING:
        if workspace.log.is_executing():
            return "is executing now"
        began = workspace.state.executions[trial.number]
        if isinstance(began, Executing) and began.folder and not began.command:
            return (
                f"its plan was executed, as executions/{began.folder} shows, of which the journal, "
                "restored from a copy, knows nothing: was that this trial, did the arm move?"
            )
        return "was executing when the program stopped: did the arm move?"
    if trial.stage is Stage.EXECUTED:
        warning = execution_warning(workspace, trial)
        return f"executed, {warning}" if warning else "executed, waits to be told"
    waits = "asked for, waits to be executed and told"
    return f"{waits}; {OUTDATED}" if trial.outdated else waits


def say_expectation(state: WorkspaceState, trial: Trial) -> list[str]:
    """Say what the adapter expected of a trial, and after poor ones what would help."""
    if trial.p_hit is None or trial.expected_trials is None:
        return []
    lines = [f"hits with probability {trial.p_hit:.2f}; {trial.expected_trials:.1f} trials to go"]
    told = [known for known in state.trials if known.stage is Stage.TOLD]
    if told and told[-1].surprise:
        lines.append(f"trial {told[-1].number} was {told[-1].surprise}")
    missed = sum(known.goal_number == trial.goal_number for known in told)
    if missed >= _POOR_TRIALS and not state.solved and trial.p_hit < _POOR_CHANCE:
        lines.append(
            "what would help: a demonstration near this goal, or a finer look at the next trial "
            '("5.2 +- 0.3 cm long")'
        )
    return lines


def execution_warning(workspace: Workspace, trial: Trial) -> str:
    """Why a reading of a trial might mislead: it was aborted, or went another way than planned."""
    ended, gate = workspace.state.executions.get(trial.number), workspace.manifest.gate
    if not isinstance(ended, Executed):
        return ""
    warnings = []
    if ended.outcome == "aborted":
        warnings.append(f"but aborted: {ended.reason or 'no reason was given'}")
    for which, distances, says in (
        (0, ended.start_error, "but began {} from the plan's first frame, more than {:g}"),
        (1, ended.tracking_rms, "but went {} rms off the plan, more than {:g}"),
    ):
        for unit, distance in distances.items():
            allowed = gate.errors_of(unit)
            if allowed is not None and distance > allowed[which]:
                warnings.append(says.format(f"{distance:.3g} {unit}", allowed[which]))
    return plain("; ".join(warnings))


def say_look(look: Look) -> str:
    """Say which arm it is, and where it stands: `fr3, firmware 5.9: the arm is there`."""
    firmware = f", firmware {look.arm.firmware}" if look.arm.firmware else ""
    return plain(f"{look.arm.model}{firmware}: {look.said}")


def ask_to_move(
    workspace: Workspace,
    trial: Trial,
    look: Look | None = None,
    motion: Motion = "trial",
    speed: float = 1.0,
    *,
    where: bool = False,
) -> str:
    """What a person is asked before the arm moves: how it will, and what nobody checked.

    Args:
        workspace: The trial's.
        trial: Whose plan it is.
        look: What the arm said before; None where a command moves it.
        motion: What it is to be moved for.
        speed: Share of the plan's own speed, of a rehearsal.
        where: Whether a command was asked where the arm stands.
    """
    plan, said = workspace.plan(trial), _MOTIONS[motion].format(trial.number, 100 * speed)
    gate, verdict = workspace.manifest.gate, workspace.gate(plan.actions)
    unchecked, limits = [] if where else ["where the arm stands"], False
    if look is not None:
        seconds = look.approach if motion == "approach" else plan.times[-1] / speed
        said, unchecked = f"{said}, {seconds:.1f} s", [*look.arm.unchecked]
        limits = any("velocity" in check for check in look.arm.checked)
    if not limits and (verdict is None or "velocity" in verdict.unchecked):
        unchecked.append("the arm's limits")
    unchecked.append("self-collision")
    boxed = gate.box_low is not None and verdict is not None
    unchecked.append("the table, but for the tool tip" if boxed else "the table")
    missing = ", ".join(dict.fromkeys(unchecked))
    return plain(f"the arm will move ({said}); NOT checked: {missing}; is the area clear?")


def call(workspace: Workspace, command: str, *words: object) -> str:
    """A command as it is typed here: within the workspace, it need not be named."""
    here = workspace_around(Path())
    is_here = here is not None and here.resolve() == workspace.folder.resolve()
    named = () if is_here else (shlex.quote(str(workspace.folder)),)
    return " ".join(map(str, ("prior-reinforce", command, *named, *words)))


def next_step(workspace: Workspace) -> str:
    """The command that comes next."""
    state = workspace.state
    if state.demonstrations is None:
        return call(workspace, "import", "RECORDINGS")
    if state.stale:
        return call(workspace, "learn")
    new_goal = call(workspace, "goal", _goal_example(workspace))
    if not state.goals:
        return new_goal
    trial = state.open_trial
    if trial is not None:
        tell = call(workspace, "tell", trial.number, tell_example(workspace))
        did_not_move = call(workspace, "ask", "--arm-did-not-move")
        if trial.stage is Stage.EXECUTING and not workspace.log.is_executing():
            return f"if it moved: {tell}; if not: {did_not_move}"
        ended = state.executions.get(trial.number)
        if isinstance(ended, Executed) and ended.outcome == "aborted":
            void = call(workspace, "void", trial.number, "--reason WHY")
            return f"{void}; if it failed before the arm moved: {did_not_move}"
        if isinstance(ended, NotExecuted):
            return call(workspace, "ask", '--run "COMMAND {plan}"')
        return f"{tell} (or --hit)"
    if state.solved:
        return f"{new_goal}, or {call(workspace, 'report')}"
    own = {
        "generator": state.training and state.training.own,
        "adapter": own_class(state.goals[-1].adapter),
    }
    flags = (f"--{family} {shlex.quote(name)}" for family, name in own.items() if name)
    return call(workspace, "ask", *flags)


def _say_nearer(workspace: Workspace) -> str:
    """What else comes next where the gate may refuse a first plan: the goal is far out."""
    state = workspace.state
    if state.stale or not state.goals or state.current:
        return ""
    if not np.any(workspace.demonstrations.far_outside(state.goals[-1].goal)):
        return ""
    nearer = call(workspace, "goal", _goal_example(workspace))
    return f"; if it refuses, a goal nearer to the demonstrations: {nearer}"


def tell_example(workspace: Workspace) -> str:
    """How an error of this task can be told."""
    names, units = workspace.manifest.outcome_names, workspace.manifest.outcome_units
    if example := error_example(names, units):
        return f'--error "{example}"'
    return "--error " + " ".join(f"D{name.upper()}" for name in names)


def _goal_example(workspace: Workspace) -> str:
    return " ".join(name.upper() for name in workspace.manifest.outcome_names)


def _say_model(workspace: Workspace) -> str:
    training = workspace.state.training
    if training is None:
        return "none yet"
    said = f"{training.model}, {training.generator}"
    return f"{said}, of other demonstrations" if workspace.state.stale else said


def _say_goal(workspace: Workspace, goal: Goal, n: int) -> str:
    manifest = workspace.manifest
    place = say_place(goal.goal, manifest.outcome_names, manifest.outcome_units)
    trials = workspace.state.trials_of(goal.number)
    told = [trial for trial in trials if trial.stage is Stage.TOLD]
    hits = [count for count, trial in enumerate(told, start=1) if trial.hit]
    if hits:
        total = f"N = {n} demonstrations + {hits[0]} = {n + hits[0]}"
        return f"{place}: reached in {_say_count(hits[0])} ({total})"
    changed = f", new hardware: {goal.new_hardware}" if goal.new_hardware is not None else ""
    carried = ", with earlier goals' trials" if goal.carry_over else ""
    so_far = f"not reached yet, {_say_count(len(told))} told"
    if goal.number < len(workspace.state.goals):
        return f"{place}: not reached in {_say_count(len(told))}"
    return f"{place}: {so_far}; adapter {goal.adapter}{carried}{changed}"


def _say_count(trials: int) -> str:
    return "1 trial" if trials == 1 else f"{trials} trials"

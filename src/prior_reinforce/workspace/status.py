"""Where a workspace stands, in ten lines, and what to do next."""

from __future__ import annotations

from prior_reinforce.robots.executors.lock import is_executing
from prior_reinforce.workspace.history import GoalRecord, History, TrialRecord, TrialStage
from prior_reinforce.workspace.wording import say_error, say_place
from prior_reinforce.workspace.workspace import Workspace

_TRIALS_SHOWN = 3
_EXAMPLE = ("5cm long", "2cm left", "1cm high")


def describe(workspace: Workspace) -> str:
    """Say where a workspace stands: ten lines at most."""
    history = workspace.history
    manifest = workspace.manifest
    robot = manifest.robot.robot if manifest.robot is not None else "none, no limits are checked"
    n = 0 if history.demonstrations is None else workspace.demonstrations.n
    rows = [
        ("task", f"{manifest.name}, tolerance {manifest.tolerance:g} {manifest.outcome_units[0]}"),
        (
            "plans",
            f"{manifest.format.action_dim} numbers a frame, a frame every "
            f"{manifest.format.dt * 1000:g} ms; robot: {robot}",
        ),
        ("demonstrations", str(n or "none yet")),
        ("model", _say_model(history)),
    ]
    goal = history.goal
    if goal is not None:
        rows.append((f"goal {goal.number}", _say_goal(workspace, history, goal, n)))
        rows += [
            (f"  trial {trial.number}", say_trial(workspace, trial))
            for trial in history.trials_of(goal.number)[-_TRIALS_SHOWN:]
        ]
    rows.append(("next", next_step(workspace)))
    return "\n".join(f"{name:<15} {text}" for name, text in rows)


def say_trial(workspace: Workspace, trial: TrialRecord) -> str:
    """Say what became of a trial."""
    if trial.stage is TrialStage.TOLD and trial.error_seen is not None:
        seen = say_error(workspace.manifest, trial.error_seen)
        return f"reached ({seen})" if trial.hit else seen
    if trial.stage is TrialStage.VOIDED:
        return f"void: {trial.note}" if trial.note else "void"
    if trial.stage is TrialStage.EXECUTING:
        if is_executing(workspace.folder):
            return "is executing now"
        return "was executing when the program stopped: did the arm move?"
    if trial.stage is TrialStage.EXECUTED:
        return "executed, waits to be told"
    return "plan handed out, waits to be executed and told"


def next_step(workspace: Workspace) -> str:
    """The command that comes next."""
    folder = workspace.folder
    history = workspace.history
    trial = history.open_trial
    if history.demonstrations is None:
        return f"prior-reinforce import {folder} RECORDINGS"
    if history.stale:
        return f"prior-reinforce learn {folder}"
    if history.goal is None:
        return f"prior-reinforce goal {folder} {_example_goal(workspace)}"
    if trial is not None:
        tell = f"prior-reinforce tell {folder} {trial.number} {tell_example(workspace)}"
        if trial.stage is TrialStage.EXECUTING and not is_executing(folder):
            return f"if it moved: {tell}; if not: prior-reinforce ask {folder} --arm-did-not-move"
        return f"{tell} (or --hit)"
    if any(t.hit for t in history.trials_of(history.goal.number)):
        return (
            f"prior-reinforce goal {folder} {_example_goal(workspace)}, "
            f"or prior-reinforce report {folder}"
        )
    training = history.training
    own = f" --generator {training.generator}" if training is not None and training.own else ""
    return f"prior-reinforce ask {folder}{own}"


def tell_example(workspace: Workspace) -> str:
    """How an error of this task can be told."""
    manifest = workspace.manifest
    if manifest.in_words:
        words = ", ".join(_EXAMPLE[: len(manifest.outcome_names)])
        return f'--error "{words}"'
    return "--error " + " ".join(f"D{name.upper()}" for name in manifest.outcome_names)


def _example_goal(workspace: Workspace) -> str:
    return " ".join(name.upper() for name in workspace.manifest.outcome_names)


def _say_model(history: History) -> str:
    training = history.training
    if training is None:
        return "none yet"
    aligned = ", demonstrations aligned" if training.aligned else ""
    said = f"{training.model}, {training.generator}{aligned}"
    return f"{said}, of other demonstrations" if history.stale else said


def _say_goal(workspace: Workspace, history: History, goal: GoalRecord, n: int) -> str:
    trials = history.trials_of(goal.number)
    place = say_place(workspace.manifest, goal.goal)
    told = [trial for trial in trials if trial.stage is TrialStage.TOLD]
    hits = [count for count, trial in enumerate(told, start=1) if trial.hit]
    if hits:
        return f"{place}: reached, N = {n} demonstrations + {hits[0]} trials = {n + hits[0]}"
    memory = ", helped by earlier goals' trials" if goal.memory == "workspace" else ""
    return f"{place}: not reached yet, {len(told)} trials told{memory}"

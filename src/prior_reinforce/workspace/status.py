"""Where a workspace stands, in ten lines, and what to do next."""

from __future__ import annotations

from prior_reinforce.feedback import to_words
from prior_reinforce.workspace.history import History, TrialRecord, TrialStage
from prior_reinforce.workspace.workspace import DEMONSTRATIONS_FILE, Workspace


def describe(workspace: Workspace) -> str:
    """Say where a workspace stands."""
    history = workspace.history
    manifest = workspace.manifest
    robot = manifest.robot.robot if manifest.robot is not None else "no limits checked"
    lines = [
        f"{manifest.name}   ({workspace.folder})",
        f"plans           {manifest.format.action_dim} numbers a frame, a frame every "
        f"{manifest.format.dt * 1000:g} ms; robot: {robot}",
        f"tolerance       {manifest.tolerance:g} {manifest.outcome_units[0]}",
    ]
    has_demonstrations = (workspace.folder / DEMONSTRATIONS_FILE).is_file()
    n = workspace.demonstrations.n if has_demonstrations else 0
    lines.append(f"demonstrations  {n or 'none yet'}")
    lines.append(f"model           {history.model or 'none yet'}")
    goal = history.goal
    if goal is not None:
        numbers = ", ".join(f"{value:g}" for value in goal.goal)
        lines.append(f"goal {goal.number:<10} ({numbers}), memory: {goal.memory}")
        trials = history.trials_of(goal.number)
        lines.extend(f"  trial {trial.number:<7} {_say(trial)}" for trial in trials[-4:])
        told = sum(trial.stage is TrialStage.TOLD for trial in trials)
        if any(trial.hit for trial in trials):
            lines.append(f"reached         N = {n} demonstrations + {told} trials = {n + told}")
    lines.append(f"next            {_next(workspace, history, n)}")
    return "\n".join(lines)


def _say(trial: TrialRecord) -> str:
    if trial.stage is TrialStage.TOLD and trial.error_seen is not None:
        return "reached" if trial.hit else to_words(trial.error_seen)
    if trial.stage is TrialStage.VOIDED:
        return f"void: {trial.note}" if trial.note else "void"
    return {
        TrialStage.ASKED: "plan handed out, waits to be executed and told",
        TrialStage.EXECUTING: "was executing when the program stopped: did the arm move?",
        TrialStage.EXECUTED: "executed, waits to be told",
    }[trial.stage]


def _next(workspace: Workspace, history: History, n_demonstrations: int) -> str:
    folder = workspace.folder
    trial = history.open_trial
    if n_demonstrations == 0:
        return f"prior-reinforce import {folder} RECORDINGS"
    if history.model is None:
        return f"prior-reinforce learn {folder}"
    if history.goal is None:
        return f"prior-reinforce goal {folder} X Y"
    if trial is not None:
        return f'prior-reinforce tell {folder} {trial.number} --error "5cm long, 2cm left"'
    if any(t.hit for t in history.trials_of(history.goal.number)):
        return f"another goal: prior-reinforce goal {folder} X Y"
    return f"prior-reinforce ask {folder}"

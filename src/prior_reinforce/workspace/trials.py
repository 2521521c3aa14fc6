"""Trials on a real arm: asked for, told, amended, voided; each an event before it returns.

Neither telling, nor amending, nor voiding needs the model: a reading is kept even where the model's
files are damaged.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.arrays import as_error
from prior_reinforce.errors import RobotLimitError, TrialStateError, WorkspaceError
from prior_reinforce.generators import Generator
from prior_reinforce.plans.motions import Plan
from prior_reinforce.robots.executors.lock import is_executing
from prior_reinforce.workspace.history import TrialRecord, TrialStage
from prior_reinforce.workspace.workspace import Workspace


def ask(
    workspace: Workspace, *, arm_did_not_move: bool = False, own: Generator | None = None
) -> TrialRecord:
    """Return the trial to execute: the open one, or a new one that passed the gate.

    Args:
        workspace: Whose goal is worked on.
        arm_did_not_move: What a person saw of a trial that was executing when the program
            died: nothing moved, it may be executed after all.
        own: A generator of the class that the model was learned by, where it is none of ours.

    Raises:
        WorkspaceError: A trial was executing when the program died, and nobody said yet
            whether the arm moved; or what a session needs is missing.
        TrialStateError: A trial is executing right now.
        ConfigurationError: The model is of one's own class, and `own` is not of it.
        RobotLimitError: The plan breaks a limit; nothing is handed out.
        FileFormatError: The plan, the model or the demonstrations are damaged.
    """
    if workspace.history.open_trial is None:
        workspace.generator(own)  # imports torch, in seconds: other programs need not wait for that
    with workspace.journal.exclusive():
        trial = workspace.history.open_trial
        if trial is None:
            trial = _ask_new(workspace, own)
        elif trial.stage is TrialStage.EXECUTING:
            if is_executing(workspace.folder):
                raise TrialStateError(f"trial {trial.number} is executing now; wait for it")
            if not arm_did_not_move:
                raise WorkspaceError(
                    f"trial {trial.number} was executing when the program stopped; did the "
                    f"arm move? If it did, tell or void trial {trial.number}; if it did not, "
                    "ask again with --arm-did-not-move"
                )
            workspace.journal.append("not_executed", {"trial": trial.number})
        workspace.plan(trial)
        return workspace.record(trial.number)


def tell(
    workspace: Workspace, number: int, error_seen: ArrayLike, *, hit: bool | None = None
) -> TrialRecord:
    """Report what was seen of the open trial.

    Args:
        workspace: Whose trial it is.
        number: Of the trial.
        error_seen: e tilde, outcome minus goal, shape (k,), in the outcome's units.
        hit: Whether the goal was reached, where that was seen; None judges by the tolerance.

    Raises:
        TrialStateError: There is no such trial, or it is not open.
        InvalidFeedbackError: Wrong shape, or not finite.
    """
    with workspace.journal.exclusive():
        trial = workspace.record(number)
        if not trial.open:
            raise TrialStateError(
                f"trial {number} is {trial.stage.value} already; "
                + ("amend it to correct it" if trial.error_seen is not None else "ask anew")
            )
        _append_reading(workspace, "told", trial, error_seen, hit)
        return workspace.record(number)


def amend(
    workspace: Workspace, number: int, error_seen: ArrayLike, *, hit: bool | None = None
) -> TrialRecord:
    """Correct what was told of a trial, of any goal; arguments and errors as in `tell`."""
    with workspace.journal.exclusive():
        trial = workspace.record(number)
        if trial.stage is not TrialStage.TOLD:
            raise TrialStateError(
                f"trial {number} is {trial.stage.value}, only a told trial can be amended; "
                + ("tell it" if trial.open else "ask anew")
            )
        _append_reading(workspace, "amended", trial, error_seen, hit)
        return workspace.record(number)


def void(workspace: Workspace, number: int, reason: str) -> TrialRecord:
    """Declare that a trial, open or told, is not data: the ball slipped, the arm stopped.

    Raises:
        TrialStateError: There is no such trial, or it is voided already.
    """
    with workspace.journal.exclusive():
        trial = workspace.record(number)
        if trial.stage is TrialStage.VOIDED:
            raise TrialStateError(f"trial {number} is voided already; ask anew")
        # What a terminal could not decode cannot be printed again.
        text = reason.encode(errors="replace").decode()
        workspace.journal.append("voided", {"trial": number, "reason": text})
        return workspace.record(number)


def _ask_new(workspace: Workspace, own: Generator | None) -> TrialRecord:
    session = workspace.session(own)
    history = workspace.history
    assert history.goal is not None
    pending = session.ask()
    plan = Plan(pending.plan, session.demonstrations.format)
    report = workspace.gate(plan)
    if report is not None:
        try:
            report.require()
        except RobotLimitError as error:
            condition = (np.round(pending.condition, 4) + 0.0).tolist()  # -0 is 0
            raise RobotLimitError(f"nothing is handed out for {condition}: {error}") from error
    number = len(history.trials) + 1
    plan_file = workspace.store.save_plan(plan, number)
    workspace.journal.append(
        "asked",
        {
            "trial": number,
            "goal": history.goal.number,
            "condition": pending.condition.tolist(),
            "plan_file": plan_file.path.name,
            "plan_sha256": plan_file.sha256,
            "model": history.model,
            "gate": None if report is None else report.as_json(),
        },
    )
    return workspace.record(number)


def _append_reading(
    workspace: Workspace, kind: str, trial: TrialRecord, error_seen: ArrayLike, hit: bool | None
) -> None:
    goal = workspace.history.goals[trial.goal_number - 1]
    error = as_error(error_seen, goal.goal.size)
    reached = bool(np.linalg.norm(error) <= goal.tolerance) if hit is None else hit
    workspace.journal.append(
        kind, {"trial": trial.number, "error_seen": error.tolist(), "hit": reached}
    )

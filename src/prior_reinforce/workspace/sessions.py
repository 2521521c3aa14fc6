"""The session of a goal, built anew from what the journal says happened."""

from __future__ import annotations

import numpy as np

from prior_reinforce.adapters import GaussianProcessAdapter
from prior_reinforce.generators import Generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.session import Session, Trial, TrialState
from prior_reinforce.workspace.history import GoalRecord, History, TrialRecord, TrialStage


def build_session(
    history: History, goal: GoalRecord, generator: Generator, demonstrations: Demonstrations
) -> Session:
    """Bring a goal's session back.

    Trials that another model planned are left out: their conditions mean other motions.

    Args:
        history: What happened.
        goal: One of its goals.
        generator: The model in use.
        demonstrations: What it was learned from.
    """
    trials = [
        _trial(number, trial, trial.model == history.model, demonstrations.action_dim)
        for number, trial in enumerate(history.trials_of(goal.number), start=1)
    ]
    return Session(
        generator,
        GaussianProcessAdapter(),
        demonstrations,
        goal.goal,
        goal.tolerance,
        trials=trials,
        earlier=_earlier(history, goal),
    )


def _trial(number: int, record: TrialRecord, same_model: bool, action_dim: int) -> Trial:
    stages = {TrialStage.TOLD: TrialState.TOLD, TrialStage.VOIDED: TrialState.VOIDED}
    state = stages.get(record.stage, TrialState.PENDING)
    if state is TrialState.TOLD and not same_model:
        state = TrialState.VOIDED
    told = state is TrialState.TOLD
    return Trial(
        number,
        record.condition,
        # The adapter needs no frames of trials that were; a damaged plan file then stops nobody.
        np.empty((0, action_dim)),
        state,
        record.error_seen if told else None,
        record.hit and told,
        record.note,
    )


def _earlier(history: History, goal: GoalRecord) -> list[tuple[np.ndarray, np.ndarray]]:
    """Told trials of earlier goals with the same model, oldest first, where the goal wants them."""
    if goal.memory == "goal":
        return []
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    for trial in history.trials:
        earlier = trial.goal_number < goal.number and trial.model == history.model
        if earlier and trial.stage is TrialStage.TOLD and trial.error_seen is not None:
            aimed_at = history.goals[trial.goal_number - 1].goal
            pairs.append((trial.condition, aimed_at + trial.error_seen))
    return pairs

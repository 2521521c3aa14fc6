"""Does knowledge carry over? Trials on later goals, with and without the trials of earlier ones.

Ours; the paper starts every goal from the demonstrations alone. A person who works through
several goals in one afternoon has the earlier goals' trials at no cost; `Session` takes them as
`earlier`, a workspace as `--memory workspace`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.experiments.protocol import is_hit
from prior_reinforce.experiments.statistics import (
    Interval,
    bootstrap_difference,
    bootstrap_mean,
)
from prior_reinforce.generators.base import Generator
from prior_reinforce.motions import Demonstrations
from prior_reinforce.perception.base import Perception
from prior_reinforce.session import Session, TrialState, ask_all
from prior_reinforce.tasks.base import Task

Memory = Literal["goal", "workspace"]
Pair = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class CarryOver:
    """Mean trials on the later goals of a sequence."""

    without: Interval
    """Each goal from the demonstrations alone."""
    with_earlier: Interval
    """With the trials of the sequence's earlier goals."""
    saved: Interval
    """The first minus the second, paired by sequence."""


def trials_needed(
    task: Task,
    generator: Generator,
    make_adapter: Callable[[], Adapter],
    perception: Perception,
    demonstrations: Demonstrations,
    sequences: np.ndarray,
    *,
    memory: Memory,
    rounds: int,
    seed: int,
) -> np.ndarray:
    """Work through sequences of goals, all sequences in lock step.

    Args:
        task: Where plans are executed, with its disturbances.
        generator: pi, fitted to `demonstrations`.
        make_adapter: Makes one adapter for each goal.
        perception: What the adapters see through.
        demonstrations: D_prior.
        sequences: Goals, shape (sequences, goals, k), [m].
        memory: Whether earlier goals' trials of the same sequence serve a later one.
        rounds: Largest number of trials a goal.
        seed: Of the disturbances (a stream a goal and round) and of perception (one a sequence).

    Returns:
        Trials needed, shape (sequences, goals); `rounds` + 1 where a goal was not reached.
    """
    n, n_goals, _ = sequences.shape
    seers = [np.random.default_rng([seed, 1, i]) for i in range(n)]
    earlier: list[list[Pair]] = [[] for _ in range(n)]
    needed = np.full((n, n_goals), rounds + 1)
    for j in range(n_goals):
        sessions = [
            Session(
                generator,
                make_adapter(),
                demonstrations,
                sequences[i, j],
                task.tolerance,
                earlier=earlier[i] if memory == "workspace" else (),
            )
            for i in range(n)
        ]
        for number in range(1, rounds + 1):
            active = [i for i in range(n) if not sessions[i].solved]
            if not active:
                break
            trials = ask_all([sessions[i] for i in active])
            plans = np.stack([trial.plan for trial in trials])
            executed = task.rollout(plans, np.random.default_rng([seed, 0, j, number]))
            for i, trial, rollout in zip(active, trials, executed, strict=True):
                goal = sessions[i].goal
                hit = is_hit(rollout, goal, task.tolerance)
                error_seen = perception.perceive(rollout, goal, seers[i])
                sessions[i].tell(trial.number, error_seen, hit=hit)
                if hit:
                    needed[i, j] = number
        for i, session in enumerate(sessions):
            earlier[i] += _seen(session)
    return needed


def compare(without: np.ndarray, with_earlier: np.ndarray) -> CarryOver:
    """Mean trials on goals 2, 3, ... of every sequence.

    Args:
        without: Trials needed, shape (trainings, sequences, goals).
        with_earlier: The same with earlier goals' trials.
    """
    # A sequence is one draw: its goals share what was remembered.
    a, b = without[:, :, 1:].mean(axis=2), with_earlier[:, :, 1:].mean(axis=2)
    return CarryOver(bootstrap_mean(a), bootstrap_mean(b), bootstrap_difference(a, b))


def _seen(session: Session) -> list[Pair]:
    return [
        (trial.condition, session.goal + trial.error_seen)
        for trial in session.trials
        if trial.state is TrialState.TOLD and trial.error_seen is not None
    ]

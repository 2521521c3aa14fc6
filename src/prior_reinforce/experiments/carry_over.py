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
from prior_reinforce.experiments.protocol import GoalTrials, run_goals
from prior_reinforce.experiments.statistics import (
    Interval,
    bootstrap_difference,
    bootstrap_mean,
    trials_counted,
)
from prior_reinforce.generators.base import Generator
from prior_reinforce.perception.base import Perception
from prior_reinforce.plans.motions import Demonstrations
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
        seed: Of the disturbances and of perception: other streams for each goal of a sequence.

    Returns:
        Trials needed, shape (sequences, goals); `rounds` + 1 where a goal was not reached.
    """
    earlier: list[list[Pair]] = [[] for _ in sequences]
    needed = []
    for j in range(sequences.shape[1]):
        results = run_goals(
            task,
            generator,
            make_adapter,
            perception,
            demonstrations,
            sequences[:, j],
            rounds=rounds,
            seed=int(np.random.SeedSequence([seed, j]).generate_state(1)[0]),
            earlier=earlier if memory == "workspace" else None,
        )
        needed.append(trials_counted(np.array([r.solved_at or 0 for r in results]), rounds))
        for pairs, result in zip(earlier, results, strict=True):
            pairs += _seen(result)
    return np.stack(needed, axis=1)


def compare(without: np.ndarray, with_earlier: np.ndarray) -> CarryOver:
    """Mean trials on goals 2, 3, ... of every sequence.

    Args:
        without: Trials needed, shape (trainings, sequences, goals).
        with_earlier: The same with earlier goals' trials.
    """
    # A sequence is one draw: its goals share what was remembered.
    a, b = without[:, :, 1:].mean(axis=2), with_earlier[:, :, 1:].mean(axis=2)
    return CarryOver(bootstrap_mean(a), bootstrap_mean(b), bootstrap_difference(a, b))


def _seen(result: GoalTrials) -> list[Pair]:
    return [
        (trial.condition, result.goal + trial.error_seen)
        for trial in result.trials
        if trial.error_seen is not None
    ]

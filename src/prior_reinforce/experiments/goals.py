"""Which goals are tried."""

from __future__ import annotations

import numpy as np

from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.tasks.base import Task

# Ours: how many candidates are weighed for each goal that is taken.
_CANDIDATES_PER_GOAL = 20


def unseen_goals(
    task: Task, demonstrations: Demonstrations, n: int, rng: np.random.Generator
) -> np.ndarray:
    """Draw goals far from all demonstrated outcomes and from each other.

    The paper places its goals "deliberately far from prior rollout outcomes" by hand; ours takes
    the best of random candidates, one goal after another (farthest-point sampling).

    Args:
        task: Whose reachable region the goals lie in.
        demonstrations: Whose outcomes to stay away from.
        n: Number of goals.
        rng: Source of the candidates.

    Returns:
        Goals, shape (n, k), [m].
    """
    taken = demonstrations.outcomes_seen
    for _ in range(n):
        candidates = task.sample_goals(_CANDIDATES_PER_GOAL, rng)
        distances = np.linalg.norm(candidates[:, None] - taken[None], axis=-1).min(axis=1)
        taken = np.vstack([taken, candidates[np.argmax(distances)]])
    return taken[-n:].copy() if n else taken[:0].copy()

"""D_M, the adapter's memory, and data forgetting (paper, Stage 2: "Data-Forgetting")."""

from __future__ import annotations

from collections import deque

import numpy as np


class Memory:
    """Pairs (condition, outcome seen): every demonstration, and the latest m trials only.

    Forgetting keeps a corrupted observation from biasing the adapter for good.
    """

    def __init__(self, outcomes_seen: np.ndarray, size: int | None) -> None:
        """Start with D_M = {(c_i, r_i) | c_i = r_i} (Algorithm 1).

        Args:
            outcomes_seen: The demonstrations' outcomes, shape (N, k). Copied.
            size: m, the number of trials kept; None keeps them all.
        """
        self._demonstrations = np.array(outcomes_seen, dtype=float)
        self._trials: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=size)

    def add(self, condition: np.ndarray, outcome_seen: np.ndarray) -> None:
        """Remember a trial, (k,) and (k,), and forget the oldest beyond m. Copies."""
        self._trials.append((np.array(condition), np.array(outcome_seen)))

    @property
    def n_demonstrations(self) -> int:
        """N, the number of demonstrations, which come first in every array."""
        return len(self._demonstrations)

    @property
    def n_trials(self) -> int:
        """Number of trials remembered, at most m."""
        return len(self._trials)

    @property
    def conditions(self) -> np.ndarray:
        """Conditions of all pairs, demonstrations first, then trials by age, shape (n, k)."""
        return np.vstack([self._demonstrations, *(condition for condition, _ in self._trials)])

    @property
    def outcomes_seen(self) -> np.ndarray:
        """Perceived outcomes of all pairs, in the order of `conditions`, shape (n, k)."""
        return np.vstack([self._demonstrations, *(outcome for _, outcome in self._trials)])

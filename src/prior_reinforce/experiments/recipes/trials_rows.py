"""What the paper's table of trials says, row by row (paper, Table II)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class PaperRow:
    """One row of the paper's table."""

    title: str
    """The task as the paper calls it."""
    task: str
    """Where it is tried."""
    learned_on: str
    """The task whose demonstrations are learned from."""
    by_model: bool
    """Whether a model looks at pictures; else a person estimates by eye."""
    prior: int
    """|D_prior|."""
    trials: float
    """The paper's mean of Stage-2 trials, on a real arm."""
    sd: float
    """The paper's standard deviation."""


ROWS = (
    PaperRow("Basketball Shot", "basketball-v1", "basketball-v1", False, 6, 2.9, 0.9),
    PaperRow("Basketball Shot", "basketball-v1", "basketball-v1", True, 6, 2.1, 1.1),
    PaperRow("Curling", "curling", "curling", False, 6, 3.4, 1.1),
    PaperRow("Curling", "curling", "curling", True, 6, 3.0, 1.2),
    PaperRow("Fishing Rod Swinging", "fishing", "fishing", False, 8, 2.0, 0.8),
    PaperRow("Basketball Shot V2", "basketball-v2", "basketball-v1", False, 6, 3.2, 0.7),
    PaperRow("Basketball Shot V3", "basketball-v3", "basketball-v1", False, 6, 3.7, 1.5),
)
"""Table II of the paper, in its order."""


def sense_of(row: Mapping[str, Any], figures: Mapping[str, Any]) -> str:
    """The paper's word for how a row of figures was seen, and who stood in for the VLM."""
    return f"VLM ({figures['model']})" if row["by_model"] else "eye"

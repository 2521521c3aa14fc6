"""What a person says of a trial on the command line: words, numbers, or that it hit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import tyro

from prior_reinforce.commands.workspace import Folder
from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError
from prior_reinforce.session import Session
from prior_reinforce.wording import from_words, in_words
from prior_reinforce.workspace.status import tell_example
from prior_reinforce.workspace.workspace import Workspace

Number = Annotated[int, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL")]

_LARGEST_PLAUSIBLE_METRES = 1.0
"""Ours: a bare number beyond it is centimetres far more often than a throw a metre off."""
_LARGEST_SAYABLE_METRES = 5.0
"""Ours: words carry their unit, but nobody measures a throw that far off a table of a metre."""


@dataclass(frozen=True)
class Reading:
    """Of which trial, and what was seen."""

    folder: Folder
    """Workspace."""
    number: Number
    """Number of the trial."""
    error: tuple[str, ...] | None = None
    """What was seen, outcome minus goal: words ("5cm long, 2cm left") or metres (0.05 -0.02)."""
    outcome: tuple[float, ...] | None = None
    """Or where the object ended, in the table frame, in the outcome's units."""
    hit: bool = False
    """The goal was reached, whatever the distance says."""
    miss: bool = False
    """The goal was not reached, whatever the distance says."""

    def read(self, workspace: Workspace, session: Session) -> tuple[np.ndarray, bool | None]:
        """The error seen, and whether it was a hit if that was said."""
        given = [self.error is not None, self.outcome is not None]
        if sum(given) > 1 or not (any(given) or self.hit) or (self.hit and self.miss):
            raise ConfigurationError(
                "say what was seen: --error or --outcome, with --hit or --miss if that was seen "
                "as well, or --hit alone"
            )
        hit = True if self.hit else False if self.miss else None
        goal = session.goals[session.trial(self.number).goal_number - 1].goal
        if self.outcome is not None:
            if len(self.outcome) != goal.size:
                raise InvalidFeedbackError(
                    f"--outcome needs {goal.size} numbers, got {len(self.outcome)}: "
                    f"{', '.join(workspace.manifest.outcome_names)}"
                )
            return _plausible(workspace, np.array(self.outcome) - goal), hit
        if self.error is None:
            return np.zeros(goal.size), hit
        return _read_error(workspace, " ".join(self.error)), hit


def _read_error(workspace: Workspace, text: str) -> np.ndarray:
    """Read outcome minus goal, shape (k,), in the outcome's units, from words or numbers.

    Raises:
        InvalidFeedbackError: It is neither, or another number of numbers.
    """
    names, units = workspace.manifest.outcome_names, workspace.manifest.outcome_units
    k = len(names)
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        numbers = None
    if numbers is None or (k > 1 and text == "0"):  # a lone 0 says: on the goal
        if in_words(units):
            return _sayable(text, from_words(text, k))
        raise InvalidFeedbackError(
            f"cannot read {text!r}; this task's outcomes have no words, give {k} numbers: "
            f"{tell_example(workspace)}"
        )
    if len(numbers) != k:
        words = ", or words" if in_words(units) else ""
        raise InvalidFeedbackError(
            f"--error needs {k} numbers, got {len(numbers)}: outcome minus goal in "
            f"{', '.join(names)}{words}: {tell_example(workspace)}"
        )
    return _plausible(workspace, np.array(numbers))


def _sayable(text: str, error: np.ndarray) -> np.ndarray:
    """The error, unless no throw is that far off."""
    largest = np.abs(error).max(initial=0.0)
    if largest > _LARGEST_SAYABLE_METRES:
        raise InvalidFeedbackError(
            f"{text!r} is {largest:g} m; say it again, in cm, or void the trial if that is true"
        )
    return error


def _plausible(workspace: Workspace, error: np.ndarray) -> np.ndarray:
    """The error, unless it looks like centimetres where words could say it as well."""
    largest = np.abs(error).max(initial=0.0)
    words = in_words(workspace.manifest.outcome_units)
    if words and _LARGEST_PLAUSIBLE_METRES <= largest < np.inf:
        raise InvalidFeedbackError(
            f"an error of {largest:g} m looks like centimetres; numbers are metres, or say it in "
            f"words: {tell_example(workspace)}"
        )
    return error

"""A trial's result on the command line: words, numbers, or that it hit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import tyro

from prior_reinforce.arrays import FARTHEST, Point, as_error
from prior_reinforce.bench.workspace.status import tell_example
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands.workspace import OnWorkspace
from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError
from prior_reinforce.readings import Reading
from prior_reinforce.wording import in_words, read_error, read_numbers

Number = Annotated[int, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL")]

_LARGEST_PLAUSIBLE_METRES = 1.0
"""Ours: larger bare numbers are centimetres far more often than a miss by a metre."""


@dataclass(frozen=True)
class Seen(OnWorkspace):
    """A trial and its result."""

    number: Annotated[int | None, tyro.conf.Positional, tyro.conf.arg(metavar="[TRIAL]")] = None
    """Number of the trial."""
    seen: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[SEEN]")] = ()
    """What was seen, outcome minus goal: "5cm long, 2cm left", "5.2 +- 0.3 cm long", "long", "hit",
    "miss"; or a number for each component, in its own unit: 0.05 -0.02, 0.05+-0.003 0.02+-0.003."""
    error: tuple[str, ...] | None = None
    """The same, as a named option."""
    outcome: tuple[float, ...] | None = None
    """Or where the object ended, in the table frame, in the outcome's units."""
    hit: bool = False
    """The goal was reached, whatever the distance says."""
    miss: bool = False
    """The goal was not reached, whatever the distance says."""

    @property
    def trial(self) -> int:
        """Number of the trial.

        Raises:
            ConfigurationError: None was given.
        """
        if self.number is None:
            raise ConfigurationError("say which trial: its number comes after the workspace")
        return self.number

    def read(self, workspace: Workspace) -> tuple[Reading | Point | None, bool | None]:
        """Return what was seen, as `Session.tell` takes it, and whether it hit, if given."""
        given = [bool(self.seen), self.error is not None, self.outcome is not None]
        said = any(given) or self.hit or self.miss
        if sum(given) > 1 or not said or (self.hit and self.miss):
            raise ConfigurationError(
                "say what was seen: words or numbers, or --error or --outcome, with --hit or "
                "--miss if that was seen as well, or one of those alone"
            )
        hit = True if self.hit else False if self.miss else None
        goal = workspace.state.goal_of(workspace.state.trial(self.trial)).goal
        if self.outcome is not None:
            if len(self.outcome) != goal.size:
                raise InvalidFeedbackError(
                    f"--outcome needs {goal.size} numbers, got {len(self.outcome)}: "
                    f"{', '.join(workspace.manifest.outcome_names)}"
                )
            return plausible(workspace, np.array(self.outcome) - goal), hit
        words = self.seen or self.error
        return (None if words is None else read_seen(workspace, " ".join(words))), hit


def read_seen(workspace: Workspace, text: str) -> Reading | Point:
    """Read outcome minus goal, in the outcome's units, from words or numbers.

    Raises:
        InvalidFeedbackError: It is neither, or another number of numbers.
    """
    names, units = workspace.manifest.outcome_names, workspace.manifest.outcome_units
    k = len(names)
    alone = text.strip().lower()
    if alone in ("hit", "miss"):
        return Reading.only(alone == "hit", k)
    numbers = read_numbers(text)
    if numbers is None or (k > 1 and text == "0"):  # a lone 0 says: on the goal
        error = read_error(text, units)
        return _sayable(text, error) if in_words(units) else error
    if len(numbers) != k:
        words = ", or words" if in_words(units) else ""
        raise InvalidFeedbackError(
            f"an error needs {k} numbers, got {len(numbers)}: outcome minus goal in "
            f"{', '.join(names)}{words}: {tell_example(workspace)}"
        )
    error = plausible(workspace, np.array([number for number, _ in numbers]))
    sds = [sd for _, sd in numbers if sd is not None]
    if not sds:
        return error
    if len(sds) < k:
        raise InvalidFeedbackError(
            f"{text!r} has +- for {len(sds)} of {k} numbers; give all or none"
        )
    return Reading.measured(as_error(error, k), np.array(sds))


def _sayable(text: str, reading: Reading | Point) -> Reading | Point:
    """Return the reading, unless it is too large for any throw."""
    number = reading.error_seen if isinstance(reading, Reading) else reading
    largest = np.abs(number).max(initial=0.0)
    if largest > FARTHEST:
        raise InvalidFeedbackError(
            f"{text!r} is {largest:g} m; say it again, in cm, or void the trial if that is true"
        )
    return reading


def plausible(workspace: Workspace, error: Point) -> Point:
    """Return the error, unless it looks like centimetres."""
    largest = np.abs(error).max(initial=0.0)
    words = in_words(workspace.manifest.outcome_units)
    if words and _LARGEST_PLAUSIBLE_METRES <= largest < np.inf:
        raise InvalidFeedbackError(
            f"an error of {largest:g} m looks like centimetres; numbers are metres, or say it in "
            f"words: {tell_example(workspace)}"
        )
    return error

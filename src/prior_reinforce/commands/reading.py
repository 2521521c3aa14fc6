"""A trial's result: words, numbers, or that it hit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import tyro

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.arrays import Point
from prior_reinforce.commands.base import OnWorkspace, Words, trial_and_rest
from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError
from prior_reinforce.parsing import (
    as_bare_error,
    from_words,
    read_numbers,
    read_uncertain_place,
    with_points,
)
from prior_reinforce.readings import Reading
from prior_reinforce.session.trials import Goal
from prior_reinforce.wording import error_example


@dataclass(frozen=True)
class Seen(OnWorkspace):
    """A trial and its result."""

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] [TRIAL] [SEEN]")] = ()
    """The workspace (the current folder's if not given), the trial's number (the one that waits if
    not given), and what was seen, outcome minus goal: "5cm long, 2cm left", "5.2 +- 0.3 cm long",
    "long", "hit", "miss"; or a number for each component, in its own unit: 0.05 -0.02,
    0.05+-0.003 0.02+-0.003."""
    error: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="SEEN")] = None
    """What was seen, as a named option."""
    outcome: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="PLACE")] = None
    """Or where the object ended, in the table frame, said as a goal is: 0.92 0.10, 92cm 10cm,
    "92cm ahead, 10cm left", or measured: "92cm 10cm +- 2mm"."""
    hit: bool = False
    """The goal was reached, whatever the distance says."""
    miss: bool = False
    """The goal was not reached, whatever the distance says."""

    takes_words = True

    def read(
        self, workspace: Workspace, words: tuple[str, ...]
    ) -> tuple[int, Reading | Point | None, bool | None]:
        """Return the trial's number, what was seen and whether it hit, as for `Session.tell`."""
        number, seen = trial_and_rest(workspace, words)
        given = [bool(seen), self.error is not None, self.outcome is not None]
        said = any(given) or self.hit or self.miss
        if sum(given) > 1 or not said or (self.hit and self.miss):
            raise ConfigurationError(
                "say what was seen: words or numbers, or --error or --outcome, with --hit or "
                "--miss if that was seen as well, or one of those alone"
            )
        hit = True if self.hit else False if self.miss else None
        goal = workspace.state.goal_of(workspace.state.trial(number))
        if self.outcome is not None:
            return number, read_landed(" ".join(self.outcome), goal), hit
        said_words = seen or self.error
        error = None if said_words is None else read_seen(" ".join(said_words), goal)
        return number, error, hit


def read_seen(text: str, goal: Goal) -> Reading | Point:
    """Read outcome minus goal, in the outcome's units, from words or numbers.

    Raises:
        InvalidFeedbackError: It is neither, or another number of numbers.
    """
    form, k = goal.format, goal.format.outcome_dim
    numbers = read_numbers(with_points(text, k))
    if numbers is None or (k > 1 and text == "0"):  # a lone 0 says: on the goal
        return from_words(text, form)
    if len(numbers) != k:
        raise InvalidFeedbackError(
            f"an error needs {k} numbers, got {len(numbers)}: outcome minus goal in "
            f"{', '.join(form.names)}{_or_words(goal)}"
        )
    error = as_bare_error([number for number, _ in numbers], goal.goal, form)
    sds = [sd for _, sd in numbers if sd is not None]
    if not sds:
        return error
    if len(sds) < k:
        raise InvalidFeedbackError(
            f"{text!r} has +- for {len(sds)} of {k} numbers; give all or none"
        )
    return Reading.measured(error, np.array(sds))


def read_landed(text: str, goal: Goal) -> Reading:
    """Read outcome minus goal, in the outcome's units, from where the object ended.

    Raises:
        InvalidFeedbackError: It is no place.
    """
    form, k = goal.format, goal.format.outcome_dim
    numbers = read_numbers(with_points(text, k))
    if numbers is not None and len(numbers) != k:
        raise InvalidFeedbackError(
            f"--outcome needs {k} numbers, got {len(numbers)}: {', '.join(form.names)}"
        )
    if numbers is not None:
        as_bare_error([number for number, _ in numbers], goal.goal, form, landed=True)
    place, sd = read_uncertain_place(text, form)
    error = place - goal.goal
    return Reading.measured(error, sd) if sd else Reading.estimated(error, form.least_sd)


def _or_words(goal: Goal) -> str:
    example = error_example(goal.format)
    return f', or words: "{example}"' if example else ""

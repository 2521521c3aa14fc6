"""Commands that say what was seen of a trial: tell, amend, void; and how their words are read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
import tyro

from prior_reinforce.arm.workspace.execute import recover
from prior_reinforce.arm.workspace.state import Standing
from prior_reinforce.arm.workspace.text import (
    call,
    execution_warning,
    next_step,
    say_left_out,
    say_outdated,
    say_told,
    say_trial,
    tell_example,
)
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.arrays import Point
from prior_reinforce.commands import warn
from prior_reinforce.commands.base import OnWorkspace, Words, trial_and_rest
from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError
from prior_reinforce.formats import as_bare_error
from prior_reinforce.numerals import read_numbers, with_points
from prior_reinforce.parsing import from_words, read_uncertain_place, unit_of_all
from prior_reinforce.readings import Reading
from prior_reinforce.session.trials import Goal, Trial
from prior_reinforce.units import UNITS
from prior_reinforce.wording import bare_units, error_example, say_tolerance, say_understood


@dataclass(frozen=True)
class Seen(OnWorkspace):
    """A trial and its result."""

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] [TRIAL] [SEEN]")] = ()
    """The workspace (the current folder's if not given), the trial's number (if not given, the one
    that waits, or to `amend` the latest that was told), and what was seen, outcome minus goal:
    "5cm long, 2cm left", "5.2 +- 0.3 cm long", "long", "hit", "miss", "lost" (a miss that nobody
    saw land); or a number for each component, in its own unit: 0.05 -0.02,
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
    of_told: ClassVar[bool] = False
    """Whether it is about a trial that was told, not about one that waits."""

    def read(
        self, workspace: Workspace, words: tuple[str, ...]
    ) -> tuple[int, Reading | Point | None, bool | None]:
        """Return the trial's number, what was seen and whether it hit, as for `Session.tell`."""
        number, seen = trial_and_rest(workspace, words, told=self.of_told)
        given = [bool(seen), self.error is not None, self.outcome is not None]
        if sum(given) > 1:
            raise ConfigurationError(
                "say what was seen in one way: beside the trial's number, or with --error or "
                "--outcome"
            )
        if self.hit and self.miss:
            raise ConfigurationError("--hit and --miss contradict each other; drop one of them")
        if not (any(given) or self.hit or self.miss):
            raise ConfigurationError(_ask_what_was_seen(workspace, number, words))
        hit = True if self.hit else False if self.miss else None
        goal = workspace.state.goal_of(workspace.state.trial(number))
        if self.outcome is not None:
            return number, read_landed(" ".join(self.outcome), goal), hit
        said_words = seen or self.error
        error = None if said_words is None else read_seen(" ".join(said_words), goal)
        return number, error, hit

    def _say_told(self, now: Standing, trial: Trial, words: tuple[str, ...]) -> str:
        """What was told as it was understood, and that numbers had no unit, if so."""
        said, reading, goal = say_told(now, trial), trial.reading, now.state.goal_of(trial)
        assert reading is not None
        if understood := say_understood(reading, goal.format):
            said += f"; understood as {understood}"
        typed, shared = " ".join(self.error or words), ""
        if reading.said.split(" (")[0] not in typed:  # before the sign that was understood
            shared = bare_units(goal.format)
        elif unit := unit_of_all(" ".join(self.outcome or ()), goal.format.units):
            shared = UNITS[unit].plural if unit in UNITS else unit
        said += f"; numbers without a unit are {shared}" * bool(shared)
        if trial.hit and not goal.is_hit(np.clip(0.0, reading.low, reading.high)):
            within = say_tolerance(goal.format)
            said += f"; it counts as a hit, as told, though that is not within {within}"
        return said


@dataclass(frozen=True)
class Tell(Seen):
    """Report what was seen of a trial.

    For example:
        prior-reinforce tell hoop 3 "5cm long, 2cm left"
        prior-reinforce tell "5cm long"
    """

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        recover(workspace)
        number, seen, hit = self.read(workspace, words)
        _warn_of_its_execution(workspace.standing, number)
        trial = workspace.session().tell(number, seen, hit=hit)
        now = workspace.standing
        print(f"trial {trial.number}: {self._say_told(now, trial, words)}")
        print(f"next: {next_step(now)}")


@dataclass(frozen=True)
class Amend(Seen):
    """Correct what was told of a trial, of any goal; one that was voided since counts again.

    For example:
        prior-reinforce amend hoop 3 "5cm short"
        prior-reinforce amend "5cm short"
    """

    of_told = True

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        number, seen, hit = self.read(workspace, words)
        trial = workspace.session().amend(number, seen, hit=hit)
        now = workspace.standing
        print(f"trial {trial.number}, corrected: {self._say_told(now, trial, words)}")
        print(
            *say_outdated(now.state), *say_left_out(now.state), f"next: {next_step(now)}", sep="\n"
        )


@dataclass(frozen=True)
class Void(OnWorkspace):
    """Discard a trial, of which nothing is learned: the ball slipped, the arm stopped.

    For example:
        prior-reinforce void hoop 3 --reason "ball slipped"
    """

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] [TRIAL]")] = ()
    """The workspace (the current folder's if not given), and the trial's number (the one that waits
    if not given)."""
    reason: str = ""
    """Why, for the log and the report."""

    takes_words = True

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        number, rest = trial_and_rest(workspace, words)
        if rest:
            raise ConfigurationError(f"unexpected {rest[0]!r}; say why with --reason")
        recover(workspace)
        trial = workspace.session().void(number, self.reason)
        now = workspace.standing
        undo = "; amend it to tell it again" if trial.told_before else ""
        print(f"trial {trial.number}: {say_trial(now, trial)}; nothing is learned from it{undo}")
        print(*say_outdated(now.state), f"next: {next_step(now)}", sep="\n")


def _ask_what_was_seen(workspace: Workspace, number: int, words: tuple[str, ...]) -> str:
    """Ask for it; or, where it was a number alone, which of the two that number is."""
    now, waiting = workspace.standing, workspace.state.open_trial
    seen = tell_example(now.manifest)
    if words and waiting is not None and now.manifest.outcome_format.outcome_dim == 1:
        as_seen = f"what was seen: {call(now.folder, 'tell', waiting.number, *words)}"
        if not 1 <= number <= waiting.number:
            return f"there is no trial {number}; if {number} is {as_seen}"
        return f"{number} may be {as_seen}; or the trial: {call(now.folder, 'tell', number, seen)}"
    return f"say what was seen of trial {number}, for instance {seen}, or --hit, or --miss"


def _warn_of_its_execution(now: Standing, number: int) -> None:
    """Say before a reading is taken what could make it mislead."""
    trial = now.state.trial(number)
    warning = execution_warning(now, trial) if trial.open else ""
    if warning:
        warn(
            f"trial {number} was executed, {warning}; if that spoiled it, void it: a told "
            "trial can be voided too"
        )


def read_seen(text: str, goal: Goal) -> Reading | Point:
    """Read outcome minus goal, in the outcome's units, from words or numbers.

    InvalidFeedbackError if it is neither, or another number of numbers.
    """
    form, k = goal.format, goal.format.outcome_dim
    numbers = read_numbers(with_points(text, k))
    if numbers is None or (k > 1 and text == "0"):  # a lone 0 says: on the goal
        return from_words(text, form)
    if len(numbers) != k:
        example = f', or words: "{said}"' if (said := error_example(form)) else ""
        raise InvalidFeedbackError(
            f"an error needs {k} numbers, got {len(numbers)}: outcome minus goal in "
            f"{', '.join(form.names)}{example}"
        )
    bare, sds = np.array([number for number, _ in numbers]), _sds(text, numbers)
    if sds is None:
        return bare  # the session judges it, which knows what is expected and was shown
    return Reading.measured(as_bare_error(bare, goal.goal, form), sds)


def _sds(text: str, numbers: Sequence[tuple[float, float | None]]) -> Point | None:
    """Standard deviations of numbers; None if none has one, InvalidFeedbackError if some have."""
    sds = [sd for _, sd in numbers if sd is not None]
    if sds and len(sds) < len(numbers):
        raise InvalidFeedbackError(
            f"{text!r} has +- for {len(sds)} of {len(numbers)} numbers; give all or none"
        )
    return np.array(sds) if sds else None


def read_landed(text: str, goal: Goal) -> Reading:
    """Read outcome minus goal, in the outcome's units, from where the object ended.

    InvalidFeedbackError if it is no place.
    """
    form, k = goal.format, goal.format.outcome_dim
    numbers = read_numbers(with_points(text, k))
    if numbers is not None and len(numbers) != k:
        raise InvalidFeedbackError(
            f"--outcome needs {k} numbers, got {len(numbers)}: {', '.join(form.names)}"
        )
    if numbers is not None:
        bare, sds = [number for number, _ in numbers], _sds(text, numbers)
        error = as_bare_error(bare, goal.goal, form, landed=True)
        if sds is not None:
            return Reading.measured(error, sds)
    place, sd = read_uncertain_place(text, form, goal.goal[None])
    error = place - goal.goal
    return Reading.measured(error, sd) if sd else Reading.estimated(error, form.least_sd)

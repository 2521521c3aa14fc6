"""Commands that say what was seen of a trial: tell, amend, void."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from prior_reinforce.arm.workspace.state import Standing
from prior_reinforce.arm.workspace.text import execution_warning, next_step, say_outdated, say_trial
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands import warn
from prior_reinforce.commands.base import OnWorkspace, Words, trial_and_rest
from prior_reinforce.commands.reading import Seen
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.session.trials import Trial
from prior_reinforce.wording import bare_units


@dataclass(frozen=True)
class Tell(Seen):
    """Report what was seen of a trial.

    For example:
        prior-reinforce tell hoop 3 "5cm long, 2cm left"
        prior-reinforce tell "5cm long"
    """

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        number, seen, hit = self.read(workspace, words)
        _warn_of_its_execution(workspace.standing, number)
        trial = workspace.session().tell(number, seen, hit=hit)
        now = workspace.standing
        print(f"trial {trial.number}: {_say_told(now, trial, self.error or words)}")
        print(f"next: {next_step(now)}")


@dataclass(frozen=True)
class Amend(Seen):
    """Correct what was told of a trial, of any goal.

    For example:
        prior-reinforce amend hoop 3 "5cm short"
    """

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        number, seen, hit = self.read(workspace, words)
        trial = workspace.session().amend(number, seen, hit=hit)
        now = workspace.standing
        print(f"trial {trial.number}, corrected: {_say_told(now, trial, self.error or words)}")
        print(*say_outdated(now.state), f"next: {next_step(now)}", sep="\n")


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
        trial = workspace.session().void(number, self.reason)
        now = workspace.standing
        print(f"trial {trial.number}: {say_trial(now, trial)}; nothing is learned from it")
        print(*say_outdated(now.state), f"next: {next_step(now)}", sep="\n")


def _say_told(now: Standing, trial: Trial, typed: tuple[str, ...]) -> str:
    """What was told as it was understood, and that numbers had no unit, if so."""
    said, words = say_trial(now, trial), "" if trial.reading is None else trial.reading.said
    no_unit = words not in " ".join(typed)
    bare = bare_units(now.manifest.outcome_format)
    return f"{said}; numbers without a unit are {bare}" if no_unit else said


def _warn_of_its_execution(now: Standing, number: int) -> None:
    """Say before a reading is taken what could make it mislead."""
    trial = now.state.trial(number)
    warning = execution_warning(now, trial) if trial.open else ""
    if warning:
        warn(
            f"trial {number} was executed, {warning}; if that spoiled it, void it: a told "
            "trial can be voided too"
        )

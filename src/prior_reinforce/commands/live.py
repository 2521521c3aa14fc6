"""What an operator reads and is asked while a simulated task is learned and tried."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn
from rich.text import Text

from prior_reinforce.arrays import Point
from prior_reinforce.commands.questions import answer_to, until_read
from prior_reinforce.errors import PerceptionFailedError, PriorReinforceError
from prior_reinforce.parsing import from_words
from prior_reinforce.readings import Reading
from prior_reinforce.terminal import plain
from prior_reinforce.wording import (
    error_example,
    say_chance,
    say_cost,
    say_place,
    say_reading,
    to_words,
)

if TYPE_CHECKING:
    from prior_reinforce.environment import Rollout
    from prior_reinforce.generators.base import FitProgress
    from prior_reinforce.perception.base import Perception
    from prior_reinforce.plans.motions import Demonstrations
    from prior_reinforce.report import AdaptationRecord
    from prior_reinforce.simulation.protocol import FailedReading, GoalTrials


def say(console: Console, *parts: str | tuple[str, str]) -> None:
    """Print a line as it is: names and reasons hold no markup, emoji or control characters."""
    styled = [(part, "") if isinstance(part, str) else part for part in parts]
    shown = [(plain(text, keep="\n"), style) for text, style in styled]
    console.print(Text.assemble(*shown), soft_wrap=True)


class LiveView:
    """Prints goals and trials as they happen."""

    def __init__(self, console: Console, demonstrations: Demonstrations) -> None:
        """Remember where to print, and what an outcome is called."""
        self._say, self._n = partial(say, console), demonstrations.n
        self._form = demonstrations.outcome_format

    def goal(self, number: int, n_goals: int, goal: Point) -> None:
        """Announce a goal."""
        of_all = f" {number} of {n_goals}" if n_goals > 1 else ""
        self._say((f"\ngoal{of_all}", "bold"), f": {say_place(goal, self._form)}")

    def trial(self, result: GoalTrials) -> None:
        """Print the latest trial: how the condition moved, what was seen, solved or not."""
        trial, goal, before = result.trials[-1], result.goal, result.trials[-2:-1]
        assert trial.reading is not None
        aimed, moved = (before[0].condition, "moved ") if before else (goal, "")
        nothing = to_words(0.0 * goal, self._form)
        off = to_words(trial.condition - aimed, self._form)
        seen = say_reading(trial.reading, self._form)
        aim = "aim at the goal" if off == nothing else f"aim {moved}{off}"
        shown = ("HIT", "bold green") if trial.hit else "a near miss" if seen == nothing else seen
        p_hit = trial.expected.p_hit
        chance = "" if p_hit is None else f"hit {say_chance(p_hit):<8}  "
        self._say(f"  trial {len(result.trials)}  {aim:<36} {chance}seen: ", shown)

    def end(self, result: GoalTrials) -> None:
        """Print the paper's count for this goal."""
        if (n := result.solved_at) is None:
            self._say("  ", ("not reached", "bold red"), f" in {len(result.trials)} trials")
        else:
            self._say(f"  reached: {say_cost(self._n, n)}")

    def summary(self, records: Sequence[AdaptationRecord]) -> None:
        """Print the count over all goals."""
        from prior_reinforce.report.summary import headline

        said = headline(records)
        if len(records) > 1 and said.count:
            self._say((f"\n{said.text}", "bold"), f", on average {said.count}")
            self._say(f"trials by goal: {trials_by_goal(records)}")


def trials_by_goal(records: Sequence[AdaptationRecord]) -> str:
    """Say how many trials each goal took, in order; `10+` where it was not reached."""
    return ", ".join(str(r.trials_to_hit or f"{len(r.told)}+") for r in records)


def asking(
    console: Console, demonstrations: Demonstrations, perception: Perception
) -> FailedReading:
    """Return what asks the person at the terminal where perception fails, with its latest picture.

    PerceptionFailedError where there is no terminal, or no answer.
    """
    form = demonstrations.outcome_format

    def ask(failure: PerceptionFailedError, _: Rollout, goal: Point, __: object) -> Reading:
        if not sys.stdin.isatty():
            raise PerceptionFailedError(
                f"{failure}; there is no terminal to ask at: run in one, or choose another "
                "--perception"
            ) from failure
        say(console, f"  not seen: {failure}")
        if (latest := getattr(perception, "latest", None)) is not None:
            say(console, f"  picture: {latest}")
        example = f'"{said}", or ' if (said := error_example(form)) else ""
        question = (
            f"  what was the error, seen from {say_place(goal, form)}? for instance {example}hit: "
        )
        try:
            return until_read(partial(answer_to, question), lambda text: from_words(text, form))
        except EOFError as error:
            raise PerceptionFailedError(f"{failure}; no answer came") from error

    return ask


@contextmanager
def fit_progress(console: Console) -> Iterator[Callable[[FitProgress], None]]:
    """Show a bar with loss and time left while a generator is fitted."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.fields[detail]}"),
    )
    with Progress(*columns, console=console) as progress:
        line = progress.add_task("learning the motion", total=None, detail="")

        def show(state: FitProgress) -> None:
            detail = f"loss {state.loss:.4f}, {state.seconds_left:.0f} s left"
            progress.update(line, total=state.n_steps, completed=state.step, detail=detail)

        try:
            yield show
        except PriorReinforceError:  # which says why nothing was learned
            progress.remove_task(line)
            raise
        progress.update(line, detail="done")


@contextmanager
def drawing_progress(console: Console) -> Iterator[Callable[[int, int], None]]:
    """Show which goal of a report is being drawn; nothing where nobody watches."""
    with console.status("drawing") as status:

        def show(done: int, n: int) -> None:
            status.update(f"drawing: {done} of {n} goals done")

        yield show

"""What an operator reads while trials run: one line a trial, in words and centimetres."""

from __future__ import annotations

import numpy as np
from rich.console import Console

from prior_reinforce.experiments.protocol import GoalTrials
from prior_reinforce.wording import say_place, to_words


class LiveView:
    """Prints goals and trials as they happen."""

    def __init__(self, console: Console, n_demonstrations: int) -> None:
        """Remember where to print, and how many demonstrations count into N."""
        self._console = console
        self._n_demonstrations = n_demonstrations

    def goal(self, number: int, n_goals: int, goal: np.ndarray) -> None:
        """Announce a goal."""
        of_all = f" {number} of {n_goals}" if n_goals > 1 else ""
        place = say_place(goal, "xyz", ["m"] * len(goal))
        self._console.print(f"\n[bold]goal{of_all}[/bold] at {place}")

    def trial(self, result: GoalTrials) -> None:
        """Print the latest trial: how the condition moved, what was seen, solved or not."""
        trial = result.trials[-1]
        assert trial.error_seen is not None
        before = result.trials[-2].condition if len(result.trials) > 1 else result.goal
        moved = to_words(trial.condition - before)
        aim = "aim at the goal" if moved == "on the goal" else f"aim {moved}"
        seen = to_words(trial.error_seen)
        if trial.hit:
            seen = "[bold green]HIT[/bold green]"
        elif seen == "on the goal":
            seen = "a near miss"
        if len(result.trials) > 1 and moved != "on the goal":
            aim = f"aim moved {moved}"
        self._console.print(f"  trial {trial.number}  {aim:<36} seen: {seen}", highlight=False)

    def end(self, result: GoalTrials) -> None:
        """Print the paper's count for this goal."""
        n = self._n_demonstrations
        if result.solved_at is None:
            self._console.print(
                f"  [bold red]not reached[/bold red] in {len(result.trials)} trials",
                highlight=False,
            )
        else:
            self._console.print(
                f"  reached: N = {n} demonstrations + {result.solved_at} "
                f"trial{'s' if result.solved_at > 1 else ''} = {n + result.solved_at}",
                highlight=False,
            )

    def summary(self, results: list[GoalTrials]) -> None:
        """Print the count over all goals."""
        solved = [result.solved_at for result in results if result.solved_at is not None]
        if len(results) < 2 or not solved:
            return
        n = self._n_demonstrations
        self._console.print(
            f"\n[bold]{len(solved)} of {len(results)} goals reached[/bold], on average "
            f"N = {n} + {np.mean(solved):.1f} = {n + np.mean(solved):.1f} trials",
            highlight=False,
        )

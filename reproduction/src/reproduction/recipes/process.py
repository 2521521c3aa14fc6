"""The process of adaptation in pictures: one row a task, trial by trial to the hit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.simulation.protocol import GoalTrials
from prior_reinforce.wording import to_words
from reproduction.evaluation import OfTraining, Training, Trials
from reproduction.recipes.base import Picture, Planned, Recipe, Scale
from reproduction.recipes.tables import Table
from reproduction.results import Results, as_text

TASKS = {
    "basketball-v1": "Basketball Shot",
    "curling": "Curling",
    "fishing": "Fishing Rod Swinging",
}
"""The paper's three tasks, as it calls them."""
_GOALS = 5
"""Unseen goals of which one is shown, the same as in the table of trials."""
_SHOWN = 3
"""The goal shown is the first of those whose number of trials is nearest to this (ours): two
misses with their corrections and a hit tell the whole story."""


@dataclass(frozen=True)
class Process(OfTraining):
    """All trials of a training's unseen goals, with what a camera needs to draw them."""

    perception: str = "eye"
    """How errors are seen."""
    rounds: int = 10
    """Trials a goal at most."""
    what = "process"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Run the protocol as `Trials` does, and keep everything."""
        of, seen = self.training, self.perception
        trials = Trials(of, of.task, "gp-two-term", seen, _GOALS, unseen=True, rounds=self.rounds)
        return {"goals": [_kept(result) for result in trials.trials(folder)]}

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a trial."""
        return [
            {
                **self.columns,
                "perception": self.perception,
                "goal": i,
                "place": as_text(goal["goal"]),
                "trial": j,
                "seen": as_text(trial["error_seen"]),
                "outcome": as_text(trial["outcome"]),
                "hit": trial["hit"],
                "key_state": as_text(trial["key_state"]),
            }
            for i, goal in enumerate(result["goals"])
            for j, trial in enumerate(goal["trials"], start=1)
        ]


def _kept(result: GoalTrials) -> dict[str, Any]:
    trials = []
    for trial, rollout in zip(result.trials, result.rollouts, strict=True):
        assert trial.reading is not None
        assert rollout.key_frame is not None
        kept = {
            "condition": trial.condition,
            "error_seen": trial.reading.error_seen,
            "outcome": rollout.outcome,
            "key_state": np.round(rollout.key_frame.state, 6),
        }
        trials.append({"hit": trial.hit, **{name: of.tolist() for name, of in kept.items()}})
    return {"goal": result.goal.tolist(), "trials": trials}


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The unseen goals of each task, of the first set and seed, and what was seen before."""
    learned = [
        Training(task, scale.sets[0], "diffusion", scale.seeds[0], perception="eye")
        for task in TASKS
    ]
    tried = [Process(training, rounds=scale.rounds) for training in learned]
    return [(unit, {}) for unit in (*(t.perceived for t in learned if t.perceived), *tried)]


def shown(results: Results) -> dict[str, dict[str, Any]]:
    """Of each task the goal that is shown, with its trials; see `_SHOWN`."""
    chosen = {}
    for task, of_task in results.by("task").items():
        goals = of_task.by("goal").values()
        reached = [goal for goal in goals if goal.frame["hit"].iloc[-1]] or goals
        goal = min(reached, key=lambda goal: abs(goal.n - _SHOWN))
        prior = results.where(learned_on=task).having("demonstration")
        told = (goal.texts("seen"), goal.texts("outcome"), goal.texts("key_state"))
        chosen[task] = {
            "task": task,
            "goal": next(goal.texts("place")),
            "demonstrated": np.array(list(prior.texts("seen"))),
            "trials": [
                {"error_seen": seen, "outcome": outcome, "key_state": state, "hit": bool(hit)}
                for seen, outcome, state, hit in zip(*told, goal.frame["hit"], strict=True)
            ],
        }
    return chosen


def table(results: Results) -> Table:
    """What was seen of each trial."""
    rows = [
        (
            TASKS[task] if number == 1 else "",
            str(number),
            "hit" if trial["hit"] else to_words(trial["error_seen"]),
            f"{100 * np.linalg.norm(trial['outcome'] - row['goal']):.1f} cm",
        )
        for task, row in shown(results).items()
        for number, trial in enumerate(row["trials"], start=1)
    ]
    return Table(("task", "trial", "seen by eye", "truly off by"), tuple(rows))


def draw(results: Results, folder: Path) -> list[Picture]:
    """Draw the key frames from above, with arrows."""
    from reproduction.recipes.key_frames import draw_process

    rows = {TASKS[task]: row for task, row in shown(results).items()}
    caption = (
        "From above, one goal of each task: the whole table with the demonstrations as they were "
        "seen, then every trial's key frame close up. The arrow is the error as it was seen by "
        "eye, from the goal; it guides the next trial. Of five unseen goals the first that took "
        "three trials is shown, or the nearest to that."
    )
    return [Picture(draw_process(rows, folder / "process.png"), caption)]


RECIPE = Recipe("process", "The process of adaptation", "Figure 3", units, table, draw)

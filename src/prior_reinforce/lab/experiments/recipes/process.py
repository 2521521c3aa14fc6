"""The process of adaptation in pictures: one row a task, trial by trial to the hit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.lab.experiments.evaluation import Training, Trials
from prior_reinforce.lab.experiments.protocol import GoalTrials
from prior_reinforce.lab.experiments.recipes.base import (
    Figures,
    Measurement,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.lab.experiments.units import Unit
from prior_reinforce.wording import to_words

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
class Process(Unit):
    """All trials of a training's unseen goals, with what a camera needs to draw them."""

    training: Training
    """What was learned."""
    perception: str = "eye"
    """How errors are seen."""
    rounds: int = 10
    """Trials a goal at most."""

    @property
    def label(self) -> str:
        """What it is, for a progress line."""
        return f"process of {self.training.label.removeprefix('learn ')}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Run the protocol as `Trials` does, and keep everything."""
        trials = Trials(
            self.training,
            self.training.task,
            "gp",
            self.perception,
            _GOALS,
            unseen=True,
            rounds=self.rounds,
        )
        return {"goals": [_kept(result) for result in trials.trials(folder)]}


@dataclass(frozen=True)
class ProcessPictures(Measurement):
    """The trials of one goal of each task."""

    tasks: tuple[str, ...] = tuple(TASKS)
    """Which of `TASKS`."""
    generator: str = "diffusion"
    """What is learned."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """One a task: the first set and seed."""
        first = scale.sets[0], self.generator, scale.seeds[0]
        return [Training(task, *first, perception="eye") for task in self.tasks]

    def run(self, run: Run) -> dict[str, Any]:
        """Try the unseen goals of each task, and choose one of them."""
        trainings = self.trainings(run.scale)
        run.learn(trainings)
        results = run.results([Process(t, rounds=run.scale.rounds) for t in trainings])
        return {
            "rows": [
                {
                    "task": training.task,
                    "demonstrated": training.learned(run.folder).prior.outcomes_seen.tolist(),
                    **_chosen(result["goals"]),
                }
                for training, result in zip(trainings, results, strict=True)
            ]
        }


def _kept(result: GoalTrials) -> dict[str, Any]:
    trials = []
    for trial, rollout in zip(result.trials, result.rollouts, strict=True):
        assert trial.error_seen is not None
        assert rollout.key_frame is not None
        trials.append(
            {
                "condition": trial.condition.tolist(),
                "error_seen": trial.error_seen.tolist(),
                "outcome": rollout.outcome.tolist(),
                "hit": trial.hit,
                "key_state": np.round(rollout.key_frame.state, 6).tolist(),
            }
        )
    return {"goal": result.goal.tolist(), "trials": trials}


def _chosen(goals: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """The first goal that was reached in a number of trials nearest to `_SHOWN`."""
    reached = [goal for goal in goals if goal["trials"][-1]["hit"]] or list(goals)
    return min(reached, key=lambda goal: abs(len(goal["trials"]) - _SHOWN))


def table(figures: Figures) -> Table:
    """What was seen of each trial."""
    return Table(
        ("task", "trial", "seen by eye", "truly off by"),
        tuple(
            (
                TASKS[row["task"]] if number == 1 else "",
                str(number),
                "hit" if trial["hit"] else to_words(trial["error_seen"]),
                f"{100 * np.linalg.norm(np.subtract(trial['outcome'], row['goal'])):.1f} cm",
            )
            for row in figures["rows"]
            for number, trial in enumerate(row["trials"], start=1)
        ),
    )


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """Draw the key frames from above, with arrows."""
    from prior_reinforce.lab.experiments.recipes.key_frames import draw_process

    rows = {TASKS[row["task"]]: row for row in figures["rows"]}
    caption = (
        "From above, one goal of each task: the whole table with the demonstrations as they were "
        "seen, then every trial's key frame close up. The arrow is the error as it was seen by "
        "eye, from the goal; it guides the next trial. Of five unseen goals the first that took "
        "three trials is shown, or the nearest to that."
    )
    return [Picture(draw_process(rows, folder / "process.png"), caption)]


RECIPE = Recipe("process", "The process of adaptation", "Figure 3", ProcessPictures(), table, draw)

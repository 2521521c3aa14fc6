"""Where demonstrations show two ways, and between them is none (ours; the paper has one way).

Forehand and backhand, over the shoulder and underhand, straight and off a cushion (zoo), and round
a stone by the left or the right (the Panda, in contact physics). What is compared is what
generators make of twelve demonstrations of both, unsorted. The Bayesian adapter sees trials
exactly.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arrays import LARGEST, Plans
from prior_reinforce.generators.patterns import motion_vectors
from prior_reinforce.lab.experiments.evaluation import GOAL_SEED, Training, Trials
from prior_reinforce.lab.experiments.recipes.base import (
    Figures,
    Measurement,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.lab.experiments.statistics import (
    SHARE,
    bootstrap_difference,
    bootstrap_mean,
    trials_counted,
)
from prior_reinforce.lab.experiments.units import Unit
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.lab.tasks.zoo import SEVERAL_WAYS
from prior_reinforce.plans.motions import Demonstrations

GENERATORS = (
    ("diffusion on mixtures", "diffusion-ways"),
    ("the same, untrained", "diffusion-ways,training_steps=0"),
    ("closed form of all", "interpolation"),
    ("closed form within each way (auto)", "auto"),
    ("nearest neighbours", "nearest,timing=start"),
    ("DMP", "dmp"),
)
"""What is compared is called, and its choice; the first is the network."""
SETS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(SEVERAL_WAYS, tuple(f"ways-12-{seed}" for seed in range(5))),
    "curling-round": ("A", "B"),
}
"""Sets of demonstrations of each task."""
_GOALS = 20


@dataclass(frozen=True)
class Unlike(Unit):
    """Which plans for the goals are like no demonstration."""

    training: Training
    """What was learned."""
    goals: int
    """Number of goals, those of `Trials`."""

    @property
    def label(self) -> str:
        """What it is, for a progress line."""
        return f"plans of {self.training.label.removeprefix('learn ')}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Generate a plan for each goal, and hold it against the demonstrations."""
        learned, task = self.training.learned(folder), make_task(self.training.task)
        goals = task.sample_goals(self.goals, np.random.default_rng(GOAL_SEED))
        return {"unlike": unlike(learned.prior, learned.generator.generate(goals)).tolist()}


def unlike(demonstrations: Demonstrations, plans: Plans) -> np.ndarray:
    """Whether plans are farther from every demonstration than any of these from its nearest.

    Motions are compared on a common phase, every unit counting alike: a plan that is half of one
    way and half of another is like none.
    """
    n, outcomes = demonstrations.n, demonstrations.outcomes_seen
    ran_away = np.abs(plans).max(axis=(1, 2)) > LARGEST  # no numbers to compare
    plans = np.where(ran_away[:, None, None], demonstrations.plans[0], plans)
    # What is compared are motions: outcomes of plans are made up, and of no demonstration.
    made_up = outcomes.max(axis=0) * np.arange(2.0, len(plans) + 2)[:, None]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they advise on recordings; a wild plan is the point here
        both = Demonstrations(
            np.concatenate([demonstrations.plans, plans]),
            np.concatenate([outcomes, made_up]),
            demonstrations.format,
            demonstrations.outcome_names,
            demonstrations.outcome_units,
        )
    motions = motion_vectors(both)
    apart = np.linalg.norm(motions[:, None] - motions[None, :n], axis=2)
    own = apart[:n] + np.where(np.eye(n, dtype=bool), np.inf, 0.0)
    far: np.ndarray = apart[n:].min(axis=1) > own.min(axis=1).max()
    return far | ran_away


@dataclass(frozen=True)
class Ways(Measurement):
    """First throws, trials, lost objects and plans that are neither way."""

    sets: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: SETS)
    """Sets of demonstrations of each task."""
    generators: tuple[tuple[str, str], ...] = GENERATORS
    """What is compared; the first is the network."""

    def _sets(self, scale: Scale) -> Mapping[str, tuple[str, ...]]:
        """All, or the first of each task in a quick run."""
        return self.sets if scale.variants else {task: of[:1] for task, of in self.sets.items()}

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """Every generator on every set of every task."""
        choices = [choice for _, choice in self.generators] + list(include)
        return [
            Training(task, name, choice, seed=0)
            for choice in choices
            for task, names in self._sets(scale).items()
            for name in names
        ]

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every generator."""
        goals, rounds = min(run.scale.goals, _GOALS), run.scale.rounds
        sets, trainings = self._sets(run.scale), self.trainings(run.scale, run.include)
        run.learn(trainings)
        tried = run.results(
            [Trials(t, t.task, "bayes", "exact", goals, rounds=rounds) for t in trainings]
        )
        looked = run.results([Unlike(t, goals) for t in trainings])
        labels = [label for label, _ in self.generators] + list(run.include)
        tasks = [t.task for t in trainings[: sum(map(len, sets.values()))]]
        shape = len(labels), len(tasks), goals
        solved = np.array([result["solved_at"] for result in tried]).reshape(shape)
        values = {
            "first": (solved == 1).astype(float),
            "trials": trials_counted(solved, rounds),
            "lost": np.array([result["lost"] for result in tried]).reshape(shape),
            "unlike": np.array([result["unlike"] for result in looked]).reshape(shape),
        }
        places = {task: [i for i, t in enumerate(tasks) if t == task] for task in sets}
        return {
            "sets": {task: list(names) for task, names in sets.items()},
            "goals": goals,
            "rows": [
                {
                    "label": label,
                    "tasks": {
                        task: {
                            "first": bootstrap_mean(values["first"][i, at], within=SHARE),
                            "network_minus": bootstrap_difference(
                                values["first"][0, at], values["first"][i, at], within=SHARE
                            ),
                            "trials": bootstrap_mean(
                                values["trials"][i, at], within=(1, rounds + 1)
                            ),
                            "lost": float(values["lost"][i, at].mean()),
                            "unlike": float(values["unlike"][i, at].mean()),
                        }
                        for task, at in places.items()
                    },
                    "solved_at": [" ".join(map(str, row)) for row in solved[i]],
                }
                for i, label in enumerate(labels)
            ],
        }


def table(figures: Figures) -> Table:
    """One row a task and generator."""
    rows = [
        {"task": task, "label": row["label"], **row["tasks"][task]}
        for task in figures["sets"]
        for row in figures["rows"]
    ]
    columns = {
        "task": lambda row: row["task"],
        "generator": lambda row: row["label"],
        "first throws that hit": lambda row: row["first"],
        "the network minus it": lambda row: f"{row['network_minus']:+.2f}",
        "trials": lambda row: row["trials"],
        "lost a goal": lambda row: f"{row['lost']:.2f}",
        "plans like no demonstration": lambda row: f"{row['unlike']:.2f}",
    }
    return Table.of(rows, columns)


RECIPE = Recipe(
    "ways", "Demonstrations of two ways", "not in the paper", Ways(), table, family="generator"
)

"""Where demonstrations show two ways, and between them is none (ours; the paper has one way).

Forehand and backhand, over the shoulder and underhand, straight and off a cushion (zoo), and round
a stone by the left or the right (the Panda, in contact physics). What is compared is what
generators make of twelve demonstrations of both, unsorted. The Bayesian adapter sees trials
exactly.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arrays import LARGEST, Plans
from prior_reinforce.generators.patterns import motion_vectors
from prior_reinforce.lab.experiments.evaluation import GOAL_SEED, Training, Trials
from prior_reinforce.lab.experiments.recipes.base import Planned, Recipe, Scale, Table
from prior_reinforce.lab.experiments.results import FIRST, TRIALS, Measure, Results
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

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal."""
        told = {**self.training.columns, "task": self.training.task}
        return [{**told, "goal": i, "unlike": bool(is_)} for i, is_ in enumerate(result["unlike"])]


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


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same goals with every generator on every set; a quick run on the first of each task."""
    goals = min(scale.goals, _GOALS)
    planned: list[Planned] = []
    for label, choice in (*GENERATORS, *((choice, choice) for choice in include)):
        for task, names in SETS.items():
            for name in names if scale.variants else names[:1]:
                learned = Training(task, name, choice, seed=0)
                tried = Trials(learned, task, "bayes", "exact", goals, rounds=scale.rounds)
                planned += [(unit, {"method": label}) for unit in (tried, Unlike(learned, goals))]
    return planned


def table(results: Results) -> Table:
    """One row a task and generator."""
    tried = Results(results.frame[results.frame["solved_at"].notna()], results.made_by)
    rows = [
        (task, method, of, of_task.where(method=GENERATORS[0][0]))
        for task, of_task in tried.by("task").items()
        for method, of in of_task.by("method").items()
    ]
    columns = {
        "task": lambda row: row[0],
        "generator": lambda row: row[1],
        "first throws that hit": lambda row: row[2].mean(FIRST),
        "the network minus it": lambda row: _ahead(row[3], row[2], FIRST),
        "trials": lambda row: row[2].mean(TRIALS),
        "network minus it, trials": lambda row: _ahead(row[3], row[2], TRIALS),
        "objects lost, a goal": lambda row: f"{row[2].frame['lost'].mean():.2f}",
        "plans like no demonstration": lambda row: (
            f"{results.where(task=row[0], method=row[1]).frame['unlike'].astype(float).mean():.2f}"
        ),
    }
    return Table.of(rows, columns)


def _ahead(network: Results, of: Results, quantity: Measure) -> str:
    return "" if of.frame.equals(network.frame) else f"{network.minus(of, quantity):+.2f}"


RECIPE = Recipe(
    "ways", "Demonstrations of two ways", "not in the paper", units, table, family="generator"
)

"""Where demonstrations show two ways, and between them is none (ours; the paper has one way).

Forehand and backhand, over the shoulder and underhand, straight and off a cushion (zoo), and round
a stone by the left or the right (the Panda, in contact physics). What is compared is what
generators make of twelve demonstrations of both, unsorted. The Bayesian adapter sees trials
exactly.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.arrays import LARGEST, Plans
from prior_reinforce.generators.patterns import motion_vectors
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks import make_task
from reproduction.evaluation import GOAL_SEED, OfTraining, Training
from reproduction.recipes.base import Planned, Recipe, Scale
from reproduction.recipes.tables import Columns, Table, mean_of
from reproduction.results import FIRST, TRIALS, Measure, Results, rows_of
from reproduction.zoo import SEVERAL_WAYS

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
class Unlike(OfTraining):
    """Which plans for the goals are like no demonstration."""

    goals: int
    """Number of goals, those of `Trials`."""
    what = "plans"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Generate a plan for each goal, and hold it against the demonstrations."""
        learned, task = self.training.learned(folder), make_task(self.training.task)
        goals = task.sample_goals(self.goals, np.random.default_rng(GOAL_SEED))
        return {"unlike": unlike(learned.prior, learned.generator.generate(goals)).tolist()}

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a goal."""
        said = list(map(bool, result["unlike"]))
        return rows_of(self.columns, goal=range(len(said)), unlike=said)


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
            np.concatenate([demonstrations.plans, plans]), np.concatenate([outcomes, made_up]),
            demonstrations.format, demonstrations.outcome_format,
        )  # fmt: skip
    motions = motion_vectors(both)
    apart = np.linalg.norm(motions[:, None] - motions[None, :n], axis=2)
    own = apart[:n] + np.where(np.eye(n, dtype=bool), np.inf, 0.0)
    far: np.ndarray = apart[n:].min(axis=1) > own.min(axis=1).max()
    return far | ran_away


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same goals with every generator on every set; a quick run on the first of each task."""
    some = replace(scale, goals=min(scale.goals, _GOALS))
    return [
        (unit, {"method": label})
        for label, choice in (*GENERATORS, *((choice, choice) for choice in include))
        for task, names in SETS.items()
        for learned in (
            Training(task, name, choice, seed=0)
            for name in (names if scale.variants else names[:1])
        )
        for unit in (some.trials(learned, "bayes", "exact"), Unlike(learned, some.goals))
    ]


def table(results: Results) -> Table:
    """One row a task and generator."""
    tried = results.having("solved_at")
    network = tried.where(method=GENERATORS[0][0])

    def beside(measure: Measure) -> Callable[[Results], str]:
        return lambda of: network.where(task=of.first("task")).beside(of, measure)

    def alien(of: Results) -> str:
        plans = results.where(task=of.first("task"), method=of.first("method"))
        return f"{plans.frame['unlike'].astype(float).mean():.2f}"

    rows = {
        (task, method): of
        for task, of_task in tried.by("task").items()
        for method, of in of_task.by("method").items()
    }
    columns: Columns = {
        "first throws that hit": mean_of(FIRST),
        "the network minus it": beside(FIRST),
        "trials": mean_of(TRIALS),
        "network minus it, trials": beside(TRIALS),
        "objects lost, a goal": lambda of: f"{of.frame['lost'].mean():.2f}",
        "plans like no demonstration": alien,
    }
    return Table.of(("task", "generator"), rows, columns)


RECIPE = Recipe(
    "ways", "Demonstrations of two ways", "not in the paper", units, table, family="generator"
)

"""When is diffusion needed? Generators over people's variation and numbers of demonstrations.

Ours; the paper compares generators on one task. No setting was chosen on these tasks. Each has one
set of demonstrations of each kind. Outcomes are exact, so that what is compared is what a generator
makes of the demonstrations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from prior_reinforce.lab.experiments.evaluation import Training, Trials
from prior_reinforce.lab.experiments.recipes.base import (
    Figures,
    Measurement,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.lab.experiments.statistics import bootstrap_mean, trials_counted

GENERATORS = (
    ("auto", "auto"),
    ("diffusion", "diffusion"),
    ("aligned thin-plate spline", "interpolation,kernel=thin-plate,timing=align"),
    ("diffusion, untrained", "diffusion,training_steps=0"),
)
"""What is compared is called, and its choice."""
TASKS = ("zoo-drag", "zoo-hoop", "zoo-arrival", "zoo-curl")
"""Tasks of the zoo's reported half, without a clock and of at most 100 frames: a network learns
them in a minute."""
SETS = ("clean-8", "mixed-4", "mixed-12", "styles-9")
"""Kind and number of the demonstrations (docs/tasks/zoo.md)."""
_QUICK_SETS, _QUICK_TASKS, _QUICK_GENERATORS, _GOALS = 1, 1, 3, 30


@dataclass(frozen=True)
class GeneratorsByVariation(Measurement):
    """First throws and trials of every generator on every kind of set."""

    tasks: tuple[str, ...] = TASKS
    """Where it is tried."""
    sets: tuple[str, ...] = SETS
    """`KIND-COUNT`; the set's own seed is 0."""
    generators: tuple[tuple[str, str], ...] = GENERATORS
    """What is compared."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """Every generator on every set of every task."""
        tasks, sets = self._shown(scale)
        return [
            Training(task, f"{name}-0", choice, seed=0)
            for _, choice in self._compared(scale, include)
            for name in sets
            for task in tasks
        ]

    def run(self, run: Run) -> dict[str, Any]:
        """Try the same goals with every generator."""
        scale, (tasks, sets) = run.scale, self._shown(run.scale)
        goals = min(scale.goals, _GOALS)
        trainings = self.trainings(scale, run.include)
        run.learn(trainings)
        units = [Trials(t, t.task, "bayes", "exact", goals, rounds=scale.rounds) for t in trainings]
        labels = [label for label, _ in self._compared(scale, run.include)]
        solved = run.solved_at(units).reshape(len(labels), len(sets), len(tasks), goals)
        took = trials_counted(solved, scale.rounds)
        return {
            "tasks": list(tasks),
            "sets": list(sets),
            "goals": goals,
            "rows": [
                {
                    "label": label,
                    "first": [
                        bootstrap_mean((of_set == 1).astype(float), within=(0, 1))
                        for of_set in solved[i]
                    ],
                    "trials": [
                        bootstrap_mean(of_set, within=(1, scale.rounds + 1)) for of_set in took[i]
                    ],
                    "first_of_each": (solved[i] == 1).mean(axis=2).tolist(),
                    "trials_of_each": took[i].mean(axis=2).tolist(),
                }
                for i, label in enumerate(labels)
            ],
        }

    def _compared(self, scale: Scale, include: Sequence[str]) -> tuple[tuple[str, str], ...]:
        """Label and choice of each generator of a scale."""
        known = self.generators if scale.variants else self.generators[:_QUICK_GENERATORS]
        return (*known, *((choice, choice) for choice in include))

    def _shown(self, scale: Scale) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Tasks and sets of a scale."""
        if scale.variants:
            return self.tasks, self.sets
        return self.tasks[:_QUICK_TASKS], self.sets[:_QUICK_SETS]


def table(figures: Figures) -> Table:
    """One row a kind of set, then one a task; first throws that hit, and trials."""
    rows = figures["rows"]
    by_set = [
        (
            name,
            *(f"{r['first'][i]}; {r['trials'][i]}" for r in rows),
        )
        for i, name in enumerate(figures["sets"])
    ]
    by_task = [
        (
            name,
            *(
                f"{_of_task(r['first_of_each'], i)}; {_of_task(r['trials_of_each'], i)}"
                for r in rows
            ),
        )
        for i, name in enumerate(figures["tasks"])
    ]
    return Table(("demonstrations", *(row["label"] for row in rows)), (*by_set, *by_task))


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """First throws on the left, trials on the right, over the kinds of sets."""
    from prior_reinforce.lab.experiments.recipes.charts import Line, draw_kinds

    lines = {
        key: [
            Line(row["label"], row[key], place, each=row[f"{key}_of_each"])
            for place, row in enumerate(figures["rows"])
        ]
        for key in ("first", "trials")
    }
    path = draw_kinds(
        [_in_words(name) for name in figures["sets"]],
        {"first throws that hit": lines["first"], "trials to a hit": lines["trials"]},
        folder / "variation.png",
    )
    caption = (
        f"Large: means over {len(figures['tasks'])} tasks on which nothing was chosen, by what "
        "differs between the demonstrations and how many there are. Small: each task, "
        f"{figures['goals']} goals. The Bayesian adapter sees trials exactly."
    )
    return [Picture(path, caption)]


def _of_task(cells: Sequence[Sequence[float]], i: int) -> str:
    """Mean over the sets of a task."""
    return f"{sum(of_set[i] for of_set in cells) / len(cells):.2f}"


def _in_words(name: str) -> str:
    """A set's kind and number, on two lines."""
    kind, count = name.rsplit("-", 1)
    return f"{kind}\n{count} demos"


RECIPE = Recipe(
    "variation", "When is diffusion needed?", "not in the paper", GeneratorsByVariation(), table,
    draw, family="generator",
)  # fmt: skip

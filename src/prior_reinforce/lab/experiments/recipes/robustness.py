"""Few-trial adaptation beside its rivals where something is wrong, changed, or scarce (ours).

On displacement fields, each measured once in physics for a task and a set of demonstrations, so
that a condition is tried on as many sets as its interval needs. Every adapter works through the
same afternoons of goals; goals 2 to the last count. Sets are A, B and draws from both.
"""

from __future__ import annotations

import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.lab.experiments.evaluation import GOAL_SEED
from prior_reinforce.lab.experiments.fields import Change, MeasuredField
from prior_reinforce.lab.experiments.recipes.adaptation import (
    TASKS,
    reliability,
    reliability_in_words,
    said_and_came,
)
from prior_reinforce.lab.experiments.recipes.base import (
    Figures,
    Measurement,
    Picture,
    Recipe,
    Run,
    Scale,
    Table,
)
from prior_reinforce.lab.experiments.sequences import FieldAfternoons
from prior_reinforce.lab.experiments.statistics import (
    difference_of_tasks,
    mean_of_tasks,
    trials_counted,
)

_RIVALS = "prior_reinforce.lab.experiments.rivals"
_OBSERVERS = "prior_reinforce.lab.experiments.observers"


@dataclass(frozen=True)
class Rule:
    """One of the adapters compared."""

    label: str
    """What it is called in tables and pictures."""
    adapter: str
    """Its choice."""
    carry_over: bool = False
    """Whether the trials of earlier goals serve it."""
    search: bool = False
    """Slow, and far behind: tried in few conditions, on sets A and B."""


RULES = (
    Rule("Bayesian, earlier goals too", "bayes", carry_over=True),
    Rule("GP, no forgetting, earlier goals too", "gp-all", carry_over=True),
    Rule("GP, m = 2, earlier goals too", "gp", carry_over=True),
    Rule("Bayesian, each goal alone", "bayes"),
    Rule("GP, m = 2, each goal alone", "gp"),
    Rule("GP of the paper, each goal alone", "gp-one-term"),
    Rule("proportional, 0.8", "proportional"),
    Rule("proportional, 0.7", "proportional,gain=0.7"),
    Rule("mean offset", "offset"),
    Rule("Broyden, 0.8", "broyden"),
    Rule("Newton on an interpolator", f"{_RIVALS}:NewtonAdapter"),
    Rule("norm-optimal learning control", f"{_RIVALS}:NormOptimalAdapter"),
    Rule("CMA-ES", f"{_RIVALS}:CmaEsAdapter", search=True),
    Rule("Bayesian optimisation", f"{_RIVALS}:BayesianOptimisationAdapter", search=True),
)
"""The first is ours. Each has the settings that served it best on tuning material
(docs/decisions-adapter.md)."""
_QUICK_RULES = 7
"""The first so many are tried in a quick run."""


def own_sets() -> list[list[MeasuredField]]:
    """A, B, and two draws of as many demonstrations, of every task.

    Without fishing's second draw, of which two outcomes look the same: these fields are older than
    that such sets can be learned.
    """
    sets = (("A", 0), ("B", 1), ("C", 2), ("D", 0))
    return [
        [
            MeasuredField(task, learned_on, name, labels)
            for name, labels in sets
            if (task, name) != ("fishing", "D")
        ]
        for task, learned_on in TASKS.items()
    ]


def draws(count: int, times: int) -> list[list[MeasuredField]]:
    """So many demonstrations of basketball, drawn so often.

    Not all twelve, of which two always look the same by eye; three of curling lose stones where
    plans extrapolate.
    """
    names = (string.ascii_uppercase[5:] + string.ascii_lowercase)[:times]
    return [[MeasuredField("basketball-v1", "basketball-v1", name, 0, count) for name in names]]


def seen_by(perception: str) -> list[list[MeasuredField]]:
    """Basketball, with the demonstrations' outcomes as another perception saw them."""
    return [
        [MeasuredField(task, "basketball-v1", name, 0, perception=perception) for name in "ABCD"]
        for task in ("basketball-v1", "basketball-v2")
    ]


@dataclass(frozen=True)
class Condition:
    """What is tried."""

    label: str
    """For tables and pictures."""
    fields: Sequence[Sequence[MeasuredField]] = field(default_factory=own_sets)
    """A row a task, a column a set of demonstrations."""
    change: Change = field(default_factory=Change)
    """What is different since the fields were measured."""
    perception: str = "eye"
    """Through which trials are seen."""
    goals: int = 8
    """In an afternoon."""
    searches: bool = False
    """Whether the rules that search are tried too."""
    alone: bool = False
    """Whether nothing is remembered from goal to goal, by any rule."""

    def tries(self, rule: Rule) -> bool:
        """Whether a rule is tried."""
        return (self.searches or not rule.search) and not (self.alone and rule.carry_over)


_FEW, _MANY = 30, 10
"""Draws: what three or four demonstrations give differs more from draw to draw."""
_SHIFT = (-0.057, 0.019)
"""6 cm."""
_AFTERNOONS = (
    Condition("by eye", searches=True),
    Condition("twenty goals", goals=20),
    Condition("exact", perception="exact"),
    Condition("amplified noise", perception="amplified"),
    Condition("an eye that errs", perception=f"{_OBSERVERS}:ErringEye"),
    Condition("5 % of trials lost", change=Change(lost=0.05)),
    Condition("5 % of trials misread", perception=f"{_OBSERVERS}:MisreadingEye"),
    Condition("shifted by 6 cm", change=Change(shift=_SHIFT)),
    Condition("stretched by 1.15", change=Change(stretch=1.15)),
    Condition("shifted and stretched", change=Change(_SHIFT, stretch=1.08), searches=True),
    Condition("labels exact", seen_by("exact")),
    Condition("labels by an eye that errs", seen_by(f"{_OBSERVERS}:ErringEye")),
    Condition("3 demonstrations", draws(3, _FEW)),
    Condition("4 demonstrations", draws(4, _FEW)),
    Condition("8 demonstrations", draws(8, _MANY)),
    Condition("10 demonstrations", draws(10, _MANY)),
)
_TRIED_ALONE = (
    "by eye", "amplified noise", "an eye that errs", "5 % of trials lost",
    "5 % of trials misread", "shifted by 6 cm", "stretched by 1.15", "shifted and stretched",
    "3 demonstrations", "4 demonstrations",
)  # fmt: skip
_GOALS_ALONE = 100
"""On each field: rules that know one goal differ by less than those that remember."""
CONDITIONS = (
    *_AFTERNOONS,
    *(
        replace(c, label=f"{c.label}, alone", goals=_GOALS_ALONE, searches=False, alone=True)
        for c in _AFTERNOONS
        if c.label in _TRIED_ALONE
    ),
)


@dataclass(frozen=True)
class Robustness(Measurement):
    """Trials a goal of every rule in every condition."""

    conditions: tuple[Condition, ...] = CONDITIONS
    """What is tried."""
    seed: int = GOAL_SEED
    """Of the goals."""

    def run(self, run: Run) -> dict[str, Any]:
        """Measure the fields, and work through the same afternoons with every rule."""
        scale = run.scale
        tried = self._shown(scale)
        fields = dict.fromkeys(f for condition in tried for row in condition.fields for f in row)
        run.results(list(fields))
        shown = []
        for condition in tried:
            known = RULES if scale.variants else RULES[:_QUICK_RULES]
            included = [Rule(choice, choice, not condition.alone) for choice in run.include]
            rules = [rule for rule in (*known, *included) if condition.tries(rule)]
            shown.append(self._compared(run, condition, rules))
        return {"conditions": shown}

    def _shown(self, scale: Scale) -> tuple[Condition, ...]:
        """The conditions of a scale: a quick one has the first, of one field."""
        if scale.variants:
            return self.conditions
        first = self.conditions[0]
        return (replace(first, fields=[first.fields[0][:1]], searches=False),)

    def _compared(self, run: Run, condition: Condition, rules: Sequence[Rule]) -> dict[str, Any]:
        """One condition: every rule's mean with its interval, and ours minus it."""
        units = {
            rule.label: [
                [
                    FieldAfternoons(
                        of, rule.adapter, rule.carry_over, condition.change, condition.perception,
                        condition.goals, rounds=run.scale.rounds, seed=self.seed,
                    )
                    for of in (row[:2] if rule.search else row)
                ]
                for row in condition.fields
            ]
            for rule in rules
        }  # fmt: skip
        flat = [unit for rows in units.values() for row in rows for unit in row]
        results = dict(zip(flat, run.results(flat), strict=True))
        trials = {
            label: [
                np.array([_trials(results[unit], run.scale.rounds) for unit in row]) for row in rows
            ]
            for label, rows in units.items()
        }
        ours = trials[rules[0].label]
        of_ours = [unit for row in units[rules[0].label] for unit in row]
        said = [row for unit in of_ours for row in said_and_came(results[unit], run.scale.rounds)]
        bounds = (1, run.scale.rounds + 1)
        return {
            "label": condition.label,
            "tasks": [row[0].task for row in condition.fields],
            "goals": sum(row.size for row in ours),
            "rules": {
                label: {
                    "each": [float(row.mean()) for row in rows],
                    "mean": mean_of_tasks(rows, within=bounds),
                    "ours_minus": difference_of_tasks(ours, rows),
                }
                for label, rows in trials.items()
            },
            "p_hit": reliability(np.array(said)),
        }


def _trials(result: Mapping[str, Any], rounds: int) -> np.ndarray:
    """Trials on the goals that count of one field."""
    return trials_counted(np.array(result["solved_at"])[:, 1:], rounds).ravel()


def table(figures: Figures) -> Table:
    """One row a condition, one column a rule: the mean, and ours minus it, which stands first."""
    labels = dict.fromkeys(label for c in figures["conditions"] for label in c["rules"])

    def cell(condition: Mapping[str, Any], label: str) -> str:
        if label not in condition["rules"]:
            return ""
        of = condition["rules"][label]
        mean = of["mean"]
        if label == next(iter(condition["rules"])):
            return str(mean)
        return f"{mean.value:.2f} ({of['ours_minus']:+.2f})"

    return Table(
        ("condition", "goals", *labels),
        tuple(
            (c["label"], str(c["goals"]), *(cell(c, label) for label in labels))
            for c in figures["conditions"]
        ),
    )


_DRAWN = {
    "Bayesian, earlier goals too": "o",
    "Bayesian, each goal alone": "D",
    "GP, no forgetting, earlier goals too": "v",
    "GP, m = 2, each goal alone": "s",
    "proportional, 0.8": "^",
}
"""Marks of the rules in the picture, which has room for few."""


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """Trials a goal by condition, a row each, with intervals."""
    from prior_reinforce.lab.experiments.recipes.charts import COLOURS, Mark, draw_rows
    from prior_reinforce.report.style import GOAL

    of = {c["label"]: c["rules"] for c in figures["conditions"]}
    colours = [GOAL, *(colour for colour in COLOURS if colour != GOAL)]
    marks = {
        label: Mark(
            shape,
            colour,
            [rules[label]["mean"] if label in rules else None for rules in of.values()],
        )
        for (label, shape), colour in zip(_DRAWN.items(), colours, strict=False)
    }
    label = "trials a goal, with 95 % intervals over sets of demonstrations and goals"
    path = draw_rows(list(of), marks, label, folder / "robustness.png")
    caption = (
        "Trials a goal on goals 2 to the last of an afternoon, a row a condition, on displacement "
        "fields measured in physics; the lines are 95 % intervals over sets and goals. Alone: "
        "nothing is remembered from goal to goal."
    )
    return [Picture(path, caption)]


def remarks(figures: Figures) -> list[str]:
    """Which rules took fewer trials than ours, and how far what ours says can be trusted."""
    behind = [
        f"{label} in {condition['label']!r} ({of['ours_minus']:+.2f})"
        for condition in figures["conditions"]
        for label, of in condition["rules"].items()
        if of["ours_minus"].value > 0
    ]
    first = figures["conditions"][0]
    said = f"On fields, {first['label']}: {reliability_in_words(first['p_hit'])}"
    if not behind:
        return [said]
    return [f"With fewer trials than ours (ours minus it): {'; '.join(behind)}.", said]


RECIPE = Recipe(
    "robustness", "Trials where something is wrong, changed, or scarce", "not in the paper",
    Robustness(), table, draw, remarks=remarks, family="adapter",
)  # fmt: skip

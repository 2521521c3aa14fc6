"""Few-trial adaptation beside its rivals where something is wrong, changed, or scarce (ours).

On displacement fields, each measured once in physics for a task and a set of demonstrations, so
that a condition is tried on as many sets as its interval needs. Every adapter works through the
same afternoons of goals; goals 2 to the last count. Sets are A, B and draws from both.
"""

from __future__ import annotations

import string
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from reproduction.fields import Change, MeasuredField
from reproduction.recipes.adaptation import RIDGE, TASKS, later, reliability
from reproduction.recipes.base import Picture, Planned, Recipe, Scale
from reproduction.recipes.tables import Table
from reproduction.results import TRIALS, Results
from reproduction.sequences import FieldAfternoons

_RIVALS = "reproduction.rivals"
_OBSERVERS = "reproduction.observers"


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
    Rule("GP of two terms, no forgetting, earlier goals too", "gp-two-term-all", carry_over=True),
    Rule("GP of two terms, m = 2, earlier goals too", "gp-two-term", carry_over=True),
    Rule("Bayesian, each goal alone", "bayes"),
    Rule("GP of two terms, m = 2, each goal alone", "gp-two-term"),
    Rule("GP, m = 2, each goal alone", "gp"),
    Rule("proportional, 0.8", "proportional"),
    Rule("proportional, 0.7", "proportional,gain=0.7"),
    Rule("mean offset", "offset"),
    Rule("Broyden, 0.8", "broyden"),
    Rule("Newton on an interpolator", f"{_RIVALS}:NewtonAdapter"),
    Rule("norm-optimal learning control", f"{_RIVALS}:NormOptimalAdapter"),
    Rule("ridge on the spline's weights, earlier goals too", RIDGE, carry_over=True),
    Rule("CMA-ES", f"{_RIVALS}:CmaEsAdapter", search=True),
    Rule("Bayesian optimisation", f"{_RIVALS}:BayesianOptimisationAdapter", search=True),
)
"""The first is ours. Each has the settings that served it best on tuning material
(reproduction/docs/decisions-adapter.md)."""
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

    Not ten of the twelve or more, where draws overlap and two of them nearly always look the same
    by eye; three of curling lose stones where plans extrapolate.
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
    Condition("a biased model", perception=f"{_OBSERVERS}:BiasedModel"),
    Condition("a scattered model", perception=f"{_OBSERVERS}:ScatteredModel"),
    Condition("shifted by 6 cm", change=Change(shift=_SHIFT)),
    Condition("stretched by 1.15", change=Change(stretch=1.15)),
    Condition("shifted and stretched", change=Change(_SHIFT, stretch=1.08), searches=True),
    Condition("labels exact", seen_by("exact")),
    Condition("labels by an eye that errs", seen_by(f"{_OBSERVERS}:ErringEye")),
    Condition("3 demonstrations", draws(3, _FEW)),
    Condition("4 demonstrations", draws(4, _FEW)),
    Condition("8 demonstrations", draws(8, _MANY)),
)
_TRIED_ALONE = (
    "by eye", "amplified noise", "an eye that errs", "5 % of trials lost",
    "5 % of trials misread", "shifted by 6 cm", "stretched by 1.15", "shifted and stretched",
    "3 demonstrations", "4 demonstrations", "exact", "labels exact",
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


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same afternoons with every rule; a quick run has one condition, of one field."""
    conditions, rules = CONDITIONS, RULES if scale.variants else RULES[:_QUICK_RULES]
    if not scale.variants:
        first = CONDITIONS[0]
        conditions = (replace(first, fields=[first.fields[0][:1]], searches=False),)
    return [
        unit
        for c in conditions
        for unit in tried(
            c, [*rules, *(Rule(choice, choice, not c.alone) for choice in include)], scale.rounds
        )
    ]


def tried(condition: Condition, rules: Sequence[Rule], rounds: int) -> list[Planned]:
    """One condition, with the rules that it tries."""
    c = condition
    return [
        (
            FieldAfternoons(
                of, c.change, adapter=rule.adapter, carry_over=rule.carry_over,
                perception=c.perception, goals=c.goals, rounds=rounds,
            ),
            {"condition": c.label, "method": rule.label},
        )
        for rule in rules
        if c.tries(rule)
        for row in c.fields
        for of in (row[:2] if rule.search else row)
    ]  # fmt: skip


def _compared(results: Results) -> dict[str, dict[str, Results]]:
    """Rows that count, by condition and rule."""
    return {name: of.by("method") for name, of in later(results).by("condition").items()}


def table(results: Results) -> Table:
    """One row a condition, one column a rule: the mean, and ours minus it, which stands first."""
    conditions = _compared(results)
    labels = dict.fromkeys(label for rules in conditions.values() for label in rules)

    def cell(rules: dict[str, Results], label: str) -> str:
        if label not in rules:
            return ""
        ours, of = next(iter(rules.values())), rules[label]
        if of is ours:
            return str(of.mean(TRIALS))
        return f"{of.mean(TRIALS).value:.2f} ({ours.beside(of)})"

    rows = {(name, next(iter(of.values())).n): of for name, of in conditions.items()}
    columns = {label: partial(cell, label=label) for label in labels}
    return Table.of(("condition", "goals"), rows, columns)


_DRAWN = {
    "Bayesian, earlier goals too": "o",
    "Bayesian, each goal alone": "D",
    "GP of two terms, no forgetting, earlier goals too": "v",
    "GP of two terms, m = 2, each goal alone": "s",
    "proportional, 0.8": "^",
}
"""Marks of the rules in the picture, which has room for few."""


def draw(results: Results, folder: Path) -> list[Picture]:
    """Trials a goal by condition, a row each, with intervals."""
    from prior_reinforce.report.style import GOAL
    from reproduction.recipes.charts import COLOURS, Mark, draw_rows

    conditions = _compared(results)
    colours = [GOAL, *(colour for colour in COLOURS if colour != GOAL)]
    marks = {}
    for (label, shape), colour in zip(_DRAWN.items(), colours, strict=False):
        means = [of[label].mean(TRIALS) if label in of else None for of in conditions.values()]
        marks[label] = Mark(shape, colour, means)
    label = "trials a goal, with 95 % intervals over sets of demonstrations and goals"
    path = draw_rows(list(conditions), marks, label, folder / "robustness.png")
    caption = (
        "Trials a goal on goals 2 to the last of an afternoon, a row a condition, on displacement "
        "fields measured in physics; the lines are 95 % intervals over sets and goals. Alone: "
        "nothing is remembered from goal to goal."
    )
    return [Picture(path, caption)]


def remarks(results: Results) -> list[str]:
    """Which rules took fewer trials than ours, and how far what ours says can be trusted."""
    behind = []
    for condition, of in _compared(results).items():
        (_, ours), *others = of.items()
        for rule, rows in others:
            minus = ours.minus(rows, TRIALS)
            behind += [f"{rule} in {condition!r} ({minus:+.2f})"] if minus.value > 0 else []
    condition, first = next(iter(results.by("condition").items()))
    said = f"On fields, {condition}: {reliability(next(iter(first.by('method').values())))}"
    ahead = f"With fewer trials than ours (ours minus it): {'; '.join(behind)}."
    return [ahead, said] if behind else [said]


RECIPE = Recipe(
    "robustness", "Trials where something is wrong, changed, or scarce", "not in the paper",
    units, table, draw, remarks, family="adapter", apart=True,
)  # fmt: skip

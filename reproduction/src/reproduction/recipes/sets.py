"""Twenty prior sets a task, drawn as one person's differ from another's (ours).

What A and B cannot tell: how far a figure depends on the set. Closed form, its rivals without a
network, and the adapters; the network has a recipe of its own, since it takes longer. Each set goes
with a seed of its own, so intervals resample sets and goals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from reproduction.recipes.adaptation import RIDGE, TASKS, afternoons, later
from reproduction.recipes.base import TASK, Picture, Planned, Recipe, Scale
from reproduction.recipes.generators import METHODS, Method
from reproduction.recipes.tables import Columns, Table, mean_of
from reproduction.results import FIRST, TRIALS, Results, reached

SETS = tuple((f"v{k:02d}", k) for k in range(20))
"""Names and seeds (reproduction/docs/reproduce.md)."""
RULES = (
    ("bayes", True, "Bayesian, earlier goals too"),
    ("gp-two-term-all", True, "GP of two terms, no forgetting, earlier goals too"),
    (RIDGE, True, "ridge on the spline's weights, earlier goals too"),
    ("bayes", False, "Bayesian, each goal alone"),
    ("gp-two-term", False, "GP of two terms, m = 2, each goal alone"),
    ("gp", False, "GP, m = 2, each goal alone"),
    ("proportional", False, "proportional, 0.8"),
)
"""Adapters, whether earlier goals serve them, and what each is called."""
BY_EYE, EXACT = "adapters behind closed form, by eye", "generators, exact outcomes"
_SEQUENCES, _MOST_GOALS = 2, 30
"""Afternoons of eight goals, and goals, a set: sets say more than goals do."""
_DEMONSTRATED = tuple(task for task, learned_on in TASKS.items() if task == learned_on)
"""Basketball's other variants are learned from the same demonstrations."""
CLOSED = tuple(m for m in METHODS if not m.generator.startswith(("diffusion", "regression")))
NETWORKS = METHODS[:2]
"""Generators tried on them: without a network, and a network alone with its control."""


def _scales(scale: Scale) -> list[Scale]:
    """One for each set."""
    goals = min(scale.goals, _MOST_GOALS)
    return [replace(scale, goals=goals, sets=(name,), seeds=(seed,)) for name, seed in SETS]


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """Every adapter by eye where demonstrated; every generator without a network on V1."""
    rules = [*RULES, *((choice, True, choice) for choice in include)]
    by_eye = [
        (unit, {"condition": BY_EYE, **names})
        for one in _scales(scale)
        for unit, names in afternoons(one, rules, tasks=_DEMONSTRATED, sequences=_SEQUENCES)
    ]
    return by_eye + _generators(scale, CLOSED)


def _generators(scale: Scale, methods: Sequence[Method]) -> list[Planned]:
    """As the recipe `generators`, on drawn sets."""
    return [
        (unit, {"condition": EXACT, "method": method.label})
        for one in _scales(scale)
        for method in methods
        for unit in method.trials(one)
    ]


def table(results: Results) -> Table:
    """One row a method: trials on each task and in the mean, and ours minus it."""
    compared = _compared(results)
    firsts = {condition: next(iter(methods.values())) for condition, methods in compared.items()}
    columns: Columns = {
        **{task: mean_of(TRIALS, task=task) for task in results.by("task")},
        "trials, mean": mean_of(TRIALS),
        "the first row minus it": lambda of: firsts[of.first("condition")].beside(of),
        "first trials": mean_of(FIRST),
        "within 4": mean_of(reached(4)),
        "sets": lambda of: of.where(task=TASK).sets,
    }
    rows = {(c, name): of for c, methods in compared.items() for name, of in methods.items()}
    return Table.of(("compared", "method"), rows, columns)


def _compared(results: Results) -> dict[str, dict[str, Results]]:
    """Rows that count by condition and method."""
    conditions = results.by("condition").items()
    return {c: (later(of) if c == BY_EYE else of).by("method") for c, of in conditions}


def draw(results: Results, folder: Path) -> list[Picture]:
    """A picture a condition: means of all sets, with their intervals."""
    from reproduction.recipes.charts import COLOURS, Mark, draw_rows

    pictures = []
    for condition, methods in _compared(results).items():
        mark = Mark("o", COLOURS[0], [of.mean(TRIALS) for of in methods.values()])
        kind = "adapters" if condition == BY_EYE else "generators"
        path = draw_rows(
            list(methods), {"mean": mark}, f"trials a goal: {condition}",
            folder / f"{results.first('recipe')}-{kind}.png",
        )  # fmt: skip
        n = results.where(condition=condition, task=TASK).sets
        caption = (
            f"Trials a goal ({condition}) in the mean of {n} drawn prior sets a task, with 95 % "
            "intervals over sets and goals."
        )
        pictures.append(Picture(path, caption))
    return pictures


def behind_networks(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same with a network, each learned once or shared with `trials`."""
    return _generators(scale, NETWORKS)


RECIPE = Recipe(
    "sets", "Twenty prior sets a task", "Figures 7a and 7b, on drawn sets", units, table, draw,
    family="adapter", apart=True,
)  # fmt: skip
NETWORK = Recipe(
    "sets-network", "Twenty prior sets, a network alone", "Figure 7a, on drawn sets",
    behind_networks, table, draw, apart=True,
)  # fmt: skip

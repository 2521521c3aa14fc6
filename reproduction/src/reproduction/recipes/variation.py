"""When is diffusion needed? Generators over people's variation and numbers of demonstrations.

Ours; the paper compares generators on one task. No setting was chosen on these tasks. Each has one
set of demonstrations of each kind. Outcomes are exact, so that what is compared is what a generator
makes of the demonstrations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from reproduction.evaluation import Training
from reproduction.recipes.base import Picture, Planned, Recipe, Scale
from reproduction.recipes.tables import Table
from reproduction.results import FIRST, TRIALS, Measure, Results

GENERATORS: tuple[tuple[str, str], ...] = (
    ("auto", "auto"),
    ("diffusion", "diffusion"),
    ("aligned thin-plate spline", "interpolation,kernel=thin-plate,timing=align"),
    ("diffusion, untrained", "diffusion,training_steps=0"),
)
"""What is compared is called, and its choice."""
TASKS: tuple[str, ...] = ("zoo-drag", "zoo-hoop", "zoo-arrival", "zoo-curl")
"""Tasks of the zoo's reported half, without a clock and of at most 100 frames: a network learns
them in a minute."""
SETS: tuple[str, ...] = ("clean-8", "mixed-4", "mixed-12", "styles-9")
"""Kind and number of the demonstrations (reproduction/docs/zoo.md)."""
_QUICK_SETS, _QUICK_TASKS, _QUICK_GENERATORS, _GOALS = 1, 1, 3, 30


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same goals with every generator on every set of every task; a quick run on one."""
    known, sets, tasks = GENERATORS, SETS, TASKS
    if not scale.variants:
        known, sets, tasks = known[:_QUICK_GENERATORS], sets[:_QUICK_SETS], tasks[:_QUICK_TASKS]
    some = replace(scale, goals=min(scale.goals, _GOALS))
    return [
        (
            some.trials(Training(task, f"{name}-0", choice, seed=0), "bayes", "exact"),
            {"method": label, "condition": name},
        )
        for label, choice in (*known, *((choice, choice) for choice in include))
        for name in sets
        for task in tasks
    ]


def table(results: Results) -> Table:
    """One row a kind of set, then one a task; first throws that hit, and trials."""

    def shown(rows: Results, method: str) -> str:
        of = rows.where(method=method)
        return f"{of.mean(FIRST).value:.2f}; {of.mean(TRIALS).value:.2f}"

    rows = {**results.by("condition"), **results.by("task")}
    columns = {name: partial(shown, method=name) for name in results.by("method")}
    return Table.of(("demonstrations",), rows, columns)


def draw(results: Results, folder: Path) -> list[Picture]:
    """First throws on the left, trials on the right, over the kinds of sets."""
    from reproduction.recipes.charts import Line, draw_kinds

    kinds = list(results.by("condition"))

    def line(place: int, method: str, measure: Measure) -> Line:
        of_kinds = [results.where(condition=kind, method=method) for kind in kinds]
        each = [[of.mean(measure).value for of in rows.by("task").values()] for rows in of_kinds]
        return Line(method, [rows.mean(measure) for rows in of_kinds], place, each=each)

    panels = {
        label: [line(i, method, measure) for i, method in enumerate(results.by("method"))]
        for label, measure in (("first throws that hit", FIRST), ("trials to a hit", TRIALS))
    }
    names = ["{}\n{} demos".format(*kind.rsplit("-", 1)) for kind in kinds]
    path = draw_kinds(names, panels, folder / "variation.png")
    caption = (
        f"Large: means over {len(results.by('task'))} tasks on which nothing was chosen, by what "
        "differs between the demonstrations and how many there are. Small: each task, "
        f"{results.frame['goal'].max() + 1} goals. The Bayesian adapter sees trials exactly. One "
        "set a task and kind: no intervals."
    )
    return [Picture(path, caption)]


RECIPE = Recipe(
    "variation", "When is diffusion needed?", "not in the paper", units, table, draw,
    family="generator", apart=True,
)  # fmt: skip

"""When is diffusion needed? Generators over people's variation and numbers of demonstrations.

Ours; the paper compares generators on one task. No setting was chosen on these tasks. Each has one
set of demonstrations of each kind. Outcomes are exact, so that what is compared is what a generator
makes of the demonstrations.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from prior_reinforce.lab.experiments.evaluation import Training, Trials
from prior_reinforce.lab.experiments.recipes.base import Picture, Planned, Recipe, Scale, Table
from prior_reinforce.lab.experiments.results import FIRST, TRIALS, Results

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
"""Kind and number of the demonstrations (docs/tasks/zoo.md)."""
_QUICK_SETS, _QUICK_TASKS, _QUICK_GENERATORS, _GOALS = 1, 1, 3, 30


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same goals with every generator on every set of every task; a quick run on one."""
    known, sets, tasks = GENERATORS, SETS, TASKS
    if not scale.variants:
        known, sets, tasks = known[:_QUICK_GENERATORS], sets[:_QUICK_SETS], tasks[:_QUICK_TASKS]
    goals = min(scale.goals, _GOALS)
    return [
        (
            Trials(
                Training(task, f"{name}-0", choice, seed=0), task, "bayes", "exact", goals,
                rounds=scale.rounds,
            ),
            {"method": label, "condition": name},
        )
        for label, choice in (*known, *((choice, choice) for choice in include))
        for name in sets
        for task in tasks
    ]  # fmt: skip


def table(results: Results) -> Table:
    """One row a kind of set, then one a task; first throws that hit, and trials."""
    methods = results.by("method")

    def cells(**of: str) -> list[str]:
        rows = [method.where(**of) for method in methods.values()]
        return [f"{row.mean(FIRST).value:.2f}; {row.mean(TRIALS).value:.2f}" for row in rows]

    rows = [(name, *cells(condition=name)) for name in results.by("condition")]
    rows += [(task, *cells(task=task)) for task in results.by("task")]
    return Table(("demonstrations", *methods), tuple(rows))


def draw(results: Results, folder: Path) -> list[Picture]:
    """First throws on the left, trials on the right, over the kinds of sets."""
    from prior_reinforce.lab.experiments.recipes.charts import Line, draw_kinds

    kinds = list(results.by("condition"))
    panels = {}
    for label, measure in (("first throws that hit", FIRST), ("trials to a hit", TRIALS)):
        panels[label] = [
            Line(
                method,
                [rows.where(condition=kind).mean(measure) for kind in kinds],
                place,
                each=[
                    [of.mean(measure).value for of in of_kind.by("task").values()]
                    for of_kind in rows.by("condition").values()
                ],
            )
            for place, (method, rows) in enumerate(results.by("method").items())
        ]
    path = draw_kinds([_in_words(kind) for kind in kinds], panels, folder / "variation.png")
    caption = (
        f"Large: means over {len(results.by('task'))} tasks on which nothing was chosen, by what "
        "differs between the demonstrations and how many there are. Small: each task, "
        f"{results.frame['goal'].max() + 1} goals. The Bayesian adapter sees trials exactly. One "
        "set a task and kind: no intervals."
    )
    return [Picture(path, caption)]


def _in_words(name: str) -> str:
    """A set's kind and number, on two lines."""
    kind, count = name.rsplit("-", 1)
    return f"{kind}\n{count} demos"


RECIPE = Recipe(
    "variation", "When is diffusion needed?", "not in the paper", units, table, draw,
    family="generator", apart=True,
)  # fmt: skip

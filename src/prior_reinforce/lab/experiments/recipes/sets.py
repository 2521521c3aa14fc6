"""Twenty prior sets a task, drawn as one person's differ from another's (ours).

What A and B cannot tell: how far a figure depends on the set. Closed form, its rivals without a
network, and the adapters; the network has a recipe of its own, since it takes longer. Each set goes
with a seed of its own, so intervals resample sets, seeds and goals.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from prior_reinforce.lab.experiments.evaluation import Training, Trials
from prior_reinforce.lab.experiments.recipes.adaptation import GENERATOR, GOALS, RIDGE, TASKS, later
from prior_reinforce.lab.experiments.recipes.base import (
    TASK,
    Picture,
    Planned,
    Recipe,
    Scale,
    Table,
)
from prior_reinforce.lab.experiments.recipes.generators import METHODS
from prior_reinforce.lab.experiments.results import FIRST, TRIALS, Results, reached
from prior_reinforce.lab.experiments.sequences import Afternoons

SETS = tuple((f"v{k:02d}", k) for k in range(20))
"""Names and seeds (docs/reproduce.md)."""
RULES = (
    ("bayes", True, "Bayesian, earlier goals too"),
    ("gp-all", True, "GP, no forgetting, earlier goals too"),
    (RIDGE, True, "ridge on the spline's weights, earlier goals too"),
    ("bayes", False, "Bayesian, each goal alone"),
    ("gp", False, "GP, m = 2, each goal alone"),
    ("gp-one-term", False, "GP of the paper, each goal alone"),
    ("proportional", False, "proportional, 0.8"),
)
"""Adapters, whether earlier goals serve them, and what each is called."""
_BY_EYE, _EXACT = "adapters behind closed form, by eye", "generators, exact outcomes"
_SEQUENCES, _MOST_GOALS = 2, 30
"""Afternoons of eight goals, and goals, a set: sets say more than goals do."""
_DEMONSTRATED = tuple(task for task, learned_on in TASKS.items() if task == learned_on)
"""Basketball's other variants are learned from the same demonstrations."""
_CLOSED = tuple(m for m in METHODS if not m.generator.startswith(("diffusion", "regression")))
_NETWORKS = tuple(m for m in METHODS[:2])


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """Every adapter by eye where demonstrated; every generator without a network on V1."""
    rules = [*RULES, *((choice, True, choice) for choice in include)]
    by_eye: list[Planned] = [
        (
            Afternoons(
                Training(task, name, GENERATOR, seed, perception="eye"), task, adapter, "eye",
                carried, _SEQUENCES, GOALS, scale.rounds,
            ),
            {"condition": _BY_EYE, "method": label},
        )
        for name, seed in SETS
        for task in _DEMONSTRATED
        for adapter, carried, label in rules
    ]  # fmt: skip
    return by_eye + _generators(scale, [(m.label, m.generator) for m in _CLOSED])


def _generators(scale: Scale, methods: Sequence[tuple[str, str]]) -> list[Planned]:
    """As the recipe `generators`, on drawn sets."""
    goals = min(scale.goals, _MOST_GOALS)
    return [
        (
            Trials(
                Training(TASK, name, choice, seed), TASK, "gp", "amplified", goals,
                rounds=scale.rounds,
            ),
            {"condition": _EXACT, "method": label},
        )
        for name, seed in SETS
        for label, choice in methods
    ]  # fmt: skip


def table(results: Results) -> Table:
    """One row a method: trials on each task and in the mean, and ours minus it."""
    tasks = list(results.by("task"))
    rows = []
    for condition, of in results.by("condition").items():
        counted = later(of) if condition == _BY_EYE else of
        methods = counted.by("method")
        ours = next(iter(methods.values()))
        for name, one in methods.items():
            rows.append(
                (
                    condition,
                    name,
                    *(_said(one.where(task=task)) for task in tasks),
                    str(one.mean(TRIALS)),
                    "" if one is ours else f"{ours.minus(one, TRIALS):+.2f}",
                    str(one.mean(FIRST)),
                    str(one.mean(reached(4))),
                    str(one.where(task=TASK).trainings),
                )
            )
    header = (
        "compared", "method", *tasks, "trials, mean", "the first row minus it", "first trials",
        "within 4", "sets",
    )  # fmt: skip
    return Table(header, tuple(rows))


def _said(of: Results) -> str:
    return "" if of.empty else str(of.mean(TRIALS))


def draw(results: Results, folder: Path) -> list[Picture]:
    """A picture a condition: means of all sets, with their intervals."""
    from prior_reinforce.lab.experiments.recipes.charts import COLOURS, Mark, draw_rows

    recipe = results.frame["recipe"].iloc[0]
    pictures = []
    for condition, of in results.by("condition").items():
        methods = (later(of) if condition == _BY_EYE else of).by("method")
        mark = Mark("o", COLOURS[0], [one.mean(TRIALS) for one in methods.values()])
        name = f"{recipe}-{'adapters' if condition == _BY_EYE else 'generators'}.png"
        path = draw_rows(
            list(methods), {"mean": mark}, f"trials a goal: {condition}", folder / name
        )
        caption = (
            f"Trials a goal ({condition}) in the mean of {of.where(task=TASK).trainings} drawn "
            "prior sets a task, with 95 % intervals over sets, seeds and goals."
        )
        pictures.append(Picture(path, caption))
    return pictures


def behind_networks(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """The same with a network, each learned once or shared with `trials`."""
    return _generators(scale, [(m.label, m.generator) for m in _NETWORKS])


RECIPE = Recipe(
    "sets", "Twenty prior sets a task", "not in the paper", units, table, draw,
    family="adapter", apart=True,
)  # fmt: skip
NETWORK = Recipe(
    "sets-network", "Twenty prior sets, a network alone", "not in the paper",
    behind_networks,
    table, draw, apart=True,
)  # fmt: skip

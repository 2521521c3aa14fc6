"""The paper's form of the generator behind its adapters, on every task and its fields (hours).

The same comparisons as `adapters`, `trials` and `displacement`, behind the network on whole plans
that `generators` names, for each prior set and seed. Outcomes of the demonstrations are exact, so
that one training serves all: a network in this form takes ten to twenty minutes of a core.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from reproduction.evaluation import Training
from reproduction.recipes.adapters import ADAPTERS
from reproduction.recipes.base import Planned, Recipe, Scale
from reproduction.recipes.displacement import Displacement, widest_three
from reproduction.recipes.generators import (
    AMPLIFIED,
    FRESH,
    PAPERS_FORM,
    FreshNoiseTrials,
)
from reproduction.recipes.tables import Table, table_by_round
from reproduction.results import Results

_OF_THE_PAPER = "GP, m = 2"
_V1 = {"basketball-v1": "V1", "basketball-v2": "V2", "basketball-v3": "V3"}
_ELSEWHERE = ("curling", "fishing")
_SEEDS = 2
"""Training seeds a prior set on these, and of three demonstrations: they serve one row each."""
_UNSEEN_GOALS = 5


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """Every adapter under amplified noise on V1; the paper's by eye on every task; fields."""
    planned: list[Planned] = []
    for seed in scale.seeds:
        one = replace(scale, seeds=(seed,))
        for t in one.trainings(PAPERS_FORM):
            planned += _on_v1(t, scale, include)
        if seed not in scale.seeds[:_SEEDS]:
            continue
        for t in one.trainings(PAPERS_FORM):
            few = replace(t, subset=widest_three(t.recorded().outcomes_seen))
            planned.append((Displacement(few), {"method": "three demonstrations"}))
        for task in _ELSEWHERE:
            for t in one.trainings(PAPERS_FORM, task):
                planned += _by_eye(t, task, task, scale)
    return planned


def _on_v1(training: Training, scale: Scale, include: Sequence[str]) -> list[Planned]:
    adapters = {**ADAPTERS, **{choice: choice for choice in include}}
    tried = {name: scale.trials(training, of, "amplified") for name, of in adapters.items()}
    tried[FRESH] = FreshNoiseTrials(**vars(tried["no adapter"]))
    return [
        *((unit, {"condition": AMPLIFIED, "method": name}) for name, unit in tried.items()),
        *(p for task, label in _V1.items() for p in _by_eye(training, task, label, scale)),
        (Displacement(training), {"method": "all demonstrations"}),
    ]


def _by_eye(training: Training, task: str, label: str, scale: Scale) -> list[Planned]:
    """The paper's adapter by eye, on unseen goals and on uniform ones."""
    adapter, names = ADAPTERS[_OF_THE_PAPER], {"condition": f"{label}, by eye"}
    tried = [
        scale.trials(training, adapter, "eye", task=task, goals=goals, unseen=unseen)
        for unseen, goals in ((True, _UNSEEN_GOALS), (False, scale.goals))
    ]
    return [(unit, {**names, "method": _OF_THE_PAPER}) for unit in tried]


def table(results: Results) -> Table:
    """One row a condition and adapter."""
    tried = {
        f"{label}, {condition}": of
        for condition, rows in results.by("condition").items()
        for label, of in rows.by("method").items()
    }
    return table_by_round(tried, "adapter", next(iter(tried)))


RECIPE = Recipe(
    "papers-form", "The paper's form of the generator", "Figures 7b, 8, Table II", units, table,
    family="adapter", apart=True,
)  # fmt: skip

"""The paper's form of the generator behind its adapters, on its tasks of one prior set (hours).

The same comparisons as `adapters`, `trials` and `displacement`, behind the network on whole plans
that `generators` names, for each prior set and seed. Outcomes of the demonstrations are exact, so
that one training serves all: a network in this form takes twenty minutes of a core.
"""

from __future__ import annotations

from collections.abc import Sequence

from prior_reinforce.lab.experiments.evaluation import Trials
from prior_reinforce.lab.experiments.recipes.adapters import ADAPTERS
from prior_reinforce.lab.experiments.recipes.base import (
    Planned,
    Recipe,
    Scale,
    Table,
    table_by_round,
)
from prior_reinforce.lab.experiments.recipes.displacement import Displacement
from prior_reinforce.lab.experiments.recipes.generators import PAPERS_FORM
from prior_reinforce.lab.experiments.results import Results

_OF_THE_PAPER = "GP, one term, m = 2"
_EYE = {"basketball-v1": "V1, by eye", "basketball-v2": "V2, by eye", "basketball-v3": "V3, by eye"}
_UNSEEN_GOALS = 5


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """Every adapter under amplified noise; the paper's by eye on V1, V2, V3; the field."""
    planned: list[Planned] = []
    for t in sorted(scale.trainings(PAPERS_FORM), key=lambda t: t.seed):
        adapters = {**ADAPTERS, **{choice: choice for choice in include}}
        planned += [
            (
                Trials(t, t.task, adapter, "amplified", scale.goals, rounds=scale.rounds),
                {"condition": "amplified noise", "method": label},
            )
            for label, adapter in adapters.items()
        ]
        planned += [
            (
                Trials(
                    t, task, ADAPTERS[_OF_THE_PAPER], "eye",
                    _UNSEEN_GOALS if unseen else scale.goals, unseen=unseen, rounds=scale.rounds,
                ),
                {"condition": label, "method": _OF_THE_PAPER},
            )
            for task, label in _EYE.items()
            for unseen in (True, False)
        ]  # fmt: skip
        planned.append((Displacement(t), {"method": "all demonstrations"}))
    return planned


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

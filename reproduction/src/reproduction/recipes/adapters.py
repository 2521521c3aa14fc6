"""Adapters under amplified noise, behind the same generators (paper, Figure 7b).

The demonstrations' outcomes are perceived by eye, as in the table of trials; the noise of the
trials is amplified. So the generator learns from outcomes that are off by up to 5 cm along each
axis, and there is something to adapt. GP: Gaussian process, of two noise sizes (ours) or one (the
paper's; reproduction/docs/decisions-adapter.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from reproduction.recipes.base import Picture, Planned, Recipe, Scale
from reproduction.recipes.tables import Table, table_by_round
from reproduction.results import Results

ADAPTERS = {
    "GP of two terms, m = 2": "gp-two-term",
    "GP of two terms, no forgetting": "gp-two-term-all",
    "GP, m = 2": "gp",
    "GP, no forgetting": "gp-all",
    "proportional, 0.8": "proportional",
    "no adapter": "frozen",
}
"""The adapters compared by what each is called in tables and pictures."""
_OURS = "GP of two terms, m = 2"


def units(scale: Scale, include: Sequence[str] = (), generator: str = "diffusion") -> list[Planned]:
    """The same goals with every adapter."""
    compared = {**ADAPTERS, **{c: c for c in include if c not in ADAPTERS.values()}}
    return [
        (scale.trials(training, choice, "amplified"), {"method": name})
        for name, choice in compared.items()
        for training in scale.trainings(generator, perception="eye")
    ]


def table(results: Results) -> Table:
    """One row an adapter."""
    return table_by_round(results.by("method"), "adapter", _OURS)


def draw(results: Results, folder: Path) -> list[Picture]:
    """Shares reached, and how far the Gaussian process is above the others."""
    from reproduction.recipes.charts import Line, Panel, curve, draw_success

    methods = results.by("method")
    lines = [
        Line(name, curve(rows), i, dashed=name not in ADAPTERS)
        for i, (name, rows) in enumerate(methods.items())
    ]
    minus = [
        replace(line, curve=curve(methods[_OURS], methods[line.label]))
        for line in lines
        if line.label != _OURS
    ]
    caption = (
        "Left: share of goals reached within so many rounds, a network alone behind every adapter, "
        "its demonstrations seen by eye, the trials under amplified noise. Right: the paired "
        "difference; above zero the Gaussian process with m = 2 is ahead. Bars: 95 % intervals "
        "over sets and goals."
    )
    panels = [Panel("", lines), Panel("", minus, difference=f"{_OURS}, minus it")]
    return [Picture(draw_success(panels, folder / "adapters.png"), caption)]


RECIPE = Recipe(
    "adapters", "Adapters under amplified noise", "Figure 7b", units, table, draw, family="adapter"
)

"""The picture of the table of trials: one line a row, the paper's mean beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.ticker import MaxNLocator

from prior_reinforce.experiments.statistics import Interval
from prior_reinforce.report.style import (
    GOAL,
    INK,
    calm_axes,
    drawing,
    new_figure,
    save_png,
)

_MANY, _UNSEEN = "#0072b2", "#56b4e9"  # Okabe and Ito 2008; markers differ as well
_APART = 0.24
"""Between the three marks of a row, of the distance between rows."""


@dataclass(frozen=True)
class TrialsRow:
    """One line."""

    label: str
    unseen: Interval
    """Mean trials on the paper's number of goals."""
    many: Interval
    """Mean trials on many goals."""
    paper: float
    """The paper's mean."""
    paper_sd: float
    """The paper's standard deviation."""


@drawing()
def draw_trials(rows: Sequence[TrialsRow], path: Path) -> Path:
    """Draw all rows, the first on top.

    Returns:
        The path.
    """
    figure = new_figure(8.2, 1.5 + 0.62 * len(rows))
    axes = figure.subplots()
    calm_axes(axes)
    axes.grid(visible=False, axis="y")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    for i, row in enumerate(rows):
        axes.errorbar(
            row.paper,
            i - _APART,
            xerr=row.paper_sd,
            fmt="D",
            color=GOAL,
            elinewidth=1,
            markersize=6,
            label="paper, real arm (standard deviation)" if i == 0 else None,
        )
        for interval, offset, colour, marker, label in (
            (row.many, 0.0, _MANY, "o", "ours, many goals (95 % interval)"),
            (row.unseen, _APART, _UNSEEN, "s", "ours, five unseen goals a set (95 % interval)"),
        ):
            reach = [[interval.value - interval.low], [interval.high - interval.value]]
            axes.errorbar(
                interval.value,
                i + offset,
                xerr=reach,
                fmt=marker,
                color=colour,
                markersize=6.5,
                capsize=3,
                label=label if i == 0 else None,
            )
    axes.set_yticks(range(len(rows)), [row.label for row in rows], color=INK, fontsize=10.5)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(left=0.8)
    axes.set_xlabel("Stage-2 trials to the first hit")
    figure.legend(loc="outside lower center", frameon=False, fontsize=9.5, labelcolor=INK)
    return save_png(figure, path)

"""The picture of success fraction by round: one line a method, its interval at every round."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from prior_reinforce.experiments.recipes.success import Curve
from prior_reinforce.report.style import (
    INK,
    INK_SOFT,
    calm_axes,
    drawing,
    new_figure,
    save_png,
)

# Okabe and Ito 2008, "Color Universal Design"; a marker goes with each, so that nothing is said by
# colour alone.
_COLOURS = ("#0072b2", "#d55e00", "#e69f00", "#cc79a7", "#009e73", "#56b4e9", "#000000", "#999999")
_MARKERS = ("o", "s", "D", "^", "v", "P", "X", "*")
_SPREAD = 0.34
"""Part of a round over which the methods' markers are spread, so that their bars do not hide one
another."""


@dataclass(frozen=True)
class Line:
    """One method."""

    label: str
    curve: Curve
    place: int
    """Which colour and marker; the same method has the same in every panel."""
    dashed: bool = False


@dataclass(frozen=True)
class Panel:
    """Methods on one pair of axes."""

    title: str
    lines: Sequence[Line]
    """The first is ours where shares are drawn: on top, and thicker."""
    difference: str = ""
    """Label of the vertical axis where the curves are differences; shares of goals without."""


@drawing()
def draw_success(panels: Sequence[Panel], path: Path) -> Path:
    """Draw panels side by side.

    Args:
        panels: At least one.
        path: PNG to write.

    Returns:
        The path.
    """
    figure = new_figure(5.6 * len(panels), 5.2)
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _draw_panel(axes, panel)
        axes.set_title(panel.title, loc="left", fontsize=12, color=INK)
        axes.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.14),
            ncols=2,
            frameon=False,
            fontsize=9.5,
            labelcolor=INK,
        )
    return save_png(figure, path)


def _draw_panel(axes: Axes, panel: Panel) -> None:
    calm_axes(axes)
    lines, shares = panel.lines, not panel.difference
    n_rounds = len(lines[0].curve)
    offsets = np.linspace(-_SPREAD / 2, _SPREAD / 2, len(lines)) if len(lines) > 1 else [0.0]
    for i, (line, offset) in enumerate(zip(lines, offsets, strict=True)):
        value, low, high = (
            np.array([point[key] for point in line.curve]) for key in ("value", "low", "high")
        )
        axes.errorbar(
            np.arange(1, n_rounds + 1) + offset,
            value,
            yerr=[value - low, high - value],
            color=_COLOURS[line.place % len(_COLOURS)],
            marker=_MARKERS[line.place % len(_MARKERS)],
            markersize=5.5,
            linewidth=2.6 if shares and i == 0 else 1.5,
            linestyle="--" if line.dashed else "-",
            elinewidth=1.1,
            zorder=10 - i,
            label=line.label,
            clip_on=False,
        )
    axes.set_xlim(0.5, n_rounds + 0.5)
    if shares:
        axes.set_ylim(0, 1.02)
    else:
        axes.axhline(0.0, color=INK, linewidth=1.0)
    axes.set_ylabel(panel.difference or "share of goals reached")
    axes.set_xticks(range(1, n_rounds + 1))
    axes.set_xlabel("round")
    axes.tick_params(labelcolor=INK_SOFT)

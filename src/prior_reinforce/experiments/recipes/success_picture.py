"""The picture of success fraction by round: one line a method, its interval at every round."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
_COLOURS = ("#0072b2", "#d55e00", "#e69f00", "#cc79a7", "#009e73", "#56b4e9", "#000000")
_MARKERS = ("o", "s", "D", "^", "v", "P", "X")
_SPREAD = 0.34
"""Part of a round over which the methods' markers are spread, so that their bars do not hide one
another."""


@dataclass(frozen=True)
class Line:
    """One method."""

    label: str
    success: Curve
    place: int
    """Which colour and marker; the same method has the same in every panel."""
    dashed: bool = False


@drawing()
def draw_success(panels: Mapping[str, Sequence[Line]], path: Path) -> Path:
    """Draw panels side by side.

    Args:
        panels: Lines by the panel's title; the first line is ours, drawn on top and thicker.
        path: PNG to write.

    Returns:
        The path.
    """
    figure = new_figure(5.6 * len(panels), 5.2)
    for axes, (title, lines) in zip(
        figure.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels.items(), strict=True
    ):
        _draw_panel(axes, lines)
        axes.set_title(title, loc="left", fontsize=12, color=INK)
        axes.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.14),
            ncols=2,
            frameon=False,
            fontsize=9.5,
            labelcolor=INK,
        )
    figure.axes[0].set_ylabel("share of goals reached")
    return save_png(figure, path)


def _draw_panel(axes: Axes, lines: Sequence[Line]) -> None:
    calm_axes(axes)
    n_rounds = len(lines[0].success)
    offsets = np.linspace(-_SPREAD / 2, _SPREAD / 2, len(lines)) if len(lines) > 1 else [0.0]
    for i, (line, offset) in enumerate(zip(lines, offsets, strict=True)):
        value, low, high = (
            np.array([point[key] for point in line.success]) for key in ("value", "low", "high")
        )
        axes.errorbar(
            np.arange(1, n_rounds + 1) + offset,
            value,
            yerr=[value - low, high - value],
            color=_COLOURS[line.place % len(_COLOURS)],
            marker=_MARKERS[line.place % len(_MARKERS)],
            markersize=5.5,
            linewidth=2.6 if i == 0 else 1.5,
            linestyle="--" if line.dashed else "-",
            elinewidth=1.1,
            zorder=10 - i,
            label=line.label,
            clip_on=False,
        )
    axes.set_xlim(0.5, n_rounds + 0.5)
    axes.set_ylim(0, 1.02)
    axes.set_xticks(range(1, n_rounds + 1))
    axes.set_xlabel("round")
    axes.tick_params(labelcolor=INK_SOFT)

"""The region as an adapter knows it: where a first throw would hit, and where to learn more."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from prior_reinforce.arrays import Point, Points
from prior_reinforce.report.style import (
    DEMONSTRATION,
    GOAL,
    HIT,
    INK,
    INK_SOFT,
    calm_axes,
    drawing,
    new_figure,
    save_png,
)


@drawing()
def draw_advice(
    path: Path,
    goals: Points,
    p_hit: Float[np.ndarray, " n"],
    demonstrated: Float[np.ndarray, "N k"],
    throw: Point,
    demonstration: Point,
    outcome: tuple[Sequence[str], Sequence[str]],
) -> Path:
    """Draw it.

    Args:
        path: PNG.
        goals: A grid, shape (n, 2), the second component fastest.
        p_hit: Probability that a first throw hits each.
        demonstrated: Outcomes of the demonstrations.
        throw: Goal of the throw that teaches most.
        demonstration: Where the demonstration that teaches most ends.
        outcome: Names and units of the two components.

    Returns:
        The path.
    """
    x, y = (np.unique(goals[:, j]) for j in range(2))
    names, units = outcome
    # As high as the region at this width, and what stands below it.
    height = 4.8 * np.ptp(x) / np.ptp(y) if units[0] == units[1] else 3.0
    figure = new_figure(6.4, 1.1 + float(np.clip(height, 1.5, 6.0)))
    axes = figure.add_subplot()
    calm_axes(axes, grid=False)
    # As seen from the robot: ahead is up, left is left.
    shade = axes.pcolormesh(
        y, x, p_hit.reshape(len(x), len(y)), cmap="Greys", vmin=0.0, vmax=1.0, shading="gouraud"
    )
    bar = figure.colorbar(shade, ax=axes)
    bar.set_label("first throw hits", color=INK_SOFT)
    bar.ax.tick_params(labelsize=9, colors=INK_SOFT)
    marks = (
        (demonstrated, "o", DEMONSTRATION, "demonstrated"),
        (throw[None], "*", GOAL, "throw that teaches most"),
        (demonstration[None], "D", HIT, "demonstration that teaches most"),
    )
    for points, mark, colour, label in marks:
        axes.scatter(
            points[:, 1], points[:, 0], marker=mark, s=90 if mark == "*" else 42, color=colour,
            edgecolors=INK, linewidths=0.8, label=label, zorder=3,
        )  # fmt: skip
    axes.invert_xaxis()
    axes.set_xlabel(f"{names[1]} [{units[1]}]")
    axes.set_ylabel(f"{names[0]} [{units[0]}]")
    if units[0] == units[1]:
        axes.set_aspect("equal")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3, frameon=False, fontsize=8)
    return save_png(figure, path)

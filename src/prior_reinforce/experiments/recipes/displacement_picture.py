"""The picture of displacement fields: arrows over a heat map, as seen from behind the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import ListedColormap
from matplotlib.patches import Rectangle

from prior_reinforce.report.style import INK, calm_axes, drawing, new_figure, save_png

_LARGEST_SHOWN = 10.0
"""Errors from here on have one colour, in [cm]: else a few far misses would hide all else."""
# The light part of matplotlib's Blues, on which dark arrows can be seen.
_COLOURS = ListedColormap(colormaps["Blues"](np.linspace(0.0, 0.62, 128)))
_DEMONSTRATION = "#f0c800"


@dataclass(frozen=True, eq=False)
class Field:
    """What one training does to the goals asked of it."""

    title: str
    axes: tuple[np.ndarray, ...]
    """Coordinates of the grid along x and y, shapes (nx,) and (ny,), [m]."""
    displacements: np.ndarray
    """r(c) - c, shape (nx, ny, 2), [m]."""
    outcomes: np.ndarray
    """Where the demonstrations landed, shape (N, 2), [m]."""


@drawing()
def draw_fields(fields: Sequence[Field], region: np.ndarray, path: Path) -> Path:
    """Draw fields one above the other, y to the left and x upwards.

    Args:
        fields: At least one.
        region: Reachable region, lower and upper corner, shape (2, 2), [m].
        path: PNG to write.

    Returns:
        The path.
    """
    figure = new_figure(8.6, 5.0 * len(fields))
    for axes, field in zip(
        figure.subplots(len(fields), 1, squeeze=False)[:, 0], fields, strict=True
    ):
        calm_axes(axes, grid=False)
        x, y = (100 * axis for axis in field.axes)
        arrows = 100 * field.displacements
        colours = axes.pcolormesh(
            y, x, np.linalg.norm(arrows, axis=-1), cmap=_COLOURS, vmin=0, vmax=_LARGEST_SHOWN,
            shading="nearest", rasterized=True,
        )  # fmt: skip
        axes.quiver(
            y, x, arrows[..., 1], arrows[..., 0],
            angles="xy", scale_units="xy", scale=1, width=0.0022, color=INK, clip_on=True,
        )  # fmt: skip
        axes.plot(
            *100 * field.outcomes[:, ::-1].T, "o", markersize=11, color=_DEMONSTRATION,
            markeredgecolor=INK, zorder=5,
        )  # fmt: skip
        (x_low, y_low), (x_high, y_high) = 100 * region
        axes.add_patch(
            Rectangle(
                (y_low, x_low), y_high - y_low, x_high - x_low,
                fill=False, linestyle="--", edgecolor=INK, linewidth=1.2,
            )
        )  # fmt: skip
        axes.set_aspect("equal")
        axes.set_xlim(y[-1], y[0])
        axes.set_ylim(x[0], x[-1])
        axes.set_title(field.title, loc="left", fontsize=12, color=INK)
        axes.set_xlabel("← left      y [cm]      right →")
        axes.set_ylabel("x, away from the robot [cm]")
        bar = figure.colorbar(colours, ax=axes, extend="max", shrink=0.9, pad=0.02)
        bar.set_label("distance from goal to landing [cm]")
        bar.outline.set_visible(False)
    return save_png(figure, path)

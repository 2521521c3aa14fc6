"""Numbered badges beside points, moved apart where they would cover each other.

By eye, errors are rounded, so two trials are often seen at the very same place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from prior_reinforce.report.style import text_on

_SIZE = 15.0  # [points], diameter of a badge
_DISTANCE = 15.0  # [points], from a point to the middle of its badge, on the innermost ring
_DIRECTIONS = np.linspace(0, 2 * np.pi, 16, endpoint=False)


def draw_badges(
    figure: Figure,
    axes: Axes,
    points: np.ndarray,
    labels: Sequence[str],
    colours: Sequence[str],
    *,
    away_from: np.ndarray,
    avoid: np.ndarray | None = None,
) -> None:
    """Draw a numbered badge near each point.

    Args:
        figure: The figure of `axes`.
        axes: Prepared axes; their limits must not change afterwards.
        points: Shape (n, 2), in data coordinates.
        labels: One a point.
        colours: One a point.
        away_from: Where badges should not point to (the goal), shape (2,), data coordinates.
        avoid: Other marks that badges should not cover, shape (m, 2), data coordinates.
    """
    if not len(points):
        return
    # Lay out now, so that data coordinates have a place on paper, and leave it at that.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    points_per_pixel = 72 / figure.dpi
    pixels = axes.transData.transform(points) * points_per_pixel
    centre = axes.transData.transform(away_from) * points_per_pixel
    marks = pixels
    if avoid is not None and len(avoid):
        marks = np.concatenate([pixels, axes.transData.transform(avoid) * points_per_pixel])
    box = axes.get_window_extent()
    frame = np.array([[box.x0, box.y0], [box.x1, box.y1]]) * points_per_pixel
    taken: list[np.ndarray] = []
    for place, point, label, colour in zip(points, pixels, labels, colours, strict=True):
        offset = _offset(point, centre, marks, taken, frame)
        taken.append(point + offset)
        axes.annotate(
            label,
            xy=(float(place[0]), float(place[1])),
            xytext=tuple(offset),
            textcoords="offset points",
            ha="center",
            va="center_baseline",
            fontsize=8.5,
            fontweight="bold",
            color=text_on(colour),
            bbox={"boxstyle": "circle,pad=0.28", "facecolor": colour, "edgecolor": "white"},
            zorder=8,
        )


def _offset(
    point: np.ndarray,
    centre: np.ndarray,
    marks: np.ndarray,
    taken: list[np.ndarray],
    frame: np.ndarray,
) -> np.ndarray:
    """Find the free place that points best away from the centre, all in [points] of the page."""
    away = point - centre
    angle = np.arctan2(away[1], away[0]) if np.linalg.norm(away) > 1 else np.pi / 4
    best, best_cost = np.zeros(2), np.inf
    for ring in (1.0, 1.6, 2.2, 2.8):
        for direction in _DIRECTIONS + angle:
            offset = ring * _DISTANCE * np.array([np.cos(direction), np.sin(direction)])
            place = point + offset
            cost = 4 * (ring - 1) + 1 - np.cos(direction - angle)
            cost += 100 * sum(np.linalg.norm(place - other) < 1.1 * _SIZE for other in taken)
            cost += 3 * float(np.sum(np.linalg.norm(marks - place, axis=1) < 0.7 * _SIZE))
            outside = np.any(place < frame[0] + _SIZE / 2) or np.any(place > frame[1] - _SIZE / 2)
            cost += 50 * bool(outside)
            if cost < best_cost:
                best, best_cost = offset, cost
    return best

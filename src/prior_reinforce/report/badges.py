"""Labels beside points, moved apart where they would cover each other.

By eye, errors are rounded, so two trials are often seen at the very same place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from prior_reinforce.report.style import text_on

_Place = Float[np.ndarray, "2"]

_HEIGHT = 15.0  # [points], of a badge
_LETTER = 6.0  # [points], by which each further letter widens it
_RINGS = (1.0, 1.6, 2.2, 2.8)
_TURNS = np.linspace(0, 2 * np.pi, 16, endpoint=False)


def draw_badges(
    axes: Axes,
    places: Sequence[_Place],
    labels: Sequence[str],
    colours: Sequence[str],
    *,
    away_from: _Place,
    avoid: Sequence[_Place] = (),
) -> None:
    """Draw a label near each place; all places are in data coordinates.

    The figure is laid out, and the limits of its axes must not change afterwards. Badges point
    `away_from` a place (the goal), and cover none of the marks to `avoid`.
    """
    longest = max(map(len, labels), default=1)
    size = np.array([_HEIGHT + _LETTER * (longest - 1), _HEIGHT])
    radii = (size + _HEIGHT) / 2
    to_points = 72 / axes.figure.dpi
    centre = axes.transData.transform(away_from) * to_points
    marks = axes.transData.transform(np.array([*places, *avoid]).reshape(-1, 2)) * to_points
    low, high = axes.get_window_extent().get_points() * to_points
    taken: list[_Place] = []

    def cost(mark: _Place, offset: _Place, detour: float) -> float:
        place = mark + offset
        outside = np.any((place < low + size / 2) | (place > high - size / 2))
        covered = np.linalg.norm((marks - place) / size, axis=1) < 0.7
        clashes = [np.linalg.norm((place - other) / size) < 1.1 for other in taken]
        return detour + 100 * sum(clashes) + 50 * bool(outside) + 3 * float(covered.sum())

    for place, mark, label, colour in zip(places, marks, labels, colours, strict=False):
        away = mark - centre
        angle = np.arctan2(away[1], away[0]) if np.linalg.norm(away) > 1 else np.pi / 4
        choices = [
            (ring * radii * [np.cos(angle + turn), np.sin(angle + turn)], 4 * ring - np.cos(turn))
            for ring in _RINGS
            for turn in _TURNS
        ]
        offset, _ = min(choices, key=lambda choice: cost(mark, *choice))
        taken.append(mark + offset)
        shape = "circle,pad=0.28" if longest == 1 else "round,pad=0.25,rounding_size=0.7"
        axes.annotate(
            label,
            xy=tuple(place),
            xytext=tuple(offset),
            textcoords="offset points",
            ha="center",
            va="center_baseline",
            fontsize=8.5,
            fontweight="bold",
            color=text_on(colour),
            bbox={"boxstyle": shape, "facecolor": colour, "edgecolor": "white"},
            zorder=8,
        )

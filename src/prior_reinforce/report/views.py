"""From which side outcomes are drawn: a line for k = 1, from above for 2, also from the side for 3.

From above, the picture is what an operator behind the robot sees: x forward is up, y left is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.report.style import calm_axes
from prior_reinforce.report.wording import direction_words, display_factor, display_unit


@dataclass(frozen=True)
class View:
    """A projection of outcomes onto paper."""

    horizontal: int
    """Component drawn to the right, or to the left if `mirrored`."""
    vertical: int | None
    """Component drawn upwards; None for a line, where trials stand below each other instead."""
    mirrored: bool
    title: str = ""

    def project(self, points: np.ndarray, rows: np.ndarray | float = 0.0) -> np.ndarray:
        """Place outcomes on paper.

        Args:
            points: Shape (..., k), in the unit shown.
            rows: Row of each point on a line, from the top; ignored by other views.

        Returns:
            Paper coordinates, shape (..., 2). Mirroring is left to the axes.
        """
        across = points[..., self.horizontal]
        up = (
            points[..., self.vertical]
            if self.vertical is not None
            else np.broadcast_to(-np.asarray(rows, dtype=float), across.shape)
        )
        return np.stack([across, up], axis=-1)


def views_of(record: AdaptationRecord) -> tuple[View, ...]:
    """Choose the views that together show all k components."""
    k = record.outcome_dim
    if k == 1:
        return (View(0, None, mirrored=False),)
    if k == 2:
        return (View(1, 0, mirrored=True),) if record.in_words else (View(0, 1, mirrored=False),)
    if record.in_words:
        return (
            View(1, 0, mirrored=True, title="from above"),
            View(0, 2, mirrored=False, title="from the side"),
        )
    return tuple(View(i, i + 1, mirrored=False) for i in range(k - 1))


def prepare_axes(
    axes: Axes,
    view: View,
    record: AdaptationRecord,
    extent: np.ndarray,
    *,
    ratio: float,
    n_rows: int,
) -> None:
    """Set limits, labels and scale so that data coordinates can be turned into paper at once.

    Args:
        axes: To prepare.
        view: What is drawn in it.
        record: Names and units of the components.
        extent: Lower and upper corner to be seen, shape (2, k), in the unit shown.
        ratio: Width over height that the panel has inside its labels.
        n_rows: Rows of a line.
    """
    calm_axes(axes, grid=view.vertical is not None)
    equal = view.vertical is not None and display_unit(record, view.horizontal) == display_unit(
        record, view.vertical
    )
    if equal:
        extent = _widened(extent, view, ratio)
        axes.set_aspect("equal", adjustable="box")
    axes.set_title(view.title, fontsize=10, loc="left")
    axes.set_xlim(*extent[:, view.horizontal])
    axes.set_xlabel(_axis_label(record, view.horizontal, view.mirrored))
    if view.vertical is None:
        axes.set_ylim(-n_rows + 0.4, 0.8)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
    else:
        axes.set_ylim(*extent[:, view.vertical])
        axes.set_ylabel(_axis_label(record, view.vertical, mirrored=False))
    for axis in (axes.xaxis, axes.yaxis) if view.vertical is not None else (axes.xaxis,):
        axis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
    if view.mirrored:
        axes.invert_xaxis()


def extent_of(points: list[np.ndarray], margin: float, least: float) -> np.ndarray:
    """Find the box to be drawn.

    Args:
        points: What must be seen, each of shape (..., k).
        margin: Share of the box's size that is left free on each side.
        least: Least half size of the box.

    Returns:
        Lower and upper corner, shape (2, k).
    """
    stacked = np.concatenate([p.reshape(-1, p.shape[-1]) for p in points])
    low, high = stacked.min(axis=0), stacked.max(axis=0)
    half = np.maximum((high - low) * (0.5 + margin), least)
    middle = (low + high) / 2
    return np.stack([middle - half, middle + half])


def shown(record: AdaptationRecord, values: np.ndarray) -> np.ndarray:
    """Convert from the outcomes' units to the unit shown."""
    return np.asarray(values, dtype=float) * display_factor(record)


def _widened(extent: np.ndarray, view: View, ratio: float) -> np.ndarray:
    """Widen an extent to the panel's shape, so that an equal scale leaves no empty margins."""
    assert view.vertical is not None
    widened = extent.copy()
    width, height = np.ptp(extent, axis=0)[[view.horizontal, view.vertical]]
    for component, size in (
        (view.horizontal, max(width, height * ratio)),
        (view.vertical, max(height, width / ratio)),
    ):
        middle = extent[:, component].mean()
        widened[:, component] = [middle - size / 2, middle + size / 2]
    return widened


def _axis_label(record: AdaptationRecord, component: int, mirrored: bool) -> str:
    name = record.demonstrations.outcome_names[component]
    label = f"{name} [{display_unit(record, component)}]"
    words = direction_words(record, component)
    if words is None:
        return label
    positive, negative = words
    low, high = (positive, negative) if mirrored else (negative, positive)
    return f"← {low}      {label}      {high} →"

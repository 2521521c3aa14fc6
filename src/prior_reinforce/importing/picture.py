"""The picture of an import: every channel over time, and where the demonstrations landed."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull, QhullError

from prior_reinforce.importing.recording import Recording
from prior_reinforce.plans.motions import Demonstrations

_COLUMNS = 4
_LEAST_RANGE = 0.2
"""Smallest vertical range of a channel's panel, as a share of the largest motion."""


@dataclass(frozen=True, eq=False)
class Picture:
    """What the picture shows."""

    demonstrations: Demonstrations
    """The plans and their outcomes, N of them."""
    episodes: tuple[str, ...]
    """Their names."""
    recordings: tuple[Recording, ...]
    """What they were made from, with the same channels."""
    starts: tuple[float, ...]
    """Where in its recording each plan starts, in [s]."""

    def draw(self, path: str | os.PathLike[str]) -> None:
        """Write the picture as PNG."""
        demos = self.demonstrations
        rows = math.ceil((demos.action_dim + 1) / _COLUMNS)
        figure = Figure(figsize=(3.4 * _COLUMNS, 2.6 * rows + 0.5), layout="constrained", dpi=110)
        axes = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
        colours = [colormaps["tab10"](i % 10) for i in range(demos.n)]
        for channel in range(demos.action_dim):
            self._draw_channel(axes[channel], channel, colours)
        draw_outcomes(axes[demos.action_dim], demos, self.episodes, colours)
        for spare in axes[demos.action_dim + 1 :]:
            spare.set_axis_off()
        figure.suptitle(
            f"{demos.n} demonstrations as they will be learned (colour, dot where the motion ends) "
            "and as recorded (grey)"
        )
        figure.savefig(path, format="png")

    def _draw_channel(self, axes: Any, channel: int, colours: list[Any]) -> None:
        form = self.demonstrations.format
        times = np.arange(self.demonstrations.horizon) * form.dt
        for recording, start in zip(self.recordings, self.starts, strict=True):
            axes.plot(
                recording.times - start,
                recording.positions[:, channel],
                color="0.8",
                linewidth=2.5,
                zorder=1,
            )
        for plan, colour in zip(self.demonstrations.plans, colours, strict=True):
            axes.plot(times, plan[:, channel], color=colour, linewidth=1.1, zorder=2)
            moving = np.flatnonzero(np.any(plan != plan[-1], axis=1))
            end = min(int(moving[-1]) + 1, len(times) - 1) if moving.size else 0
            axes.plot(times[end], plan[end, channel], "o", color=colour, markersize=3, zorder=3)
        # A channel that hardly moves must not look as if it did.
        low, high = axes.get_ylim()
        least = _LEAST_RANGE * float(np.ptp(self.demonstrations.plans, axis=(0, 1)).max())
        if high - low < least:
            axes.set_ylim((low + high - least) / 2, (low + high + least) / 2)
        axes.set_title(f"{form.names[channel]} [{form.units[channel]}]", fontsize=10)
        axes.set_xlabel("time from the plan's start [s]", fontsize=8)
        axes.tick_params(labelsize=8)


def draw_outcomes(
    axes: Any, demos: Demonstrations, episodes: tuple[str, ...], colours: list[Any]
) -> None:
    """Outcomes with the hull of their first two components; one component is drawn on a line."""
    points = demos.outcomes_seen[:, :2]
    if demos.outcome_dim == 1:
        points = np.column_stack([points[:, 0], np.zeros(demos.n)])
        axes.set_yticks([])
    else:
        corners = hull_corners(points)
        if corners.size:
            axes.fill(*points[corners].T, color="0.9", zorder=1)
            axes.set_ylabel(f"{demos.outcome_names[1]} [{demos.outcome_units[1]}]", fontsize=8)
        if demos.outcome_units[0] == demos.outcome_units[1]:
            axes.set_aspect("equal", adjustable="datalim")
    axes.scatter(*points.T, c=colours, s=30, zorder=2)
    for point, episode in zip(points, episodes, strict=True):
        axes.annotate(episode, point, textcoords="offset points", xytext=(5, 4), fontsize=7)
    axes.margins(0.25)
    axes.set_xlabel(f"{demos.outcome_names[0]} [{demos.outcome_units[0]}]", fontsize=8)
    axes.set_title("outcomes and their hull", fontsize=10)
    axes.tick_params(labelsize=8)


def hull_corners(points: np.ndarray) -> np.ndarray:
    """Indices of the corners of the convex hull of points (N, 2), in order; empty if flat."""
    try:
        return np.asarray(ConvexHull(points).vertices)
    except (QhullError, ValueError):
        return np.zeros(0, dtype=int)

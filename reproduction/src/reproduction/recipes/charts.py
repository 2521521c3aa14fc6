"""The pictures that are charts: success by round, means of trials, fields, motions in time.

A marker goes with each colour (Okabe and Ito 2008, "Color Universal Design"), so that nothing is
said by colour alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Rectangle

from prior_reinforce.report.style import (
    INK,
    INK_SOFT,
    calm_axes,
    drawing,
    new_figure,
    save_figure,
    trial_colour,
)
from reproduction.results import ROUNDS, Results, reached
from reproduction.statistics import Interval

COLOURS = ("#0072b2", "#d55e00", "#e69f00", "#cc79a7", "#009e73", "#56b4e9", "#000000", "#999999")
_MARKERS = ("o", "s", "D", "^", "v", "P", "X", "*")
_SPREAD = 0.34
"""Part of a round over which the methods' markers are spread, so that their bars do not hide one
another."""
_LARGEST_SHOWN = 10.0
"""Errors from here on have one colour, in [cm]: else a few far misses would hide all else."""
# The light part of matplotlib's Blues, on which dark arrows can be seen.
_ERROR_COLOURS = ListedColormap(colormaps["Blues"](np.linspace(0.0, 0.62, 128)))
_DEMONSTRATION = "#f0c800"
_LEGEND: Any = {"frameon": False, "fontsize": 9.5, "labelcolor": INK}


@dataclass(frozen=True)
class Line:
    """One method."""

    label: str
    curve: Sequence[Interval]
    """An interval a point."""
    place: int
    """Which colour and marker; the same method has the same in every panel."""
    dashed: bool = False
    each: Sequence[Sequence[float]] = ()
    """What each point of the curve is the mean of, where that is drawn instead of intervals."""

    @property
    def colour(self) -> str:
        """Of its line and marks."""
        return COLOURS[self.place % len(COLOURS)]

    @property
    def marker(self) -> str:
        """Shape of its marks."""
        return _MARKERS[self.place % len(_MARKERS)]


def curve(results: Results, minus: Results | None = None) -> list[Interval]:
    """Share of goals reached within 1, 2, ... rounds; or how far it is above another."""
    measures = [reached(by) for by in range(1, ROUNDS + 1)]
    return [results.mean(m) if minus is None else results.minus(minus, m) for m in measures]


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
    """Draw success fraction by round, panels side by side: a line a method, its intervals."""
    figure = new_figure(5.6 * len(panels), 5.2)
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _draw_panel(axes, panel)
        axes.set_title(panel.title, loc="left", fontsize=12, color=INK)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, **_LEGEND)
    return save_figure(figure, path)


def _draw_panel(axes: Axes, panel: Panel) -> None:
    calm_axes(axes)
    lines, shares = panel.lines, not panel.difference
    rounds = np.arange(1, len(lines[0].curve) + 1)
    offsets = np.linspace(-_SPREAD / 2, _SPREAD / 2, len(lines)) if len(lines) > 1 else [0.0]
    for i, (line, offset) in enumerate(zip(lines, offsets, strict=True)):
        value, around = _bars(line.curve)
        axes.errorbar(
            rounds + offset, value, yerr=around, color=line.colour, marker=line.marker,
            markersize=5.5, linewidth=2.6 if shares and i == 0 else 1.5,
            linestyle="--" if line.dashed else "-", elinewidth=1.1, zorder=10 - i,
            label=line.label, clip_on=False,
        )  # fmt: skip
    axes.set_xlim(0.5, len(rounds) + 0.5)
    if shares:
        axes.set_ylim(0, 1.02)
    else:
        axes.axhline(0.0, color=INK, linewidth=1.0)
    axes.set_ylabel(panel.difference or "share of goals reached")
    axes.set_xticks(rounds)
    axes.set_xlabel("round")
    axes.tick_params(labelcolor=INK_SOFT)


def _bars(intervals: Sequence[Interval]) -> tuple[np.ndarray, np.ndarray]:
    """Values, and how far their intervals reach below and above them."""
    value, low, high = np.array([(of.value, of.low, of.high) for of in intervals]).T
    return value, np.stack([value - low, high - value])


@drawing()
def draw_kinds(kinds: Sequence[str], panels: Mapping[str, Sequence[Line]], path: Path) -> Path:
    """Draw a value by kind, panels side by side: a mark a method, and what it is the mean of."""
    figure = new_figure(5.6 * len(panels), 4.6)
    subplots = figure.subplots(1, len(panels), squeeze=False)[0]
    for axes, (label, lines) in zip(subplots, panels.items(), strict=True):
        calm_axes(axes)
        for line, offset in zip(lines, np.linspace(-0.3, 0.3, len(lines)), strict=True):
            look = {"marker": line.marker, "color": line.colour, "linestyle": ""}
            at = np.arange(len(kinds)) + offset
            axes.plot(at, _bars(line.curve)[0], markersize=9, label=line.label, **look)
            for x, cells in zip(at, line.each, strict=True):
                axes.plot([x] * len(cells), cells, markersize=4, alpha=0.45, **look)
        axes.set_xticks(range(len(kinds)), kinds)
        axes.set_ylim(bottom=0)
        axes.set_ylabel(label)
        axes.tick_params(labelcolor=INK_SOFT)
    handles, labels = subplots[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), **_LEGEND)
    return save_figure(figure, path)


@drawing()
def draw_fields(
    fields: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    region: Float[np.ndarray, "2 2"],
    path: Path,
) -> Path:
    """Draw displacement fields one above the other, y to the left and x upwards.

    Args:
        fields: Each with its conditions and displacements, (nx, ny, 2), and the demonstrations'
            outcomes, (N, 2), all in [m].
        region: Reachable region, lower and upper corner, [m].
        path: PNG to write.
    """
    figure = new_figure(8.6, 5.0 * len(fields))
    (x_low, y_low), (x_high, y_high) = 100 * region
    for axes, field in zip(
        figure.subplots(len(fields), 1, squeeze=False)[:, 0], fields, strict=True
    ):
        calm_axes(axes, grid=False)
        grid, arrows, outcomes = (100 * of for of in field)
        x, y = grid[:, 0, 0], grid[0, :, 1]
        colours = axes.pcolormesh(
            y, x, np.linalg.norm(arrows, axis=-1), cmap=_ERROR_COLOURS, vmin=0,
            vmax=_LARGEST_SHOWN, shading="nearest", rasterized=True,
        )  # fmt: skip
        axes.quiver(
            y, x, arrows[..., 1], arrows[..., 0], angles="xy", scale_units="xy", scale=1,
            width=0.0022, color=INK, clip_on=True,
        )  # fmt: skip
        dots: Any = {"markersize": 11, "color": _DEMONSTRATION, "markeredgecolor": INK}
        axes.plot(*outcomes[:, ::-1].T, "o", zorder=5, **dots)
        dashes: Any = {"linestyle": "--", "edgecolor": INK, "linewidth": 1.2}
        axes.add_patch(
            Rectangle((y_low, x_low), y_high - y_low, x_high - x_low, fill=False, **dashes)
        )
        axes.set_aspect("equal")
        axes.set_xlim(y[-1], y[0])
        axes.set_ylim(x[0], x[-1])
        axes.set_title(f"{len(outcomes)} demonstrations", loc="left", fontsize=12, color=INK)
        axes.set_xlabel("← left      y [cm]      right →")
        axes.set_ylabel("x, away from the robot [cm]")
        bar = figure.colorbar(colours, ax=axes, extend="max", shrink=0.9, pad=0.02)
        bar.set_label("distance from goal to landing [cm]")
        bar.outline.set_visible(False)
    return save_figure(figure, path)


@drawing()
def draw_alignment(
    before: Float[np.ndarray, "N H"],
    after: Float[np.ndarray, "N longer"],
    joint: str,
    dt: float,
    path: Path,
) -> Path:
    """Draw one joint of all demonstrations, before and after alignment, on one time axis in [s]."""
    figure = new_figure(8.0, 5.6)
    for axes, plans, title in zip(
        figure.subplots(2, 1, sharex=True, sharey=True),
        (before, after),
        ("as recorded", "aligned in time"),
        strict=True,
    ):
        calm_axes(axes)
        for i, plan in enumerate(plans):
            colour = trial_colour(i, len(plans))
            axes.plot(dt * np.arange(len(plan)), plan, color=colour, linewidth=1.8)
        axes.set_title(title, loc="left", fontsize=12, color=INK)
        axes.set_ylabel(joint)
    figure.axes[-1].set_xlabel("time [s]")
    figure.axes[-1].set_xlim(0, dt * (max(before.shape[1], after.shape[1]) - 1))
    return save_figure(figure, path)


@dataclass(frozen=True)
class Mark:
    """One method of a chart of rows."""

    shape: str
    """Shape of its marks, as matplotlib names it."""
    colour: str
    """Colour of marks and intervals."""
    intervals: Sequence[Interval | None]
    """One a row; None where it was not tried."""


@drawing()
def draw_rows(
    labels: Sequence[str], marks: Mapping[str, Mark], axis_label: str, path: Path
) -> Path:
    """Draw intervals, a row each, the first on top, and a mark a method, one below another."""
    figure = new_figure(8.2, 1.3 + 0.2 * len(marks) + (0.3 + 0.05 * len(marks)) * len(labels))
    axes = figure.subplots()
    calm_axes(axes)
    axes.grid(visible=False, axis="y")
    for i, (name, mark) in enumerate(marks.items()):
        offset = 0.8 * ((i + 0.5) / len(marks) - 0.5)
        shown = [(row, of) for row, of in enumerate(mark.intervals) if of is not None]
        if not shown:
            continue
        value, around = _bars([of for _, of in shown])
        axes.errorbar(
            value, np.array([row for row, _ in shown]) + offset, xerr=around, fmt=mark.shape,
            color=mark.colour, markersize=6, elinewidth=1.5, label=name,
        )  # fmt: skip
    axes.set_yticks(range(len(labels)), labels, color=INK)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.set_xlabel(axis_label)
    figure.legend(loc="outside lower center", **_LEGEND)
    return save_figure(figure, path)

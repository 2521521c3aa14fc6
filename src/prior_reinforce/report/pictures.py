"""Pictures of places: where trials landed, where they were aimed, and all goals on one table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from prior_reinforce.report.badges import draw_badges
from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.report.style import (
    DEMONSTRATION,
    GOAL,
    INK_SOFT,
    LINE,
    REGION,
    drawing,
    new_figure,
    trial_colour,
)
from prior_reinforce.report.views import View, extent_of, prepare_axes, shown, views_of

_WIDTH, _HEIGHT = 5.4, 4.5  # [inch], one of two beside each other on a page
_LABELS = (0.65, 0.6)  # [inch], what labels take of a panel's width and height
_SHORT_ARROW = 16.0  # [points]; below this a head hides more than it says
_LEGEND = 0.3  # [inch], what a legend takes of its height


@drawing()
def draw_table(record: AdaptationRecord, region: np.ndarray | None = None) -> Figure:
    """Draw the whole table from above: region, demonstrations, goal, landings as seen.

    Args:
        record: The goal and its trials.
        region: Reachable region of goals, lower and upper corner, shape (2, k), or None.
    """
    return draw_overview([record], region, numbered_trials=True)


@drawing()
def draw_overview(
    records: Sequence[AdaptationRecord],
    region: np.ndarray | None = None,
    *,
    numbered_trials: bool = False,
) -> Figure:
    """Draw all goals on one table, with what was seen of every trial.

    Args:
        records: Goals of one set of demonstrations, at least one.
        region: Reachable region of goals, lower and upper corner, shape (2, k), or None.
        numbered_trials: Number the trials of the only goal, instead of numbering the goals.
    """
    first = records[0]
    demonstrated = shown(first, first.demonstrations.outcomes_seen)
    box = None if region is None else shown(first, region)
    everything = [demonstrated, *([] if box is None else [box])]
    for record in records:
        everything += [shown(record, record.goal), *_landings(record)[1]]
    least = 4 * shown(first, np.array(first.tolerance))
    extent = extent_of(everything, 0.06, float(least))
    figure = new_figure(_WIDTH * len(views_of(first)), _HEIGHT)
    n_rows = 1 + max(len(record.trials) if numbered_trials else 1 for record in records)
    for axes, view in _panels(figure, first, extent, n_rows, with_legend=True):
        if box is not None:
            corners = view.project(box)
            low, size = corners[0], corners[1] - corners[0]
            if view.vertical is None:
                low, size = np.array([low[0], -n_rows + 0.4]), np.array([size[0], n_rows + 0.4])
            axes.add_patch(Rectangle(tuple(low), *size, facecolor=REGION, edgecolor=LINE, zorder=0))
        _draw_demonstrations(axes, view, demonstrated)
        _draw_legend(axes, box is not None)
        for record in records:
            _draw_goal(axes, view, record)
            _draw_landings(figure, axes, view, record, badges=numbered_trials, with_truth=False)
        if not numbered_trials:
            goals = view.project(np.stack([shown(r, r.goal) for r in records]), 1.0)
            labels = [str(i + 1) for i in range(len(records))]
            draw_badges(
                figure, axes, goals, labels, [GOAL] * len(records), away_from=goals.mean(axis=0)
            )
    return figure


@drawing()
def draw_landings(record: AdaptationRecord) -> Figure:
    """Draw close up where each trial was seen to land, with its error as an arrow from the goal."""
    figure = new_figure(_WIDTH * len(views_of(record)), _HEIGHT)
    for axes, view in _panels(figure, record, _close_extent(record), 1 + len(record.trials)):
        _draw_demonstrations(axes, view, shown(record, record.demonstrations.outcomes_seen))
        _draw_goal(axes, view, record)
        _draw_landings(figure, axes, view, record, badges=True, with_truth=True)
    return figure


@drawing()
def draw_aims(record: AdaptationRecord) -> Figure:
    """Draw on the same scale where each trial was aimed: the way of the condition."""
    figure = new_figure(_WIDTH * len(views_of(record)), _HEIGHT)
    n = len(record.trials)
    conditions = np.array([shown(record, t.condition) for t in record.trials]).reshape(
        n, record.outcome_dim
    )
    for axes, view in _panels(figure, record, _close_extent(record), 1 + n):
        _draw_demonstrations(axes, view, shown(record, record.demonstrations.outcomes_seen))
        _draw_goal(axes, view, record)
        places = view.project(conditions, np.arange(1, n + 1))
        colours = [trial_colour(i, n, hit=t.hit) for i, t in enumerate(record.trials)]
        for i in range(1, n):
            _draw_arrow(axes, places[i - 1], places[i], colours[i], dashed=True)
        for (x, y), colour in zip(places, colours, strict=True):
            axes.plot(x, y, "s", color=colour, markersize=5.5, markeredgecolor="white", zorder=6)
        labels = [str(t.number) for t in record.trials]
        goal = view.project(shown(record, record.goal), 1.0)
        draw_badges(figure, axes, places, labels, colours, away_from=goal)
    return figure


def _panels(
    figure: Figure,
    record: AdaptationRecord,
    extent: np.ndarray,
    n_rows: int,
    *,
    with_legend: bool = False,
) -> list[tuple[Axes, View]]:
    views = views_of(record)
    height = figure.get_figheight() - _LABELS[1] - (_LEGEND if with_legend else 0.0)
    ratio = (figure.get_figwidth() / len(views) - _LABELS[0]) / height
    panels = list(zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True))
    for axes, view in panels:
        prepare_axes(axes, view, record, extent, ratio=ratio, n_rows=n_rows)
    return panels


def _close_extent(record: AdaptationRecord) -> np.ndarray:
    points = [shown(record, record.goal), *_landings(record)[1]]
    points += [shown(record, trial.condition) for trial in record.trials]
    least = 3 * float(shown(record, np.array(record.tolerance)))
    return extent_of(points, 0.14, least)


def _landings(record: AdaptationRecord) -> tuple[list[int], list[np.ndarray]]:
    """Places in the list of trials that landed somewhere, and where, in the unit shown."""
    told = [(i, r) for i, r in enumerate(record.landings) if r is not None]
    return [i for i, _ in told], [shown(record, r) for _, r in told]


def _draw_demonstrations(axes: Axes, view: View, outcomes: np.ndarray) -> None:
    places = view.project(outcomes)
    axes.plot(*places.T, "D", markersize=5, color=DEMONSTRATION, zorder=3)


def _draw_goal(axes: Axes, view: View, record: AdaptationRecord) -> None:
    goal = view.project(shown(record, record.goal))
    radius = float(shown(record, np.array(record.tolerance)))
    if view.vertical is None:
        axes.axvspan(goal[0] - radius, goal[0] + radius, color=GOAL, alpha=0.13, linewidth=0)
        axes.axvline(goal[0], color=GOAL, linewidth=1.6, zorder=2)
        return
    axes.add_patch(Circle(tuple(goal), radius, facecolor=GOAL, alpha=0.13, zorder=1))
    axes.add_patch(
        Circle(tuple(goal), radius, facecolor="none", edgecolor=GOAL, linewidth=1.6, zorder=4)
    )
    axes.plot(*goal, "+", color=GOAL, markersize=7, markeredgewidth=1.6, zorder=4)


def _draw_landings(
    figure: Figure,
    axes: Axes,
    view: View,
    record: AdaptationRecord,
    *,
    badges: bool,
    with_truth: bool,
) -> None:
    order, landings = _landings(record)
    if not landings:
        return
    n = len(record.trials)
    rows = np.array(order) + 1.0 if badges else np.ones(len(order))
    places = view.project(np.array(landings), rows)
    goals = view.project(
        np.broadcast_to(shown(record, record.goal), (len(order), record.outcome_dim)), rows
    )
    colours = [trial_colour(i, n, hit=record.trials[i].hit) for i in order]
    true_places: list[np.ndarray] = []
    for i, place, goal, row, colour in zip(order, places, goals, rows, colours, strict=True):
        _draw_arrow(axes, goal, place, colour)
        axes.plot(*place, "o", color=colour, markersize=6.5, markeredgecolor="white", zorder=6)
        truth = record.true_outcomes[i]
        if with_truth and truth is not None:
            true_place = view.project(shown(record, truth), row)
            true_places.append(true_place)
            axes.plot(*np.stack([place, true_place]).T, ":", color=INK_SOFT, linewidth=1, zorder=5)
            axes.plot(
                *true_place,
                "o",
                markersize=5.5,
                markerfacecolor="white",
                zorder=5,
                markeredgecolor=INK_SOFT,
                markeredgewidth=1.0,
            )
    if badges:
        labels = [str(record.trials[i].number) for i in order]
        avoid = np.array(true_places).reshape(-1, 2)
        draw_badges(figure, axes, places, labels, colours, away_from=goals[0], avoid=avoid)


def _draw_arrow(
    axes: Axes, start: np.ndarray, end: np.ndarray, colour: str, *, dashed: bool = False
) -> None:
    paper = axes.transData.transform(np.stack([start, end])) * 72 / axes.figure.dpi
    short = np.linalg.norm(paper[1] - paper[0]) < _SHORT_ARROW
    axes.add_patch(
        FancyArrowPatch(
            tuple(start),
            tuple(end),
            arrowstyle="-" if short else "-|>",
            mutation_scale=9,
            shrinkA=0,
            shrinkB=3.5,
            color=colour,
            linewidth=1.5,
            linestyle=(0, (2, 1.5)) if dashed else "-",
            zorder=5,
        )
    )


def _draw_legend(axes: Axes, with_region: bool) -> None:
    """Say what the marks are, below the picture."""
    marks: list[Artist] = [
        axes.plot([], [], "o", color=GOAL, markerfacecolor="none", label="goal")[0],
        axes.plot([], [], "D", color=DEMONSTRATION, markersize=5, label="demonstration, as seen")[
            0
        ],
        axes.plot([], [], "o", color=trial_colour(0, 1), markersize=5, label="trial")[0],
        axes.plot([], [], "o", color=trial_colour(0, 1, hit=True), markersize=5, label="hit")[0],
    ]
    if with_region:
        marks.append(Rectangle((0, 0), 1, 1, facecolor=REGION, edgecolor=LINE, label="reachable"))
    axes.legend(
        handles=marks,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=len(marks),
        frameon=False,
        fontsize=9,
        labelcolor=INK_SOFT,
        handletextpad=0.3,
        columnspacing=1.2,
    )

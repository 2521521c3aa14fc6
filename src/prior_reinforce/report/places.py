"""Pictures of places: where trials landed, where they were aimed, and all goals on one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from prior_reinforce.arrays import Point, Points
from prior_reinforce.report import style
from prior_reinforce.report.panels import Panel, views_of
from prior_reinforce.report.record import AdaptationRecord, Box
from prior_reinforce.session.trials import Stage
from prior_reinforce.wording import say_tolerance

_WIDTH, _HEIGHT = 5.4, 4.5  # [inch], one of two beside each other on a page
_LABELS = (0.7, 0.72)  # [inch], what labels take of a panel's width and height
_LEGEND = 0.5  # [inch], what a legend takes of a figure's height
_LEAST_HEIGHT = 1.6  # [inch], of a panel inside its labels
_ROW = 0.45  # [inch], of a trial where k = 1
_NAMED = 12  # goals at most; the names of more would hide what they name


@style.drawing()
def draw_table(records: Sequence[AdaptationRecord], region: Box | None = None) -> Figure:
    """Draw the whole table: demonstrations, goals, and what was seen of every trial.

    The trials of a single goal are numbered; of a few, the goals are named.
    """
    first, single = records[0], len(records) == 1
    legend = _legend(first)
    seen = [*first.demonstrations.outcomes_seen]
    if region is not None:
        legend["region of goals"] = Patch(facecolor=style.REGION, edgecolor=style.LINE)
        seen += [*region]
    for record in records:
        seen += [record.goal, *(point for point in record.landings if point is not None)]
    n_rows = 1 + len(first.trials) if single else 2
    figure, panels = _panels(
        first, seen, margin=0.06, least=4, n_rows=n_rows, legend=legend, flat=True
    )
    for panel in panels:
        if region is not None:
            panel.draw_region(region)
        panel.draw_demonstrations()
        for record in records:
            panel.draw_goal(record)
            panel.draw_trials(record, numbered=single)
        if 1 < len(records) <= _NAMED:
            panel.name_goals(records)
    return figure


@style.drawing()
def draw_close_up(record: AdaptationRecord, *, aims: bool = False) -> Figure:
    """Draw where each trial was seen to land, or where it was aimed."""
    seen = [record.goal, *(trial.condition for trial in record.trials)]
    if not aims:  # one wild landing would squeeze all aims together
        seen += [point for point in record.landings if point is not None]
        seen += _near(np.stack(seen), record.true_outcomes)
    n_rows = 1 + len(record.trials)
    legend = _legend(record, aims=True) if aims else None
    figure, panels = _panels(record, seen, margin=0.14, least=3, n_rows=n_rows, legend=legend)
    for panel in panels:
        panel.draw_demonstrations()
        panel.draw_goal(record)
        panel.draw_trials(record, aims=aims, with_truth=not aims)
    return figure


def _near(seen: Points, truths: Sequence[Point | None]) -> list[Point]:
    """The true outcomes that can be shown without making all else small, as a lost ball's would."""
    middle, size = (seen.min(axis=0) + seen.max(axis=0)) / 2, np.ptp(seen, axis=0).max()
    return [r for r in truths if r is not None and np.abs(r - middle).max() <= size]


def _panels(
    record: AdaptationRecord,
    seen: Sequence[Point],
    *,
    margin: float,
    least: float,
    n_rows: int,
    legend: Mapping[str, Any] | None = None,
    flat: bool = False,
) -> tuple[Figure, list[Panel]]:
    """Make a figure with one panel a view, laid out and ready to be drawn in.

    All that is `seen` is in it, with a margin that is a share of its size, and at least so many
    tolerances; a line has `n_rows`. `flat` makes it only as high as that.
    """
    views = views_of(record.format)
    points = np.stack(seen) * record.scale
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    half = np.ptp(points, axis=0) * (0.5 + margin)
    half = np.maximum(half, least * record.format.half_axes * record.scale)
    around = _LABELS[1] + (_LEGEND if legend else 0)
    wanted = _HEIGHT
    if views[0].up is None:
        wanted = _ROW * (n_rows + 1)
    elif flat and record.unit():
        wanted = (_WIDTH - _LABELS[0]) * max(half[view.up] / half[view.across] for view in views)
    height = np.clip(wanted, _LEAST_HEIGHT, _HEIGHT - around) + around
    figure = style.new_figure(_WIDTH * len(views), height)
    panels = [
        Panel(axes, view, record, np.stack([middle - half, middle + half]), n_rows)
        for axes, view in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True)
    ]
    if legend:
        side_by_side = {tuple: HandlerTuple(ndivide=None)}
        style.add_legend(figure, legend, "center", handler_map=side_by_side)
    style.lay_out(figure)  # so that data coordinates have their place on paper
    for panel in panels:
        panel.equalise()
    return figure, panels


def _mark(colour: str, marker: str = "o", **more: Any) -> Line2D:
    return Line2D([], [], linestyle="", marker=marker, markersize=5, color=colour, **more)


def _legend(record: AdaptationRecord, *, aims: bool = False) -> dict[str, Any]:
    """Marks by what they mean; a tuple of marks stands side by side."""
    tried, marker = ("aims", "s") if aims else ("misses", "o")
    legend: dict[str, Any] = {
        f"goal ± {say_tolerance(record.format)}": _mark(style.GOAL, markerfacecolor="none"),
        "demonstrations": _mark(style.DEMONSTRATION, "D"),
        f"{tried}, first to last": tuple(_mark(style.trial_colour(i, 3), marker) for i in range(3)),
    }
    if not aims:
        legend["hits"] = _mark(style.HIT)
    elif record.trials_to_hit is not None:
        legend["aim that hit"] = _mark(style.HIT, "s")
    if aims and any(trial.stage is Stage.VOIDED for trial in record.trials):
        legend["voided"] = _mark(style.trial_colour(2, 3), "s", markerfacecolor="white")
    return legend

"""Pictures over goals, trials and time: trials by goal, the error by trial, plans by joint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from prior_reinforce.arrays import Frames
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.report.style import (
    DEMONSTRATION,
    GOAL,
    HIT,
    INK,
    INK_SOFT,
    calm_axes,
    drawing,
    new_figure,
    trial_colour,
)
from prior_reinforce.report.summary import say_tolerance
from prior_reinforce.trials import Stage
from prior_reinforce.wording import say_length

_COLUMNS = 4
_LEAST_TRIALS = 3  # that the error's axis has room for
_LEAST_SHARE = 0.02
"""Ours: a joint that moves less than this share of what moves most is drawn as nearly at rest."""


@drawing()
def draw_trials_by_goal(records: Sequence[AdaptationRecord]) -> Figure:
    """Draw how many trials each goal took, one goal after another; hollow where none hit."""
    figure = new_figure(5.4, 2.2)
    axes = figure.subplots()
    calm_axes(axes)
    axes.grid(visible=False, axis="x")
    places = range(1, len(records) + 1)
    counts = [record.trials_to_hit or len(record.told) for record in records]
    axes.plot(places, counts, "-", color=DEMONSTRATION, linewidth=1.5, zorder=3)
    for place, count, record in zip(places, counts, records, strict=True):
        hit = record.trials_to_hit is not None
        fill: Any = {"markerfacecolor": HIT if hit else "white", "markeredgecolor": HIT}
        axes.plot(place, count, "o", markersize=9, clip_on=False, zorder=5, **fill)
        said = str(count) if hit else f"{count}, not reached"
        _write(axes, said, (place, count), (0, 8), color=INK, ha="center")
    axes.set_ylim(0, 1.35 * max([2, *counts]))
    axes.set_xlim(0.5, len(records) + 0.5)
    axes.set_xticks(places, [str(place) for place in places])
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_xlabel("goal, in order")
    axes.set_ylabel("trials")
    return figure


@drawing()
def draw_errors(record: AdaptationRecord) -> Figure:
    """Draw how far each trial was off, against the tolerance."""
    figure = new_figure(5.4, 4.5)
    axes = figure.subplots()
    calm_axes(axes)
    axes.grid(visible=False, axis="x")
    n, tolerance = len(record.trials), record.tolerance * record.scale
    axes.axhspan(0, tolerance, color=GOAL, alpha=0.13, linewidth=0)
    axes.axhline(tolerance, color=GOAL, linewidth=1.4)
    seen: dict[int, float] = {}
    true: dict[int, float] = {}
    for x, (trial, truth) in enumerate(zip(record.trials, record.true_outcomes, strict=True), 1):
        if truth is not None:
            true[x] = record.distance(truth - record.goal) * record.scale
        if trial.error_seen is None:
            _write(axes, trial.stage.value, (x, tolerance), (0, 12), rotation=90, ha="center")
            continue
        off = record.distance(trial.error_seen)
        seen[x] = off * record.scale
        colour = trial_colour(x - 1, n, hit=trial.hit)
        axes.plot(x, seen[x], "o", color=colour, markersize=10, clip_on=False, zorder=5)
        said = say_length(off, record.demonstrations.outcome_units)
        _write(axes, said, (x, seen[x]), (9, 7), color=INK)
    axes.plot(list(seen), list(seen.values()), "-", color=DEMONSTRATION, linewidth=1.5, zorder=3)
    if true:
        hollow: Any = {"markersize": 6, "markerfacecolor": "white", "markeredgecolor": INK_SOFT}
        axes.plot(list(true), list(true.values()), "o", **hollow, zorder=4, label="true error")
        axes.legend(frameon=False, fontsize=9, labelcolor=INK_SOFT, loc="upper right")
    room = max(n, _LEAST_TRIALS)
    reached = f"reached: within {say_tolerance(record)}"
    _write(axes, reached, (room + 0.68, tolerance), (0, 2), color=GOAL, ha="right")
    axes.set_ylim(0, 1.18 * max([2.5 * tolerance, *seen.values(), *true.values()]))
    axes.set_xlim(0.5, room + 0.7)
    axes.set_xticks(range(1, n + 1), [str(trial.number) for trial in record.trials])
    axes.set_xlabel("trial")
    axes.set_ylabel("distance from the goal" + (f" [{record.unit()}]" if record.unit() else ""))
    return figure


@drawing()
def draw_plans(record: AdaptationRecord) -> Figure:
    """Draw the plans of all trials, one panel an action dimension, demonstrations behind."""
    plan_format, d = record.demonstrations.format, record.demonstrations.action_dim
    columns = min(_COLUMNS, d)
    rows = -(-d // columns)
    figure = new_figure(max(2.75 * columns, 5.4), 1.9 * rows + 0.45)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
    lines: list[tuple[str, Frames, dict[str, Any]]] = [
        ("demonstrations", plan, {"color": DEMONSTRATION, "alpha": 0.45, "linewidth": 1})
        for plan in record.demonstrations.plans
    ]
    for i, trial in enumerate(record.trials):
        style = {
            "color": trial_colour(i, len(record.trials), hit=trial.hit),
            "linewidth": 1.7,
            "linestyle": "--" if trial.stage is Stage.VOIDED else "-",
        }
        plan = np.empty((0, d)) if trial.plan is None else trial.plan
        lines.append((f"trial {trial.number}" + (" (hit)" if trial.hit else ""), plan, style))
    for j, axes in enumerate(panels):
        if j >= d:
            axes.set_axis_off()
            continue
        calm_axes(axes)
        axes.tick_params(labelsize=8.5)
        for label, plan, style in lines:
            axes.plot(np.arange(len(plan)) * plan_format.dt, plan[:, j], label=label, **style)
        _widen(axes, record.demonstrations, j)
        title = f"{plan_format.names[j]} [{plan_format.units[j]}]"
        axes.set_title(title, loc="left", fontsize=9.5, color=INK)
        if j + columns >= d:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("time [s]", fontsize=9)
    handles, labels = panels[0].get_legend_handles_labels()
    keys = dict(zip(labels, handles, strict=True))
    figure.legend(
        list(keys.values()),
        list(keys),
        loc="outside upper left",
        ncols=max(3, 2 * columns),
        frameon=False,
        fontsize=9,
        labelcolor=INK_SOFT,
        handlelength=1.6,
        columnspacing=1.4,
    )
    return figure


def _widen(axes: Axes, demonstrations: Demonstrations, j: int) -> None:
    """Leave room around a joint that hardly moves, so that a sensor's noise does not look wild."""
    units = np.array(demonstrations.format.units)
    spans = np.ptp(demonstrations.plans, axis=(0, 1))
    least = _LEAST_SHARE * spans[units == units[j]].max()
    low, high = axes.get_ylim()
    if high - low < least:
        axes.set_ylim((low + high - least) / 2, (low + high + least) / 2)


def _write(
    axes: Axes,
    text: str,
    place: tuple[float, float],
    offset: tuple[float, float],
    color: str = INK_SOFT,
    **more: Any,
) -> None:
    points: Any = {"textcoords": "offset points", "fontsize": 9.5, "va": "bottom"}
    axes.annotate(text, place, offset, color=color, **points, **more)

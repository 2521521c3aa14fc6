"""Pictures over goals, trials and time: trials by goal, the error by trial, plans by joint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.report.style import (
    DEMONSTRATION,
    GOAL,
    HIT,
    INK,
    INK_SOFT,
    add_legend,
    calm_axes,
    draw_joint,
    drawing,
    new_figure,
    trial_colour,
    widen,
)
from prior_reinforce.report.summary import CALLED, numbers, say_distance
from prior_reinforce.session.trials import Stage, Trial
from prior_reinforce.wording import say_tolerance

_COLUMNS = 4
_LEAST_TRIALS = 3  # that the error's axis has room for
_LEAST_SHARE = 0.02
"""Ours: a joint that moves less than this share of what moves most is drawn as nearly at rest."""
_SHOWN: Any = {"label": "demonstrations", "color": DEMONSTRATION, "alpha": 0.45, "linewidth": 1}
_MEASURED: Any = {"label": "measured on the arm", "linestyle": ":", "linewidth": 2.2}
_TIGHT: Any = {"handlelength": 1.6, "columnspacing": 1.4}

_Plan = Float[np.ndarray, "_ D"]
"""A plan of any horizon, or no frames of one."""


@drawing()
def draw_trials_by_goal(records: Sequence[AdaptationRecord]) -> Figure:
    """Draw how many trials each goal took, one goal after another.

    A line joins the goals that were reached; an unreached goal has no trial count to compare.
    """
    figure = new_figure(5.4, 2.2)
    axes = figure.subplots()
    calm_axes(axes)
    axes.grid(visible=False, axis="x")
    marks: Any = {"linestyle": "", "marker": "o", "markersize": 9, "markeredgecolor": HIT}
    legend: dict[str, Line2D] = {}
    reached: dict[int, int] = {}
    counts = [record.trials_to_hit or len(record.told) for record in records]
    for place, (record, count) in enumerate(zip(records, counts, strict=True), start=1):
        if not count:
            _write(axes, "–", (place, 0), (0, 4), ha="center")
            legend["no trial that counts"] = Line2D([], [], ls="", marker="_", color=INK_SOFT)
            continue
        hit = record.trials_to_hit is not None
        if hit:
            reached[place] = count
        (mark,) = axes.plot(
            place, count, markerfacecolor=HIT if hit else "white", clip_on=False, zorder=5, **marks
        )
        legend["reached" if hit else "not reached yet"] = mark
        _write(axes, str(count), (place, count), (0, 8), color=INK, ha="center", zorder=6)
    axes.plot(
        list(reached), list(reached.values()), "-", color=DEMONSTRATION, linewidth=1.5, zorder=3
    )
    axes.set_ylim(0, 1.35 * max([2, *counts]))
    axes.set_xlim(0.5, len(records) + 0.5)
    axes.set_xticks(range(1, len(records) + 1), [str(number) for number in numbers(records)])
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_xlabel("goal, in order")
    axes.set_ylabel("trials")
    if len(reached) < len(records):
        add_legend(figure, legend, **_TIGHT)
    return figure


@drawing()
def draw_errors(record: AdaptationRecord) -> Figure:
    """Draw how far each trial was off, against the tolerance."""
    figure = new_figure(5.4, 4.5)
    axes = figure.subplots()
    calm_axes(axes)
    axes.grid(visible=False, axis="x")
    n, tolerance = len(record.trials), record.edge
    axes.axhspan(0, tolerance, color=GOAL, alpha=0.13, linewidth=0)
    axes.axhline(tolerance, color=GOAL, linewidth=1.4)
    seen: dict[int, float] = {}
    true: dict[int, float] = {}
    for x, (trial, truth) in enumerate(zip(record.trials, record.true_outcomes, strict=True), 1):
        if truth is not None:
            true[x] = record.distance(truth - record.goal)
        if (distance := record.distance_seen(trial)) is None:
            result = "hit" if trial.hit else "miss"
            said = result if trial.stage is Stage.TOLD else trial.stage.value
            _write(axes, said, (x, tolerance), (0, 8), rotation=90, ha="center")
            continue
        seen[x] = distance
        colour = trial_colour(x - 1, n, hit=trial.hit)
        axes.plot(x, seen[x], "o", color=colour, markersize=10, clip_on=False, zorder=5)
        called = CALLED if trial.hit and seen[x] > tolerance else ""
        _write(
            axes, called + say_distance(record, seen[x]), (x, seen[x]), (9, 7), color=INK, zorder=6
        )
    axes.plot(list(seen), list(seen.values()), "-", color=DEMONSTRATION, linewidth=1.5, zorder=3)
    if true:
        hollow: Any = {"markersize": 6, "markerfacecolor": "white", "markeredgecolor": INK_SOFT}
        axes.plot(list(true), list(true.values()), "o", **hollow, zorder=4, label="true error")
        axes.legend(frameon=False, fontsize=9, labelcolor=INK_SOFT, loc="upper right")
    room = max(n, _LEAST_TRIALS)
    reached = f"shaded: reached, within {say_tolerance(record.format)}"
    axes.set_title(reached, loc="right", fontsize=9.5, color=GOAL)
    axes.set_ylim(0, 1.18 * max([2.5 * tolerance, *seen.values(), *true.values()]))
    axes.set_xlim(0.5, room + 0.7)
    axes.set_xticks(range(1, n + 1), [str(trial.number) for trial in record.trials])
    axes.set_xlabel("trial")
    axes.set_ylabel(f"distance from the goal [{record.distance_unit}]")
    return figure


@drawing()
def draw_plans(record: AdaptationRecord) -> Figure:
    """Draw the plans of all trials, one panel an action dimension, demonstrations behind.

    Trials move a plan by less than a line's width, so a second panel below each shows by how much
    it differs from the first plan.
    """
    form, d = record.demonstrations.format, record.demonstrations.action_dim
    shown = record.demonstrations.plans
    plans = [t.plan if len(t.plan) else np.empty((0, d)) for t in record.trials]
    styles = [_trial_style(record, i) for i in range(len(plans))]
    first, differences = _differences(record.trials, plans)
    drawn = [
        *((np.arange(len(plan)) * form.dt, plan, _SHOWN) for plan in shown),
        *((np.arange(len(p)) * form.dt, p, look) for p, look in zip(plans, styles, strict=True)),
    ]
    for number, (times, path) in record.measured.items():
        at = next(i for i, trial in enumerate(record.trials) if trial.number == number)
        drawn.append((times, path, styles[at] | _MEASURED))
    columns = min(_COLUMNS, d)
    rows = -(-d // columns)
    heights = [1.9, 1.3] if differences else [1.9]
    figure = new_figure(max(2.75 * columns, 5.4), sum(heights) * rows + 0.45)
    panels = figure.subplots(
        rows * len(heights), columns, squeeze=False, sharex=True, height_ratios=heights * rows
    )
    for j in range(columns * rows):
        row, column = len(heights) * (j // columns), j % columns
        panel, *below = panels[row : row + len(heights), column]
        for axes in (panel, *below):
            calm_axes(axes)
            axes.tick_params(labelsize=8.5)
            if j >= d:
                axes.set_axis_off()
        if j >= d:
            continue
        draw_joint(panel, form, j, drawn, loc="left", fontsize=9.5, color=INK)
        widen(panel, shown, form.units, j, _LEAST_SHARE)
        for axes in below:
            scale, unit = (1000, "mrad") if form.units[j] == "rad" else (1, form.units[j])
            for off, style in zip(differences, styles, strict=True):
                axes.plot(np.arange(len(off)) * form.dt, scale * off[:, j], **style)
            compared = np.stack([off for off in differences if len(off)])
            widen(axes, scale * compared, form.units, j, _LEAST_SHARE)
            title = f"minus trial {first} [{unit}]"
            axes.set_title(title, loc="left", fontsize=8.5, color=INK_SOFT)
        if j + columns >= d:
            lowest = below[-1] if below else panel
            lowest.tick_params(labelbottom=True)
            lowest.set_xlabel("time [s]", fontsize=9)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    marks = dict(zip(labels, handles, strict=True))
    add_legend(figure, marks, ncols=max(3, 2 * columns), **_TIGHT)
    return figure


def _differences(trials: Sequence[Trial], plans: Sequence[_Plan]) -> tuple[int, list[_Plan]]:
    """The first trial with a plan, and by how much each plan differs from its plan.

    No frames where a plan cannot be compared; an empty list where nothing can.
    """
    first = next((i for i, plan in enumerate(plans) if len(plan)), 0)
    alike = [len(plan) > 0 and plan.shape == plans[first].shape for plan in plans]
    if sum(alike) < 2:
        return 0, []
    return trials[first].number, [
        plan - plans[first] if same else plan[:0] for plan, same in zip(plans, alike, strict=True)
    ]


def _trial_style(record: AdaptationRecord, i: int) -> dict[str, Any]:
    trial = record.trials[i]
    return {
        "label": f"trial {trial.number}" + (" (hit)" if trial.hit else ""),
        "color": trial_colour(i, len(record.trials), hit=trial.hit),
        "linewidth": 1.7,
        "linestyle": "--" if trial.stage is Stage.VOIDED else "-",
    }


def _write(
    axes: Axes,
    text: str,
    place: tuple[float, float],
    offset: tuple[float, float],
    color: str = INK_SOFT,
    **more: Any,
) -> None:
    points: Any = {"textcoords": "offset points", "fontsize": 9.5, "va": "bottom"}
    over_lines = [withStroke(linewidth=2.5, foreground="white")]
    axes.annotate(text, place, offset, color=color, path_effects=over_lines, **points, **more)

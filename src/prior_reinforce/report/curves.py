"""Pictures over trials and over time: the error by trial, and the plans joint by joint."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.report.style import (
    DEMONSTRATION,
    GOAL,
    INK,
    INK_SOFT,
    calm_axes,
    drawing,
    new_figure,
    trial_colour,
)
from prior_reinforce.report.views import shown
from prior_reinforce.report.wording import display_unit, say_length
from prior_reinforce.trials import Stage

_COLUMNS = 4


@drawing()
def draw_errors(record: AdaptationRecord) -> Figure:
    """Draw how far each trial was off, against the tolerance."""
    figure = new_figure(5.4, 4.5)
    axes = figure.subplots()
    calm_axes(axes)
    axes.grid(visible=False, axis="x")
    n = len(record.trials)
    tolerance = float(shown(record, np.array(record.tolerance)))
    numbers = np.array([trial.number for trial in record.trials])
    told = [i for i, t in enumerate(record.trials) if t.error_seen is not None]
    seen = np.array([_size(record, record.trials[i].error_seen) for i in told])
    true = np.array(
        [np.nan if r is None else _size(record, r - record.goal) for r in record.true_outcomes]
    )
    known = np.isfinite(true)
    axes.axhspan(0, tolerance, color=GOAL, alpha=0.13, linewidth=0)
    axes.axhline(tolerance, color=GOAL, linewidth=1.4)
    axes.plot(numbers[told], seen, "-", color=DEMONSTRATION, linewidth=1.5, zorder=3)
    axes.plot(
        numbers[known],
        true[known],
        "o",
        markersize=6,
        markerfacecolor="white",
        markeredgecolor=INK_SOFT,
        zorder=4,
        label="true error",
    )
    for i, size in zip(told, seen, strict=True):
        trial, colour = record.trials[i], trial_colour(i, n, hit=record.trials[i].hit)
        axes.plot(trial.number, size, "o", color=colour, markersize=10, clip_on=False, zorder=5)
        axes.annotate(
            say_length(record, size / float(shown(record, np.array(1.0)))),
            (trial.number, size),
            (9, 7),
            textcoords="offset points",
            fontsize=9.5,
            color=INK,
        )
    for trial in record.trials:
        if trial.stage is not Stage.TOLD:
            axes.annotate(
                trial.stage.value,
                (trial.number, tolerance),
                (0, 12),
                textcoords="offset points",
                rotation=90,
                ha="center",
                va="bottom",
                fontsize=9.5,
                color=INK_SOFT,
            )
    top = max([3 * tolerance, *(1.18 * seen), *(1.1 * true[known])])
    axes.set_ylim(0, top)
    axes.set_xlim(0.5, max(n, 3) + 0.7)
    axes.text(
        max(n, 3) + 0.68, tolerance, "reached", color=GOAL, fontsize=9.5, ha="right", va="bottom"
    )
    axes.set_xticks(np.arange(1, max(n, 3) + 1))
    axes.set_xlabel("trial")
    unit = display_unit(record)
    axes.set_ylabel("distance from the goal" + (f" [{unit}]" if unit else ""))
    if known.any():
        axes.legend(frameon=False, fontsize=9, labelcolor=INK_SOFT, loc="upper right")
    return figure


@drawing()
def draw_plans(record: AdaptationRecord) -> Figure:
    """Draw the plans of all trials, one panel an action dimension, demonstrations behind."""
    demonstrations = record.demonstrations
    d, n = demonstrations.action_dim, len(record.trials)
    columns = min(_COLUMNS, d)
    rows = -(-d // columns)
    figure = new_figure(max(2.75 * columns, 5.4), 1.9 * rows + 0.45)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
    for axes in panels[d:]:
        axes.set_axis_off()
    for j, axes in enumerate(panels[:d]):
        calm_axes(axes)
        axes.tick_params(labelsize=8.5)
        times = np.arange(demonstrations.horizon) * demonstrations.format.dt
        for plan in demonstrations.plans:
            axes.plot(times, plan[:, j], color=DEMONSTRATION, alpha=0.45, linewidth=1)
        for i, trial in enumerate(record.trials):
            axes.plot(
                np.arange(trial.plan.shape[0]) * demonstrations.format.dt,
                trial.plan[:, j],
                color=trial_colour(i, n, hit=trial.hit),
                linewidth=1.7,
                linestyle="--" if trial.stage is Stage.VOIDED else "-",
            )
        unit = demonstrations.format.units[j]
        name = demonstrations.format.names[j]
        axes.set_title(f"{name} [{unit}]", loc="left", fontsize=9.5, color=INK)
        if j + columns >= d:
            axes.tick_params(labelbottom=True)
            if j // columns == rows - 1:
                axes.set_xlabel("time [s]", fontsize=9)
    keys = [panels[0].plot([], [], color=DEMONSTRATION, label="demonstrations")[0]]
    for i, trial in enumerate(record.trials):
        label = f"trial {trial.number}" + (" (hit)" if trial.hit else "")
        style = "--" if trial.stage is Stage.VOIDED else "-"
        colour = trial_colour(i, n, hit=trial.hit)
        keys.append(panels[0].plot([], [], style, color=colour, linewidth=1.7, label=label)[0])
    figure.legend(
        handles=keys,
        loc="outside upper left",
        ncols=max(3, 2 * columns),
        frameon=False,
        fontsize=9,
        labelcolor=INK_SOFT,
        handlelength=1.6,
        columnspacing=1.4,
    )
    return figure


def _size(record: AdaptationRecord, error: np.ndarray | None) -> float:
    """Length of an error in the unit shown."""
    assert error is not None
    return float(np.linalg.norm(shown(record, error)))

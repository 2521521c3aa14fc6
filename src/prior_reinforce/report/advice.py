"""The region as an adapter knows it: where a first throw would hit, and where to learn more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from prior_reinforce.arrays import Point, Points
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.generators.reach import Reach
from prior_reinforce.report import style
from prior_reinforce.report.panels import axis_label
from prior_reinforce.report.record import drawn_scale
from prior_reinforce.wording import CHANCES, say_chance


@style.drawing()
def draw_advice(
    path: Path,
    form: OutcomeFormat,
    demonstrated: Float[np.ndarray, "N k"],
    reached: Reach | None = None,
    *,
    goals: Points | None = None,
    p_hit: Float[np.ndarray, " n"] | None = None,
    goal: Point | None = None,
    throw: Point | None = None,
    demonstration: Point | None = None,
) -> Path:
    """Draw it as a PNG, and return the path; what cannot be reached is hatched.

    `goals` are a grid (n, 2), the second component fastest, with the probability that a first throw
    hits each; None shows what is reached. `throw` and `demonstration` are the goals of those that
    teach most; None if none does.
    """
    scale, units = drawn_scale(form), form.units
    demonstrated = scale * demonstrated
    places = demonstrated if reached is None else scale * reached.goals.reshape(-1, len(units))
    places = places if goals is None else scale * goals
    x, y = (np.unique(places[:, j]) for j in range(2))
    # As high as the region at this width, and what stands below it.
    height = 4.8 * np.ptp(x) / np.ptp(y) if units[0] == units[1] else 3.0
    height = float(np.clip(height, 1.5, 6.0))
    figure = style.new_figure(6.4, 1.1 + height)
    axes = figure.add_subplot()
    style.calm_axes(axes, grid=False)
    # As seen from the robot: ahead is up, left is left.
    axes.set_xlim(y[0], y[-1])
    axes.set_ylim(x[0], x[-1])
    if p_hit is not None:
        _shade(figure, axes, x, y, p_hit)
    marks = [
        (demonstrated, "o", 42, style.DEMONSTRATION, "demonstrated"),
    ]
    if throw is not None:
        marks.append((scale * throw[None], "*", 260, style.GOAL, "throw that teaches most"))
    if reached is not None:
        at = scale * reached.goals[..., 1], scale * reached.goals[..., 0]
        inside = reached.reached.astype(float)
        if goals is None:
            axes.contourf(*at, inside, levels=(0.5, 1.5), colors=[style.HIT], alpha=0.25)
            marks += [(np.zeros((1, 2)), "s", 42, style.INK_SOFT, "robot's base")]
            axes.fill([], [], color=style.HIT, alpha=0.25, label="can be reached")
        if not reached.reached.all():
            axes.contourf(*at, inside, levels=(-0.5, 0.5), colors="none", hatches=["///"])
            share = f"hatched: out of reach, {1 - inside.mean():.0%} of the goals"
            axes.plot([], [], color=style.INK_SOFT, label=share)
    if demonstration is not None:  # the diamond fits into the star, for both are often at one place
        shown = scale * demonstration[None]
        marks.append((shown, "D", 26, style.HIT, "demonstration that teaches most"))
    for points, mark, size, colour, label in marks:
        axes.scatter(
            points[:, 1], points[:, 0], marker=mark, s=size, color=colour,
            edgecolors=style.INK, linewidths=0.8, label=label, zorder=3, clip_on=False,
        )  # fmt: skip
    if goal is not None:
        place = np.clip(scale * goal, [x[0], y[0]], [x[-1], y[-1]])
        label = "goal" if np.allclose(place, scale * goal) else "goal, off the map"
        cross: Any = {"color": style.GOAL, "ms": 11, "mew": 2.2, "zorder": 4, "clip_on": False}
        axes.plot(place[1], place[0], "+", label=label, **cross)
    axes.invert_xaxis()
    axes.set_xlabel(axis_label(form, 1, mirrored=True))
    axes.set_ylabel(axis_label(form, 0))
    if units[0] == units[1]:
        axes.set_aspect("equal")
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.6 / height), ncols=3, frameon=False, fontsize=8
    )
    return style.save_figure(figure, path)


def _shade(
    figure: Figure,
    axes: Axes,
    x: Float[np.ndarray, " rows"],
    y: Float[np.ndarray, " columns"],
    p_hit: Float[np.ndarray, " n"],
) -> None:
    """Shade places by how likely a first throw hits them, with what shades mean beside."""
    shade = axes.pcolormesh(
        y, x, p_hit.reshape(len(x), len(y)), cmap="Greys", vmin=0.0, vmax=1.0, shading="gouraud"
    )
    bar = figure.colorbar(shade, cax=axes.inset_axes((1.04, 0, 0.035, 1)))  # as high as the panel
    bar.set_label("a first throw's hit is", color=style.INK_SOFT)
    bar.set_ticks(np.mean(CHANCES, axis=1), labels=[say_chance(low) for low, _ in CHANCES])
    bar.ax.hlines([high for _, high in CHANCES[:-1]], 0, 1, colors=style.INK_SOFT, linewidths=1)
    bar.ax.tick_params(labelsize=9, colors=style.INK_SOFT)

"""A panel that outcomes are drawn in: a line for k = 1, from above for 2, also from the side for 3.

From above, the picture is what an operator behind the robot sees: x forward is up, y left is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse, FancyArrowPatch, Rectangle
from matplotlib.ticker import MaxNLocator

from prior_reinforce.arrays import Point
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.report import style
from prior_reinforce.report.badges import draw_badges
from prior_reinforce.report.record import AdaptationRecord, Box, drawn_scale
from prior_reinforce.report.summary import titles
from prior_reinforce.session.trials import Stage
from prior_reinforce.wording import WORDS, in_words

_Place = Float[np.ndarray, "2"]
_SHORT_ARROW = 16.0  # [points]; below this a head hides more than it says


class View(NamedTuple):
    """A projection of outcomes onto paper."""

    across: int
    """Component drawn to the right, or to the left if `mirrored`."""
    up: int | None
    """Component drawn upwards; None for a line, where trials stand below each other instead."""
    mirrored: bool = False
    title: str = ""


def views_of(form: OutcomeFormat) -> list[View]:
    """Choose the views that together show all components of outcomes."""
    if form.outcome_dim == 1:
        return [View(0, None)]
    if not in_words(form):
        return [View(i, i + 1) for i in range(form.outcome_dim - 1)]
    above = View(1, 0, mirrored=True, title="from above")
    return [above] if form.outcome_dim == 2 else [above, View(0, 2, title="from the side")]


def axis_label(form: OutcomeFormat, component: int, *, mirrored: bool = False) -> str:
    """Say what an axis shows, and in words what lies at its ends."""
    unit = "cm" if drawn_scale(form) == 100 else form.units[component]
    label = f"{form.names[component]} [{unit}]"
    if not in_words(form):
        return label
    low, high = WORDS[component][:: 1 if mirrored else -1]
    return f"← {low}      {label}      {high} →"


class Panel:
    """One view of outcomes; all that is to be drawn is given in their units."""

    def __init__(
        self, axes: Axes, view: View, record: AdaptationRecord, extent: Box, n_rows: int
    ) -> None:
        """Label axes, and limit them to what is to be seen: an extent in the units drawn.

        On a line, `n_rows` stand below each other.
        """
        self._axes, self._view, self._record = axes, view, record
        style.calm_axes(axes, grid=view.up is not None)
        axes.set_title(view.title, fontsize=10, loc="left", color=style.INK_SOFT)
        axes.set_xlim(*extent[:: -1 if view.mirrored else 1, view.across])
        axes.set_xlabel(self._axis_label(view.across))
        axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
        if view.up is None:
            axes.set_ylim(-n_rows + 0.4, 0.8)
            axes.set_yticks([])
            axes.spines["left"].set_visible(False)
        else:
            axes.set_ylim(*extent[:, view.up])
            axes.set_ylabel(self._axis_label(view.up))
            axes.yaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))

    def equalise(self) -> None:
        """Widen the limits until both directions have one scale, if they have one unit.

        The figure must be laid out, and must not be laid out again.
        """
        view, axes, box = self._view, self._axes, self._axes.get_window_extent()
        if view.up is None or not self._record.unit(view.across, view.up):
            return
        (left, right), (low, high) = axes.get_xbound(), axes.get_ybound()
        half = max((right - left) / box.width, (high - low) / box.height) / 2
        across, up = (left + right) / 2, (low + high) / 2
        axes.set_xbound(across - half * box.width, across + half * box.width)
        axes.set_ybound(up - half * box.height, up + half * box.height)
        # Ticks are left out whose labels the new limits put over the figure's edge.
        (low, high), edge = axes.get_xbound(), axes.figure.bbox.x1
        ticks = zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
        inside = [(tick, label) for tick, label in ticks if low <= tick <= high]
        axes.set_xticks([tick for tick, label in inside if label.get_window_extent().x1 <= edge])

    def draw_region(self, region: Box) -> None:
        """Shade the region of goals."""
        low, high = (self._place(corner) for corner in region)
        if self._view.up is None:
            low[1], high[1] = self._axes.get_ylim()
        self._axes.add_patch(
            Rectangle(
                tuple(low), *(high - low), facecolor=style.REGION, edgecolor=style.LINE, zorder=0
            )
        )

    def draw_demonstrations(self) -> None:
        """Draw where the demonstrations ended."""
        for outcome in self._record.demonstrations.outcomes_seen:
            self._mark(self._place(outcome), "D", style.DEMONSTRATION, zorder=3)

    def draw_goal(self, record: AdaptationRecord) -> None:
        """Draw a goal and all that counts as reached."""
        x, y = self._place(record.goal)
        radius = record.format.half_axes * record.scale
        across = radius[self._view.across]
        if self._view.up is None:
            self._axes.axvspan(x - across, x + across, color=style.GOAL, alpha=0.13, linewidth=0)
            self._axes.axvline(x, color=style.GOAL, linewidth=1.6, zorder=2)
            return
        edge: Any = {"facecolor": "none", "edgecolor": style.GOAL, "linewidth": 1.6, "zorder": 4}
        size = 2 * across, 2 * radius[self._view.up]
        self._axes.add_patch(Ellipse((x, y), *size, facecolor=style.GOAL, alpha=0.13, zorder=1))
        self._axes.add_patch(Ellipse((x, y), *size, **edge))
        self._axes.plot(x, y, "+", color=style.GOAL, markersize=7, markeredgewidth=1.6, zorder=4)

    def draw_trials(
        self,
        record: AdaptationRecord,
        *,
        aims: bool = False,
        numbered: bool = True,
        with_truth: bool = False,
    ) -> None:
        """Draw where trials were seen to land, each with its error as an arrow from the goal.

        With `aims`, where they were aimed instead, each with an arrow from the aim before, hollow
        where a trial was voided; `numbered`, with their numbers, and on a line each in a row;
        `with_truth`, also where they truly landed, as far as that is known. Dashed and hollow is a
        direction alone.
        """
        places: list[_Place] = []
        true_places: list[_Place] = []
        labels: list[str] = []
        colours: list[str] = []
        for i, trial in enumerate(record.trials):
            point = trial.condition if aims else record.landings[i]
            if point is None:
                continue
            row = 1 + i if numbered else 1
            place = self._place(point, row)
            colour = style.trial_colour(i, len(record.trials), hit=trial.hit)
            start = self._place(record.goal, row)
            if aims:
                start = places[-1] if places else place
            vague = not aims and trial.number in record.directions
            if start is not place:
                self._draw_arrow(start, place, colour, dashed=aims or vague)
            if vague:
                self._mark(place, "o", "white", edge=colour, zorder=6)
            elif aims and trial.stage is Stage.VOIDED:
                self._mark(place, "s", "white", edge=colour, zorder=6)
            else:
                self._mark(place, "s" if aims else "o", colour, zorder=6)
            truth = record.true_outcomes[i]
            if with_truth and truth is not None:
                true_places.append(self._place(truth, row))
                dotted = np.stack([place, true_places[-1]]).T
                self._axes.plot(*dotted, ":", color=style.INK_SOFT, linewidth=1, zorder=5)
                self._mark(true_places[-1], "o", "white", edge=style.INK_SOFT, zorder=5)
            places.append(place)
            labels.append(str(trial.number))
            colours.append(colour)
        if numbered:
            goal = self._place(record.goal, 1)
            draw_badges(self._axes, places, labels, colours, away_from=goal, avoid=true_places)

    def name_goals(self, records: Sequence[AdaptationRecord]) -> None:
        """Call the goals what the page calls them."""
        goals = [self._place(record.goal) for record in records]
        landings = [point for r in records for point in r.landings if point is not None]
        shown = (*self._record.demonstrations.outcomes_seen, *landings)
        avoid = [self._place(point) for point in shown]
        colours, middle = [style.GOAL] * len(records), np.mean(goals, axis=0)
        draw_badges(self._axes, goals, titles(records), colours, away_from=middle, avoid=avoid)

    def _place(self, point: Point, row: int = 0) -> _Place:
        """Where an outcome stands on paper; on a line, in a row from the top."""
        view, drawn = self._view, point * self._record.scale
        return np.array([drawn[view.across], -row if view.up is None else drawn[view.up]])

    def _axis_label(self, component: int) -> str:
        mirrored = self._view.mirrored and component == self._view.across
        return axis_label(self._record.format, component, mirrored=mirrored)

    def _mark(
        self, place: _Place, marker: str, colour: str, *, edge: str = "white", zorder: int
    ) -> None:
        self._axes.plot(*place, marker, color=colour, ms=6, mec=edge, zorder=zorder)

    def _draw_arrow(self, start: _Place, end: _Place, colour: str, *, dashed: bool) -> None:
        pixels = np.diff(self._axes.transData.transform([start, end]), axis=0)
        short = np.linalg.norm(pixels) * 72 / self._axes.figure.dpi < _SHORT_ARROW
        line = (0, (2, 1.5)) if dashed else "-"
        look: Any = {"mutation_scale": 9, "shrinkA": 0, "shrinkB": 3.5, "linewidth": 1.5}
        look |= {"arrowstyle": "-" if short else "-|>", "linestyle": line, "color": colour}
        self._axes.add_patch(FancyArrowPatch(tuple(start), tuple(end), zorder=5, **look))

"""The result of an import, in about ten lines and one picture, for a person to check."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.arm.recordings.appending import appended
from prior_reinforce.arm.recordings.fit import slips
from prior_reinforce.arm.recordings.inspection import Inspection, in_rows, say_small
from prior_reinforce.arm.recordings.takes import names_in_use
from prior_reinforce.arm.recordings.units import say_names
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.files import named_disk_errors
from prior_reinforce.generators.timing.events import find_transitions
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import Polar, hand_paths
from prior_reinforce.terminal import plain
from prior_reinforce.wording import axes_of, in_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from prior_reinforce.report.panels import View
    from prior_reinforce.report.style import TimedMotion

_COLUMNS = 4
_LONGEST_NAME = 18
"""Characters of an episode's name that a panel has room for."""
_LEAST_RANGE = 0.2
"""Smallest vertical range of a channel's panel, as a share of the largest motion in its unit."""
_AT_THE_BASE = 0.2
"""So near the base, in [m], nothing is thrown or pushed (ours)."""
_AT_THE_PLACE = 0.3
"""So near a place, in [m], the tool of a hand touches what lies there. Ours: curling's flange comes
within 0.2 of the stone, and a tool in it is seldom longer."""
Corners = Int[np.ndarray, " corners"]
PlanePoints = Float[np.ndarray, "n 2"]


@dataclass(frozen=True, eq=False)
class Preview:
    """The last look before demonstrations are used."""

    source: str
    """What was read, with its format."""
    inspection: Inspection
    """The N recordings, and what became of them."""
    demonstrations: Demonstrations
    """The result; appended, the new ones alone."""
    outcomes_from: str
    """Where the outcomes are from."""

    @property
    def episodes(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return self.inspection.selection.episodes

    @cached_property
    def _whole(self) -> Demonstrations:
        """All that will be learned from: those in use as well, where these are appended."""
        before, more = self.inspection.wanted.before, self.demonstrations
        return more if before is None else appended(before, more, self.episodes)

    @property
    def _names(self) -> list[str]:
        """What to call them."""
        return [*names_in_use(self._whole.n - self.demonstrations.n), *self.episodes]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings: those of the inspection, and outcomes that occur twice or look swapped."""
        alike = tuple(
            f"{self._names[i]} and {self._names[j]} have the same outcome: the mean of both "
            "motions stands for it; if that is a slip of the pen, correct it"
            for i, j in self._whole.repeated_outcomes()
        )
        doubted = tuple(
            f"{slip.what}: put right, the motions tell outcomes {slip.better:.1f} times better; "
            "look at that in the table"
            for slip in slips(self.demonstrations, self.episodes)
        )
        places = (*self._near_base(), *self._far_from_place())
        return (*self.inspection.remarks, *places, *alike, *doubted)

    def _near_base(self) -> Iterator[str]:
        """Say it if all outcomes lie at the base, as errors from a target would."""
        form, seen = self.demonstrations.outcome_format, self.demonstrations.outcomes_seen
        far = float(np.linalg.norm(seen, axis=1).max())
        if in_words(form) and axes_of(form)[:2] == [0, 1] and far < _AT_THE_BASE:
            yield (
                f"all outcomes are within {100 * far:.2g} cm of the base: they are to be places, "
                "counted from the base, and no errors from a target"
            )

    def _far_from_place(self) -> Iterator[str]:
        """Say it of hands that never come near the place where the object is said to lie."""
        demos, gate = self.demonstrations, self.inspection.wanted.gate
        chart = None if demos.symmetry is None else demos.symmetry.chart
        if demos.symmetry is None or not isinstance(chart, Polar) or not any(chart.centre):
            return  # carried, or anywhere
        tip = (gate and gate.tool_tip) or (0.0, 0.0, 0.0)
        paths = hand_paths(demos.symmetry, demos.plans, tip=tip)
        if paths is None:
            return  # carried by an arm that does not stand at the origin
        nearest = np.linalg.norm(paths - chart.centre, axis=-1).min(axis=1)
        far = np.flatnonzero(nearest > _AT_THE_PLACE)
        if far.size:
            (x, y), where = chart.centre, say_names([self.episodes[i] for i in far])
            yield (
                f"the hand comes no nearer than {nearest[far].min():.3g} m to ({x:g}, {y:g}), "
                f"where the object is said to lie, in {where}: see [symmetry] object, whether it "
                "is counted in the arm's base frame, and for a long tool [gate] tool_tip"
            )

    @property
    def text(self) -> str:
        """About ten lines: episodes, rate, trimming, resampling, outcomes, remarks."""
        demos = self.demonstrations
        form = demos.outcome_format
        outcomes = zip(form.names, form.units, demos.outcomes_seen.T, strict=True)
        ranges = ", ".join(
            f"{n} {v.min():.3g}" + f" to {v.max():.3g}" * (len(v) > 1) + f" {u}"
            for n, u, v in outcomes
        )
        if np.any(demos.outcome_noise):
            most = say_small(float(demos.outcome_noise.max()), form.units[0])
            ranges += f", uncertain by up to {most}"
        rows = {
            "episodes": f"{demos.n} from {self.source}: {', '.join(self.episodes)}",
            **self.inspection.rows,
            "outcomes": f"{ranges}, from {self.outcomes_from}",
            "coverage": self._coverage(),
        }
        return in_rows(rows, self.remarks)

    def __repr__(self) -> str:
        """The text."""
        return self.text

    def draw(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """Draw joints over time, and outcomes with their hull; as a PNG at `path`, if given."""
        from matplotlib import colormaps, rc_context
        from matplotlib.figure import Figure

        from prior_reinforce.report.panels import views_of

        demos = self.demonstrations
        views = views_of(demos.outcome_format)
        rows = math.ceil((demos.action_dim + len(views)) / _COLUMNS)
        width, height = 3.4 * _COLUMNS, 2.6 * rows + 0.5
        figure = Figure(figsize=(width, height), dpi=110)
        colours = [colormaps["tab10"](i % 10) for i in range(demos.n)]
        plain: Any = {"text.parse_math": False, "text.usetex": False}  # names hold $
        with rc_context(plain | {"axes.titley": 1.0}):  # no ticks stand where titles do
            axes = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
            # All panels are alike, so their margins are known; measuring them took half the time.
            figure.subplots_adjust(
                0.7 / width, 0.5 / height, 1 - 0.15 / width, 1 - 0.75 / height, 0.34, 0.45
            )
            for channel in range(demos.action_dim):
                self._draw_channel(axes[channel], channel, colours)
            for at, view in enumerate(views, start=demos.action_dim):
                self._draw_outcomes(axes[at], view, colours)
            for spare in axes[demos.action_dim + len(views) :]:
                spare.set_axis_off()
            figure.suptitle(
                f"{demos.n} demonstrations as they will be learned (colour, dot where the motion "
                "ends) and as recorded (grey)"
            )
            if path is not None:
                figure.savefig(path, format="png")
        return figure

    def save(self, folder: Path) -> Path:
        """Draw it into a folder, and return its path; WorkspaceError, and no old picture, else."""
        picture = folder / "demonstrations.png"
        try:
            with named_disk_errors(folder):
                self.draw(picture)
        except WorkspaceError:
            with suppress(OSError):
                picture.unlink()
            raise
        return picture

    def _coverage(self) -> str:
        demos, points = self._whole, self._whole.outcomes_seen
        if demos.n == 1:
            if demos.symmetry is None:
                return "one outcome, and no symmetry is declared: no other goal can be reached"
            return f"one outcome; other goals are reached by the symmetry: {demos.symmetry.name}"
        gaps = np.linalg.norm(points[:, None] - points[None], axis=-1)
        gaps[np.diag_indices(demos.n)] = np.inf
        i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
        units = demos.outcome_format.units
        one_unit = f" {units[0]}" * (len(set(units)) == 1)
        pair = f"{self._names[i]} and {self._names[j]}"
        nearest = f"nearest two are {pair}, {gaps[i, j]:.3g}{one_unit} apart"
        if demos.outcome_dim == 1:
            return nearest
        corners = hull_corners(points[:, :2])
        x, y = points[corners, :2].T
        area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
        square = f" {units[0]}^2" if units[1] == units[0] else ""
        name = " and ".join(demos.outcome_format.names[:2])
        return f"hull in {name} of {area:.3g}{square} by {len(corners)} of {demos.n}; {nearest}"

    def _draw_channel(self, axes: Any, channel: int, colours: list[Any]) -> None:
        from prior_reinforce.report.style import draw_joint, widen

        demos, form = self.demonstrations, self.demonstrations.format
        times = np.arange(demos.horizon) * form.dt
        starts = self.inspection.processed.starts
        changes, grey = self._changes(channel), {"color": "0.8", "linewidth": 2.5, "zorder": 1}
        recorded = zip(self.inspection.recordings, starts, strict=True)
        drawn: list[TimedMotion] = [(r.times - start, r.positions, grey) for r, start in recorded]
        for plan, colour in zip(demos.plans, colours, strict=True):
            drawn.append((times, plan, {"color": colour, "linewidth": 1.1, "zorder": 2}))
            moving = np.flatnonzero(np.any(plan != plan[-1], axis=1))
            end = min(int(moving[-1]) + 1, len(times) - 1) if moving.size else 0
            axes.plot(times[end], plan[end, channel], "o", color=colour, markersize=3, zorder=3)
        for at in changes:
            axes.axvline(at, color="0.5", linewidth=0.6, linestyle=":", zorder=0)
        note = ", changes dotted" if len(changes) else ""
        draw_joint(axes, form, channel, drawn, note, fontsize=10)
        widen(axes, demos.plans, form.units, channel, _LEAST_RANGE)
        axes.set_xlabel("time from the plan's start [s]", fontsize=8)
        axes.tick_params(labelsize=8)

    def _changes(self, channel: int) -> Float[np.ndarray, " n"]:
        """When a step or a gripper changes, in [s]; empty for other channels."""
        demos, form = self.demonstrations, self.demonstrations.format
        steps = find_transitions(demos.plans, demos.signals)
        times = np.ravel(steps.get(channel, ())) * form.dt
        values = demos.plans[:, :, channel]
        if times.size or form.units[channel] in ("rad", "m") or not np.ptp(values):
            return times
        beyond = np.abs(values - values[:, :1]) >= 0.5 * np.ptp(values, axis=1, keepdims=True)
        return np.argmax(beyond, axis=1) * form.dt

    def _draw_outcomes(self, axes: Any, view: View, colours: list[Any]) -> None:
        """Outcomes as a report draws them, with their hull; a single component on a line."""
        demos, (across, up) = self.demonstrations, (view.across, view.up)
        names, units = demos.outcome_format.names, demos.outcome_format.units
        height = np.zeros(demos.n) if up is None else demos.outcomes_seen[:, up]
        points = np.column_stack([demos.outcomes_seen[:, across], height])
        if up is None:
            axes.set_yticks([])
        else:
            corners = hull_corners(points)
            axes.fill(*points[corners].T, color="0.9", zorder=1)
            axes.set_ylabel(f"{names[up]} [{units[up]}]", fontsize=8)
            if units[across] == units[up]:
                axes.set_aspect("equal", adjustable="datalim")
        axes.scatter(*points.T, c=colours, s=30, zorder=2)
        axes.margins(0.25)
        if view.mirrored:
            axes.invert_xaxis()
        middle = np.mean(axes.get_xlim())
        for point, episode in zip(points, self.episodes, strict=True):
            is_left = (point[0] > middle) == view.mirrored  # names run towards the middle
            name = plain(episode)
            name = name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 1]}…"
            axes.annotate(
                name, point, textcoords="offset points", xytext=(5 if is_left else -5, 4),
                fontsize=7, ha="left" if is_left else "right",
            )  # fmt: skip
        axes.set_xlabel(f"{names[across]} [{units[across]}]", fontsize=8)
        axes.set_title(f"outcomes {view.title}".strip(), fontsize=10)
        axes.tick_params(labelsize=8)


def hull_corners(points: PlanePoints) -> Corners:
    """Return indices of the corners of the convex hull, in order; none if it is flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(ConvexHull(points).vertices)
    except (QhullError, ValueError):
        return np.zeros(0, dtype=int)

"""The result of an import, in about ten lines and one picture, for a person to check."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.bench.importing.inspection import Inspection, in_rows, say_small
from prior_reinforce.plans.events import find_transitions
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.wording import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from prior_reinforce.report.panels import View

_COLUMNS = 4
_LONGEST_NAME = 18
"""Characters of an episode's name that a panel has room for."""
_LEAST_RANGE = 0.2
"""Smallest vertical range of a channel's panel, as a share of the largest motion in its unit."""
_FEWEST_TO_DOUBT, _MOST_TO_DOUBT = 7, 60
"""Demonstrations among which swapped outcomes are looked for."""
_FAR_BETTER, _TELLING, _DOUBTFUL = 2.5, 0.6, 0.5
"""By how much, below which error exchanged, above which error as they stand, in spreads."""
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
    """The result."""
    outcomes_from: str
    """Where the outcomes are from."""

    @property
    def episodes(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return self.inspection.selection.episodes

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings: those of the inspection, and outcomes that occur twice or look swapped."""
        alike = tuple(
            f"{self.episodes[i]} and {self.episodes[j]} have the same outcome: the mean of both "
            "motions stands for it; if that is a slip of the pen, correct it"
            for i, j in self.demonstrations.repeated_outcomes()
        )
        swapped = tuple(
            f"{self.episodes[i]} and {self.episodes[j]} may have each other's outcome: exchanged, "
            "the motions tell all outcomes far better; look at those two rows"
            for i, j in swapped_outcomes(self.demonstrations)
        )
        return (*self.inspection.remarks, *alike, *swapped)

    @property
    def text(self) -> str:
        """About ten lines: episodes, rate, trimming, resampling, outcomes, remarks."""
        demos = self.demonstrations
        outcomes = zip(demos.outcome_names, demos.outcome_units, demos.outcomes_seen.T, strict=True)
        ranges = ", ".join(f"{n} {v.min():.3g} to {v.max():.3g} {u}" for n, u, v in outcomes)
        if np.any(demos.outcome_noise):
            most = say_small(float(demos.outcome_noise.max()), demos.outcome_units[0])
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
        """Draw every joint over time, and the outcomes with their hull.

        Args:
            path: Where to write it (PNG), if given.

        Returns:
            The matplotlib figure.
        """
        from matplotlib import colormaps, rc_context
        from matplotlib.figure import Figure

        from prior_reinforce.report.panels import views_of

        demos = self.demonstrations
        views = views_of(demos.outcome_units)
        rows = math.ceil((demos.action_dim + len(views)) / _COLUMNS)
        width, height = 3.4 * _COLUMNS, 2.6 * rows + 0.5
        figure = Figure(figsize=(width, height), dpi=110)
        colours = [colormaps["tab10"](i % 10) for i in range(demos.n)]
        with rc_context({"text.parse_math": False, "text.usetex": False}):  # names hold $
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

    def _coverage(self) -> str:
        demos, points = self.demonstrations, self.demonstrations.outcomes_seen
        gaps = np.linalg.norm(points[:, None] - points[None], axis=-1)
        gaps[np.diag_indices(demos.n)] = np.inf
        i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
        one_unit = f" {demos.outcome_units[0]}" * (len(set(demos.outcome_units)) == 1)
        pair = f"{self.episodes[i]} and {self.episodes[j]}"
        nearest = f"nearest two are {pair}, {gaps[i, j]:.3g}{one_unit} apart"
        if demos.outcome_dim == 1:
            return nearest
        corners = hull_corners(points[:, :2])
        x, y = points[corners, :2].T
        area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
        unit = demos.outcome_units[0]
        square = f" {unit}^2" if demos.outcome_units[1] == unit else ""
        name = " and ".join(demos.outcome_names[:2])
        return f"hull in {name} of {area:.3g}{square} by {len(corners)} of {demos.n}; {nearest}"

    def _draw_channel(self, axes: Any, channel: int, colours: list[Any]) -> None:
        demos, form = self.demonstrations, self.demonstrations.format
        times = np.arange(demos.horizon) * form.dt
        starts = self.inspection.processed.starts
        for recording, start in zip(self.inspection.recordings, starts, strict=True):
            recorded = recording.positions[:, channel]
            axes.plot(recording.times - start, recorded, color="0.8", linewidth=2.5, zorder=1)
        for plan, colour in zip(demos.plans, colours, strict=True):
            axes.plot(times, plan[:, channel], color=colour, linewidth=1.1, zorder=2)
            moving = np.flatnonzero(np.any(plan != plan[-1], axis=1))
            end = min(int(moving[-1]) + 1, len(times) - 1) if moving.size else 0
            axes.plot(times[end], plan[end, channel], "o", color=colour, markersize=3, zorder=3)
        changes = self._changes(channel)
        for at in changes:
            axes.axvline(at, color="0.5", linewidth=0.6, linestyle=":", zorder=0)
        # A channel that hardly moves must not look as if it did.
        low, high = axes.get_ylim()
        like = np.array(form.units) == form.units[channel]
        least = _LEAST_RANGE * float(np.ptp(demos.plans, axis=(0, 1))[like].max())
        if high - low < least:
            axes.set_ylim((low + high - least) / 2, (low + high + least) / 2)
        kind = ", changes dotted" if len(changes) else ""
        axes.set_title(f"{form.names[channel]} [{form.units[channel]}]{kind}", fontsize=10)
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
        names, units = demos.outcome_names, demos.outcome_units
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


def swapped_outcomes(demonstrations: Demonstrations) -> list[tuple[int, int]]:
    """Return the pair whose outcomes look as if they stood in each other's row, if any.

    Outcomes are predicted from the main directions in which plans differ, each from the others; a
    pair is doubted if these predictions get 2.5 times better when its outcomes are exchanged (ours:
    23 of 56 exchanged pairs of the two shipped sets of eight are found; with six none could be).
    """
    n, k = demonstrations.outcomes_seen.shape
    if not _FEWEST_TO_DOUBT <= n <= _MOST_TO_DOUBT:
        return []
    outcomes = demonstrations.outcomes_seen - demonstrations.outcomes_seen.mean(axis=0)
    outcomes = outcomes / outcomes.std(axis=0)
    plans = demonstrations.plans - demonstrations.plans.mean(axis=0)
    spread = demonstrations.plans.std(axis=(0, 1))
    flat = (plans / np.where(spread > 0, spread, 1.0)).reshape(n, -1)
    left, sizes, _ = np.linalg.svd(flat, full_matrices=False)
    hats = []
    for directions in (k, k + 1):
        columns = np.column_stack([np.ones(n), (left * sizes)[:, :directions]])
        hats.append(columns @ np.linalg.pinv(columns))

    def error(of: np.ndarray) -> float:
        """Of predicting each from the others; the hat matrix tells it without fitting again."""
        left_out = [(of - hat @ of) / (1.0 - np.diag(hat)[:, None] + 1e-12) for hat in hats]
        return min(float(np.sqrt(np.mean(each**2))) for each in left_out)

    pairs = list(combinations(range(n), 2))
    exchanged = []
    for i, j in pairs:
        other = outcomes.copy()
        other[[i, j]] = other[[j, i]]
        exchanged.append(error(other))
    best, now = int(np.argmin(exchanged)), error(outcomes)
    is_better = exchanged[best] < min(now / _FAR_BETTER, _TELLING)
    return [pairs[best]] if is_better and now > _DOUBTFUL else []


def hull_corners(points: PlanePoints) -> Corners:
    """Return indices of the corners of the convex hull, in order; none if it is flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(ConvexHull(points).vertices)
    except (QhullError, ValueError):
        return np.zeros(0, dtype=int)

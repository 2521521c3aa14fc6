"""Timeline alignment: demonstrations before and after (paper, Figure 6).

The paper aligns by hand and shows joint 3; ours finds the shifts from the motions themselves and
shows the joint that moves most, which here is another.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from prior_reinforce.generators.timing.alignment import align
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.speeds import largest_of_unit, mean_frame, onset
from prior_reinforce.simulation.tasks import make_task
from reproduction.recipes.base import TASK, Picture, Planned, Recipe, Scale
from reproduction.recipes.tables import Columns, Table
from reproduction.results import Results, rows_of
from reproduction.units import Unit

_TASKS = (TASK, "curling", "fishing")
"""Hardware variants have the demonstrations of the first."""
_NOTHING = 1e-12
"""A range below this is rounding, not motion."""


@dataclass(frozen=True)
class Aligned(Unit):
    """When the motions of a shipped prior set begin, before and after alignment."""

    task: str
    """Whose demonstrations."""
    demonstrations: str
    """Prior set."""

    def __str__(self) -> str:
        return f"align {self.task} {self.demonstrations}"

    def run(self, folder: Path) -> Mapping[str, Any]:
        """Align it."""
        recorded = make_task(self.task).demonstrations(self.demonstrations).without_symmetry()
        alignment = align(recorded)
        both = recorded, alignment.demonstrations
        return {
            "shift_s": alignment.shifts.tolist(),
            "start_s": [_moments(onset, demonstrations) for demonstrations in both],
            "middle_s": [
                _moments(lambda speed: mean_frame(speed**2), demonstrations)
                for demonstrations in both
            ],
        }

    def rows(self, result: Mapping[str, Any]) -> list[dict[str, Any]]:
        """A row a demonstration."""
        (starts, aligned_starts), (middles, aligned_middles) = result["start_s"], result["middle_s"]
        return rows_of(
            {"learned_on": self.task, "set": self.demonstrations},
            demonstration=range(len(starts)),
            shift_s=result["shift_s"],
            start_s=starts,
            aligned_start_s=aligned_starts,
            middle_s=middles,
            aligned_middle_s=aligned_middles,
        )


def recorded_speeds(plans: Float[np.ndarray, "N H D"], units: Sequence[str]) -> np.ndarray:
    """Return how fast each plan moves frame by frame, to show rather than to compare: (N, H).

    Not smoothed, each channel relative to the largest range among the channels of its unit.
    """
    largest = largest_of_unit(np.ptp(plans, axis=1).max(axis=0), units)
    scaled = plans / np.maximum(largest, _NOTHING)
    return np.asarray(np.linalg.norm(np.gradient(scaled, axis=1), axis=-1))


def _moments(moment: Callable[[Any], float], demonstrations: Demonstrations) -> list[float]:
    """A moment of each demonstration's motion, in [s]."""
    speeds = recorded_speeds(demonstrations.plans, demonstrations.format.units)
    return [round(float(moment(speed) * demonstrations.format.dt), 5) for speed in speeds]


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """Every shipped prior set."""
    return [(Aligned(task, name), {}) for task in _TASKS for name in scale.sets]


def table(results: Results) -> Table:
    """One row a prior set; standard deviations over its demonstrations."""

    def sd(name: str) -> Callable[[Any], str]:
        return lambda of: f"{1000 * of[name].std(ddof=0):.0f}"

    columns: Columns = {
        "moved by up to [s]": lambda of: f"{of['shift_s'].abs().max():.2f}",
        "starts, sd [ms]": sd("start_s"),
        "aligned": sd("aligned_start_s"),
        "middles, sd [ms]": sd("middle_s"),
        "aligned ": sd("aligned_middle_s"),
    }
    sets = results.frame.groupby(["learned_on", "set"], sort=False)
    return Table.of(("task", "set"), dict(iter(sets)), columns)


def draw(results: Results, folder: Path) -> list[Picture]:
    """Draw one joint of the shipped demonstrations, before and after."""
    from reproduction.recipes.charts import draw_alignment

    name = results.first("set")
    shown = make_task(TASK).demonstrations(name).without_symmetry()
    joint = int(np.argmax(np.ptp(shown.plans, axis=1).mean(axis=0)))
    path = draw_alignment(
        shown.plans[:, :, joint],
        align(shown).demonstrations.plans[:, :, joint],
        f"{shown.format.names[joint]} [{shown.format.units[joint]}]",
        shown.format.dt,
        folder / "alignment.png",
    )
    caption = (
        f"{shown.format.names[joint]} of all demonstrations of {TASK}, set {name}: as recorded "
        "(top) and aligned in time (bottom). A line is a demonstration."
    )
    return [Picture(path, caption)]


RECIPE = Recipe("alignment", "Timeline alignment", "Figure 6", units, table, draw)

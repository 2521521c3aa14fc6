"""Timeline alignment: demonstrations before and after (paper, Figure 6).

The paper aligns by hand and shows joint 3; ours finds the shifts from the motions themselves and
shows the joint that moves most, which here is another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.lab.experiments.recipes.base import (
    TASK,
    Figures,
    Measurement,
    Picture,
    Recipe,
    Run,
    Table,
)
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.plans.alignment import align
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.speeds import middle, onset, recorded_speeds

_TASKS = (TASK, "curling", "fishing")
"""Hardware variants have the demonstrations of the first."""


@dataclass(frozen=True)
class AlignmentShifts(Measurement):
    """When the demonstrations' motions begin, before and after alignment."""

    def run(self, run: Run) -> dict[str, Any]:
        """Align every shipped prior set."""
        sets = run.scale.sets
        shown = make_task(TASK).demonstrations(sets[0])
        joint = int(np.argmax(np.ptp(shown.plans, axis=1).mean(axis=0)))
        return {
            "rows": [_row(task, name) for task in _TASKS for name in sets],
            "shown": {
                "set": sets[0],
                "joint": shown.format.names[joint],
                "unit": shown.format.units[joint],
                "dt_s": shown.format.dt,
                "before": shown.plans[:, :, joint].tolist(),
                "after": align(shown).demonstrations.plans[:, :, joint].tolist(),
            },
        }


def _row(task: str, name: str) -> dict[str, Any]:
    recorded = make_task(task).demonstrations(name)
    alignment = align(recorded)
    both = recorded, alignment.demonstrations
    return {
        "task": task,
        "set": name,
        "shifts_s": alignment.shifts.tolist(),
        "start_sd_s": [_spread(onset, demonstrations) for demonstrations in both],
        "middle_sd_s": [_spread(middle, demonstrations) for demonstrations in both],
    }


def _spread(moment: Callable[[Any], float], demonstrations: Demonstrations) -> float:
    """Standard deviation over demonstrations of a moment of their motion, in [s]."""
    speeds = recorded_speeds(demonstrations.plans, demonstrations.format.units)
    moments = [moment(speed) for speed in speeds]
    return float(np.std(moments) * demonstrations.format.dt)


def table(figures: Figures) -> Table:
    """One row a prior set."""
    columns = {
        "task": lambda row: row["task"],
        "set": lambda row: row["set"],
        "moved by up to [s]": lambda row: f"{max(map(abs, row['shifts_s'])):.2f}",
        "starts, sd [ms]": lambda row: f"{1000 * row['start_sd_s'][0]:.0f}",
        "aligned": lambda row: f"{1000 * row['start_sd_s'][1]:.0f}",
        "middles, sd [ms]": lambda row: f"{1000 * row['middle_sd_s'][0]:.0f}",
        "aligned ": lambda row: f"{1000 * row['middle_sd_s'][1]:.0f}",
    }
    return Table.of(figures["rows"], columns)


def draw(figures: Figures, folder: Path) -> list[Picture]:
    """Draw one joint of all demonstrations, before and after."""
    from prior_reinforce.lab.experiments.recipes.charts import draw_alignment

    shown = figures["shown"]
    path = draw_alignment(
        np.array(shown["before"]),
        np.array(shown["after"]),
        f"{shown['joint']} [{shown['unit']}]",
        shown["dt_s"],
        folder / "alignment.png",
    )
    caption = (
        f"{shown['joint']} of all demonstrations of {TASK}, set {shown['set']}: as recorded (top) "
        "and aligned in time (bottom). A line is a demonstration."
    )
    return [Picture(path, caption)]


RECIPE = Recipe("alignment", "Timeline alignment", "Figure 6", AlignmentShifts(), table, draw)

"""Timeline alignment: demonstrations before and after (paper, Figure 6).

The paper aligns by hand and shows joint 3; ours finds the shifts from the motions themselves and
shows the joint that moves most, which here is another.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from prior_reinforce.experiments.recipes.alignment_picture import draw_alignment
from prior_reinforce.experiments.recipes.base import Picture, Recipe, Run, Table
from prior_reinforce.experiments.recipes.success import TASK
from prior_reinforce.plans.alignment import align
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.timing import middle, onset, recorded_speeds
from prior_reinforce.tasks import make_task

_TASKS = (TASK, "curling", "fishing")
"""Hardware variants have the demonstrations of the first."""


class TimelineAlignment(Recipe):
    """When the demonstrations' motions begin, before and after alignment."""

    name: ClassVar[str] = "alignment"
    title: ClassVar[str] = "Timeline alignment"
    paper: ClassVar[str] = "Figure 6"

    def run(self, run: Run) -> dict[str, Any]:
        """Align every shipped prior set."""
        rows = []
        for task in _TASKS:
            for name in run.scale.sets:
                recorded = make_task(task).demonstrations(name)
                alignment = align(recorded)
                aligned = alignment.demonstrations
                rows.append(
                    {
                        "task": task,
                        "set": name,
                        "shifts_s": alignment.shifts.tolist(),
                        "start_sd_s": [_spread(onset, d) for d in (recorded, aligned)],
                        "middle_sd_s": [_spread(middle, d) for d in (recorded, aligned)],
                    }
                )
        recorded = make_task(TASK).demonstrations(run.scale.sets[0])
        joint = int(np.argmax(np.ptp(recorded.plans, axis=1).mean(axis=0)))
        return {
            "rows": rows,
            "shown": {
                "set": run.scale.sets[0],
                "joint": recorded.format.names[joint],
                "unit": recorded.format.units[joint],
                "dt_s": recorded.format.dt,
                "before": recorded.plans[:, :, joint].tolist(),
                "after": align(recorded).demonstrations.plans[:, :, joint].tolist(),
            },
        }

    def table(self, figures: Mapping[str, Any]) -> Table:
        """One row a prior set."""
        return Table(
            (
                "task", "set", "moved by up to [s]",
                "starts, sd [ms]", "aligned", "middles, sd [ms]", "aligned ",
            ),
            tuple(
                (
                    row["task"],
                    row["set"],
                    f"{max(abs(shift) for shift in row['shifts_s']):.2f}",
                    *(f"{1000 * sd:.0f}" for sd in row["start_sd_s"]),
                    *(f"{1000 * sd:.0f}" for sd in row["middle_sd_s"]),
                )
                for row in figures["rows"]
            ),
        )  # fmt: skip

    def draw(self, figures: Mapping[str, Any], folder: Path) -> list[Picture]:
        """Draw one joint of all demonstrations, before and after."""
        shown = figures["shown"]
        path = draw_alignment(
            np.array(shown["before"]),
            np.array(shown["after"]),
            f"{shown['joint']} [{shown['unit']}]",
            shown["dt_s"],
            folder / f"{self.name}.png",
        )
        return [
            Picture(
                path,
                f"{shown['joint']} of all demonstrations of {TASK}, set {shown['set']}: as "
                "recorded (top) and aligned in time (bottom). A line is a demonstration.",
            )
        ]


def _spread(times: Any, demonstrations: Demonstrations) -> float:
    """Standard deviation over demonstrations of a moment of their motion, in [s]."""
    moments = [times(speed) for speed in recorded_speeds(demonstrations)]
    return float(np.std(moments) * demonstrations.format.dt)

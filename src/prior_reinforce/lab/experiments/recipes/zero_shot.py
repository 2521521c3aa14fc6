"""How near generated plans come without any trial (the paper shows it as displacement only)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from prior_reinforce.lab.experiments.evaluation import Training, ZeroShot
from prior_reinforce.lab.experiments.recipes.base import (
    Figures,
    Measurement,
    Recipe,
    Run,
    Scale,
    Table,
    trainings_of,
)


@dataclass(frozen=True)
class ZeroShotErrors(Measurement):
    """Errors of first throws, and at the demonstrations' own outcomes.

    The latter, "own": how far each generated plan is from the demonstration, and how far from the
    demonstration's landing it lands, both without disturbances.
    """

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """Diffusion and what is included, on misaligned demonstrations."""
        return [t for name in ("diffusion", *include) for t in trainings_of(scale, name)]

    def run(self, run: Run) -> dict[str, Any]:
        """Throw once at every point of a grid."""
        trainings = self.trainings(run.scale, run.include)
        run.learn(trainings)
        results = run.results([ZeroShot(training) for training in trainings])
        return {"rows": [{**asdict(t), **r} for t, r in zip(trainings, results, strict=True)]}


def table(figures: Figures) -> Table:
    """One row a training."""
    own = "own_landing_from_demonstrated_m"
    columns = {
        "generator": lambda row: row["generator"],
        "set": lambda row: row["demonstrations"],
        "seed": lambda row: row["seed"],
        "own plans, worst rms [mrad]": lambda row: f"{max(row['own_rms_rad']) * 1e3:.1f}",
        "own landing, median [cm]": lambda row: f"{np.median(row[own]) * 100:.1f}",
        "worst [cm]": lambda row: f"{max(row[own]) * 100:.1f}",
        "grid median [cm]": lambda row: f"{row['grid_median_m'] * 100:.2f}",
        "p90 [cm]": lambda row: f"{row['grid_p90_m'] * 100:.2f}",
        "within tolerance": lambda row: f"{row['grid_within_tolerance']:.2f}",
        "lost": lambda row: f"{row['grid_lost']:.3f}",
    }
    return Table.of(figures["rows"], columns)


RECIPE = Recipe(
    "zero-shot", "First throws, before any trial", "no table of its own", ZeroShotErrors(), table,
    family="generator",
)  # fmt: skip

"""How near generated plans come without any trial (the paper shows it as displacement only)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from prior_reinforce.experiments.evaluation import Training, ZeroShot
from prior_reinforce.experiments.recipes.base import (
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
    return Table(
        (
            "generator",
            "set",
            "seed",
            "own plans, worst rms [mrad]",
            "own landing, median [cm]",
            "worst [cm]",
            "grid median [cm]",
            "p90 [cm]",
            "within tolerance",
            "lost",
        ),
        tuple(
            (
                row["generator"],
                row["demonstrations"],
                str(row["seed"]),
                f"{max(row['own_rms_rad']) * 1e3:.1f}",
                f"{np.median(row['own_landing_from_demonstrated_m']) * 100:.1f}",
                f"{max(row['own_landing_from_demonstrated_m']) * 100:.1f}",
                f"{row['grid_median_m'] * 100:.2f}",
                f"{row['grid_p90_m'] * 100:.2f}",
                f"{row['grid_within_tolerance']:.2f}",
                f"{row['grid_lost']:.3f}",
            )
            for row in figures["rows"]
        ),
    )


RECIPE = Recipe(
    name="zero-shot",
    title="First throws, before any trial",
    paper="no table of its own",
    measurement=ZeroShotErrors(),
    table=table,
    family="generator",
)

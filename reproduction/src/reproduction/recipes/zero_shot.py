"""How near generated plans come without any trial (the paper shows it as displacement only).

"Own": how far each plan for a demonstration's own outcome is from the demonstration, and how far
from the demonstration's landing it lands, both without disturbances.
"""

from __future__ import annotations

from collections.abc import Sequence

from reproduction.evaluation import ZeroShot
from reproduction.recipes.base import Planned, Recipe, Scale
from reproduction.recipes.tables import Columns, Table
from reproduction.results import Results


def units(scale: Scale, include: Sequence[str] = ()) -> list[Planned]:
    """Diffusion and what is included, on misaligned demonstrations."""
    return [
        (ZeroShot(training), {"method": name})
        for name in ("diffusion", *include)
        for training in scale.trainings(name)
    ]


def table(results: Results) -> Table:
    """One row a training."""
    by = ["method", "set", "seed", "quantity"]
    of = results.frame.groupby(by, sort=False)["value"].agg(["median", "max"]).unstack("quantity")
    own = "own_landing_from_demonstrated_m"
    columns: Columns = {
        "own plans, worst rms [mrad]": lambda row: f"{row['max', 'own_rms_rad'] * 1e3:.1f}",
        "own landing, median [cm]": lambda row: f"{row['median', own] * 100:.1f}",
        "worst [cm]": lambda row: f"{row['max', own] * 100:.1f}",
        "grid median [cm]": lambda row: f"{row['max', 'grid_median_m'] * 100:.2f}",
        "p90 [cm]": lambda row: f"{row['max', 'grid_p90_m'] * 100:.2f}",
        "within tolerance": lambda row: f"{row['max', 'grid_within_tolerance']:.2f}",
        "lost": lambda row: f"{row['max', 'grid_lost']:.3f}",
    }
    return Table.of(("generator", "set", "seed"), dict(of.iterrows()), columns)


RECIPE = Recipe(
    "zero-shot", "First throws, before any trial", "not in the paper", units, table,
    family="generator",
)  # fmt: skip

"""Commands that reproduce the paper's evidence."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.experiments.recipes import RECIPES, Scale, interval, provenance
from prior_reinforce.experiments.units import Workers, write_atomically


@dataclass(frozen=True)
class Reproduce:
    """Run a recipe of the paper's evidence; a killed run goes on where it was."""

    recipe: Annotated[str, tyro.conf.Positional]
    """Which: zero-shot, adapters, eye, or all."""
    out: Path = Path("runs/reproduce")
    """Folder for results, and for the units that they are made of."""
    goals: int = 100
    """Goals a training."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Training seeds."""
    workers: int = 1
    """Processes on this machine."""
    ray: str | None = None
    """Address of a Ray cluster to run on."""
    include: tuple[str, ...] = ()
    """One's own methods beside ours, each as module:Class."""

    def run(self) -> None:
        """Run, save, print."""
        names = list(RECIPES) if self.recipe == "all" else [self.recipe]
        for name in names:
            if name not in RECIPES:
                raise ConfigurationError(
                    f"no recipe {name!r}; recipes are {', '.join(RECIPES)}, or all"
                )
        if self.goals < 1 or self.workers < 1 or not self.seeds:
            raise ConfigurationError("--goals and --workers must be at least 1, and --seeds given")
        console = Console()
        scale = Scale(goals=self.goals, seeds=self.seeds)
        workers = Workers(self.workers, self.ray)
        columns = (
            TextColumn("{task.completed}/{task.total}"),
            BarColumn(bar_width=24),
            TimeElapsedColumn(),
            TextColumn("{task.description}"),
        )
        for name in names:
            with Progress(*columns, console=console) as progress:
                line = progress.add_task(name, total=None)

                def show(done: int, total: int, label: str) -> None:
                    progress.update(line, completed=done, total=total, description=label)  # noqa: B023

                figures = RECIPES[name](self.out, scale, workers, show, self.include)
            path = self.out / f"{name}.json"
            text = json.dumps({**provenance(scale), **figures}, indent=1)
            write_atomically(path, text + "\n")
            console.print(_table(name, figures))
            console.print(f"figures: {path}")


def _table(name: str, figures: dict[str, Any]) -> Table:
    table = Table(title=name)
    if name == "adapters":
        rounds = (1, 2, 4, 8, 10)
        for column in ("adapter", *(f"by round {r}" for r in rounds)):
            table.add_column(column)
        for adapter, success in figures["success"].items():
            cells = [str(interval(success[r - 1])) for r in rounds if r <= len(success)]
            table.add_row(adapter, *cells)
    elif name == "eye":
        for column in ("goals", "Stage-2 trials", "sd", "total N", "not reached"):
            table.add_column(column)
        for goals, row in figures["trials"].items():
            table.add_row(
                goals,
                str(interval(row["trials"])),
                f"{row['sd']:.1f}",
                f"{row['total']:.1f}",
                str(row["not_reached"]),
            )
        table.add_row("paper, real arm", "2.9", "0.9", "8.9", "")
    else:
        for column in ("generator", "set", "seed", "own rms [mrad]", "own landing [cm]",
                       "grid median [cm]", "p90", "within 1.5 cm", "lost"):  # fmt: skip
            table.add_column(column)
        for row in figures["rows"]:
            table.add_row(
                row["generator"],
                row["demonstrations"],
                str(row["seed"]),
                f"{max(row['own_rms_rad']) * 1e3:.1f}",
                f"{max(row['own_landing_m']) * 100:.1f}",
                f"{row['grid_median_m'] * 100:.2f}",
                f"{row['grid_p90_m'] * 100:.2f}",
                f"{row['grid_within_tolerance']:.2f}",
                f"{row['grid_lost']:.3f}",
            )
    return table

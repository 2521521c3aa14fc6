"""What a recipe is: which units it runs, and what is made of their rows.

Table, pictures and remarks are functions of the raw rows alone, so that they are made again in
seconds from the table of a run that took an hour.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from prior_reinforce.adapters import ADAPTERS, make_adapter
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import GENERATORS, make_generator
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from reproduction.evaluation import Training, Trials
from reproduction.recipes.tables import Table
from reproduction.results import ROUNDS, Results, Row
from reproduction.units import Unit, Workers, result_path, run_units

TASK = "basketball-v1"
"""The task of all comparisons of methods, as in the paper."""
_SLOWEST = "diffusion-paper"
"""Takes forty times as long to learn as the next."""

Family = Literal["generator", "adapter"]
_COMPARED: tuple[tuple[Family, Callable[[str], Any], Callable[[str], Any]], ...] = (
    ("generator", GENERATORS.resolve, make_generator),
    ("adapter", ADAPTERS.resolve, make_adapter),
)

Progress = Callable[[int, int, str], None]
Planned = tuple[Unit, Mapping[str, str]]
"""A unit, and columns that name its place in a recipe: `method`, `condition`."""


@dataclass(frozen=True)
class Scale:
    """How much of a recipe is run. Methods and their settings are the same at every scale."""

    goals: int = 100
    """Goals a training, as in the paper."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Training seeds."""
    sets: tuple[str, ...] = ("A", "B")
    """Prior sets."""
    rounds: int = ROUNDS
    """Trials a goal at most."""
    variants: bool = True
    """Whether what the paper does not compare is run beside it."""
    read_pictures: bool = True
    """Whether rows are run whose trials are read from pictures: they take long."""
    model: VisionLanguageModelConfig | None = None
    """Endpoint that reads the pictures; None for the camera that finds objects by colour."""
    device: str = "cpu"
    """Where networks of the paper's own size are trained and run, `cpu` or `cuda`."""

    def trainings(
        self, generator: str, task: str = TASK, *, perception: str | None = None
    ) -> list[Training]:
        """One training for each prior set and seed; `perception` sees the demonstrations."""
        return [
            Training(task, name, generator, seed, perception=perception)
            for name in self.sets
            for seed in self.seeds
        ]

    def trials(
        self, training: Training, adapter: str, perception: str, *, task: str = "", **more: Any
    ) -> Trials:
        """Its goals with what was learned, on the same task or another; `more`: other settings."""
        settings = {"goals": self.goals, "rounds": self.rounds, **more}
        return Trials(training, task or training.task, adapter, perception, **settings)


QUICK = Scale(goals=10, seeds=(0,), sets=("A",), variants=False, read_pictures=False)
"""One training a method of the paper, nothing read from pictures: decides no claim."""


@dataclass(frozen=True)
class Run:
    """Where and how units run."""

    folder: Path
    """Where units and models lie; a killed run goes on from there."""
    workers: Workers = field(default_factory=Workers)
    """Where units run."""
    progress: Progress = lambda done, total, label: None
    """Called with units done, units in all, and the label of the last one."""
    only_found: bool = False
    """Whether nothing is run: units that are not on disk give no rows."""

    def prepare(self, units: Sequence[Unit]) -> None:
        """Run what units need, before all that need it; the slowest first, so no core waits."""
        level, levels = list(units), []
        while level := list(dict.fromkeys(need for unit in level for need in unit.needs)):
            levels.append(sorted(level, key=lambda unit: _SLOWEST not in str(unit)))
        for needed in reversed(levels):
            run_units(needed, self.folder, self.workers, self.progress)

    def found(self, planned: Sequence[Planned]) -> list[Planned]:
        """Those whose results are on disk."""
        return [p for p in planned if result_path(self.folder, p[0]).is_file()]

    def rows(self, planned: Sequence[Planned]) -> list[Row]:
        """Run what is not done yet; the rows of all, each with the commit that made it."""
        if self.only_found:
            planned = self.found(planned)
        else:
            self.prepare([unit for unit, _ in planned])
        kept = run_units([unit for unit, _ in planned], self.folder, self.workers, self.progress)
        return [
            {**names, **row, "commit": of_unit.get("commit", "unknown")}
            for (unit, names), of_unit in zip(planned, kept, strict=True)
            for row in unit.rows(of_unit["result"])
        ]


@dataclass(frozen=True)
class Picture:
    """A picture that was drawn."""

    path: Path
    """PNG."""
    caption: str
    """What is seen, in a sentence or two; read aloud where the picture cannot be seen."""


@dataclass(frozen=True)
class Recipe:
    """One figure or table of the paper."""

    name: str
    """On the command line, and of its file of rows."""
    title: str
    """Heading of its section."""
    paper: str
    """The figure or table of the paper that it answers."""
    units: Callable[[Scale, Sequence[str]], list[Planned]]
    """What is run at a scale, with choices of the recipe's family put beside ours."""
    table: Callable[[Results], Table]
    """Puts the recipe's rows into a table."""
    draw: Callable[[Results, Path], list[Picture]] = lambda results, folder: []
    """Draws them as PNGs in a folder."""
    remarks: Callable[[Results], list[str]] = lambda results: []
    """Says in sentences what was measured besides the claims and must not be missed."""
    family: Family | None = None
    """Which family's members `--include` puts beside ours; None where none can join."""
    shown: Callable[[Results], Results] | None = None
    """Takes rows of all recipes for what is shown of those that belong here; None: its own rows."""
    apart: bool = False
    """Whether it is run by its name, or with `more`, and not with `all`: it takes hours."""
    on_device: bool = False
    """Whether its networks can be trained and run on a GPU."""

    @property
    def in_the_paper(self) -> bool:
        """Whether the paper has a figure or table like it."""
        return self.paper != "not in the paper"

    def rows_of(self, results: Results) -> Results:
        """The rows that table, pictures and remarks are made of."""
        return self.shown(results) if self.shown else results.where(recipe=self.name)

    def joining(self, include: Sequence[str]) -> tuple[str, ...]:
        """Which of some choices belong to the family that is compared here.

        Raises:
            ConfigurationError: One cannot be made, or is neither a generator nor an adapter.
        """
        return tuple(choice for choice in include if family_of(choice) == self.family)


def family_of(choice: str) -> Family:
    """Which family a choice belongs to.

    Raises:
        ConfigurationError: It cannot be made, or is neither a generator nor an adapter.
    """
    for family, kind_of, make in _COMPARED:
        try:
            kind_of(choice)
        except ConfigurationError as error:
            problem = error
        else:
            make(choice)
            return family
    raise ConfigurationError(
        f"{choice} is neither a Generator nor an Adapter, and only these are compared side by "
        f"side: {problem}"
    )

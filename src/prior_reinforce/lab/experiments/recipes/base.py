"""What a recipe is: a measurement that gives figures, and what is made of the figures.

Figures are one dict of plain values and intervals, kept as JSON. Table, pictures and claims are
functions of the figures alone, so a page can be drawn again from the files of a run that took an
hour.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Int

from prior_reinforce.adapters import ADAPTERS, make_adapter
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import GENERATORS, make_generator
from prior_reinforce.lab.experiments.claims import Claim
from prior_reinforce.lab.experiments.evaluation import GOAL_SEED, Training, Trials
from prior_reinforce.lab.experiments.statistics import Curve, Interval
from prior_reinforce.lab.experiments.units import Unit, Workers, commit, run_units

TASK = "basketball-v1"
"""The task of all comparisons of methods, as in the paper."""
_ROUNDS_SHOWN = (1, 2, 4, 8, 10)

Family = Literal["generator", "adapter"]
_COMPARED: tuple[tuple[Family, Callable[[str], Any], Callable[[str], Any]], ...] = (
    ("generator", GENERATORS.resolve, make_generator),
    ("adapter", ADAPTERS.resolve, make_adapter),
)

Figures = Mapping[str, Any]
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Scale:
    """How much of a recipe is run. Methods and their settings are the same at every scale."""

    goals: int = 100
    """Goals a training, as in the paper."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Training seeds."""
    sets: tuple[str, ...] = ("A", "B")
    """Prior sets."""
    rounds: int = 10
    """Trials a goal at most."""
    variants: bool = True
    """Whether what the paper does not compare is run beside it."""
    read_pictures: bool = True
    """Whether rows are run whose trials are read from pictures: they take long."""

    @property
    def trainings(self) -> int:
        """Trainings of a method: what the intervals resample besides goals."""
        return len(self.seeds) * len(self.sets)


QUICK = Scale(goals=10, seeds=(0,), sets=("A",), variants=False, read_pictures=False)
"""One training a method of the paper, nothing read from pictures: decides no claim."""


@dataclass(frozen=True)
class Run:
    """One execution of a recipe."""

    folder: Path
    """Where units and models lie; a killed run goes on from there."""
    scale: Scale
    """How much is run."""
    workers: Workers = field(default_factory=Workers)
    """Where units run."""
    progress: Progress = lambda done, total, label: None
    """Called with units done, units in all, and the label of the last one."""
    include: tuple[str, ...] = ()
    """Choices of the recipe's family that are put beside ours."""
    commits: set[str] = field(default_factory=lambda: {commit()})
    """What made the figures: this code, and whatever ran units that were found on disk."""

    def learn(self, trainings: Sequence[Training]) -> int:
        """Learn what is not learned yet, from demonstrations that are perceived first and once.

        Returns:
            How many demonstrations perception gave up on, so that they were judged by eye.
        """
        perceived = dict.fromkeys(t.perceived for t in trainings if t.perceived is not None)
        seen = self.results(list(perceived))
        self.results(trainings)
        return sum(result["failed_readings"] for result in seen)

    def results(self, units: Sequence[Unit]) -> list[Mapping[str, Any]]:
        """Run units that are not done yet; every unit's result, in order."""
        rows = run_units(units, self.folder, self.workers, self.progress)
        self.commits.update(row.get("commit", "unknown") for row in rows)
        return [row["result"] for row in rows]

    def solved_at(self, units: Sequence[Trials]) -> Int[np.ndarray, "units goals"]:
        """Trial that reached each goal, 0 where none did."""
        return np.array([result["solved_at"] for result in self.results(units)])

    def made_by(self, command: str) -> dict[str, Any]:
        """What makes the figures again: version, commits of the units, scale and seeds."""
        return {
            "command": command,
            "version": version("prior-reinforce"),
            "commit": ", ".join(sorted(self.commits)),
            "scale": asdict(self.scale),
            "goal_seed": GOAL_SEED,
        }


@dataclass(frozen=True)
class Table:
    """Text in rows and columns, the same in the terminal, in Markdown and on the page."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, rows: Sequence[Any], columns: Mapping[str, Callable[[Any], object]]) -> Table:
        """Make it from rows, and what each column shows of one."""
        cells = tuple(tuple(str(show(row)) for show in columns.values()) for row in rows)
        return cls(tuple(columns), cells)


@dataclass(frozen=True)
class Picture:
    """A picture that was drawn."""

    path: Path
    """PNG."""
    caption: str
    """What is seen, in a sentence or two; read aloud where the picture cannot be seen."""


class Measurement(ABC):
    """What a recipe measures: a frozen dataclass of settings."""

    def trainings(self, scale: Scale, include: Sequence[str] = ()) -> Sequence[Training]:
        """What is to be learned first, so that recipes can share it and learn side by side."""
        return ()

    @abstractmethod
    def run(self, run: Run) -> dict[str, Any]:
        """Run what is not done yet, and return the figures."""


@dataclass(frozen=True)
class Recipe:
    """One figure or table of the paper."""

    name: str
    """On the command line, and of its file of figures."""
    title: str
    """Heading of its section."""
    paper: str
    """The figure or table of the paper that it answers."""
    measurement: Measurement
    """What is run."""
    table: Callable[[Figures], Table]
    """Puts the figures into rows."""
    draw: Callable[[Figures, Path], list[Picture]] = lambda figures, folder: []
    """Draws the figures as PNGs in a folder."""
    claims: Callable[[Figures], list[Claim]] = lambda figures: []
    """Holds what the paper says against what was measured."""
    remarks: Callable[[Figures], list[str]] = lambda figures: []
    """Says in sentences what was measured besides the claims and must not be missed."""
    family: Family | None = None
    """Which family's members `--include` puts beside ours; None where none can join."""

    def joining(self, include: Sequence[str]) -> tuple[str, ...]:
        """Which of some choices belong to the family that is compared here.

        Raises:
            ConfigurationError: One cannot be made, or is neither a generator nor an adapter.
        """
        return tuple(choice for choice in include if family_of(choice) == self.family)


def family_of(choice: str) -> Family:
    """Which family a choice belongs to: `module:Class`, or one of ours with other settings.

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


def trainings_of(scale: Scale, generator: str, *, perception: str | None = None) -> list[Training]:
    """One training for each prior set and seed; `perception` sees the demonstrations."""
    return [
        Training(TASK, name, generator, seed, perception=perception)
        for name in scale.sets
        for seed in scale.seeds
    ]


def table_by_round(
    head: str, success: Mapping[str, Curve], ours: str, ours_minus: Mapping[str, Curve]
) -> Table:
    """One row a method: shares reached by some rounds, and how far ours is above it.

    Args:
        head: Of the first column.
        success: By what each method is called.
        ours: What ours is called in the head of the last column.
        ours_minus: Ours minus each other method.
    """
    rounds = len(next(iter(success.values())))
    shown = [r for r in _ROUNDS_SHOWN if r <= rounds]
    at = 4 if 4 in shown else shown[-1]
    rows = (
        (
            name,
            *(str(curve[r - 1]) for r in shown),
            f"{ours_minus[name][at - 1]:+.2f}" if name in ours_minus else "",
        )
        for name, curve in success.items()
    )
    header = (head, *(f"by round {r}" for r in shown), f"{ours} minus it, round {at}")
    return Table(header, tuple(rows))


def to_json(figures: Figures) -> str:
    """Figures as they are kept."""
    return json.dumps(figures, indent=1, default=asdict) + "\n"


def from_json(text: str) -> Figures:
    """Figures as they were before they became JSON."""

    def revived(values: dict[str, Any]) -> Any:
        return Interval(**values) if values.keys() == {"value", "low", "high"} else values

    figures: Figures = json.loads(text, object_hook=revived)
    return figures

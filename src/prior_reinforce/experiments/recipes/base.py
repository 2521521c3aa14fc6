"""What a recipe is: the units it needs, and what their results mean.

A recipe's figures are one JSON-able dict. Table, pictures and claims are made from the figures
alone, so a page can be drawn again from the files of a run that took an hour.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal

from prior_reinforce.experiments.code_version import commit
from prior_reinforce.experiments.evaluation import Training
from prior_reinforce.experiments.methods import family_of
from prior_reinforce.experiments.recipes.claims import Claim
from prior_reinforce.experiments.units import Unit, Workers, run_units

Progress = Callable[[int, int, str], None]
Family = Literal["generator", "adapter"]


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


def _silent(done: int, total: int, label: str) -> None:
    """Show no progress."""


@dataclass(frozen=True)
class Run:
    """One execution of a recipe."""

    folder: Path
    """Where units and models lie; a killed run goes on from there."""
    scale: Scale
    """How much is run."""
    workers: Workers = field(default_factory=Workers)
    """Where units run."""
    progress: Progress = _silent
    """Called with units done, units in all, and the label of the last one."""
    include: tuple[str, ...] = ()
    """One's own members of the recipe's family, each as module:Class."""
    commits: set[str] = field(default_factory=lambda: {commit()})
    """What made the figures: this code, and whatever ran units that were found on disk."""

    def learn(self, trainings: Sequence[Training]) -> int:
        """Learn what is not learned yet, from demonstrations that are seen first and once.

        Returns:
            How many demonstrations perception gave up on, so that they were judged by eye.
        """
        seen = self.results(list(dict.fromkeys(t.seen for t in trainings if t.seen is not None)))
        self.results(trainings)
        return sum(result["failed_readings"] for result in seen)

    def results(self, units: Sequence[Unit]) -> list[Mapping[str, Any]]:
        """Run units that are not done yet; every unit's result, in order."""
        rows = run_units(units, self.folder, self.workers, self.progress)
        self.commits.update(row.get("commit", "unknown") for row in rows)
        return [row["result"] for row in rows]


@dataclass(frozen=True)
class Table:
    """Text in rows and columns, the same in the terminal, in Markdown and on the page."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture that was drawn."""

    path: Path
    """PNG."""
    caption: str
    """What is seen, in a sentence or two; read aloud where the picture cannot be seen."""


class Recipe(ABC):
    """One figure or table of the paper."""

    name: ClassVar[str]
    """On the command line, and of its file of figures."""
    title: ClassVar[str]
    """Heading of its section."""
    paper: ClassVar[str]
    """The figure or table of the paper that it answers."""
    family: ClassVar[Family | None] = None
    """Which family's own members `--include` puts beside ours; None where none can join."""

    def trainings(self, scale: Scale, include: Sequence[str]) -> Sequence[Training]:
        """What is to be learned first, so that recipes can share it and learn side by side."""
        return ()

    def joining(self, include: Sequence[str]) -> tuple[str, ...]:
        """Which of one's own methods belong to the family that is compared here.

        Raises:
            ConfigurationError: One cannot be made, or is neither a generator nor an adapter.
        """
        return tuple(name for name in include if family_of(name) == self.family)

    @abstractmethod
    def run(self, run: Run) -> dict[str, Any]:
        """Run what is not done yet, and return the figures, JSON-able."""

    @abstractmethod
    def table(self, figures: Mapping[str, Any]) -> Table:
        """Put the figures into rows."""

    def draw(self, figures: Mapping[str, Any], folder: Path) -> list[Picture]:
        """Draw the figures as PNGs in a folder."""
        return []

    def claims(self, figures: Mapping[str, Any]) -> list[Claim]:
        """Hold what the paper says against what was measured."""
        return []

    def remarks(self, figures: Mapping[str, Any]) -> list[str]:
        """Say in sentences what was measured besides the paper's claims and must not be missed."""
        return []

"""Commands that reproduce the paper's evidence."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Column
from rich.table import Table as TerminalTable
from rich.text import Text

from prior_reinforce.commands.live import say
from prior_reinforce.errors import ConfigurationError, UnitFailedError
from prior_reinforce.extras import check_installed
from prior_reinforce.files import claim_folder, write
from prior_reinforce.generators import make_generator
from prior_reinforce.lab.experiments.evidence import claims_table, write_evidence
from prior_reinforce.lab.experiments.recipes import QUICK, RECIPES, Recipe, Run, Scale, Table
from prior_reinforce.lab.experiments.recipes.base import Progress as OnProgress
from prior_reinforce.lab.experiments.recipes.base import to_json
from prior_reinforce.lab.experiments.recipes.trials import TrialsTable
from prior_reinforce.lab.experiments.units import Workers
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

_SLOWEST = "diffusion-paper"
"""Takes forty times as long to learn as the next."""
_WIDEST = 28
"""Characters of a cell before it is wrapped."""
_BORDER = 3
"""Of each column: a space to either side, and a line."""


@dataclass(frozen=True)
class Reproduce:
    """Run a recipe of the paper's evidence; a killed run goes on where it was.

    For example:
        prior-reinforce reproduce trials --quick
    """

    recipe: Annotated[str, tyro.conf.Positional]
    """Which recipe, or all."""
    out: Path = Path("runs/reproduce")
    """Folder for results, and for the units that they are made of."""
    goals: int = 100
    """Goals a training."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Training seeds."""
    sets: tuple[Literal["A", "B"], ...] = ("A", "B")
    """Sets of demonstrations that generators learn from; one is half of the work, and decides
    less. `robustness` and `variation` have their own."""
    quick: bool = False
    """Ten goals, one training a method, no variants, no rows of the VLM: decides no claim."""
    reader: Literal["camera", "vlm"] = "camera"
    """Who reads the pictures of the VLM rows: the camera that finds objects by colour, or a model
    (--vlm.*; docs/perception.md)."""
    vlm: VisionLanguageModelConfig = field(default_factory=VisionLanguageModelConfig)
    """Endpoint and model for --reader vlm."""
    workers: int = 1
    """Processes on this machine."""
    ray: str | None = None
    """Address of a Ray cluster to run on."""
    include: tuple[str, ...] = ()
    """Generators or adapters beside ours: your own as module:Class, or ours with other settings,
    each as NAME,setting=value."""

    def run(self) -> None:
        """Run, save, print, and write the page of evidence."""
        check_installed("mujoco")
        recipes = self._recipes()
        included = {recipe.name: self._joining(recipe) for recipe in recipes}
        self._check()
        scale = QUICK if self.quick else self._scale()
        workers = Workers(self.workers, self.ray)
        console = Console()
        self._learn(recipes, included, scale, workers, console)
        failures: list[UnitFailedError] = []
        for recipe in recipes:
            try:
                with _progress(console, recipe.name) as show:
                    run = Run(self.out, scale, workers, show, included[recipe.name])
                    figures = recipe.measurement.run(run)
            except UnitFailedError as error:
                failures.append(error)  # the other recipes do not need it
                say(console, f"{recipe.name}: {error}")
            else:
                self._keep(recipe, run, figures, console)
        if len(failures) < len(recipes):
            page, _ = write_evidence(self.out)
            say(console, f"evidence: {page}")
        if failures:
            raise failures[0]

    def _learn(
        self,
        recipes: Sequence[Recipe],
        included: Mapping[str, tuple[str, ...]],
        scale: Scale,
        workers: Workers,
        console: Console,
    ) -> None:
        """Learn all that the recipes need, the slowest before the rest.

        So no core waits for the last training.
        """
        wanted = dict.fromkeys(
            training
            for recipe in recipes
            for training in recipe.measurement.trainings(scale, included[recipe.name])
        )
        trainings = sorted(wanted, key=lambda t: _SLOWEST not in t.generator)
        for choice in dict.fromkeys(training.generator for training in trainings):
            make_generator(choice)  # a library that is not installed is told now, not in an hour
        claim_folder(self.out)
        if trainings:
            # What fails here fails again in the recipes that need it, and is told there.
            with suppress(UnitFailedError), _progress(console, "learn") as show:
                Run(self.out, scale, workers, show).learn(trainings)

    def _keep(self, recipe: Recipe, run: Run, figures: Mapping[str, Any], console: Console) -> None:
        """Write a recipe's figures down and print them."""
        made_by = run.made_by(self._command(recipe, run))
        write(self.out / f"{recipe.name}.json", to_json({**made_by, **figures}))
        for part in _terminal(recipe.table(figures), recipe.title, console.width):
            console.print(part)
        if claims := recipe.claims(figures):
            for part in _terminal(claims_table(claims), f"{recipe.title}: claims", console.width):
                console.print(part)
        if len(run.commits) > 1:
            commits = ", ".join(sorted(run.commits))
            say(console, f"made by different code: {commits}; in a fresh --out all of it runs anew")

    def _check(self) -> None:
        """Refuse settings out of range, and those that would be passed over in silence."""
        if self.goals < 1 or self.workers < 1 or not self.seeds:
            raise ConfigurationError("--goals and --workers must be at least 1, and --seeds given")
        if min(self.seeds) < 0 or len(set(self.seeds)) < len(self.seeds):
            raise ConfigurationError("--seeds must be different and not negative")
        if not self.sets or len(set(self.sets)) < len(self.sets):
            raise ConfigurationError("--sets must be A, B, or both")
        if self.quick and self._scale() != Scale():
            raise ConfigurationError("--quick has its own goals, seeds and sets; leave out either")
        asked = self.reader == "vlm"
        if asked and (self.quick or self.recipe not in ("trials", "all")):
            raise ConfigurationError("--reader vlm reads the pictures of `trials`, without --quick")
        if self.vlm != VisionLanguageModelConfig() and not asked:
            raise ConfigurationError("--vlm.* say whom to ask with --reader vlm; give that as well")

    def _scale(self) -> Scale:
        """How much is asked for."""
        return Scale(goals=self.goals, seeds=self.seeds, sets=self.sets)

    def _command(self, recipe: Recipe, run: Run) -> str:
        """What makes the figures of one recipe again."""
        words = ["prior-reinforce", "reproduce", recipe.name]
        if self.quick:
            words.append("--quick")
        else:
            words += ["--goals", str(self.goals), "--seeds", *map(str, self.seeds)]
            words += ["--sets", *self.sets] if self.sets != Scale().sets else []
        for own in run.include:
            words += ["--include", own]
        measurement = recipe.measurement
        if isinstance(measurement, TrialsTable) and measurement.model is not None:
            words += ["--reader", "vlm"]
            for setting in fields(measurement.model):
                value = getattr(measurement.model, setting.name)
                flag = setting.name.replace("_", "-")
                if isinstance(value, bool):
                    words += [f"--vlm.{flag}"] if value else []
                elif value != setting.default:
                    words += [f"--vlm.{flag}", str(value)]
        return shlex.join(words)

    def _recipes(self) -> Sequence[Recipe]:
        if self.recipe not in (*RECIPES, "all"):
            raise ConfigurationError(
                f"no recipe {self.recipe!r}; recipes are {', '.join(RECIPES)}, or all"
            )
        chosen = [recipe for name, recipe in RECIPES.items() if self.recipe in (name, "all")]
        if self.reader == "camera":
            return chosen
        return [
            replace(recipe, measurement=replace(recipe.measurement, model=self.vlm))
            if isinstance(recipe.measurement, TrialsTable)
            else recipe
            for recipe in chosen
        ]

    def _joining(self, recipe: Recipe) -> tuple[str, ...]:
        joining = recipe.joining(self.include)
        if self.recipe != "all" and joining != self.include:
            stranger = next(name for name in self.include if name not in joining)
            fitting = [other.name for other in RECIPES.values() if other.joining([stranger])]
            raise ConfigurationError(
                f"recipe {recipe.name!r} does not compare methods like {stranger}; include it in "
                f"{', '.join(fitting)}, or in all"
            )
        return joining


@contextmanager
def _progress(console: Console, name: str) -> Iterator[OnProgress]:
    columns = (
        TextColumn("{task.completed}/{task.total}"),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.description}", markup=False),
    )
    with Progress(*columns, console=console) as progress:
        line = progress.add_task(name, total=None, visible=False)

        def show(done: int, total: int, label: str) -> None:
            description = f"{name}: {label}" if label else name
            progress.update(
                line, completed=done, total=total, description=description, visible=total > 0
            )

        yield show


def _terminal(table: Table, title: str, width: int) -> Iterator[TerminalTable]:
    """Tables of as many columns as a line has room for, each with those that name its rows."""
    columns = list(zip(table.header, *table.rows, strict=True))
    sizes = [_BORDER + min(_WIDEST, max(map(len, column))) for column in columns]
    names = 1  # leading columns that make a row one of its own
    while names < len(columns) and len({row[:names] for row in table.rows}) < len(table.rows):
        names += 1
    end = names
    while end < len(columns) or end == names == len(columns):
        begin, end = end, end + 1
        while end < len(columns) and sum(sizes[:names] + sizes[begin : end + 1]) < width:
            end += 1
        heads = (*table.header[:names], *table.header[begin:end])
        # As Text: rich would take [cm] for a style.
        name = Text(title) if begin == names else None
        shown = TerminalTable(*map(_column, heads), title=name, box=box.SIMPLE)
        for row in table.rows:
            shown.add_row(*map(Text, (*row[:names], *row[begin:end])))
        yield shown


def _column(header: str) -> Column:
    return Column(Text(header), overflow="fold")

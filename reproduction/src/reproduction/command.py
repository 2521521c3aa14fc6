"""The command that makes the paper's evidence: `python -m reproduction RECIPE`."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Column
from rich.table import Table as TerminalTable
from rich.text import Text

from prior_reinforce.commands.live import say
from prior_reinforce.commands.vision import Vlm, model_of
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.extras import check_installed
from prior_reinforce.files import claim_folder, write
from prior_reinforce.generators import make_generator
from reproduction.evaluation import Training
from reproduction.evidence import fill_tables, write_evidence
from reproduction.recipes import QUICK, RECIPES, Recipe, Run, Scale, Table
from reproduction.recipes.base import Planned
from reproduction.recipes.base import Progress as OnProgress
from reproduction.results import INCOMPLETE, raw_path, read_results, write_rows
from reproduction.units import UnitFailedError, Workers

_WIDEST = 28
"""Characters of a cell before it is wrapped."""
_BORDER = 3
"""Of each column: a space to either side, and a line."""


@dataclass(frozen=True)
class Reproduce:
    """Run a recipe of the paper's evidence; a killed run goes on where it was.

    For example:
        python -m reproduction trials --quick
        python -m reproduction all --from results
    """

    recipe: Annotated[
        str,
        tyro.conf.Positional,
        tyro.conf.arg(
            metavar="RECIPE",
            help=f"Which: {', '.join(RECIPES)}; `all`: everything but the slow recipes; `paper`: "
            "of those, what has a table or figure in the paper; `more`: only the slow ones.",
        ),
    ]
    out: Path | None = None
    """Folder for rows, tables and pictures, and for the units that they are made of: without it
    runs/reproduce, or that of --from."""
    goals: int = 100
    """Goals a training."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Training seeds."""
    sets: tuple[Literal["A", "B"], ...] = ("A", "B")
    """Sets of demonstrations that generators learn from; one is half of the work, and decides
    less. Some recipes have their own."""
    quick: bool = False
    """Ten goals, one training a method, no variants, no rows of the VLM: decides no claim."""
    reader: Literal["camera", "vlm"] = "camera"
    """Who reads the pictures of the VLM rows: the camera that finds objects by colour, or a model
    (--vlm; docs/perception.md)."""
    vlm: Vlm = None
    workers: int = 1
    """Processes on this machine."""
    ray: str | None = None
    """Address of a Ray cluster to run on, or `local` to start one on this machine."""
    device: Literal["cpu", "cuda"] = "cpu"
    """Where `papers-loop` trains and runs its networks."""
    include: tuple[str, ...] = ()
    """Generators or adapters beside ours: your own (--plugins MODULE), or ours with other settings,
    each as NAME,setting=value."""
    taken_from: Annotated[Path | None, tyro.conf.arg(name="from")] = None
    """Run nothing: take the units that are found in this folder, or where it has none its rows,
    and make tables, verdicts and pictures of them."""
    fill: tuple[Path, ...] = ()
    """Markdown pages whose tables of results are made anew, between `<!-- table NAME -->` lines."""

    def run(self) -> None:
        """Run, save, print, and write the page of evidence."""
        check_installed("mujoco")
        recipes = self._recipes()
        included = {recipe.name: self._joining(recipe) for recipe in recipes}
        self._check()
        planned = {r.name: r.units(self._scale, included[r.name]) for r in recipes}
        console = Console()
        if self.taken_from is None:
            self._prepare(planned, console)
        claim_folder(self._out)
        failures: list[UnitFailedError] = []
        for recipe in recipes:
            try:
                command = self._command(recipe, included[recipe.name])
                self._write_rows(recipe, planned[recipe.name], command, console)
            except UnitFailedError as error:
                failures.append(error)  # the other recipes do not need it
                say(console, f"{recipe.name}: {error}")
        if len(failures) < len(recipes):
            page, _, sections = write_evidence(self._out)
            for section in sections:
                if section.recipe in recipes:
                    for part in _terminal(section.table, section.recipe.title, console.width):
                        console.print(part)
            for filled in self.fill:
                fill_tables(filled, read_results(self._out))
            say(console, f"evidence: {page}")
        if failures:
            raise failures[0]

    def _prepare(self, planned: Mapping[str, Sequence[Planned]], console: Console) -> None:
        """Run what units of all recipes need, so that recipes share it."""
        units = [unit for of_recipe in planned.values() for unit, _ in of_recipe]
        needed = [need for unit in units for need in (unit, *unit.needs)]
        for choice in dict.fromkeys(t.generator for t in needed if isinstance(t, Training)):
            make_generator(choice)  # a library that is not installed is told now, not in an hour
        claim_folder(self._out)
        # What fails here fails again in the recipes that need it, and is told there.
        with suppress(UnitFailedError), _progress(console, "learn") as show:
            Run(self._out, Workers(self.workers, self.ray), show).prepare(units)

    def _write_rows(
        self, recipe: Recipe, planned: Sequence[Planned], command: str, console: Console
    ) -> None:
        """Run a recipe's units, or take them up, and write their rows."""
        source = self._out if self.taken_from is None else self.taken_from
        if self.taken_from is not None and not (source / "units").is_dir():
            path = raw_path(source, recipe.name)
            if path.is_file() and source.resolve() != self._out.resolve():
                write(raw_path(self._out, recipe.name), path.read_bytes())
            return
        with _progress(console, recipe.name) as show:
            workers = Workers(self.workers, self.ray)
            run = Run(source, workers, show, self.taken_from is not None)
            rows, found = run.rows(planned), len(run.found(planned))
        if found < len(planned):
            command += f"{INCOMPLETE}{found} of {len(planned)}"
        if rows:
            write_rows(self._out, recipe.name, rows, command)
        commits = sorted({row["commit"] for row in rows})
        if len(commits) > 1:
            say(
                console,
                f"made by different code: {', '.join(commits)}; in a fresh --out all runs anew",
            )

    def _check(self) -> None:
        """Refuse settings out of range, and those that would be passed over in silence."""
        if self.goals < 1 or self.workers < 1 or not self.seeds:
            raise ConfigurationError("--goals and --workers must be at least 1, and --seeds given")
        if min(self.seeds) < 0 or len(set(self.seeds)) < len(self.seeds):
            raise ConfigurationError("--seeds must be different and not negative")
        if not self.sets or len(set(self.sets)) < len(self.sets):
            raise ConfigurationError("--sets must be A, B, or both")
        if self.quick and replace(self, quick=False, reader="camera")._scale != Scale():
            raise ConfigurationError("--quick has its own goals, seeds and sets; leave out either")
        if self.device != "cpu" and not any(recipe.on_device for recipe in self._recipes()):
            raise ConfigurationError(f"{self.recipe} runs on the CPU; leave out --device")
        asked = self.reader == "vlm"
        if asked and (self.quick or self.recipe not in ("trials", "all")):
            raise ConfigurationError("--reader vlm reads the pictures of `trials`, without --quick")
        if self.vlm is not None and not asked:
            raise ConfigurationError("--vlm says whom to ask with --reader vlm; give that as well")

    @property
    def _out(self) -> Path:
        """Folder that is written to."""
        return self.out or self.taken_from or Path("runs/reproduce")

    @property
    def _scale(self) -> Scale:
        """How much is asked for."""
        model = model_of(self.vlm) if self.reader == "vlm" else None
        if self.quick:
            return QUICK
        return Scale(self.goals, self.seeds, self.sets, model=model, device=self.device)

    def _command(self, recipe: Recipe, include: Sequence[str]) -> str:
        """What makes the rows of one recipe again."""
        words = ["python", "-m", "reproduction", recipe.name]
        if self.quick:
            words.append("--quick")
        else:
            words += ["--goals", str(self.goals), "--seeds", *map(str, self.seeds)]
            words += ["--sets", *self.sets] if self.sets != Scale().sets else []
        if recipe.on_device:
            words += ["--device", self.device]
        for own in include:
            words += ["--include", own]
        said = [shlex.join(words)]
        if self._scale.model is not None and recipe.name == "trials":
            said += [
                "--reader vlm",
                *([] if self.vlm is None else ["--vlm", shlex.quote(str(self.vlm))]),
            ]
        return " ".join(said)

    def _recipes(self) -> Sequence[Recipe]:
        if self.recipe == "paper":
            return [r for r in RECIPES.values() if r.in_the_paper and not r.apart]
        if self.recipe in ("all", "more"):
            apart = self.recipe == "more"
            found = self.taken_from is not None and not apart  # takes what there is of any
            return [r for r in RECIPES.values() if found or r.apart == apart]
        if self.recipe not in RECIPES:
            raise ConfigurationError(
                f"no recipe {self.recipe!r}; recipes are {', '.join(RECIPES)}, all, paper, or more"
            )
        return [RECIPES[self.recipe]]

    def _joining(self, recipe: Recipe) -> tuple[str, ...]:
        joining = recipe.joining(self.include)
        if self.recipe in RECIPES and joining != self.include:
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
    parts = [list(range(names))]
    for column in range(names, len(columns)):
        if len(parts[-1]) > names and sum(sizes[i] for i in (*parts[-1], column)) >= width:
            parts.append(list(range(names)))
        parts[-1].append(column)
    for part in parts:
        # As Text: rich would take [cm] for a style.
        heads = [Column(Text(table.header[i]), overflow="fold") for i in part]
        name = Text(title) if part is parts[0] else None
        shown = TerminalTable(*heads, title=name, box=box.SIMPLE)
        for row in table.rows:
            shown.add_row(*(Text(row[i]) for i in part))
        yield shown

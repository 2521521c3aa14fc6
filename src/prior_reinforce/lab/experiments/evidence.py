"""Everything that is made of the raw rows: page, Markdown, pictures, and tables in other pages.

A recipe whose rows are not there is listed as not run. Rows carry the commit that made them, and
each recipe's file the command.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.errors import ConfigurationError, FileFormatError, RenderingUnavailableError
from prior_reinforce.files import write
from prior_reinforce.lab.experiments.claims import OBSERVATIONS, Judged, judge
from prior_reinforce.lab.experiments.evaluation import GOAL_SEED
from prior_reinforce.lab.experiments.recipes import RECIPES, Picture, Recipe, Table
from prior_reinforce.lab.experiments.recipes.adaptation import later
from prior_reinforce.lab.experiments.recipes.tables import Columns, mean_of
from prior_reinforce.lab.experiments.recipes.trials import told
from prior_reinforce.lab.experiments.results import (
    FIRST,
    INCOMPLETE,
    TRIALS,
    Results,
    reached,
    read_results,
)
from prior_reinforce.report.html import data_uri, render

_PACKAGE = "prior_reinforce.lab.experiments"
_TITLE = "The paper's evidence, measured on our tasks"
_NO_BREAK = "\N{NO-BREAK SPACE}"
_FILLED = re.compile(r"(<!-- table (?P<name>[\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


@dataclass(frozen=True)
class Section:
    """All that is shown of one recipe."""

    recipe: Recipe
    made_by: str
    """The command with its scale, and the code that ran it, in one line."""
    table: Table
    remarks: list[str]
    pictures: list[Picture]


def write_evidence(folder: Path) -> tuple[Path, Path, list[Section]]:
    """Make everything from the rows in a folder: `evidence.html`, `evidence.md`, `pictures/`.

    Returns:
        Paths of the page, which is whole in one file, and of the Markdown; and what is shown there.

    Raises:
        ConfigurationError: There are no rows.
        FileFormatError: Rows are damaged, or of another version's form.
    """
    results = read_results(folder)
    recipes = {name: of.rows_of(results) for name, of in RECIPES.items() if name in results.made_by}
    if not recipes:
        raise ConfigurationError(
            f"no rows in {folder / 'raw'}; expected one of "
            f"{', '.join(f'{name}.csv.gz' for name in RECIPES)}: run a recipe first"
        )
    drawn = {name: _section(RECIPES[name], of, folder / "pictures") for name, of in recipes.items()}
    judged = judge(results)
    shown: dict[str, Any] = {
        "counts": _counts(judged),
        "claims": claims_table(judged),
        "observations": observations_table(results),
        "sections": [section for section in drawn.values() if section is not None],
        "missing": [of.title for name, of in RECIPES.items() if drawn.get(name) is None],
    }
    page = render(
        "evidence.html",
        package=_PACKAGE,
        title=_TITLE,
        unbroken=_unbroken,
        source=data_uri,
        **shown,
    )
    markdown = _markdown(**shown, folder=folder)
    html, plain = write(folder / "evidence.html", page), write(folder / "evidence.md", markdown)
    return html, plain, shown["sections"]


def claims_table(judged: Sequence[Judged]) -> Table:
    """A row a claim: of the paper's form and of ours, where it speaks of them, and a control."""
    by_claim: dict[str, dict[str, Judged]] = {}
    for one in judged:
        form = "ours" if one.claim.form == "baselines" else one.claim.form
        by_claim.setdefault(one.claim.says, {})[form] = one
    columns: Columns = {
        "the paper's form": lambda of: _measured(of.get("the paper's form")),
        "verdict": lambda of: _verdict(of.get("the paper's form")),
        "ours": lambda of: _measured(of.get("ours")),
        "control": lambda of: _control(of.get("ours")),
        "verdict ": lambda of: _verdict(of.get("ours")),
    }
    return Table.of(("the paper says",), by_claim, columns)


def _measured(of: Judged | None) -> str:
    """A quantity with its interval, trainings, and p-values alone and among all tests."""
    if of is None or np.isnan(of.measured.value):
        return ""
    sign = "" if of.claim.b is None else "+"
    return f"{of.measured:{sign}.2f}; trainings: {of.trained}; p {of.p:.4f}, Holm {of.p_of_all:.4f}"


def _control(of: Judged | None) -> str:
    return "" if of is None or of.control is None else f"untrained or unadapted: {of.control}"


def _verdict(of: Judged | None) -> str:
    return "" if of is None else of.verdict


def observations_table(results: Results) -> Table:
    """What stands beside the paper's numbers without a verdict, where it was measured."""
    measured = {(of.says, of.paper): of.of(results) for of in OBSERVATIONS}
    shown = {name: quantity for name, quantity in measured.items() if quantity}
    return Table.of(("quantity", "paper"), shown, {"we measured": str})


def headlines(results: Results) -> Mapping[str, Table]:
    """Tables that other pages show, by name: README's, and those of docs/evidence.md."""
    of = {name: RECIPES[name].rows_of(results) for name in ("trials", "generators", "adapters")}
    after = later(results.where(recipe="adaptation"))
    if INCOMPLETE in results.made_by.get("adaptation", ""):
        after = after.where(recipe=())  # methods would be means of different tasks
    trials: Columns = {
        "first trials that hit": lambda of: f"{of[1].where(unseen=False).mean(FIRST).value:.2f}",
        "trials, simulated": lambda of: f"{of[1].where(unseen=False).mean(TRIALS):.2f}",
        "trials, paper (real arm)": lambda of: (
            f"{of[0].trials:.1f} ± {of[0].sd:.1f}" + (" (VLM)" if of[0].by_model else "")
        ),
    }
    four: Columns = {
        "first trials that hit": mean_of(FIRST),
        "reached within 4 trials": mean_of(reached(4)),
        "trials": mean_of(TRIALS),
        "trainings": lambda rows: rows.trained,
    }
    tasks = {(row.title, row.looks): (row, rows) for row, rows in told(of["trials"])}
    methods = {
        (recipe, name): rows
        for recipe in ("generators", "adapters")
        for name, rows in of[recipe].by("method").items()
    }
    afternoon = {"trials a goal": mean_of(TRIALS)}
    return {
        "trials": Table.of(("task", "perception"), tasks, trials),
        "methods": Table.of(("behind or before", "method"), methods, four),
        "afternoon": Table.of(("adapter",), after.by("method"), afternoon),
    }


def fill_tables(page: Path, results: Results) -> None:
    """Make the tables of a Markdown page anew, each between `<!-- table NAME -->` and the end."""
    tables = headlines(results)

    def filled(found: re.Match[str]) -> str:
        table = tables[found["name"]]
        text = "\n".join(_rows(table)) if table.rows else "Not run since raw rows are kept.\n"
        return f"{found[1]}\n{text}\n{found[3]}"

    write(page, _FILLED.sub(filled, page.read_text(encoding="utf-8")))


def _section(recipe: Recipe, results: Results, pictures: Path) -> Section | None:
    """A recipe's part of the page; None where too few of its units were run to show anything."""
    try:
        remarks = recipe.remarks(results)
        try:
            drawn = recipe.draw(results, pictures)
        except RenderingUnavailableError as error:
            drawn, remarks = [], [*remarks, f"{recipe.title}: {error}."]
        commits = ", ".join(sorted(set(results.frame["commit"])))
        return Section(
            recipe=recipe,
            made_by=f"{results.made_by[recipe.name]}; goals of seed {GOAL_SEED}; commit {commits}",
            table=recipe.table(results),
            remarks=remarks,
            pictures=drawn,
        )
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, StopIteration) as error:
        if INCOMPLETE in results.made_by[recipe.name]:
            return None
        raise FileFormatError(
            f"the rows of {recipe.name} are not of this version ({error!r}); "
            f"run `prior-reinforce reproduce {recipe.name}` again"
        ) from error


def _counts(judged: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """How many tests of each form came out how."""
    counts: dict[str, Counter[str]] = {}
    for one in judged:
        counts.setdefault(one.claim.form, Counter())[one.verdict] += 1
    return {form: dict(of.most_common()) for form, of in counts.items()}


def _unbroken(text: str) -> str:
    """A text whose intervals and percentages are never broken between lines."""
    return re.sub(r"\[[^\]]*\]|\d %", lambda match: match[0].replace(" ", _NO_BREAK), text)


def _markdown(
    counts: Mapping[str, Mapping[str, int]],
    claims: Table,
    observations: Table,
    sections: Sequence[Section],
    missing: Sequence[str],
    folder: Path,
) -> str:
    lines = [f"# {_TITLE}", ""]
    for form, of_form in counts.items():
        said = ", ".join(f"{n} {verdict}" for verdict, n in of_form.items())
        lines.append(f"- Tests of {form}: {said}.")
    lines += ["", *_rows(claims)]
    lines += ["## Beside the paper's numbers", "", *_rows(observations)]
    for section in sections:
        lines += [f"## {section.recipe.title}", "", f"Paper: {section.recipe.paper}.", ""]
        lines += [remark for text in section.remarks for remark in (text, "")]
        for picture in section.pictures:
            place = picture.path.relative_to(folder).as_posix()
            lines += [f"![{section.recipe.title}]({place})", "", picture.caption, ""]
        lines += [*_rows(section.table), f"`{section.made_by}`", ""]
    for title in missing:
        lines += [f"## {title}", "", "Not run since raw rows are kept.", ""]
    return "\n".join(lines)


def _rows(table: Table) -> list[str]:
    def line(cells: Sequence[str]) -> str:
        return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"

    return [line(table.header), line(["---"] * len(table.header)), *map(line, table.rows), ""]

"""Everything that is made of the raw rows: page, Markdown, pictures, and tables in other pages.

A recipe whose rows are not there is listed as not run. Rows carry the commit that made them, and
each recipe's file the command.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from prior_reinforce.errors import ConfigurationError, FileFormatError, RenderingUnavailableError
from prior_reinforce.files import write
from prior_reinforce.report.html import data_uri, render
from reproduction.claims import OBSERVATIONS, Judged, in_papers_form, judge
from reproduction.evaluation import GOAL_SEED
from reproduction.recipes import RECIPES, Picture, Recipe, Table
from reproduction.recipes.adaptation import later, p_hit_table
from reproduction.recipes.sets import BY_EYE, EXACT
from reproduction.recipes.tables import Columns, mean_of
from reproduction.recipes.trials import PaperRow, told
from reproduction.results import (
    FIRST,
    INCOMPLETE,
    TRIALS,
    Results,
    reached,
    read_results,
)

_PACKAGE = "reproduction"
_TITLE = "The paper's evidence, measured on our tasks"
_NO_BREAK = "\N{NO-BREAK SPACE}"
_FILLED = re.compile(r"(<!-- table (?P<name>[\w -]+?) -->\n).*?(<!-- end -->)", re.DOTALL)


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
    """Make everything from the rows in a folder: `evidence.html`, Markdown, `pictures/`.

    In Markdown, `evidence.md` has the paper's table, figures and claims, `beyond.md` the rest.

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
    before = {path: path.read_bytes() for path in (folder / "pictures").glob("*.png")}
    drawn = {name: _section(RECIPES[name], of, folder / "pictures") for name, of in recipes.items()}
    _keep_equal(before)
    judged = judge(results)
    shown: dict[str, Any] = {
        "counts": _counts(judged),
        "claims": claims_table(judged),
        "observations": observations_table(results),
        "sections": [section for section in drawn.values() if section is not None],
        "missing": [of for name, of in RECIPES.items() if drawn.get(name) is None],
    }
    page = render(
        "evidence.html",
        package=_PACKAGE,
        title=_TITLE,
        unbroken=_unbroken,
        source=data_uri,
        **shown,
    )
    html = write(folder / "evidence.html", page)
    plain = write(folder / "evidence.md", _markdown(**shown, folder=folder))
    write(folder / "beyond.md", _beyond(**shown, folder=folder))
    return html, plain, shown["sections"]


def _keep_equal(pictures: Mapping[Path, bytes]) -> None:
    """Put pictures back whose new drawing shows the same: OpenGL rounds, here and there by one."""
    from matplotlib.image import imread

    for path, old in pictures.items():
        a, b = imread(io.BytesIO(old)), imread(path)
        if a.shape == b.shape and np.abs(a - b).max() < 1.5 / 255:
            write(path, old)


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
        "control (untrained)": lambda of: _control(of.get("ours")),
        "verdict ": lambda of: _verdict(of.get("ours")),
    }
    return Table.of(("the paper says",), by_claim, columns)


def _measured(of: Judged | None) -> str:
    """A quantity with its interval, sets, and p-value among all tests (Holm)."""
    if of is None or np.isnan(of.measured.value):
        return ""
    sign = "" if of.claim.b is None else "+"
    return f"{of.measured:{sign}.2f}; {of.trained}" + (
        f"; p {of.p_of_all:.4f}" if of.measured.known else ""
    )


def _control(of: Judged | None) -> str:
    return "" if of is None or of.control is None else str(of.control)


def _verdict(of: Judged | None) -> str:
    return "" if of is None else of.verdict


def observations_table(results: Results) -> Table:
    """What stands beside the paper's numbers without a verdict, where it was measured."""
    measured = {(of.says, of.paper): of.of(results) for of in OBSERVATIONS}
    shown = {name: quantity for name, quantity in measured.items() if quantity}
    return Table.of(("quantity", "paper"), shown, {"we measured": str})


_RULES = {
    "GP": "GP, m = 2, each goal alone",
    "proportional": "proportional, 0.8",
    "GP of two terms": "GP of two terms, m = 2, each goal alone",
    "ours, remembering": "Bayesian, earlier goals too",
}
"""Adapters in README's table, by what they are called there."""


def _on_drawn(rows: Results | None, of: tuple[PaperRow, Results]) -> Any:
    row, _ = of
    tried = None if rows is None or row.task != row.learned_on else rows.where(task=row.task)
    return "" if tried is None else tried.mean(TRIALS)


def headlines(results: Results) -> Mapping[str, Callable[[], Table]]:
    """Tables in other pages, by name: README's, and those of reproduction/docs/evidence.md.

    Each is made when it is called, as a page may show one of them.
    """
    of = {name: RECIPES[name].rows_of(results) for name in ("trials", "generators", "adapters")}
    after = later(results.where(recipe="adaptation"))
    if INCOMPLETE in results.made_by.get("adaptation", ""):
        after = after.where(recipe=())  # methods would be means of different tasks
    drawn = later(results.where(recipe="sets", condition=BY_EYE)).by("method")
    trials: Columns = {
        "paper (real arm)": lambda of: f"{of[0].trials:.1f} ± {of[0].sd:.1f}",
        "the paper's form": lambda of: results.where(**in_papers_form(of[0])).mean(TRIALS),
        "ours": lambda of: of[1].where(unseen=False).mean(TRIALS),
        **{
            f"drawn sets: {name}": partial(_on_drawn, drawn.get(method))
            for name, method in _RULES.items()
        },
    }
    camera: Columns = {
        "first trials that hit": lambda of: of[1].where(unseen=False).mean(FIRST),
        "trials": lambda of: of[1].where(unseen=False).mean(TRIALS),
    }
    four: Columns = {
        "first trials that hit": mean_of(FIRST),
        "reached within 4 trials": mean_of(reached(4)),
        "trials": mean_of(TRIALS),
        "learned from": lambda rows: rows.trained,
    }
    tasks = {row.title: (row, rows) for row, rows in told(of["trials"]) if not row.by_model}
    seen = {row.title: (row, rows) for row, rows in told(of["trials"]) if row.by_model}
    network = {
        name: rows
        for recipe in ("sets-network", "sets")
        for name, rows in results.where(recipe=recipe, condition=EXACT).by("method").items()
    }
    methods = {
        (recipe, name): rows
        for recipe in ("generators", "adapters")
        for name, rows in of[recipe].by("method").items()
    }
    afternoon = {"trials a goal": mean_of(TRIALS)}
    return {
        "trials": lambda: Table.of(("task, by eye",), tasks, trials),
        "camera": lambda: Table.of(("task",), seen, camera),
        "drawn generators": lambda: Table.of(("generator",), network, four),
        "drawn adapters": lambda: Table.of(("adapter",), drawn, afternoon),
        "p-hit": lambda: p_hit_table(results.where(recipe="sets")),
        "methods": lambda: Table.of(("behind or before", "method"), methods, four),
        "once": lambda: RECIPES["once"].table(results.where(recipe="once")),
        "shown once": lambda: RECIPES["afternoon"].table(results.where(recipe="afternoon")),
        "afternoon": lambda: Table.of(("adapter",), after.by("method"), afternoon),
    }


def fill_tables(page: Path, results: Results) -> None:
    """Make the tables of a Markdown page anew, each between `<!-- table NAME -->` and the end."""
    tables = headlines(results)

    def filled(found: re.Match[str]) -> str:
        table = tables[found["name"]]()
        text = "\n".join(_rows(table)) if table.rows else "Not run.\n"
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
            f"run `python -m reproduction {recipe.name}` again"
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
    missing: Sequence[Recipe],
    folder: Path,
) -> str:
    """The paper's table and figures first, then its claims."""
    lines = [f"# {_TITLE}", "", "What is not in the paper: [beyond it](beyond.md).", ""]
    lines += _sections([s for s in sections if s.recipe.in_the_paper], folder)
    lines += _not_run([recipe for recipe in missing if recipe.in_the_paper])
    lines += ["## The paper's claims", ""]
    for form, of_form in counts.items():
        said = ", ".join(f"{n} {verdict}" for verdict, n in of_form.items())
        lines.append(f"- Tests of {form}: {said}.")
    return "\n".join([*lines, "", *_rows(claims)])


def _beyond(
    observations: Table,
    sections: Sequence[Section],
    missing: Sequence[Recipe],
    folder: Path,
    **_: Any,
) -> str:
    """What stands beside the paper's numbers, and what the paper does not have."""
    lines = [f"# {_TITLE}: beyond it", "", "## Beside the paper's numbers", ""]
    lines += _rows(observations)
    lines += _sections([s for s in sections if not s.recipe.in_the_paper], folder)
    lines += _not_run([recipe for recipe in missing if not recipe.in_the_paper])
    return "\n".join(lines)


def _sections(sections: Sequence[Section], folder: Path) -> list[str]:
    lines = []
    for section in sections:
        lines += [f"## {section.recipe.title}", "", f"Paper: {section.recipe.paper}.", ""]
        lines += [remark for text in section.remarks for remark in (text, "")]
        for picture in section.pictures:
            place = picture.path.relative_to(folder).as_posix()
            lines += [f"![{section.recipe.title}]({place})", "", picture.caption, ""]
        lines += [*_rows(section.table), f"`{section.made_by}`", ""]
    return lines


def _not_run(recipes: Sequence[Recipe]) -> list[str]:
    return [line for of in recipes for line in (f"## {of.title}", "", "Not run.", "")]


def _rows(table: Table) -> list[str]:
    def line(cells: Sequence[str]) -> str:
        return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"

    return [line(table.header), line(["---"] * len(table.header)), *map(line, table.rows), ""]

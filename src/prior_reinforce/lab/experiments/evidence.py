"""The page of evidence: every recipe's figures beside what the paper says, in HTML and Markdown.

It is made from the figures on disk alone, so it holds whatever recipes were run in a folder, each
with the scale, seeds, version and commit of its own run.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from prior_reinforce.errors import ConfigurationError, FileFormatError, RenderingUnavailableError
from prior_reinforce.files import write
from prior_reinforce.lab.experiments.claims import Claim, Verdict
from prior_reinforce.lab.experiments.recipes import RECIPES, Picture, Recipe, Table
from prior_reinforce.lab.experiments.recipes.base import Figures, from_json
from prior_reinforce.report.html import data_uri, render

_PACKAGE = "prior_reinforce.lab.experiments"
_TITLE = "The paper's evidence, measured on our tasks"
_NO_BREAK = "\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class Section:
    """All that is shown of one recipe."""

    recipe: Recipe
    made_by: str
    """The command with its scale, the code that ran it, and its version, in one line; and a note
    where what it measured is called otherwise now."""
    table: Table
    claims: list[Claim]
    remarks: list[str]
    pictures: list[Picture]


def write_evidence(folder: Path) -> tuple[Path, Path]:
    """Draw all figures found in a folder and write `evidence.html` and `evidence.md` there.

    Args:
        folder: Holds a `<recipe>.json` for each recipe that was run; pictures go to `pictures/`.

    Returns:
        Paths of the page, which is whole in one file, and of the Markdown.

    Raises:
        ConfigurationError: There are no figures in the folder.
        FileFormatError: Figures are damaged, or of another version's form.
    """
    sections = [
        _section(recipe, path, folder / "pictures")
        for recipe in RECIPES.values()
        if (path := folder / f"{recipe.name}.json").is_file()
    ]
    if not sections:
        raise ConfigurationError(
            f"no figures in {folder}; expected one of "
            f"{', '.join(f'{name}.json' for name in RECIPES)}: run a recipe first"
        )
    counts = Counter(claim.verdict for section in sections for claim in section.claims)
    page = render(
        "evidence.html",
        package=_PACKAGE,
        title=_TITLE,
        counts={verdict.value: counts[verdict] for verdict in Verdict},
        sections=sections,
        unbroken=_unbroken,
        source=data_uri,
    )
    markdown = _markdown(sections, _summary(counts), folder)
    return write(folder / "evidence.html", page), write(folder / "evidence.md", markdown)


def claims_table(claims: Sequence[Claim]) -> Table:
    """Claims as rows of text."""
    return Table(
        ("the paper says", "we measured", "verdict"),
        tuple((claim.paper, claim.measured, claim.verdict.value) for claim in claims),
    )


def _section(recipe: Recipe, path: Path, pictures: Path) -> Section:
    try:
        figures = from_json(path.read_text(encoding="utf-8"))
        remarks = recipe.remarks(figures)
        try:
            drawn = recipe.draw(figures, pictures)
        except RenderingUnavailableError as error:
            drawn, remarks = [], [*remarks, f"{recipe.title}: {error}."]
        return Section(
            recipe=recipe,
            made_by=_made_by(figures),
            table=recipe.table(figures),
            claims=recipe.claims(figures),
            remarks=remarks,
            pictures=drawn,
        )
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise FileFormatError(
            f"{path} holds no figures of this version ({error!r}); "
            f"run `prior-reinforce reproduce {recipe.name}` again"
        ) from error


def _made_by(figures: Figures) -> str:
    return (
        f"{figures['command']}; goals of seed {figures['goal_seed']}; version "
        f"{figures['version']}, commit {figures['commit']}"
        + (f". {figures['note']}" if "note" in figures else "")
    )


def _summary(counts: Counter[Verdict]) -> str:
    """How many claims came out how, in a sentence."""
    counted = ", ".join(f"{counts[verdict]} {verdict.value}" for verdict in Verdict)
    return f"Of {counts.total()} tests of the paper's claims: {counted}."


def _unbroken(text: str) -> str:
    """A text whose intervals and percentages are never broken between lines."""
    return re.sub(r"\[[^\]]*\]|\d %", lambda match: match[0].replace(" ", _NO_BREAK), text)


def _markdown(sections: Sequence[Section], summary: str, folder: Path) -> str:
    claims = [claim for section in sections for claim in section.claims]
    lines = [f"# {_TITLE}", "", summary, ""]
    if claims:
        lines += _rows(claims_table(claims))
    for section in sections:
        lines += [remark for text in section.remarks for remark in (text, "")]
    for section in sections:
        lines += [f"## {section.recipe.title}", "", f"Paper: {section.recipe.paper}.", ""]
        for picture in section.pictures:
            place = picture.path.relative_to(folder).as_posix()
            lines += [f"![{section.recipe.title}]({place})", "", picture.caption, ""]
        lines += [*_rows(section.table), f"`{section.made_by}`", ""]
    return "\n".join(lines)


def _rows(table: Table) -> list[str]:
    def line(cells: Sequence[str]) -> str:
        return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"

    return [line(table.header), line(["---"] * len(table.header)), *map(line, table.rows), ""]

"""The page of evidence, made from rows on disk."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread, imsave

from prior_reinforce.errors import ConfigurationError, FileFormatError, RenderingUnavailableError
from reproduction import recipes
from reproduction.claims import CLAIMS, judge
from reproduction.evidence import claims_table, fill_tables, write_evidence
from reproduction.recipes import Scale, alignment
from reproduction.recipes.adapters import ADAPTERS
from reproduction.recipes.base import Run
from reproduction.results import INCOMPLETE, read_results, write_rows

REPOSITORY = Path(__file__).parents[2]
REACHED = {"gp-two-term": 0.98, "gp": 0.97, "proportional": 0.9, "frozen": 0.3}
"""Share of goals that each adapter reaches in two trials; others never."""


def adapters_rows(only=()):
    """Six sets and 40 goals behind every adapter; an adapter's own luck, not the goal's."""
    rng = np.random.default_rng(0)
    return [
        {"method": label, "adapter": adapter, "perception": "amplified", "task": "basketball-v1",
         "learned_on": "basketball-v1", "set": name, "seed": seed, "goal": j, "rounds": 10,
         "solved_at": 2 * int(rng.uniform() < REACHED.get(adapter, 0.95)), "commit": "abc123"}
        for label, adapter in ADAPTERS.items() if not only or adapter in only
        for seed, name in enumerate("ABCDEF") for j in range(40)
    ]  # fmt: skip


def put(folder, name="adapters", rows=None, command="python -m reproduction this"):
    write_rows(folder, name, adapters_rows() if rows is None else rows, command)


def test_every_claim_has_a_verdict_for_each_form_that_it_speaks_of(tmp_path):
    put(tmp_path)
    rows = {row[0]: row for row in claims_table(judge(read_results(tmp_path))).rows}
    assert set(rows) == {claim.says for claim in CLAIMS}
    (alignment,) = (row for says, row in rows.items() if "alignment improves DMP" in says)
    assert (alignment[2], alignment[-1]) == ("", "not run")  # of baselines: no form of ours
    (unadapted,) = (row for says, row in rows.items() if "outperforms no adapter" in says)
    assert (unadapted[2], unadapted[-1]) == ("not run", "confirmed")


def test_the_page_holds_claims_tables_and_pictures_in_one_file(tmp_path):
    put(tmp_path)
    put(tmp_path, "alignment", Run(tmp_path).rows(alignment.units(Scale(sets=("A",)))))
    page, markdown, sections = write_evidence(tmp_path)
    assert [section.recipe.name for section in sections] == ["alignment", "adapters"]
    text, plain = page.read_text(), markdown.read_text()
    assert len(re.findall(r'src="data:image/png;base64,', text)) == 2
    assert not re.search(r'(src|href)="(?!data:|#)', text)
    for heading in ("Adapters under amplified noise", "Timeline alignment"):
        assert heading in text
        assert f"## {heading}" in plain
    assert re.search(r"- Tests of ours: .*\b1 confirmed\b", plain)  # far more than without
    assert ">1 confirmed</span>" in text
    assert "## First throws, before any trial\n\nNot run" in (tmp_path / "beyond.md").read_text()
    assert "python -m reproduction this; goals of seed 100;" in text
    assert "commit abc123" in text
    pictures = re.findall(r"!\[.*\]\((.*)\)", plain)
    assert pictures
    assert all((tmp_path / picture).is_file() for picture in pictures)


SOME = ("gp-two-term", "proportional", "frozen")
"""Enough for a difference, and for a claim to be confirmed."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Page and Markdown of some adapters' rows."""
    folder = tmp_path_factory.mktemp("evidence")
    put(folder, rows=adapters_rows(only=SOME))
    return write_evidence(folder)[:2]


def test_every_interval_of_the_page_is_made_of_the_rows(tmp_path, made):
    before = made[1].read_text()
    rows = adapters_rows(only=SOME)
    for row in rows:
        if row["adapter"] == "frozen":
            row["solved_at"] = 3
    put(tmp_path, rows=rows)
    after = write_evidence(tmp_path)[1].read_text()
    changed = [old for old, new in zip(before.splitlines(), after.splitlines(), strict=True)
               if old != new]  # fmt: skip
    assert any("no adapter" in line for line in changed)
    assert not any(line.startswith("| GP of two terms, m = 2 |") for line in changed)


def test_a_picture_that_cannot_be_drawn_costs_no_table(tmp_path, monkeypatch):
    def draw(results, folder):
        raise RenderingUnavailableError("no OpenGL here")

    monkeypatch.setitem(
        recipes.RECIPES, "adapters", replace(recipes.RECIPES["adapters"], draw=draw)
    )
    put(tmp_path)
    for path in write_evidence(tmp_path)[:2]:
        text = path.read_text()
        assert "no OpenGL here" in text
        assert "proportional, 0.8" in text


def test_the_summary_comes_before_every_picture(made):
    text = made[0].read_text()
    assert text.index("All claims") < text.index("<img")
    assert text.index(">confirmed</span>") < text.index("<img")


def test_the_page_is_the_same_when_made_again(tmp_path, made):
    put(tmp_path, rows=adapters_rows(only=SOME))
    assert [path.read_bytes() for path in write_evidence(tmp_path)[:2]] == [
        path.read_bytes() for path in made
    ]


def test_a_picture_that_shows_the_same_within_rounding_is_left_as_it_is(tmp_path, made):
    shutil.copytree(made[0].parent, tmp_path, dirs_exist_ok=True)
    (path,) = (tmp_path / "pictures").iterdir()
    drawn = (255 * imread(path)).round().astype(np.uint8)
    for by, kept in ((1, True), (40, False)):
        pixels = drawn.copy()
        pixels[:9, :9, 0] -= by
        imsave(path, pixels)
        before = path.read_bytes()
        write_evidence(tmp_path)
        assert (path.read_bytes() == before) == kept


def test_a_folder_without_rows_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="run a recipe first"):
        write_evidence(tmp_path)
    assert not list(tmp_path.iterdir())


def test_rows_of_another_form_are_named_with_their_remedy(tmp_path):
    rows = [{"method": "gp-two-term", "commit": "old"}]
    put(tmp_path, rows=rows)
    with pytest.raises(FileFormatError, match=r"rows of adapters.*reproduction adapters"):
        write_evidence(tmp_path)


def test_a_recipe_of_which_too_little_was_run_is_said_to_be_missing(tmp_path):
    put(
        tmp_path,
        rows=adapters_rows(only=SOME),
        command=f"this{INCOMPLETE}6 of 36",
    )
    put(tmp_path, "process", [{"seen": "0 0", "commit": "c"}], f"that{INCOMPLETE}1 of 6")
    page = write_evidence(tmp_path)[1].read_text()
    assert "## The process of adaptation\n\nNot run" in page
    assert f"this{INCOMPLETE}6 of 36; goals of seed" in page


def test_a_table_in_a_page_is_what_the_rows_say(tmp_path):
    put(tmp_path)
    page = tmp_path / "page.md"
    page.write_text("<!-- table methods -->\n<!-- end -->\n")
    results = read_results(tmp_path)
    fill_tables(page, results)
    filled = page.read_text()
    assert f"| {results.where(adapter='gp-two-term').trained} |" in filled
    fill_tables(page, results)
    assert page.read_text() == filled


def test_pages_show_what_the_shipped_rows_say(tmp_path):
    results = read_results(REPOSITORY / "results")
    for page in ("README.md", "reproduction/docs/evidence.md"):
        shown = (REPOSITORY / page).read_text()
        assert "<!-- table trials -->" in shown
        (tmp_path / "page.md").write_text(shown)
        fill_tables(tmp_path / "page.md", results)
        assert (tmp_path / "page.md").read_text() == shown


def test_the_shipped_table_is_small():
    assert sum(f.stat().st_size for f in (REPOSITORY / "results/raw").iterdir()) < 5e6

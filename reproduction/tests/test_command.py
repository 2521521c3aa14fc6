"""The command `reproduce`, as a user types it."""

import io
import shlex
from dataclasses import dataclass
from pathlib import Path

import pytest
import tyro
from rich.console import Console

from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from reproduction.__main__ import main
from reproduction.command import Reproduce, _terminal
from reproduction.evaluation import Training, Trials
from reproduction.recipes import RECIPES, Recipe, Scale, Table
from reproduction.results import raw_path, read_results

GENERATOR, ADAPTER = "interpolation,timing=none", "frozen"


def test_a_recipe_leaves_rows_and_a_page_that_is_made_again_from_them(tmp_path, capsys):
    tmp_path = tmp_path / ("deep" * 20)  # its name is longer than a line of the terminal
    assert main(["alignment", "--quick", "--out", str(tmp_path)]) == 0
    results = read_results(tmp_path)
    assert results.made_by == {"alignment": "python -m reproduction alignment --quick"}
    assert set(results.frame["set"]) == {"A"}
    assert "Timeline alignment" in (tmp_path / "evidence.html").read_text()
    assert (tmp_path / "pictures" / "alignment.png").is_file()
    printed = capsys.readouterr().out
    assert "0.28" in printed  # shipped throws were moved by up to that many seconds
    assert str(tmp_path / "evidence.html") in printed
    assert "[ms]" in printed  # rich would take it for a style
    # The rows alone, elsewhere, give the same bytes; and so do the units.
    rows = tmp_path / "alone"
    (rows / "raw").mkdir(parents=True)
    (rows / "raw" / "alignment.csv.gz").write_bytes(raw_path(tmp_path, "alignment").read_bytes())
    made = {}
    for name, source in (("rows", rows), ("units", tmp_path)):
        out = tmp_path / f"from {name}"
        command = ["all", "--quick", "--from", str(source), "--out", str(out)]
        assert main(command) == 0
        made[name] = [(out / "evidence.md").read_bytes(), raw_path(out, "alignment").read_bytes()]
    assert made["rows"] == made["units"]
    assert made["rows"][0] == (tmp_path / "evidence.md").read_bytes()


def test_what_is_taken_up_is_not_run(tmp_path, capsys):
    (tmp_path / "units").mkdir()
    assert main(["all", "--from", str(tmp_path), "--out", str(tmp_path / "o")]) == 2
    assert "run a recipe first" in capsys.readouterr().err
    assert not list((tmp_path / "units").iterdir())


def test_tables_of_a_page_are_filled_where_they_are_marked(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- table trials -->\nold\n<!-- end -->\nafter\n")
    arguments = ["--quick", "--out", str(tmp_path / "run"), "--fill", str(page)]
    assert main(["alignment", *arguments]) == 0
    text = page.read_text()
    assert text.startswith("before\n<!-- table trials -->\n\nNot run")
    assert text.endswith("<!-- end -->\nafter\n")
    assert "old" not in text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing"], "recipes are"),
        (["adapters", "--include", GENERATOR], "include it in generators, zero-shot"),
        (["generators", "--include", ADAPTER], "include it in trials, adapters"),
        (["alignment", "--include", ADAPTER], "does not compare"),
        (["all", "--include", "nothing-of-ours"], "registered by the module that --plugins names"),
        (["all", "--include", "exact"], "neither"),
        (["all", "--goals", "0"], "at least 1"),
        (["alignment", "--device", "cuda"], "runs on the CPU; leave out --device"),
        (["all", "--seeds", "0", "0", "1"], "different"),
        (["all", "--seeds", "-1"], "not negative"),
        (["all", "--sets", "A", "A"], "A, B, or both"),
        (["all", "--quick", "--goals", "50"], "leave out either"),
        (["all", "--quick", "--sets", "A"], "leave out either"),
        (["all", "--quick", "--reader", "vlm"], "without --quick"),
        (["adapters", "--reader", "vlm"], "the pictures of `trials`"),
        (["trials", "--vlm", "mine.toml"], "with --reader vlm"),
    ],
)
def test_wrong_input_is_one_line_and_writes_nothing(tmp_path, capsys, arguments, said):
    folder = tmp_path / "run"
    assert main([*arguments, "--out", str(folder)]) == 2
    printed = capsys.readouterr().err
    assert said in printed
    assert printed.count("\n") == 1
    assert not folder.exists()


def test_all_leaves_out_what_takes_hours_and_more_is_that():
    choices = ("all", "paper", "more")
    named = {name: {r.name for r in Reproduce(name)._recipes()} for name in choices}
    assert named["all"] - named["paper"] == {"zero-shot", "adaptation", "ways"}
    assert named["more"] == {
        "sets", "sets-network", "adaptation-network", "papers-form", "papers-loop", "robustness",
        "variation", "once", "afternoon",
    }  # fmt: skip
    assert named["all"] == set(RECIPES) - named["more"]
    assert {r.name for r in Reproduce("all", taken_from=Path("x"))._recipes()} == set(RECIPES)


def test_a_model_reads_the_pictures_of_the_table_of_trials(tmp_path):
    (tmp_path / "mine.toml").write_text('[vlm]\nmodel = "mine"\n')
    model = VisionLanguageModelConfig(model="mine")
    assert Reproduce("all", reader="vlm", vlm=tmp_path / "mine.toml")._scale.model == model
    assert Reproduce("all")._scale == Scale()


def test_rows_name_the_command_that_makes_them_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("my model.toml").write_text("[vlm]\nvotes = 1\n")
    model = Path("my model.toml")
    reproduce = Reproduce("all", goals=7, seeds=(0, 3), reader="vlm", vlm=model)
    zero_shot = reproduce._command(RECIPES["zero-shot"], (GENERATOR,))
    trials = reproduce._command(RECIPES["trials"], ())
    assert zero_shot == (
        f"python -m reproduction zero-shot --goals 7 --seeds 0 3 --include {GENERATOR}"
    )
    assert trials == (
        "python -m reproduction trials --goals 7 --seeds 0 3 --reader vlm --vlm 'my model.toml'"
    )
    for command in (zero_shot, trials):
        again = tyro.cli(Reproduce, args=shlex.split(command)[3:])
        assert again.goals == 7
        assert again.seeds == (0, 3)
    assert again.vlm == model
    half = Reproduce("variation", sets=("A",))
    assert half._scale.sets == ("A",)
    assert half._command(RECIPES["variation"], ()) == (
        "python -m reproduction variation --goals 100 --seeds 0 1 2 --sets A"
    )
    quick = Reproduce("all", quick=True)._command(RECIPES["adapters"], ())
    assert quick == "python -m reproduction adapters --quick"


@dataclass(frozen=True)
class BrokenTraining(Training):
    def run(self, folder):
        raise ValueError("no such luck")


BROKEN = Recipe(
    "broken", "Broken", "none",
    lambda scale, include: [
        (Trials(BrokenTraining("basketball-v1", "A", "nearest", 0), "curling", "gp", "eye", 1), {})
    ],
    table=lambda results: None,
)  # fmt: skip


def test_a_recipe_that_fails_costs_no_other_its_rows(tmp_path, capsys, monkeypatch):
    recipes = {"broken": BROKEN, "alignment": RECIPES["alignment"]}
    monkeypatch.setattr("reproduction.command.RECIPES", recipes)
    assert main(["all", "--quick", "--out", str(tmp_path)]) == 2
    assert "no such luck" in capsys.readouterr().err
    assert "Timeline alignment" in (tmp_path / "evidence.html").read_text()


def test_a_table_wider_than_the_terminal_is_folded_into_several_with_the_first_column():
    row = ("by eye", *(f"{i}.00 [1.00, 2.00]" for i in range(12)))
    table = Table(("condition", *(f"rule {i}" for i in range(12))), (row,))
    console = Console(width=100, file=io.StringIO())
    for part in _terminal(table, "Trials [m]", 100):
        console.print(part)
    lines = console.file.getvalue().splitlines()
    heads = [line.split() for line in lines if "condition" in line]
    assert len(heads) == 3
    assert [int(n) for head in heads for n in head if n.isdecimal()] == list(range(12))
    assert sum("by eye" in line for line in lines) == 3
    assert max(map(len, lines)) <= 100
    assert len([*_terminal(table, "", 1000)]) == 1


def test_every_part_of_a_folded_table_names_its_rows_and_fits():
    rows = tuple(("diffusion", f"set {key}", *(f"{i}.00 cm" for i in range(9))) for key in "AB")
    table = Table(("method", "set", *(f"figure {i}" for i in range(9))), rows)
    parts = [*_terminal(table, "Zero-shot", 60)]
    console = Console(width=60, file=io.StringIO())
    for part in parts:
        assert console.measure(part).maximum <= 60
        console.print(part)
    assert len(parts) == 3
    assert console.file.getvalue().count("set A") == 3
    assert console.file.getvalue().count("Zero-shot") == 1
    (alone,) = _terminal(Table(("name",), (("one",),)), "", 60)
    assert alone.row_count == 1

"""The command `reproduce`, as a user types it."""

import io
import json
import shlex
from dataclasses import dataclass

import pytest
import tyro
from rich.console import Console

from prior_reinforce.cli import main
from prior_reinforce.commands.reproduce import Reproduce, _terminal
from prior_reinforce.lab.experiments.evaluation import Training
from prior_reinforce.lab.experiments.recipes import RECIPES, Measurement, Recipe, Run, Scale, Table
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

GENERATOR = "prior_reinforce.generators.interpolation:SmoothInterpolation"
ADAPTER = "prior_reinforce.adapters.frozen:FrozenAdapter"


def test_a_recipe_leaves_figures_and_a_page(tmp_path, capsys):
    tmp_path = tmp_path / ("deep" * 20)  # its name is longer than a line of the terminal
    assert main(["reproduce", "alignment", "--quick", "--out", str(tmp_path)]) == 0
    figures = json.loads((tmp_path / "alignment.json").read_text())
    assert figures["scale"]["seeds"] == [0]
    assert figures["commit"]
    assert "Timeline alignment" in (tmp_path / "evidence.html").read_text()
    assert (tmp_path / "pictures" / "alignment.png").is_file()
    printed = capsys.readouterr().out
    assert "0.28" in printed  # shipped throws were moved by up to that many seconds
    assert str(tmp_path / "evidence.html") in printed
    assert "[ms]" in printed  # rich would take it for a style


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing"], "recipes are"),
        (["adapters", "--include", GENERATOR], "include it in zero-shot, generators"),
        (["generators", "--include", ADAPTER], "include it in adapters"),
        (["alignment", "--include", ADAPTER], "does not compare"),
        (["all", "--include", "nowhere:Thing"], "cannot import nowhere:Thing"),
        (["all", "--include", "prior_reinforce.perception.exact:Exact"], "neither"),
        (["all", "--goals", "0"], "at least 1"),
        (["all", "--seeds", "0", "0", "1"], "different"),
        (["all", "--seeds", "-1"], "not negative"),
        (["all", "--sets", "A", "A"], "A, B, or both"),
        (["all", "--quick", "--goals", "50"], "leave out either"),
        (["all", "--quick", "--sets", "A"], "leave out either"),
        (["all", "--quick", "--reader", "vlm"], "without --quick"),
        (["adapters", "--reader", "vlm"], "the pictures of `trials`"),
        (["trials", "--vlm.model", "mine"], "with --reader vlm"),
    ],
)
def test_wrong_input_is_one_line_and_writes_nothing(tmp_path, capsys, arguments, said):
    folder = tmp_path / "run"
    assert main(["reproduce", *arguments, "--out", str(folder)]) == 2
    printed = capsys.readouterr().err
    assert said in printed
    assert printed.count("\n") == 1
    assert not folder.exists()


def test_a_model_reads_the_pictures_of_the_table_of_trials_alone():
    model = VisionLanguageModelConfig(model="mine")
    recipes = {r.name: r for r in Reproduce("all", reader="vlm", vlm=model)._recipes()}
    assert list(recipes) == list(RECIPES)
    assert recipes["trials"].measurement.model is model
    assert all(recipes[name] is RECIPES[name] for name in recipes if name != "trials")
    assert Reproduce("trials")._recipes() == [RECIPES["trials"]]


def test_figures_name_the_command_that_makes_them_again(tmp_path):
    model = VisionLanguageModelConfig(model="my model", votes=1, enable_thinking=True)
    reproduce = Reproduce("all", goals=7, seeds=(0, 3), reader="vlm", vlm=model)
    commands = {
        recipe.name: reproduce._command(
            recipe, Run(tmp_path, Scale(), include=(GENERATOR,) if i == 0 else ())
        )
        for i, recipe in enumerate(reproduce._recipes())
    }
    assert commands["zero-shot"] == (
        f"prior-reinforce reproduce zero-shot --goals 7 --seeds 0 3 --include {GENERATOR}"
    )
    assert commands["trials"] == (
        "prior-reinforce reproduce trials --goals 7 --seeds 0 3 --reader vlm "
        "--vlm.model 'my model' --vlm.enable-thinking --vlm.votes 1"
    )
    for name in ("zero-shot", "trials"):
        again = tyro.cli(Reproduce, args=shlex.split(commands[name])[2:])
        assert again.goals == 7
        assert again.seeds == (0, 3)
    assert again.vlm == model
    half = Reproduce("variation", sets=("A",))
    assert half._scale().sets == ("A",)
    assert half._command(RECIPES["variation"], Run(tmp_path, half._scale())) == (
        "prior-reinforce reproduce variation --goals 100 --seeds 0 1 2 --sets A"
    )
    quick = Reproduce("all", quick=True)._command(RECIPES["adapters"], Run(tmp_path, Scale()))
    assert quick == "prior-reinforce reproduce adapters --quick"


@dataclass(frozen=True)
class BrokenTraining(Training):
    def run(self, folder):
        raise ValueError("no such luck")


@dataclass(frozen=True)
class Broken(Measurement):
    def trainings(self, scale, include=()):
        return [BrokenTraining("basketball-v1", "A", "nearest", 0)]

    def run(self, run):
        run.learn(self.trainings(run.scale))
        raise AssertionError("what failed was not told")


BROKEN = Recipe("broken", "Broken", "none", Broken(), table=lambda figures: None)


def test_a_recipe_that_fails_costs_no_other_its_figures(tmp_path, capsys, monkeypatch):
    recipes = {"broken": BROKEN, "alignment": RECIPES["alignment"]}
    monkeypatch.setattr("prior_reinforce.commands.reproduce.RECIPES", recipes)
    assert main(["reproduce", "all", "--quick", "--out", str(tmp_path)]) == 2
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

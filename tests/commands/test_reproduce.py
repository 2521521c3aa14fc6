"""The command `reproduce`, as a user types it."""

import json

import pytest

from prior_reinforce.cli import main
from prior_reinforce.experiments.recipes import RECIPES

GENERATOR = "prior_reinforce.generators:SmoothInterpolation"
ADAPTER = "prior_reinforce.adapters:FrozenAdapter"


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


def test_units_in_brackets_are_printed(tmp_path, capsys):
    main(["reproduce", "alignment", "--quick", "--out", str(tmp_path)])
    assert "[ms]" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing"], "recipes are"),
        (["adapters", "--include", GENERATOR], "include it in zero-shot, generators"),
        (["generators", "--include", ADAPTER], "include it in adapters"),
        (["alignment", "--include", ADAPTER], "does not compare"),
        (["all", "--include", "nowhere:Thing"], "cannot make nowhere:Thing"),
        (["all", "--include", "prior_reinforce.perception:Exact"], "neither"),
        (["all", "--goals", "0"], "at least 1"),
    ],
)
def test_wrong_input_is_one_line_and_writes_nothing(tmp_path, capsys, arguments, said):
    folder = tmp_path / "run"
    assert main(["reproduce", *arguments, "--out", str(folder)]) == 2
    printed = capsys.readouterr().err
    assert said in printed
    assert printed.count("\n") == 1
    assert not folder.exists()


def test_with_all_everyone_joins_the_recipes_of_their_family():
    joined = {name: recipe.joining([GENERATOR, ADAPTER]) for name, recipe in RECIPES.items()}
    assert joined["generators"] == joined["zero-shot"] == (GENERATOR,)
    assert joined["adapters"] == (ADAPTER,)
    assert joined["alignment"] == joined["displacement"] == ()


def test_every_recipe_goes_by_its_name():
    assert [recipe.name for recipe in RECIPES.values()] == list(RECIPES)

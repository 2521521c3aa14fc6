"""Who joins which comparison, and what made the figures."""

import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.lab.experiments.recipes import RECIPES, Run, Scale
from prior_reinforce.lab.experiments.recipes.base import (
    family_of,
    from_json,
    table_by_round,
    to_json,
)
from prior_reinforce.lab.experiments.statistics import Interval

GENERATOR = "prior_reinforce.generators.interpolation:SmoothInterpolation"
ADAPTER = "prior_reinforce.adapters.frozen:FrozenAdapter"


@pytest.mark.parametrize(
    ("choice", "family"),
    [
        (GENERATOR, "generator"),
        (ADAPTER, "adapter"),
        ("nearest,timing=align", "generator"),
        ("proportional,gain=0.5", "adapter"),
    ],
)
def test_a_choice_tells_its_family(choice, family):
    assert family_of(choice) == family


@pytest.mark.parametrize(
    "choice",
    [
        "prior_reinforce.perception.exact:Exact",
        "nothing-of-ours",
        "nowhere:Thing",
        "json:JSONDecoder",
        "proportional,again=1",
    ],
)
def test_what_is_neither_generator_nor_adapter_is_refused(choice):
    with pytest.raises(ConfigurationError):
        family_of(choice)


def test_everyone_joins_the_recipes_of_their_family():
    joined = {name: recipe.joining([GENERATOR, ADAPTER]) for name, recipe in RECIPES.items()}
    assert joined["generators"] == joined["zero-shot"] == (GENERATOR,)
    assert joined["adapters"] == (ADAPTER,)
    assert joined["alignment"] == joined["displacement"] == ()


def test_every_recipe_goes_by_its_name():
    assert [recipe.name for recipe in RECIPES.values()] == list(RECIPES)


def test_figures_tell_what_made_them(tmp_path):
    made_by = Run(tmp_path, Scale(goals=7), commits={"b", "a"}).made_by("this command")
    assert made_by["command"] == "this command"
    assert made_by["commit"] == "a, b"
    assert made_by["scale"]["goals"] == 7
    assert made_by["goal_seed"] == 100


def test_figures_come_back_from_json_with_their_intervals():
    interval = Interval(0.1 + 0.2, 1 / 3, 1.0)
    figures = {"rows": [{"label": "gp", "success": [interval]}], "p_hit": {"n": 3, "brier": 0.2}}
    assert from_json(to_json(figures)) == figures


def test_a_table_by_round_shows_some_rounds_and_how_far_ours_is_above():
    success = {name: [Interval(r / 10, 0.0, 1.0) for r in range(1, 6)] for name in ("ours", "it")}
    minus = {"it": [Interval(r / 10, -0.1, 0.9) for r in range(5)]}
    table = table_by_round("adapter", success, "ours", minus)
    assert table.header == (
        "adapter", "by round 1", "by round 2", "by round 4", "ours minus it, round 4",
    )  # fmt: skip
    assert table.rows[0][1:] == ("0.10 [0.00, 1.00]", "0.20 [0.00, 1.00]", "0.40 [0.00, 1.00]", "")
    assert table.rows[1][-1] == "+0.30 [-0.10, +0.90]"

"""Who joins which comparison, what is run before what, and rows of what was found."""

import json

import pytest

from prior_reinforce.errors import ConfigurationError
from reproduction.evaluation import Training, Trials
from reproduction.recipes import RECIPES, Run, Scale
from reproduction.recipes.base import family_of

GENERATOR, ADAPTER = "interpolation", "frozen"
TRAINING = Training("basketball-v1", "A", "nearest", 0, perception="eye")


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
        "exact",
        "nothing-of-ours",
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


def test_no_recipe_runs_a_unit_twice_under_one_name():
    for recipe in RECIPES.values():
        planned = [(unit, *names.items()) for unit, names in recipe.units(Scale(), ()) if names]
        assert len(set(planned)) == len(planned), recipe.name


def test_what_a_unit_needs_runs_first_and_its_rows_name_the_code(tmp_path):
    unit = Trials(TRAINING, "basketball-v1", "frozen", "eye", goals=2, rounds=1)
    ran = []
    rows = Run(tmp_path, progress=lambda done, total, label: ran.append(label)).rows(
        [(unit, {"method": "none"})]
    )
    order = [label.split()[0] for label in ran if label and "found" not in label]
    assert order == ["perceive", "learn", "basketball-v1:"]
    assert len(rows) == 2
    kept = json.loads(next(tmp_path.glob("units/trials-*.json")).read_text())
    for i, row in enumerate(rows):
        assert (row["method"], row["commit"], row["goal"]) == ("none", kept["commit"], i)
        assert row["solved_at"] == kept["result"]["solved_at"][i]


def test_what_is_only_found_is_not_run(tmp_path):
    (tmp_path / "units").mkdir()
    unit = Trials(TRAINING, "basketball-v1", "frozen", "eye", goals=2, rounds=1)
    assert Run(tmp_path, only_found=True).rows([(unit, {})]) == []
    assert not list((tmp_path / "units").iterdir())

"""Generators over kinds and numbers of demonstrations."""

import pytest

from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.base import from_json, to_json
from prior_reinforce.lab.experiments.recipes.variation import RECIPE, GeneratorsByVariation

SMALL = Scale(goals=6, seeds=(0,), sets=("A",), rounds=3)
MEASUREMENT = GeneratorsByVariation(
    tasks=("zoo-hoop", "zoo-catapult"),
    sets=("clean-6", "mixed-4", "styles-9"),
    generators=(("auto", "auto"), ("nearest neighbours", "nearest")),
)


def test_one_set_of_each_kind_gives_table_and_picture(tmp_path):
    run = Run(tmp_path, SMALL, include=("interpolation",))
    figures = from_json(to_json(MEASUREMENT.run(run)))
    table = RECIPE.table(figures)
    assert table.header == ("demonstrations", "auto", "nearest neighbours", "interpolation")
    assert [row[0] for row in table.rows] == ["clean-6", "mixed-4", "styles-9", *MEASUREMENT.tasks]
    assert {len(row) for row in table.rows} == {4}
    auto, nearest, _ = figures["rows"]
    for of_set in range(3):
        assert auto["first"][of_set].value > nearest["first"][of_set].value
        assert auto["trials"][of_set].value < nearest["trials"][of_set].value
    for interval, cells in zip(auto["trials"], auto["trials_of_each"], strict=True):
        assert interval.value == pytest.approx(sum(cells) / 2)
    (picture,) = RECIPE.draw(figures, tmp_path)
    assert picture.path.is_file()


def test_a_quick_run_takes_one_task_and_one_kind():
    quick = Scale(goals=6, seeds=(0,), sets=("A",), variants=False)
    trainings = GeneratorsByVariation().trainings(quick)
    assert {training.demonstrations for training in trainings} == {"clean-8-0"}
    assert len({training.task for training in trainings}) == 1

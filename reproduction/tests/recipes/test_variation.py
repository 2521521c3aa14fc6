"""Generators over kinds and numbers of demonstrations."""

import pytest
from gathered import gather

from reproduction.recipes import Scale, variation
from reproduction.recipes.variation import RECIPE, units
from reproduction.results import FIRST, TRIALS

SMALL = Scale(goals=4, seeds=(0,), sets=("A",), rounds=2)


def test_one_set_of_each_kind_gives_table_and_picture(tmp_path, monkeypatch):
    monkeypatch.setattr(variation, "TASKS", ("zoo-hoop", "zoo-catapult"))
    monkeypatch.setattr(variation, "SETS", ("clean-4", "mixed-4"))
    known = (("auto", "auto"), ("nearest neighbours", "nearest"))
    monkeypatch.setattr(variation, "GENERATORS", known)
    results = gather(tmp_path, units(SMALL, ("interpolation",)), "variation")
    table = RECIPE.table(results)
    assert table.header == ("demonstrations", "auto", "nearest neighbours", "interpolation")
    assert [row[0] for row in table.rows] == [
        "clean-4", "mixed-4", "zoo-hoop", "zoo-catapult",
    ]  # fmt: skip
    assert {len(row) for row in table.rows} == {4}
    auto, nearest, _ = results.by("method").values()
    for kind in results.by("condition"):
        assert (
            auto.where(condition=kind).mean(FIRST).value
            > nearest.where(condition=kind).mean(FIRST).value
        )
    by_hand = auto.where(condition="clean-4")
    assert table.rows[0][1].endswith(f"; {by_hand.mean(TRIALS).value:.2f}")
    assert by_hand.mean(TRIALS).value == pytest.approx(TRIALS.of(by_hand.frame).mean())
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.is_file()


def test_a_quick_run_takes_one_task_and_one_kind():
    quick = Scale(goals=6, seeds=(0,), sets=("A",), variants=False)
    trainings = [unit.training for unit, _ in units(quick)]
    assert {training.demonstrations for training in trainings} == {"clean-8-0"}
    assert len({training.task for training in trainings}) == 1

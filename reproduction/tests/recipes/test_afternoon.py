"""Afternoons of one demonstration: what is run, and what is made of the rows."""

import pytest
from gathered import gather

from reproduction.recipes import QUICK, Scale
from reproduction.recipes.afternoon import IN_ALL, RECIPE, units
from reproduction.recipes.once import COPIES, NONE, OURS
from reproduction.results import TRIALS


def test_each_set_has_an_afternoon_of_its_own_and_the_others_are_beside_it_on_some():
    planned = units(Scale())
    of = {
        method: [unit for unit, names in planned if names["method"] == method]
        for method in (OURS, COPIES, NONE)
    }
    assert [len(each) for each in of.values()] == [5 * 22, 5 * 8, 5 * 8]
    assert {unit.seed for unit in of[NONE]} < {unit.seed for unit in of[OURS]}
    assert {len(unit.training.subset) for unit in of[OURS]} == {1}
    assert {unit.training.subset for unit in of[NONE]} == {None}
    assert {names["method"] for _, names in units(QUICK)} == {OURS}
    beside = [unit for unit, names in units(Scale(), ("gp",)) if names["method"].endswith("gp")]
    assert {unit.adapter for unit in beside} == {"gp"}


@pytest.mark.slow
def test_an_afternoon_gives_a_row_and_a_verdict(tmp_path):
    planned = [
        p
        for p in units(Scale(rounds=2))
        if p[0].task == "fishing" and p[0].training.demonstrations == "v00"
    ]
    results = gather(tmp_path, planned, "afternoon")
    table = RECIPE.table(results)
    assert [row[:2] for row in table.rows] == [("fishing", m) for m in (OURS, COPIES, NONE)]
    ours = results.where(method=OURS)
    assert ours.mean(IN_ALL).value == pytest.approx(1 + 8 * ours.mean(TRIALS).value)
    (verdict,) = RECIPE.remarks(results)
    assert verdict.startswith("fishing: ")
    assert "at most 13" in verdict

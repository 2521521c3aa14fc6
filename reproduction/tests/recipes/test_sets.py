"""Twenty prior sets: what is run, and its table."""

import pytest
from gathered import gather

from reproduction.recipes import RECIPES, Scale, adaptation, sets
from reproduction.recipes.sets import RECIPE, SETS, units
from reproduction.results import TRIALS


def test_every_set_is_tried_with_every_method_and_a_seed_of_its_own():
    planned = units(Scale())
    assert len({unit.training.demonstrations for unit, _ in planned}) == len(SETS) == 20
    assert {unit.training.seed for unit, _ in planned} == set(range(20))
    assert not any("diffusion" in unit.training.generator for unit, _ in planned)
    networks = {unit.training.generator for unit, _ in RECIPES["sets-network"].units(Scale(), ())}
    assert "diffusion" in networks


@pytest.mark.slow
def test_two_sets_give_table_and_picture(tmp_path, monkeypatch):
    monkeypatch.setattr(adaptation, "GOALS", 4)
    monkeypatch.setattr(sets, "_SEQUENCES", 1)
    planned = [
        p
        for p in units(Scale(goals=2, rounds=2))
        if p[0].training.demonstrations in ("v00", "v01")
        and p[0].task in ("basketball-v1", "basketball-v3")
        and p[0].adapter in ("proportional", "gp-two-term")
        and p[1]["method"] not in ("DMP", "DMP, aligned", "segmented DMP")
    ]
    results = gather(tmp_path, planned, "sets")
    table = RECIPE.table(results)
    assert {len(row) for row in table.rows} == {len(table.header)}
    assert [row[1] for row in table.rows] == [
        "GP of two terms, m = 2, each goal alone", "proportional, 0.8", "closed form",
        "nearest neighbours",
        "nearest neighbours, aligned", "closed form, aligned",
    ]  # fmt: skip
    assert {row[-1] for row in table.rows} == {"2"}
    methods = results.by("method")
    nearest, closed = (methods[name].mean(TRIALS) for name in ("nearest neighbours", "closed form"))
    assert nearest.value > closed.value
    names = [picture.path.name for picture in RECIPE.draw(results, tmp_path)]
    assert names == ["sets-adapters.png", "sets-generators.png"]

"""Shipped rows that are run again."""

from dataclasses import replace

from reproduction.__main__ import main
from reproduction.recipes import RECIPES, Run
from reproduction.recipes.base import QUICK
from reproduction.results import write_rows

FEW = replace(QUICK, goals=4, rounds=2)


def test_rows_that_do_not_come_out_again_are_counted(tmp_path, monkeypatch, capsys):
    planned = [p for p in RECIPES["sets"].units(FEW) if p[1]["method"] == "nearest neighbours"][:1]
    recipe = replace(RECIPES["sets"], units=lambda scale, include: planned)
    monkeypatch.setattr("reproduction.verify.RECIPES", {"sets": recipe})
    rows = [dict(row) for row in Run(tmp_path).rows(planned)]
    arguments = ["verify", "--quick", "--sample", "4", "--results", str(tmp_path)]
    for changed in (0, 1):
        for row in rows:
            row["solved_at"] += changed
        write_rows(tmp_path, "sets", rows, "this")
        assert main(arguments) == changed
        assert f"{0 if changed else 4} of 4 rows agree (seed 0)" in capsys.readouterr().out


def test_rows_of_plans_alone_are_compared_by_what_they_say(tmp_path, monkeypatch, capsys):
    planned = [
        p
        for p in RECIPES["ways"].units(replace(QUICK, goals=4))
        if str(p[0]).startswith("plans of nearest")
    ][:1]
    recipe = replace(RECIPES["ways"], units=lambda scale, include: planned)
    monkeypatch.setattr("reproduction.verify.RECIPES", {"ways": recipe})
    rows = [dict(row) for row in Run(tmp_path).rows(planned)]
    assert {"unlike"} <= rows[0].keys()
    for changed in (0, 1):
        for row in rows:
            row["unlike"] = bool(row["unlike"]) ^ bool(changed)
        tried = [row | {"adapter": "bayes", "unlike": None, "solved_at": 1} for row in rows]
        write_rows(tmp_path, "ways", rows + tried, "this")
        assert main(["verify", "--sample", "4", "--results", str(tmp_path)]) == changed
        assert f"{0 if changed else 4} of 4 rows agree (seed 0)" in capsys.readouterr().out

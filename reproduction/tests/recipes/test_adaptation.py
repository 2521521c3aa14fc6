"""Afternoons in the mean, and what was said of P(hit)."""

import pandas as pd
import pytest
from gathered import gather

from reproduction.recipes import RECIPES, Scale, adaptation
from reproduction.recipes.adaptation import (
    OURS,
    OURS_ALONE,
    RECIPE,
    RULES,
    afternoons,
    later,
    p_hit_table,
    reliability,
    said_and_came,
)
from reproduction.results import TRIALS, Results

SMALL = Scale(goals=4, seeds=(0,), sets=("A",), rounds=2)
SAID = [
    {"solved_at": 2, "rounds": 3, "p_hit": "0.3 0.5"},
    {"solved_at": 0, "rounds": 3, "p_hit": "0.2 0.1 0.1"},
    {"solved_at": 1, "rounds": 3, "p_hit": None},  # by an adapter that says nothing
]


def test_what_was_predicted_before_each_trial_and_came_of_it():
    said = said_and_came(Results(pd.DataFrame(SAID), {}))
    assert said["number"].tolist() == [0, 1, 0, 1, 2]
    assert said["p_hit"].tolist() == [0.3, 0.5, 0.2, 0.1, 0.1]
    assert said["hit"].tolist() == [False, True, False, False, False]


def test_reliability_by_hand():
    told = reliability(Results(pd.DataFrame(SAID), {}))
    brier = (0.3**2 + 0.5**2 + 0.2**2 + 0.1**2 + 0.1**2) / 5
    assert f"5 trials: Brier score {brier:.3f}, that of the base rate 0.160." in told


def test_p_hit_is_shown_by_bin_and_called_worthless_where_the_base_rate_is_as_good():
    told = {"method": "ours", "task": "t", "rounds": 3, "solved_at": 1}
    rows = [{**told, "p_hit": "0.9", "solved_at": int(i % 10 > 0)} for i in range(100)]
    rows += [{**told, "task": "u", "p_hit": "0.5 0.1"[: 3 + 4 * (i % 2)], "solved_at": 1 - i % 2}
             for i in range(100)]  # fmt: skip
    first, later, off, _ = p_hit_table(Results(pd.DataFrame(rows), {})).rows
    assert first == ("ours", "t", "first", "100", *[""] * 4, "0.90: 0.90", "0.090", "0.090",
                     "calibrated, worthless")  # fmt: skip
    assert later[3] == "0"
    assert off[6] == "0.50: 0.50"


@pytest.mark.slow
def test_one_afternoon_of_every_rule_gives_table_picture_and_remark(tmp_path, monkeypatch):
    monkeypatch.setattr(adaptation, "GOALS", 4)
    planned = [p for p in RECIPE.units(SMALL, ("gp-two-term",)) if p[0].task == "basketball-v3"]
    results = gather(tmp_path, planned, "adaptation")
    table = RECIPE.table(results)
    assert table.header == ("adapter", "basketball-v3", "mean", "ours minus it, mean")
    assert table.rows[0][0] == OURS
    assert table.rows[-1][0] == "gp-two-term"  # the one that was included
    assert table.rows[0][-1] == ""
    methods = later(results).by("method")
    assert methods[OURS].n == 3  # of four
    assert methods[OURS].mean(TRIALS).value < methods["no adapter"].mean(TRIALS).value
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.is_file()
    alone, said = RECIPE.remarks(results)
    assert "Brier" in said
    assert "no adapter -" in alone  # fewer trials than without
    assert "earlier goals" not in alone
    minus = (
        methods[OURS_ALONE].minus(methods["GP of two terms, m = 2, each goal alone"], TRIALS).value
    )
    assert f"GP of two terms, m = 2, each goal alone {minus:+.2f}" in alone


def test_behind_a_network_stand_all_rules_that_remember_and_two_of_each_goal_alone():
    labels = {names["method"] for _, names in RECIPES["adaptation-network"].units(SMALL, ())}
    remember = {label for _, remembers, label in RULES if remembers}
    assert labels == remember | {OURS_ALONE, "GP of two terms, m = 2, each goal alone"}
    units = [unit for unit, _ in RECIPES["adaptation-network"].units(SMALL, ())]
    assert {unit.training.generator for unit in units} == {"diffusion"}
    assert len(afternoons(Scale(), [("bayes", True, "x")])) == 5 * 6

"""Afternoons in the mean, and what was said of P(hit)."""

import pandas as pd
import pytest
from gathered import gather

from prior_reinforce.lab.experiments.recipes import RECIPES, Scale
from prior_reinforce.lab.experiments.recipes.adaptation import (
    OURS,
    OURS_ALONE,
    RECIPE,
    RULES,
    afternoons,
    later,
    reliability,
    said_and_came,
)
from prior_reinforce.lab.experiments.results import TRIALS, Results

SMALL = Scale(goals=8, seeds=(0,), sets=("A",), rounds=2)
SAID = [
    {"solved_at": 2, "rounds": 3, "p_hit": "0.3 0.5"},
    {"solved_at": 0, "rounds": 3, "p_hit": "0.2 0.1 0.1"},
    {"solved_at": 1, "rounds": 3, "p_hit": None},  # by an adapter that says nothing
]


def test_trials_to_go_of_a_goal_that_was_reached_and_of_one_that_was_not():
    said = said_and_came(Results(pd.DataFrame(SAID), {}))
    assert said["to_go"].tolist() == [2.0, 1.0, 4.0, 3.0, 2.0]
    assert said["p_hit"].tolist() == [0.3, 0.5, 0.2, 0.1, 0.1]
    assert said["hit"].tolist() == [False, True, False, False, False]


def test_reliability_by_hand():
    told = reliability(Results(pd.DataFrame(SAID), {}))
    brier = (0.3**2 + 0.5**2 + 0.2**2 + 0.1**2 + 0.1**2) / 5
    assert f"5 trials: Brier score {brier:.3f}, that of the base rate 0.160." in told
    assert "0.13: 0.00 of 3, 3.00" in told
    assert "0.50: 1.00 of 1, 1.00" in told


@pytest.mark.slow
def test_one_afternoon_of_every_rule_gives_table_picture_and_remark(tmp_path):
    planned = [p for p in RECIPE.units(SMALL, ("gp",)) if p[0].task == "basketball-v3"]
    results = gather(tmp_path, planned, "adaptation")
    table = RECIPE.table(results)
    assert table.header == ("adapter", "basketball-v3", "mean", "ours minus it, mean")
    assert table.rows[0][0] == OURS
    assert table.rows[-1][0] == "gp"  # the one that was included
    assert table.rows[0][-1] == ""
    methods = later(results).by("method")
    assert methods[OURS].n == 7  # of eight
    assert methods[OURS].mean(TRIALS).value < methods["no adapter"].mean(TRIALS).value
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.is_file()
    alone, said = RECIPE.remarks(results)
    assert "Brier" in said
    assert "no adapter -" in alone  # fewer trials than without
    assert "earlier goals" not in alone
    minus = methods[OURS_ALONE].minus(methods["GP, m = 2, each goal alone"], TRIALS).value
    assert f"GP, m = 2, each goal alone {minus:+.2f}" in alone


def test_behind_a_network_stand_all_rules_that_remember_and_two_of_each_goal_alone():
    labels = {names["method"] for _, names in RECIPES["adaptation-network"].units(SMALL, ())}
    remember = {label for _, remembers, label in RULES if remembers}
    assert labels == remember | {OURS_ALONE, "GP, m = 2, each goal alone"}
    units = [unit for unit, _ in RECIPES["adaptation-network"].units(SMALL, ())]
    assert {unit.training.generator for unit in units} == {"diffusion"}
    assert len(afternoons(Scale(), [("bayes", True, "x")])) == 5 * 6

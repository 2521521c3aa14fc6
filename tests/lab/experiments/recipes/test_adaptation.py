"""Afternoons in the mean, and what was said of P(hit)."""

import numpy as np
import pytest

from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.adaptation import (
    RECIPE,
    Adaptation,
    reliability,
    said_and_came,
)
from prior_reinforce.lab.experiments.recipes.base import from_json, to_json

SMALL = Scale(goals=8, seeds=(0,), sets=("A",), rounds=2)


def test_reliability_by_hand():
    found = reliability(np.array([[0.2, 0, 3], [0.2, 0, 2], [0.2, 1, 1], [0.8, 1, 1]], dtype=float))
    assert found["brier"] == pytest.approx((0.04 + 0.04 + 0.64 + 0.04) / 4)
    assert found["base_rate"] == 0.25
    assert [b["n"] for b in found["bins"]] == [3, 1]
    assert found["bins"][0]["hit"] == pytest.approx(1 / 3)
    assert [b["to_go"] for b in found["bins"]] == [2.0, 1.0]


def test_trials_to_go_of_a_goal_that_was_reached_and_of_one_that_was_not():
    said = [[0.3, False], [0.5, True], [0.2, False], [0.1, False], [0.1, False]]
    result = {"solved_at": [[2, 0]], "expected": said}  # three trials at most
    rows = said_and_came(result, rounds=3)
    assert [to_go for _, _, to_go in rows] == [2.0, 1.0, 4.0, 3.0, 2.0]
    assert [p for p, _, _ in rows] == [p for p, _ in said]
    assert [hit for _, hit, _ in rows] == [0.0, 1.0, 0.0, 0.0, 0.0]


@pytest.mark.slow
def test_one_afternoon_of_every_rule_gives_table_picture_and_remark(tmp_path):
    measurement = Adaptation(tasks=("basketball-v3",), seed=3001)
    figures = from_json(to_json(measurement.run(Run(tmp_path, SMALL, include=("gp",)))))
    table = RECIPE.table(figures)
    assert table.rows[0][0] == "Bayesian, earlier goals too"
    assert table.rows[-1][0] == "gp"  # the one that was included
    assert table.rows[0][-1] == ""
    frozen = figures["trials"]["no adapter"]["mean"].value
    assert figures["trials"]["Bayesian, earlier goals too"]["mean"].value < frozen
    (picture,) = RECIPE.draw(figures, tmp_path)
    assert picture.path.is_file()
    alone, said = RECIPE.remarks(figures)
    assert "Brier" in said
    assert "no adapter -" in alone  # fewer trials than without
    assert "earlier goals" not in alone
    minus = figures["alone_minus"]["GP, m = 2, each goal alone"].value
    ours, theirs = (
        figures["trials"][f"{name}, each goal alone"]["mean"].value
        for name in ("Bayesian", "GP, m = 2")
    )
    assert minus == pytest.approx(ours - theirs)

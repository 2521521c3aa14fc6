"""Afternoons as units."""

import numpy as np

from reproduction.evaluation import Training
from reproduction.sequences import Afternoons

TRAINING = Training("basketball-v1", "A", "interpolation,timing=align", 0)
SMALL = {"adapter": "bayes", "sequences": 2, "goals": 2, "rounds": 2, "seed": 3001}


def test_every_goal_of_every_afternoon_is_counted_and_what_was_expected_kept(tmp_path):
    result = Afternoons(TRAINING, "basketball-v3", **SMALL, carry_over=True).run(tmp_path)
    solved = np.array(result["solved_at"])
    assert solved.shape == (2, 2)
    assert set(solved.ravel()) <= {0, 1, 2}
    trials = np.where(solved > 0, solved, 2).sum()
    assert len(result["expected"]) == trials
    assert sum(hit for _, hit in result["expected"]) == np.count_nonzero(solved)


def test_carrying_over_changes_nothing_before_the_second_goal(tmp_path):
    alone, carried = (
        Afternoons(TRAINING, "basketball-v3", **SMALL, carry_over=carry).run(tmp_path)
        for carry in (False, True)
    )
    assert [row[0] for row in alone["solved_at"]] == [row[0] for row in carried["solved_at"]]
    assert alone["expected"][0] == carried["expected"][0]

"""The pictures of the process: the trials of the table, one goal a task."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from prior_reinforce.lab.experiments.evaluation import Training, Trials
from prior_reinforce.lab.experiments.recipes.base import Run, Scale
from prior_reinforce.lab.experiments.recipes.process import (
    RECIPE,
    Process,
    ProcessPictures,
    _chosen,
)

TRAINING = Training("basketball-v1", "A", "nearest", 0, perception="eye")


def test_the_process_is_learned_from_what_the_tables_eye_saw():
    shown = ProcessPictures().trainings(Scale())
    assert [(t.task, t.demonstrations, t.seed, t.perception) for t in shown] == [
        (task, "A", 0, "eye") for task in ("basketball-v1", "curling", "fishing")
    ]


def test_the_goal_shown_was_reached_in_about_three_trials():
    def goal(name: str, n: int, *, hit: bool = True) -> dict:
        return {"goal": name, "trials": [{"hit": False}] * (n - 1) + [{"hit": hit}]}

    assert _chosen([goal("a", 1), goal("b", 3), goal("c", 3)])["goal"] == "b"
    assert _chosen([goal("a", 1), goal("b", 4), goal("c", 2)])["goal"] == "b"
    assert _chosen([goal("a", 3, hit=False), goal("b", 7)])["goal"] == "b"
    assert _chosen([goal("a", 10, hit=False)])["goal"] == "a"


@pytest.mark.slow
def test_the_process_is_that_of_the_table_and_its_picture_marks_the_hit(tmp_path):
    of_table = Trials(TRAINING, "basketball-v1", "gp", "eye", 5, unseen=True, rounds=6)
    in_table = of_table.run(tmp_path)
    solved_at = in_table["solved_at"]
    goals = Process(TRAINING, rounds=6).run(tmp_path)["goals"]
    first = [np.subtract(goal["trials"][0]["outcome"], goal["goal"]) for goal in goals]
    np.testing.assert_allclose(np.linalg.norm(first, axis=1), in_table["first_error"])
    assert [len(goal["trials"]) for goal in goals] == [at or 6 for at in solved_at]

    pictures = ProcessPictures(tasks=("basketball-v1",), generator="nearest")
    figures = pictures.run(Run(tmp_path, Scale(seeds=(0,), sets=("A",), rounds=6)))
    (row,) = figures["rows"]
    assert row["goal"] in [goal["goal"] for goal in goals]
    assert len(RECIPE.table(figures).rows) == len(row["trials"])
    (picture,) = RECIPE.draw(figures, tmp_path)
    green = np.all(np.asarray(Image.open(picture.path).convert("RGB")) == (0, 158, 115), axis=2)
    assert any(at for at in solved_at)  # so that a hit is shown
    assert green.sum() > 1000

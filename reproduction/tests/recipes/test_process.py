"""The pictures of the process: the trials of the table, one goal a task."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from gathered import gather
from PIL import Image

from reproduction.evaluation import Training, Trials
from reproduction.recipes import Scale, process
from reproduction.recipes.process import RECIPE, Process, shown, units
from reproduction.results import Results

TRAINING = Training("basketball-v1", "A", "nearest", 0, perception="eye")


def test_the_process_is_learned_from_what_the_tables_eye_saw():
    learned = [unit.training for unit, _ in units(Scale()) if isinstance(unit, Process)]
    assert [(t.task, t.demonstrations, t.seed, t.perception) for t in learned] == [
        (task, "A", 0, "eye") for task in ("basketball-v1", "curling", "fishing")
    ]


@pytest.mark.parametrize(
    ("lengths", "misses", "chosen"),
    [((1, 3, 3), (), 1), ((1, 4, 2), (), 1), ((3, 7), (0,), 1), ((10,), (0,), 0)],
)
def test_the_goal_shown_was_reached_in_about_three_trials(lengths, misses, chosen):
    told = {"learned_on": "t", "seen": "0 0", "outcome": "0 0", "key_state": "0"}
    rows = [
        {**told, "task": "t", "goal": i, "place": f"{i} 0", "trial": j + 1,
         "hit": j == n - 1 and i not in misses, "demonstration": None}
        for i, n in enumerate(lengths) for j in range(n)
    ]  # fmt: skip
    rows.append({**told, "demonstration": 0})
    row = shown(Results(pd.DataFrame(rows), {}))["t"]
    assert row["goal"][0] == chosen
    assert len(row["trials"]) == lengths[chosen]
    assert row["demonstrated"].shape == (1, 2)


@pytest.mark.slow
def test_the_process_is_that_of_the_table_and_its_picture_marks_the_hit(tmp_path, monkeypatch):
    monkeypatch.setattr(process, "_GOALS", 4)
    of_table = Trials(TRAINING, "basketball-v1", "gp-two-term", "eye", 4, unseen=True, rounds=3)
    in_table = of_table.run(tmp_path)
    results = gather(tmp_path, [(TRAINING.perceived, {}), (Process(TRAINING, rounds=3), {})])
    goals = results.where(task="basketball-v1").by("goal").values()
    assert [goal.n for goal in goals] == [at or 3 for at in in_table["solved_at"]]
    first = [next(goal.texts("outcome")) - next(goal.texts("place")) for goal in goals]
    np.testing.assert_allclose(np.linalg.norm(first, axis=1), in_table["first_error"], atol=2e-5)
    row = shown(results)["basketball-v1"]
    assert len(RECIPE.table(results).rows) == len(row["trials"])
    (picture,) = RECIPE.draw(results, tmp_path)
    green = np.all(np.asarray(Image.open(picture.path).convert("RGB")) == (0, 158, 115), axis=2)
    assert any(at for at in in_table["solved_at"])  # so that a hit is shown
    assert green.sum() > 1000

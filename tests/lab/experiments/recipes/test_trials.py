"""The table of trials, on few goals and a quick generator."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.lab.experiments.claims import Verdict
from prior_reinforce.lab.experiments.recipes.base import Run, Scale
from prior_reinforce.lab.experiments.recipes.trials import (
    RECIPE,
    ROWS,
    TrialsTable,
    first_throws_that_hit,
)
from prior_reinforce.lab.experiments.statistics import Interval
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

SMALL = Scale(goals=3, seeds=(0,), sets=("A",), rounds=2)
BY_EYE = tuple(row for row in ROWS if row.task in ("basketball-v1", "basketball-v2"))[::2]


def units_of(folder: Path, kind: str) -> list[dict]:
    return [json.loads(path.read_text()) for path in folder.glob(f"units/{kind}-*.json")]


@pytest.mark.slow
def test_a_row_counts_what_was_not_reached_as_one_trial_more(tmp_path):
    figures = TrialsTable(rows=BY_EYE, generator="nearest").run(Run(tmp_path, SMALL))
    assert [row["task"] for row in figures["rows"]] == ["basketball-v1", "basketball-v2"]
    assert len(list((tmp_path / "models").iterdir())) == 1  # V2 uses what V1's taught
    trials = [u for u in units_of(tmp_path, "trials") if u["unit"]["adapter"] == "gp"]
    for row in figures["rows"]:
        for name, unseen, n in (("unseen", True, 5), ("many", False, 3)):
            (unit,) = (
                u["result"]["solved_at"]
                for u in trials
                if u["unit"]["task"] == row["task"] and u["unit"]["unseen"] == unseen
            )
            needed = [at or 3 for at in unit]
            assert len(needed) == row[name]["goals"] == n
            assert row[name]["trials"].value == pytest.approx(np.mean(needed))
            assert row[name]["sd"] == pytest.approx(np.std(needed, ddof=1))
            assert row[name]["not_reached"] == unit.count(0)
    assert len(RECIPE.table(figures).rows) == 2
    assert {claim.verdict for claim in RECIPE.claims(figures)} == {Verdict.OPEN}  # one training
    assert figures["readings_judged_by_eye"] == 0
    assert RECIPE.remarks(figures) == []  # nobody looked at pictures
    (picture,) = RECIPE.draw(figures, tmp_path)
    assert picture.path.stat().st_size > 10_000


def test_demonstrations_are_perceived_as_the_rows_trials_are():
    model = VisionLanguageModelConfig(model="mine")
    for table, sense in ((TrialsTable(model=model), "vlm"), (TrialsTable(), "camera")):
        seen = [t.perceived for t in table.trainings(SMALL)]
        # V2 and V3 share what was seen on V1.
        assert [(s.task, s.perception) for s in seen] == [
            ("basketball-v1", "eye"),
            ("basketball-v1", sense),
            ("curling", "eye"),
            ("curling", sense),
            ("fishing", "eye"),
        ]
        assert [s.model for s in seen if s.perception == "eye"] == [None] * 3
        assert {s.model for s in seen if s.perception != "eye"} == {table.model}
    small = replace(SMALL, read_pictures=False)
    assert {t.perceived.perception for t in TrialsTable().trainings(small)} == {"eye"}


def test_the_prior_of_a_row_is_its_number_of_demonstrations():
    assert all(make_task(r.learned_on).demonstrations("A").n == r.prior for r in ROWS)


def test_first_throws_are_the_trials_that_reached_a_goal_at_once():
    hit = first_throws_that_hit(np.array([[1, 2, 0, 1], [1, 10, 3, 4]]))
    assert hit.value == 3 / 8


def test_an_eye_is_compared_with_pictures_on_the_same_trainings_and_goals():
    eye, model = (row for row in ROWS if row.task == "curling")
    scale = Scale(goals=40)
    recipe = TrialsTable()
    assert [(t.demonstrations, t.seed) for t in recipe._trainings(model, scale)] == [
        ("A", 0), ("A", 1), ("B", 0), ("B", 1),
    ]  # fmt: skip
    # In as many trials as tells the training and, from the 31st, a goal that pictures never had.
    training = np.array([1, 2, 3, 4, 5, 6])[:, None]
    by_eye = training * np.ones((6, 5), int), training + 5 * (np.arange(40) >= 30)
    read = by_eye[0][[0, 1, 3, 4]], by_eye[1][[0, 1, 3, 4], :30]
    solved = {(eye, "gp"): by_eye, (model, "gp"): read}
    fewer = recipe._eye_minus_model(eye, model, solved, scale)
    assert (fewer.low, fewer.value, fewer.high) == (0.0, 0.0, 0.0)


def test_claims_are_judged_by_the_interval():
    def row(
        many: tuple[float, float],
        unseen: tuple[float, float] = (2.0, 2.5),
        first_throws: float = 0.49,
    ) -> dict:
        def summary(low: float, high: float) -> dict:
            return {"goals": 60, "trials": Interval(3.0, low, high), "sd": 1.0}

        return {
            "title": "T", "task": "curling", "by_model": False, "prior": 6, "trials": 2.9,
            "sd": 0.9, "adapter": "gp", "trainings": 6, "unseen": summary(*unseen),
            "many": summary(*many),
            "first_throws": Interval(0.4, 0.3, first_throws),
        }  # fmt: skip

    figures = {
        "model": "mine",
        "rows": [
            row((2.0, 2.9)),
            row((2.8, 3.0)),
            row((2.95, 3.1)),
            row((2.0, 2.5), unseen=(2.0, 3.0), first_throws=0.6),
        ],
        "eye_minus_model": {
            "curling": Interval(0.2, 0.1, 0.3),
            "basketball-v1": Interval(0.0, -0.1, 0.1),
        },
    }
    verdicts = [claim.verdict for claim in RECIPE.claims(figures)]
    assert verdicts == [
        Verdict.CONFIRMED,
        Verdict.OPEN,
        Verdict.NOT_CONFIRMED,
        Verdict.OPEN,  # not on the unseen goals
        *[Verdict.CONFIRMED] * 3,
        Verdict.OPEN,  # more than half of the first throws may hit
        Verdict.CONFIRMED,
    ]
    # Fewer than three trainings decide nothing, however many other rows have.
    few = [{**row, "trainings": 2} for row in figures["rows"][:1]] + figures["rows"][1:]
    assert RECIPE.claims({**figures, "rows": few})[0].verdict is Verdict.OPEN
    # What is found by colour is no evidence about a model.
    read = [{**row, "by_model": True} for row in figures["rows"]]
    for model, expected in (("mine", verdicts), ("camera", [Verdict.OPEN] * len(verdicts))):
        claims = RECIPE.claims({**figures, "rows": read, "model": model})
        assert [claim.verdict for claim in claims] == expected

"""The table of trials and the pictures of the process, on few goals and a quick generator."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.perception.vision_server import VisionServer

from prior_reinforce.errors import EndpointError
from prior_reinforce.experiments.evaluation import Training, Trials
from prior_reinforce.experiments.recipes.base import Run, Scale
from prior_reinforce.experiments.recipes.claims import Verdict
from prior_reinforce.experiments.recipes.process import Process, ProcessPictures, _chosen
from prior_reinforce.experiments.recipes.trials import TrialsTable, first_throws_that_hit
from prior_reinforce.experiments.recipes.trials_rows import ROWS
from prior_reinforce.experiments.sight import STAND_IN
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.tasks import make_task

SMALL = Scale(goals=3, seeds=(0,), sets=("A",), rounds=2)
BY_EYE = tuple(row for row in ROWS if row.task in ("basketball-v1", "basketball-v2"))[::2]
TRAINING = Training("basketball-v1", "A", "nearest", 0)


def units_of(folder: Path, kind: str) -> list[dict]:
    return [json.loads(path.read_text()) for path in folder.glob(f"units/{kind}-*.json")]


def test_the_rows_are_the_papers():
    totals = [round(row.prior + row.trials, 1) for row in ROWS]
    assert totals == [8.9, 8.1, 9.4, 9.0, 10.0, 9.2, 9.7]
    assert all(len(make_task(r.task).demonstrations("A").plans) == r.prior for r in ROWS)
    assert [row.learned_on for row in ROWS[-2:]] == ["basketball-v1"] * 2


@pytest.mark.slow
def test_a_row_counts_what_was_not_reached_as_one_trial_more(tmp_path):
    recipe = TrialsTable(rows=BY_EYE, generator="nearest")
    figures = recipe.run(Run(tmp_path, SMALL))
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
            assert row[name]["trials"]["value"] == pytest.approx(np.mean(needed))
            assert row[name]["sd"] == pytest.approx(np.std(needed, ddof=1))
            assert row[name]["not_reached"] == unit.count(0)
    assert len(recipe.table(figures).rows) == 2
    assert {claim.verdict for claim in recipe.claims(figures)} == {Verdict.OPEN}  # one training
    assert figures["readings_judged_by_eye"] == 0
    assert recipe.remarks(figures) == []  # nobody looked at pictures
    (picture,) = recipe.draw(figures, tmp_path)
    assert picture.path.stat().st_size > 10_000


def test_demonstrations_are_seen_as_the_rows_trials_are():
    model = VisionLanguageModelConfig(model="mine")
    for recipe, sense in ((TrialsTable(model=model), "vlm"), (TrialsTable(), STAND_IN)):
        seen = [t.seen for t in recipe.trainings(SMALL, ())]
        # V2 and V3 share what was seen on V1.
        assert [(s.task, s.perception) for s in seen] == [
            ("basketball-v1", "eye"),
            ("basketball-v1", sense),
            ("curling", "eye"),
            ("curling", sense),
            ("fishing", "eye"),
        ]
        assert [s.model for s in seen if s.perception == "eye"] == [None] * 3
        assert {s.model for s in seen if s.perception != "eye"} == {recipe.model}
    small = replace(SMALL, read_pictures=False)
    assert {t.seen.perception for t in TrialsTable().trainings(small, ())} == {"eye"}
    # The process is shown of what the table's eye saw.
    shown = ProcessPictures().trainings(SMALL, ())
    assert [(t.task, t.perception) for t in shown] == [
        (task, "eye") for task in ("basketball-v1", "curling", "fishing")
    ]


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
            return {"goals": 60, "trials": {"value": 3.0, "low": low, "high": high}, "sd": 1.0}

        return {
            "title": "T", "task": "curling", "by_model": False, "prior": 6, "trials": 2.9,
            "sd": 0.9, "adapter": "gp", "trainings": 6, "unseen": summary(*unseen),
            "many": summary(*many),
            "first_throws": {"value": 0.4, "low": 0.3, "high": first_throws},
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
            "curling": {"value": 0.2, "low": 0.1, "high": 0.3},
            "basketball-v1": {"value": 0.0, "low": -0.1, "high": 0.1},
        },
    }
    verdicts = [claim.verdict for claim in TrialsTable().claims(figures)]
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
    assert TrialsTable().claims({**figures, "rows": few})[0].verdict is Verdict.OPEN
    # What the stand-in read says nothing of a model.
    read = [{**row, "by_model": True} for row in figures["rows"]]
    for model, expected in (("mine", verdicts), (STAND_IN, [Verdict.OPEN] * len(verdicts))):
        claims = TrialsTable().claims({**figures, "rows": read, "model": model})
        assert [claim.verdict for claim in claims] == expected


@pytest.mark.slow
def test_pictures_give_the_same_trials_again_and_share_the_eyes_goals(tmp_path):
    by_stand_in = Trials(TRAINING, "basketball-v1", "gp", "stand-in", 2, rounds=2)
    first, again = (by_stand_in.run(tmp_path / name) for name in ("first", "again"))
    assert first == again
    by_eye = Trials(TRAINING, "basketball-v1", "gp", "eye", 4, rounds=1).run(tmp_path / "first")
    assert by_eye["goals"][:2] == first["goals"]


@pytest.mark.slow
def test_a_real_endpoint_is_asked_in_place_of_the_stand_in(tmp_path):
    asked = []

    class Endpoint(VisionServer):
        def reply(self, headers, body):
            asked.append(body["model"])
            return super().reply(headers, body)

    with Endpoint() as server:
        model = VisionLanguageModelConfig(base_url=server.base_url, model="mine", votes=1)
        unit = Trials(TRAINING, "basketball-v1", "gp", "vlm", 1, rounds=1, model=model)
        assert unit.run(tmp_path)["failed_readings"] == [0]
    assert asked == ["mine", "mine"]


def test_an_endpoint_that_does_not_answer_is_no_eye(tmp_path):
    nobody = VisionLanguageModelConfig(base_url="http://127.0.0.1:9/v1", max_retries=0)
    unit = Trials(TRAINING, "basketball-v1", "gp", "vlm", 1, rounds=1, model=nobody)
    with pytest.raises(EndpointError, match="is the server running"):
        unit.run(tmp_path)


def test_the_goal_shown_was_reached_in_about_three_trials():
    def goal(name: str, n: int, *, hit: bool = True) -> dict:
        return {"goal": name, "trials": [{"hit": False}] * (n - 1) + [{"hit": hit}]}

    assert _chosen([goal("a", 1), goal("b", 3), goal("c", 3)])["goal"] == "b"
    assert _chosen([goal("a", 1), goal("b", 4), goal("c", 2)])["goal"] == "b"
    assert _chosen([goal("a", 3, hit=False), goal("b", 7)])["goal"] == "b"
    assert _chosen([goal("a", 10, hit=False)])["goal"] == "a"


@pytest.mark.slow
def test_the_process_is_that_of_the_table_and_its_picture_marks_the_hit(tmp_path):
    training = replace(TRAINING, perception="eye")
    of_table = Trials(training, "basketball-v1", "gp", "eye", 5, unseen=True, rounds=6)
    in_table = of_table.run(tmp_path)
    solved_at = in_table["solved_at"]
    goals = Process(training, rounds=6).run(tmp_path)["goals"]
    first = [np.subtract(goal["trials"][0]["outcome"], goal["goal"]) for goal in goals]
    np.testing.assert_allclose(np.linalg.norm(first, axis=1), in_table["first_error"])
    assert [len(goal["trials"]) for goal in goals] == [at or 6 for at in solved_at]

    recipe = ProcessPictures(tasks=("basketball-v1",), generator="nearest")
    figures = recipe.run(Run(tmp_path, Scale(seeds=(0,), sets=("A",), rounds=6)))
    (row,) = figures["rows"]
    assert row["goal"] in [goal["goal"] for goal in goals]
    assert len(recipe.table(figures).rows) == len(row["trials"])
    (picture,) = recipe.draw(figures, tmp_path)
    green = np.all(np.asarray(Image.open(picture.path).convert("RGB")) == (0, 158, 115), axis=2)
    assert any(at for at in solved_at)  # so that a hit is shown
    assert green.sum() > 1000

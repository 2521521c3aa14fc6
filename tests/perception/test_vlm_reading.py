"""The record of a reading: every answer, and the picture with its boxes."""

from __future__ import annotations

import json

import numpy as np

from tests.perception.slanted_table import BALL, GOAL
from tests.perception.vision_server import VisionServer


def test_the_record_keeps_every_answer_and_draws_the_boxes(looking, picture, tmp_path):
    with VisionServer(faults=[None, "outlier", "refusal"]) as server:
        perception = looking(server)
        reading = perception.read(picture)
    assert perception.last_reading is reading
    reading.save(str(tmp_path), "trial-3")
    record = json.loads((tmp_path / "trial-3.json").read_text())
    answers = record["reached"]["answers"]
    assert [bool(answer["problem"]) for answer in answers] == [False, False, True, False]
    assert "I'm sorry" in answers[2]["text"]
    np.testing.assert_allclose(record["error_seen_m"], BALL - GOAL, atol=0.003)
    assert (tmp_path / "trial-3.png").stat().st_size > 1000

    drawn = reading.drawn()
    assert drawn.shape == picture.shape
    left, top, right, bottom = map(round, reading.reached.box)
    assert (drawn[(top + bottom) // 2, left - 2] == (0, 90, 255)).all()
    assert (drawn[top - 2, (left + right) // 2] == (0, 90, 255)).all()
    assert reading.picture is picture

"""The paper's loop at its own size: what is run, what each unit gives, and its table from rows."""

import numpy as np
import pandas as pd
import pytest

import prior_reinforce as pr
from prior_reinforce.generators import make_generator
from reproduction.demonstrations import DRAWN
from reproduction.evaluation import LearnedGenerator, Training
from reproduction.recipes import Scale
from reproduction.recipes.papers_loop import (
    FEWER,
    FRAMES,
    GATE,
    KNOWN,
    LOOP,
    ONE_NOISE,
    QUARTER,
    RECIPE,
    SMALLER,
    SPLINES,
    Executable,
    PerceivedGoalTrials,
    units,
)
from reproduction.results import Results

TINY = (
    "diffusion-paper,network.widths=8:16,network.groups=4,training_steps=3,noise_levels=4,"
    "sampling_steps=4"
)


def test_one_training_a_set_and_code_serves_everything():
    planned = units(Scale(device="cuda"))
    trainings = {unit.training for unit, _ in planned}
    everywhere = {
        (generator, name)
        for generator in (FRAMES, SPLINES, *FEWER.values(), *SMALLER.values())
        for name in ("A", "B")
    }
    drawn = {(SMALLER[QUARTER], name) for name in DRAWN[:8]}
    assert {(t.generator, t.demonstrations) for t in trainings} == everywhere | drawn
    assert len(trainings) == len(everywhere | drawn)
    assert {t.perception for t in trainings} == {"camera"}
    assert {t.generator for t in trainings if t.device == "cpu"} == {
        FRAMES + ",network.widths=32:64:128"
    }


@pytest.fixture(scope="module")
def learned():
    prior = pr.make_task("basketball-v1").demonstrations("A").without_symmetry()
    return LearnedGenerator(make_generator(TINY).fit(prior, seed=0), prior)


def test_smoothing_changes_plans_as_said(learned, tmp_path, monkeypatch):
    training = Training("basketball-v1", "A", TINY, 0)
    monkeypatch.setattr(Training, "learned", lambda self, folder: learned)
    raw, smooth = (Executable(training, 3, by).rows(Executable(training, 3, by).run(tmp_path))
                   for by in (0.0, 0.06))  # fmt: skip
    assert [row["goal"] for row in raw] == [0, 1, 2]
    assert {row["smoothing_s"] for row in smooth} == {0.06}
    assert [row["first_error"] for row in raw] != [row["first_error"] for row in smooth]
    assert {row["passed"] for row in raw} == {0}  # three steps: noise, which no arm can follow


def test_a_perceived_goal_is_beside_the_goal_and_hits_count_at_the_goal(
    learned, tmp_path, monkeypatch
):
    training = Training("basketball-v1", "A", TINY, 0)
    monkeypatch.setattr(Training, "learned", lambda self, folder: learned)
    unit = PerceivedGoalTrials(training, "basketball-v1", "gp", "exact", 4, rounds=1)
    asked: list[np.ndarray] = []
    propose = pr.make_adapter("gp").__class__.propose
    monkeypatch.setattr(
        "prior_reinforce.adapters.gaussian_process.GaussianProcessAdapter.propose",
        lambda self, goal: (asked.append(np.array(goal)), propose(self, goal))[1],
    )
    tried = unit.trials(tmp_path)
    goals = np.array([of.goal for of in tried])
    np.testing.assert_allclose(np.array(asked), unit.seen(goals))
    off = np.array(asked) - goals
    assert 0.002 < np.sqrt(np.mean(off**2)) < 0.02
    for of in tried:  # what was seen is the error from where the goal truly is
        np.testing.assert_allclose(of.trials[0].reading.error_seen, of.errors[0])


def test_a_row_a_form_and_what_is_known_before_the_gate_in_words():
    told = {"learned_on": "t", "set": "A", "seed": 0, "rounds": 10}
    rows = [
        *({**told, "task": task, "method": "loop", "goal": j, "solved_at": at, "failed_readings": 0}
          for task, at in (("basketball-v1", 2), ("basketball-v2", 4)) for j in range(3)),
        *({**told, "task": "basketball-v1", "method": f"{form}: {of}", "goal": 0, "solved_at": at,
           "failed_readings": 0}
          for form in (*FEWER, *SMALLER) for of, at in ((LOOP, 7), (ONE_NOISE, 5))),
        *({**told, "task": "basketball-v1", "condition": GATE, "method": "raw", "goal": j,
           "solved_at": 1, "rounds": 1, "passed": j % 2} for j in range(4)),
        *({**told, "task": "basketball-v1", "condition": KNOWN, "method": "raw",
           "quantity": "own_rms_rad", "value": v} for v in (0.001, 0.003)),
    ]  # fmt: skip
    results = Results(pd.DataFrame(rows), {})
    row, *quarter = RECIPE.table(results).rows
    assert [cell.split()[0] for cell in row[:3]] == ["loop", "2.00", "4.00"]
    assert [cells[0] for cells in quarter] == [f"{QUARTER}: {LOOP}", f"{QUARTER}: {ONE_NOISE}"]
    known, others, gate = RECIPE.remarks(results)
    assert "; 10,000 steps 7.00, 5.00; " in others
    assert others.endswith("widths 128:256:512 7.00, 5.00.")
    assert known.endswith("raw 2.0.")
    assert gate.endswith("raw 0.50, 1.00.")

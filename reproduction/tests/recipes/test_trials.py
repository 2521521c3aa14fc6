"""The table of trials, on few goals and a quick generator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gathered import gather

from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.simulation.tasks import make_task
from reproduction.evaluation import PerceivedDemonstrations
from reproduction.recipes import Scale
from reproduction.recipes.trials import RECIPE, ROWS, told, units
from reproduction.results import TRIALS

SMALL = Scale(goals=3, seeds=(0,), sets=("A",), rounds=2, read_pictures=False)


@pytest.mark.slow
def test_a_row_counts_what_was_not_reached_as_one_trial_more(tmp_path):
    planned = [
        p
        for p in units(SMALL, generator="nearest")
        if p[0].task in ("basketball-v1", "basketball-v2")
    ]
    results = gather(tmp_path, planned, "trials")
    assert len(list((tmp_path / "models").iterdir())) == 1  # V2 uses what V1's taught
    rows = told(results)
    assert [row.task for row, _ in rows] == ["basketball-v1", "basketball-v2"]
    for _, of in rows:
        for unseen, n in ((True, 5), (False, 3)):
            solved_at = of.where(unseen=unseen).frame["solved_at"]
            needed = [at or 3 for at in solved_at]
            assert len(needed) == n
            assert of.where(unseen=unseen).mean(TRIALS).value == pytest.approx(np.mean(needed))
    table = RECIPE.table(results)
    assert [row[:2] for row in table.rows] == [
        ("Basketball Shot", "eye"), ("Basketball Shot V2", "eye"),
    ]  # fmt: skip
    few = TRIALS.of(rows[0][1].where(unseen=True).frame)
    assert table.rows[0][3] == f"{few.mean():.1f} ± {few.std(ddof=1):.1f} (5)"
    assert RECIPE.remarks(results) == []  # nobody looked at pictures
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.stat().st_size > 10_000


def test_demonstrations_are_perceived_as_the_rows_trials_are():
    model = VisionLanguageModelConfig(model="mine")
    for scale, sense in ((Scale(model=model), "vlm"), (Scale(), "camera")):
        planned = units(replace(scale, seeds=(0,), sets=("A",)))
        seen = [unit for unit, _ in planned if isinstance(unit, PerceivedDemonstrations)]
        # V2 and V3 share what was seen on V1.
        assert [(s.task, s.perception) for s in seen] == [
            ("basketball-v1", "eye"),
            ("basketball-v1", sense),
            ("curling", "eye"),
            ("curling", sense),
            ("fishing", "eye"),
        ]
        assert [s.model for s in seen if s.perception == "eye"] == [None] * 3
        assert {s.model for s in seen if s.perception != "eye"} == {scale.model}
        for unit, _ in planned:
            if unit not in seen:
                assert unit.perception == unit.training.perception
    assert {unit.perception for unit, _ in units(SMALL)} == {"eye"}


def test_the_prior_of_a_row_is_its_number_of_demonstrations():
    assert all(make_task(r.learned_on).demonstrations("A").n == r.prior for r in ROWS)


def test_a_row_of_pictures_has_the_first_goals_and_seeds_of_the_eyes():
    planned = [p for p in units(Scale(goals=40)) if p[1].get("condition", "").startswith("Curling")]
    eye, camera = (
        {(u.training.demonstrations, u.training.seed): u.goals for u, _ in planned
         if u.perception == sense and not u.unseen}
        for sense in ("eye", "camera")
    )  # fmt: skip
    assert set(camera) == {("A", 0), ("A", 1), ("B", 0), ("B", 1)} < set(eye)
    assert (set(eye.values()), set(camera.values())) == ({40}, {30})
    goals = [make_task("curling").sample_goals(n, np.random.default_rng(1)) for n in (40, 30)]
    np.testing.assert_array_equal(goals[0][:30], goals[1])  # so their difference is paired

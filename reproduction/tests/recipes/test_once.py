"""Shown once: what is run, augmented demonstrations, and what is made of the rows."""

import re
from collections import Counter

import numpy as np
import pytest
from gathered import gather

from prior_reinforce.simulation.tasks import make_task
from reproduction.recipes import QUICK, Scale
from reproduction.recipes.once import (
    COPIES,
    COUNTS,
    EXECUTIONS,
    EYE,
    EYE_LABELS,
    GP,
    MEASURED,
    NONE,
    OURS,
    OUTSIDE,
    RECIPE,
    ZOO,
    Shown,
    augmented,
    units,
)
from reproduction.results import TRIALS


def test_each_demonstration_of_a_and_b_is_shown_alone_and_drawn_sets_are_tried_as_well():
    planned = units(Scale())
    ours = [
        unit.training
        for unit, names in planned
        if names == {"method": OURS, "condition": EYE} and unit.task == "basketball-v1"
    ]
    alone = [of.subset for of in ours if of.demonstrations == "A" and len(of.subset) == 1]
    assert sorted(alone) == [(i,) for i in range(6)]
    assert len({of.demonstrations for of in ours}) == 22
    assert {len(of.subset) for of in ours} == set(COUNTS)
    assert len({(of.demonstrations, of.seed, of.subset) for of in ours}) == len(ours)
    conditions = Counter(names["condition"] for _, names in planned)
    assert conditions[EYE] > conditions[MEASURED] > conditions[EYE_LABELS] > 0


def test_a_quick_run_takes_set_a_and_the_symmetry_alone_and_another_adapter_can_be_beside_it():
    quick = units(QUICK)
    assert {unit.training.demonstrations for unit, _ in quick} == {"A"}
    assert {names["method"] for _, names in quick} == {OURS}
    beside = {names["method"] for _, names in units(Scale(), ("proportional",))}
    assert {OURS, NONE, COPIES, GP, "proportional"} < beside


def test_goals_outside_lie_all_round_the_region_and_others_on_every_set():
    task = make_task("basketball-v1")
    planned = [unit for unit, names in units(Scale()) if names["method"] == OUTSIDE]
    assert len(planned) == 4 * 22
    goals = np.vstack([unit.drawn(task) for unit in planned])
    far = np.linalg.norm(goals - np.clip(goals, *task.region), axis=1)
    assert far.min() >= 0.1
    assert len(np.unique(goals, axis=0)) == 4 * 22
    assert np.all((goals < task.region[0]).any(axis=0) & (goals > task.region[1]).any(axis=0))


def test_copies_lie_on_a_grid_and_are_the_less_sure_the_farther_they_were_moved():
    task = make_task("basketball-v1")
    shown = task.demonstrations("A").only([0])
    copies = augmented(shown, task.symmetry, task.region)
    assert copies.n == 9
    assert copies.symmetry is None
    np.testing.assert_allclose(
        np.unique(copies.outcomes_seen[:, 0]), np.linspace(*task.region[:, 0], 3)
    )
    chart = task.symmetry.chart
    w = np.abs(chart.to(copies.outcomes_seen) - chart.to(shown.outcomes_seen))
    of_chart = np.hypot(0.5 * w[:, 0], 0.1 * w[:, 1])  # of ln distance, and of the bearing
    distance = np.linalg.norm(copies.outcomes_seen, axis=1)
    noise = np.linalg.norm(copies.outcome_noise, axis=1)
    np.testing.assert_allclose(noise, of_chart * distance)


def test_what_is_learned_from_is_said_as_a_symmetry_or_not(tmp_path):
    def learned(symmetry):
        return Shown("curling", "A", "auto", 0, (2,), symmetry=symmetry)._prior(tmp_path)

    own = make_task("curling").symmetry
    assert learned("own").symmetry.chart.centre == own.chart.centre
    assert learned("base").symmetry.chart.centre == (0.0, 0.0)
    assert learned("base").symmetry.rival is None
    assert learned("base or own").symmetry.rival.chart.centre == own.chart.centre
    assert learned("none").symmetry is None
    assert learned("none").n == 1
    assert learned("copies").n == 9


def test_the_zoo_is_tried_from_one_demonstration_where_one_tells_all_that_is_left():
    planned = [(unit, names) for unit, names in units(Scale()) if unit.task in ZOO]
    assert {unit.task for unit, _ in planned} == set(ZOO)
    assert {unit.training.task == unit.task for unit, _ in planned} == {True}
    once = {unit.task for unit, _ in planned if len(unit.training.subset) == 1}
    assert set(ZOO) - once == {"zoo-gripper"}
    sets = {unit.training.demonstrations for unit, _ in planned}
    assert sets == {f"mixed-8-{i}" for i in range(22)}


@pytest.mark.slow
def test_a_task_of_the_zoo_says_what_its_symmetry_is_worth(tmp_path):
    planned = [
        p
        for p in units(Scale(goals=2, rounds=2))
        if p[0].task == "zoo-pour" and p[0].training.demonstrations in ("mixed-8-0", "mixed-8-1")
    ]
    (verdict, _) = RECIPE.remarks(gather(tmp_path, planned, "once"))
    assert re.match(r"zoo-pour: shown once, N = 2\.00.*; six shown [+-]\d", verdict)


@pytest.mark.slow
def test_a_few_rows_give_table_verdict_and_picture(tmp_path):
    planned = [
        p
        for p in units(Scale(goals=2, rounds=2))
        if p[0].task == "basketball-v1"
        and p[0].training.demonstrations in ("v00", "v01")
        and len(p[0].training.subset) in (1, 6)
        and p[1]["condition"] == EYE
    ]
    results = gather(tmp_path, planned, "once")
    table = RECIPE.table(results)
    assert [row[:3] for row in table.rows] == [
        ("basketball-v1", name, EYE) for name in (OURS, COPIES, GP, NONE, OUTSIDE)
    ]
    assert table.header[3:] == ("1 shown: N; first", "6 shown: N; first", "within 4, 1 shown")
    one = results.where(method=OURS, count=1)
    assert one.mean(EXECUTIONS).value == pytest.approx(1 + one.mean(TRIALS).value)
    verdict, p_hit = RECIPE.remarks(results)
    assert "said" in p_hit
    assert verdict.startswith("basketball-v1: shown once, N = ")
    assert "met" in verdict
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.is_file()

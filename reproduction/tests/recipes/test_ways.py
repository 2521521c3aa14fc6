"""Generators on demonstrations of two ways: what is like no demonstration, and the table."""

import numpy as np
import pytest
from gathered import gather

from prior_reinforce.simulation.tasks import make_task
from reproduction.recipes import Scale, ways
from reproduction.recipes.ways import GENERATORS, RECIPE, SETS, units, unlike
from reproduction.results import FIRST


def test_half_of_each_way_is_like_no_demonstration():
    demos = make_task("zoo-sidearm").demonstrations("ways-8-100")
    turned = demos.plans[:, :, 0]
    forehand = np.abs(turned.min(axis=1)) > np.abs(turned.max(axis=1))
    one, other = demos.plans[forehand][0], demos.plans[~forehand][0]
    plans = np.stack([one, 0.98 * one + 0.02 * other, (one + other) / 2])
    assert unlike(demos, plans).tolist() == [False, False, True]


def test_the_network_and_its_untrained_self_learn_from_every_set():
    choices = [choice for _, choice in GENERATORS]
    assert choices[1] == f"{choices[0]},training_steps=0"
    trainings = {unit.training for unit, _ in units(Scale())}
    assert len(trainings) == len(GENERATORS) * sum(map(len, SETS.values()))


@pytest.mark.slow
def test_closed_form_within_each_way_is_above_one_of_all(tmp_path, monkeypatch):
    """Also what the table shows, of quick generators."""
    quick = tuple(GENERATORS[i] for i in (3, 2))
    monkeypatch.setattr(ways, "GENERATORS", quick)
    monkeypatch.setattr(ways, "SETS", {"zoo-overarm": ("ways-8-100",)})
    results = gather(tmp_path, units(Scale(goals=10, rounds=1)), "ways")
    tried = [of.where(adapter="bayes").mean(FIRST) for of in results.by("method").values()]
    assert tried[0].value > 0.5 > tried[1].value
    table = RECIPE.table(results)
    assert {len(row) for row in table.rows} == {len(table.header)}
    assert [row[1] for row in table.rows] == [label for label, _ in quick]
    assert float(table.rows[0][-1]) < 0.2 < float(table.rows[1][-1])  # like no demonstration

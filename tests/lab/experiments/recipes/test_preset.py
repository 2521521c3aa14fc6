"""The paper's preset beside ours; brief networks stand for it, since it learns for hours."""

import numpy as np
import pytest

from prior_reinforce.commands.reproduce import Reproduce
from prior_reinforce.lab.experiments.evaluation import Training, Trials
from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.base import TASK, from_json, to_json
from prior_reinforce.lab.experiments.recipes.preset import (
    RECIPE,
    IndependentNoiseTrials,
    PaperPreset,
)

BRIEF = "quick_units:BriefDiffusion,sampler=ddpm"
SMALL = Scale(goals=3, seeds=(0,), sets=("A",), rounds=1)


@pytest.mark.slow
def test_one_network_is_sampled_twice_and_stands_beside_ours(tmp_path):
    methods = (("ours", "nearest", False), ("shared", BRIEF, False), ("own", BRIEF, True))
    measurement = PaperPreset(methods)
    figures = from_json(to_json(measurement.run(Run(tmp_path, SMALL))))
    assert len(list(tmp_path.glob("models/*"))) == 2  # not a network for each way of sampling
    table = RECIPE.table(figures)
    assert [row[0] for row in table.rows] == ["ours", "shared", "own"]
    assert {len(row) for row in table.rows} == {len(table.header)}
    shared, own = figures["rows"][1:]
    assert shared["first_error_m"] != own["first_error_m"]

    training = Training(TASK, "A", BRIEF, 0)
    plans = [
        kind(training, TASK, "gp", "exact", goals=1)
        .learned(tmp_path)
        .generator.generate([[1.0, 0.0], [1.0, 1e-6]])
        for kind in (Trials, IndependentNoiseTrials)
    ]
    apart = [np.abs(np.diff(of, axis=0)).max() for of in plans]
    assert apart[0] < 1e-3 < apart[1]  # near conditions have near plans, or not


def test_all_leaves_it_out_and_its_name_runs_it():
    assert RECIPE not in Reproduce("all")._recipes()
    assert Reproduce("preset")._recipes() == [RECIPE]

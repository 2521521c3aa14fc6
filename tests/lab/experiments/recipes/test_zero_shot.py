"""First throws: nearest neighbours repeat demonstrations, and are far off between them."""

import pytest

from prior_reinforce.lab.experiments.evaluation import Training, ZeroShot
from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.zero_shot import RECIPE, ZeroShotErrors

SMALL = Scale(seeds=(0,), sets=("A",))


def test_a_row_a_training_diffusion_first():
    choices = [t.generator for t in ZeroShotErrors().trainings(Scale(), ("dmp",))]
    assert choices == ["diffusion"] * 6 + ["dmp"] * 6


def test_what_neighbours_throw(tmp_path):
    training = Training("basketball-v1", "A", "nearest", 0)
    (result,) = Run(tmp_path, SMALL).results([ZeroShot(training, spacing=0.2)])
    assert max(result["own_rms_rad"]) < 1e-6
    assert max(result["own_landing_from_demonstrated_m"]) < 1e-6
    assert 0.01 < result["grid_median_m"] <= result["grid_p90_m"]
    row = {"generator": "nearest", "demonstrations": "A", "seed": 0, **result}
    table = RECIPE.table({"rows": [row]})
    assert table.rows[0][:5] == ("nearest", "A", "0", "0.0", "0.0")
    assert float(table.rows[0][6]) == pytest.approx(100 * result["grid_median_m"], abs=0.01)
    assert len(table.rows[0]) == len(table.header)

"""First throws: nearest neighbours repeat demonstrations, and are far off between them."""

from gathered import gather

from reproduction.evaluation import Training, ZeroShot
from reproduction.recipes import Scale
from reproduction.recipes.zero_shot import RECIPE, units


def test_a_row_a_training_diffusion_first():
    choices = [unit.training.generator for unit, _ in units(Scale(), ("dmp",))]
    assert choices == ["diffusion"] * 6 + ["dmp"] * 6


def test_what_neighbours_throw(tmp_path):
    training = Training("basketball-v1", "A", "nearest", 0)
    results = gather(tmp_path, [(ZeroShot(training, spacing=0.2), {"method": "nearest"})])
    table = RECIPE.table(results)
    assert table.rows[0][:6] == ("nearest", "A", "0", "0.0", "0.0", "0.0")  # its own, exactly
    median, ninety = map(float, table.rows[0][6:8])
    assert 1.0 < median <= ninety
    assert len(table.rows[0]) == len(table.header)

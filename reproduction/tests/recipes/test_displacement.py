"""Measures of a displacement field, on fields whose measures are known."""

import numpy as np
import pytest
from gathered import gather

from reproduction.recipes import Scale
from reproduction.recipes.displacement import (
    RECIPE,
    Displacement,
    measure,
    measures,
    summed,
    units,
    widest_three,
)

GRID = np.stack(np.meshgrid(np.linspace(0, 1, 11), np.linspace(0, 2, 21), indexing="ij"), axis=-1)
REGION = np.array([[0.0, 0.0], [1.0, 2.0]])
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def test_a_constant_field_has_no_steepness_and_one_error():
    found = measures(GRID, np.full_like(GRID, 0.03), CORNERS, REGION)
    assert found["steepness"] == pytest.approx(0.0)
    assert found["mean"] == pytest.approx(3 * np.sqrt(2))  # cm
    assert found["high_error_area"] == 0.0


def test_a_linear_field_is_as_steep_as_its_factor():
    assert measures(GRID, 0.4 * GRID, CORNERS, REGION)["steepness"] == pytest.approx(0.4)


def test_errors_inside_the_hull_are_told_from_those_outside():
    # No error up to y = 1, where the hull ends, and 0.1 m along x beyond it.
    step = np.stack([0.1 * (GRID[..., 1] > 1.0), 0 * GRID[..., 1]], axis=-1)
    found = measures(GRID, step, CORNERS, REGION)
    assert found["inside"] == pytest.approx(0.0)
    assert found["outside"] == found["outside_minus_inside"] == pytest.approx(10.0)
    assert found["high_error_area"] == pytest.approx(10 / 21)


def test_only_the_reachable_region_counts():
    beyond = np.where(GRID[..., 1:] > 1.5, 9.0, 0.01) * np.array([1.0, 0.0])
    found = measures(GRID, beyond, CORNERS, np.array([[0.0, 0.0], [1.0, 1.4]]))
    assert found["mean"] == pytest.approx(1.0)
    assert found["steepness"] == pytest.approx(0.0)


def test_the_three_kept_span_the_largest_triangle():
    outcomes = np.array([[0.5, 0.5], [0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.9, 0.2]])
    # The farthest three lie on one line and span nothing.
    assert set(widest_three(outcomes)) == {1, 3, 4}


@pytest.mark.slow
def test_the_recipe_runs_from_throws_to_table_and_picture(tmp_path):
    planned = [
        (Displacement(unit.training, spacing=0.15), names)
        for unit, names in units(Scale(seeds=(0,), sets=("A",)), generator="dmp")
    ]
    results = gather(tmp_path, planned, "displacement")
    six, three = summed(results).by("method").values()
    # Six throws of one pattern pin a segmented DMP down to less than half a centimetre or so.
    assert six.mean(measure("inside")).value < 1.0
    assert three.minus(six, measure("mean")).value > 0
    table = RECIPE.table(results)
    assert [row[0] for row in table.rows] == [
        "all demonstrations", "three demonstrations", "difference",
    ]  # fmt: skip
    assert {len(row) for row in table.rows} == {len(table.header)}
    (picture,) = RECIPE.draw(results, tmp_path)
    assert picture.path.read_bytes().startswith(b"\x89PNG")

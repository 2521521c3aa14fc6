"""Measures of a displacement field, on fields whose measures are known."""

import numpy as np
import pytest

from prior_reinforce.lab.experiments.claims import Verdict
from prior_reinforce.lab.experiments.recipes import Run, Scale
from prior_reinforce.lab.experiments.recipes.base import from_json, to_json
from prior_reinforce.lab.experiments.recipes.displacement import (
    RECIPE,
    DisplacementFields,
    measures,
    widest_three,
)

X, Y = np.linspace(0.0, 1.0, 11), np.linspace(0.0, 2.0, 21)
REGION = np.array([[0.0, 0.0], [1.0, 2.0]])
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def field(displacement):
    grid = np.stack(np.meshgrid(X, Y, indexing="ij"), axis=-1)
    return {"axes_m": [X.tolist(), Y.tolist()], "displacements_m": displacement(grid).tolist()}


def test_a_constant_field_has_no_steepness_and_one_error():
    found = measures(field(lambda grid: np.full_like(grid, 0.03)), CORNERS, REGION)
    assert found["steepness"] == pytest.approx(0.0)
    assert found["mean_m"] == pytest.approx(0.03 * np.sqrt(2))
    assert found["high_error_area"] == 0.0


def test_a_linear_field_is_as_steep_as_its_factor():
    found = measures(field(lambda grid: 0.4 * grid), CORNERS, REGION)
    assert found["steepness"] == pytest.approx(0.4)


def test_errors_inside_the_hull_are_told_from_those_outside():
    # No error up to y = 1, where the hull ends, and 0.1 m along x beyond it.
    step = field(lambda grid: np.stack([0.1 * (grid[..., 1] > 1.0), 0 * grid[..., 1]], axis=-1))
    found = measures(step, CORNERS, REGION)
    assert found["inside_m"] == pytest.approx(0.0)
    assert found["outside_m"] == pytest.approx(0.1)
    assert found["high_error_area"] == pytest.approx(10 / 21)


def test_only_the_reachable_region_counts():
    beyond = field(lambda grid: np.where(grid[..., 1:] > 1.5, 9.0, 0.01) * np.array([1.0, 0.0]))
    found = measures(beyond, CORNERS, np.array([[0.0, 0.0], [1.0, 1.4]]))
    assert found["mean_m"] == pytest.approx(0.01)
    assert found["steepness"] == pytest.approx(0.0)


def test_the_three_kept_span_the_largest_triangle():
    outcomes = np.array([[0.5, 0.5], [0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.9, 0.2]])
    # The farthest three lie on one line and span nothing.
    assert set(widest_three(outcomes)) == {1, 3, 4}


@pytest.mark.slow
def test_the_recipe_runs_from_throws_to_claims_and_picture(tmp_path):
    figures = DisplacementFields(generator="dmp", spacing=0.06).run(
        Run(tmp_path, Scale(seeds=(0,), sets=("A",)))
    )
    figures = from_json(to_json(figures))
    assert [row["demonstrations"] for row in figures["rows"]] == [6, 3]
    assert figures["fields"][1]["training"]["subset"] is not None
    # Six throws of one pattern pin a segmented DMP down to less than half a centimetre or so.
    assert figures["rows"][0]["inside_m"].value < 0.01
    assert figures["three_minus_six"]["mean_m"].value > 0
    assert all(claim.verdict is Verdict.OPEN for claim in RECIPE.claims(figures))
    table = RECIPE.table(figures)
    assert {len(row) for row in table.rows} == {len(table.header)}
    (picture,) = RECIPE.draw(figures, tmp_path)
    assert picture.path.read_bytes().startswith(b"\x89PNG")

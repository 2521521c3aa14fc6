"""The picture of what an adapter knows."""

import numpy as np
import pytest
from PIL import Image

from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.generators.reach import Reach
from prior_reinforce.report import advice
from prior_reinforce.report.advice import draw_advice


def test_where_a_first_throw_hits_is_dark(tmp_path):
    grid = np.stack(np.meshgrid([0.8, 0.9, 1.0], [-0.2, 0.2], indexing="ij"), -1).reshape(-1, 2)
    pictures = []
    for p in (0.0, 1.0):
        path = draw_advice(
            tmp_path / f"{p}.png", OutcomeFormat.metres(2), grid[:2], goals=grid,
            p_hit=np.full(6, p), goal=grid[2], throw=grid[3], demonstration=grid[4],
        )  # fmt: skip
        pictures.append(np.asarray(Image.open(path).convert("RGB")).mean())
    assert pictures[0] > pictures[1] + 20


@pytest.fixture
def figures(monkeypatch):
    """Figures that were drawn."""
    drawn = []
    monkeypatch.setattr(
        advice.style, "save_figure", lambda figure, path: drawn.append(figure) or path
    )
    return drawn


def test_what_is_out_of_reach_is_drawn_beside_what_is_not(tmp_path, figures):
    grid = np.stack(np.meshgrid([0.8, 0.9, 1.0], [-0.2, 0.0, 0.2, 0.4], indexing="ij"), -1)
    some = Reach(grid, np.array([[True] * 4, [True] * 4, [False] * 4]))
    draw_advice(tmp_path / "a.png", OutcomeFormat.metres(2), grid[0], some)
    (axes,) = figures[0].axes
    labels = axes.get_legend_handles_labels()[1]
    assert "can be reached" in labels
    assert "hatched: out of reach, 33% of the goals" in labels


def test_what_the_shades_and_the_axes_mean_is_said(tmp_path, figures):
    grid = np.stack(np.meshgrid([0.8, 0.9, 1.0], [-0.2, 0.2], indexing="ij"), -1).reshape(-1, 2)
    draw_advice(
        tmp_path / "a.png", OutcomeFormat.metres(2), grid[:2], goals=grid,
        p_hit=np.full(6, 0.5), goal=grid[2], throw=grid[3], demonstration=grid[3],
    )  # fmt: skip
    (axes,) = figures[0].axes
    assert axes.get_xlabel() == "← left      y [cm]      right →"
    assert axes.get_xbound() == (-20.0, 20.0)
    (bar,) = axes.child_axes
    assert bar.get_ylabel() == "a first throw's hit is"
    assert [t.get_text() for t in bar.get_yticklabels()] == ["unlikely", "possible", "likely"]
    sizes = {scatter.get_label(): scatter.get_sizes()[0] for scatter in axes.collections[1:]}
    # Both are seen where they are at one place.
    assert sizes["throw that teaches most"] > 4 * sizes["demonstration that teaches most"]


@pytest.mark.parametrize("goal", [[-0.9, 0.1], [2.5, 0.0], [0.9, -0.4]])
def test_a_goal_off_the_map_stands_at_its_edge_and_is_named_so(tmp_path, figures, goal):
    grid = np.stack(np.meshgrid([0.8, 0.9, 1.0], [-0.2, 0.2], indexing="ij"), -1).reshape(-1, 2)
    draw_advice(
        tmp_path / "a.png", OutcomeFormat.metres(2), grid[:2], goals=grid,
        p_hit=np.full(6, 0.5), goal=np.array(goal),
    )  # fmt: skip
    (axes,) = figures[0].axes
    (mark,) = (line for line in axes.lines if line.get_label() == "goal, off the map")
    x, y = mark.get_xydata()[0] / 100
    assert -0.2 <= x <= 0.2
    assert 0.8 <= y <= 1.0

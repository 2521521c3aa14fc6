"""Charts show what they are given: read back from what matplotlib was asked to draw."""

import numpy as np
import pytest
from matplotlib.axes import Axes

from prior_reinforce.lab.experiments.recipes.charts import (
    Line,
    Panel,
    TrialsRow,
    draw_success,
    draw_trials,
)
from prior_reinforce.lab.experiments.statistics import Interval


@pytest.fixture
def bars(monkeypatch):
    """Every series with its bars, as it was drawn."""
    drawn = []
    errorbar = Axes.errorbar

    def record(self, x, y, **settings):
        drawn.append((np.asarray(x), np.asarray(y), settings))
        return errorbar(self, x, y, **settings)

    monkeypatch.setattr(Axes, "errorbar", record)
    return drawn


def test_a_line_a_method_with_its_interval_at_every_round(tmp_path, bars):
    curve = [{"value": 0.5, "low": 0.4, "high": 0.7}, {"value": 0.8, "low": 0.7, "high": 0.9}]
    panels = [Panel("shares", [Line("ours", curve, 0), Line("theirs", curve, 3, dashed=True)])]
    draw_success(panels, tmp_path / "success.png")
    (x, y, ours), (other_x, _, theirs) = bars
    np.testing.assert_array_equal(y, [0.5, 0.8])
    np.testing.assert_allclose(ours["yerr"], [[0.1, 0.1], [0.2, 0.1]])
    assert np.all(np.abs(x - [1, 2]) < 0.2)
    assert np.all(x != other_x)  # no bar hides another
    assert (ours["linestyle"], theirs["linestyle"]) == ("-", "--")
    assert ours["color"] != theirs["color"]


def test_a_row_of_trials_shows_the_papers_mean_and_both_of_ours(tmp_path, bars):
    rows = [TrialsRow(name, Interval(3, 2, 5), Interval(2, 1.5, 2.25), 2.9, 0.9) for name in "ab"]
    draw_trials(rows, tmp_path / "trials.png")
    (paper, _, theirs), (many, places, ours), (unseen, _, few) = bars
    np.testing.assert_array_equal(paper, [2.9, 2.9])
    np.testing.assert_array_equal(theirs["xerr"], [0.9, 0.9])
    np.testing.assert_array_equal(many, [2, 2])
    np.testing.assert_array_equal(places, [0, 1])
    np.testing.assert_allclose(ours["xerr"], [[0.5, 0.5], [0.25, 0.25]])
    np.testing.assert_array_equal(unseen, [3, 3])
    np.testing.assert_allclose(few["xerr"], [[1, 1], [2, 2]])

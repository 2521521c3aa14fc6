"""Charts show what they are given: read back from what matplotlib was asked to draw."""

import numpy as np
import pytest
from matplotlib.axes import Axes

from reproduction.recipes.charts import (
    Line,
    Mark,
    Panel,
    draw_rows,
    draw_success,
)
from reproduction.statistics import Interval


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
    curve = [Interval(0.5, 0.4, 0.7), Interval(0.8, 0.7, 0.9)]
    panels = [Panel("shares", [Line("ours", curve, 0), Line("theirs", curve, 3, dashed=True)])]
    draw_success(panels, tmp_path / "success.png")
    (x, y, ours), (other_x, _, theirs) = bars
    np.testing.assert_array_equal(y, [0.5, 0.8])
    np.testing.assert_allclose(ours["yerr"], [[0.1, 0.1], [0.2, 0.1]])
    assert np.all(np.abs(x - [1, 2]) < 0.2)
    assert np.all(x != other_x)  # no bar hides another
    assert (ours["linestyle"], theirs["linestyle"]) == ("-", "--")
    assert ours["color"] != theirs["color"]


def test_a_row_shows_every_method_that_was_tried_with_its_interval(tmp_path, bars):
    marks = {
        "paper": Mark("D", "red", [Interval(2.9, 2.0, 3.8)] * 2),
        "ours": Mark("o", "blue", [Interval(2, 1.5, 2.25), None]),
        "nobody": Mark("s", "green", [None, None]),
    }
    draw_rows(["a", "b"], marks, "trials", tmp_path / "rows.png")
    (paper, above, theirs), (ours, below, mine) = bars
    np.testing.assert_array_equal(paper, [2.9, 2.9])
    np.testing.assert_allclose(theirs["xerr"], [[0.9, 0.9], [0.9, 0.9]])
    np.testing.assert_array_equal(ours, [2])
    np.testing.assert_allclose(mine["xerr"], [[0.5], [0.25]])
    np.testing.assert_array_equal(np.round(above), [0, 1])
    assert above[0] < below[0]  # one below another, and both nearer to their row than to the next
    assert abs(below[0]) < 0.5
    assert (theirs["fmt"], mine["fmt"]) == ("D", "o")

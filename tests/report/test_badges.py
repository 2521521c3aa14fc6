"""Badges: beside their points, apart from each other, inside the picture."""

import numpy as np
import pytest

from prior_reinforce.report.badges import draw_badges
from prior_reinforce.report.style import new_figure


@pytest.fixture
def axes():
    figure = new_figure(4, 4, laid_out=False)
    axes = figure.subplots()
    axes.set_xlim(0, 10)
    axes.set_ylim(0, 10)
    return axes


def boxes(axes):
    axes.figure.draw_without_rendering()
    return [text.get_bbox_patch().get_window_extent() for text in axes.texts]


@pytest.mark.parametrize("labels", ["12345", ["Goal 1", "Goal 2", "Goal 3", "Goal 4", "Goal 5"]])
def test_badges_of_points_at_the_very_same_place_do_not_cover_each_other(axes, labels):
    places = [np.array([5.0, 5.0])] * 5
    draw_badges(axes, places, list(labels), ["#16406f"] * 5, away_from=places[0])
    drawn = boxes(axes)
    assert [text.get_text() for text in axes.texts] == list(labels)
    for i, box in enumerate(drawn):
        for other in drawn[:i]:
            # The corners of round badges may lie in each other's bounding box.
            shared = box.intersection(box, other)
            assert shared is None or shared.width * shared.height < 0.1 * box.width * box.height


def test_a_badge_lies_on_the_far_side_of_its_point(axes):
    draw_badges(axes, [np.array([6.0, 5.0])], ["1"], ["#16406f"], away_from=np.array([5.0, 5.0]))
    (box,) = boxes(axes)
    left, _ = axes.transData.inverted().transform([box.x0, box.y0])
    assert left > 6.0


def test_badges_at_the_edge_stay_inside(axes):
    places = [np.array([10.0, 10.0]), np.array([0.0, 0.0])]
    draw_badges(axes, places, ["1", "2"], ["#16406f"] * 2, away_from=np.array([5.0, 5.0]))
    frame = axes.get_window_extent()
    for box in boxes(axes):
        assert frame.x0 <= box.x0
        assert box.x1 <= frame.x1
        assert frame.y0 <= box.y0
        assert box.y1 <= frame.y1


def test_no_trials_have_no_badges(axes):
    draw_badges(axes, [], [], [], away_from=np.array([5.0, 5.0]))
    assert not axes.texts

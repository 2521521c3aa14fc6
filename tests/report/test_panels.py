"""Panels: what is to the left is drawn left, a centimetre is as long up as across."""

import numpy as np
import pytest

from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.report.panels import View, views_of
from prior_reinforce.report.places import draw_close_up, draw_table
from tests.report.swing_world import adaptation, told


@pytest.mark.parametrize(
    ("units", "views"),
    [
        (["m"], [View(0, None)]),
        (["m", "m"], [View(1, 0, mirrored=True, title="from above")]),
        (["m", "s"], [View(0, 1)]),
        (["rad"] * 4, [View(0, 1), View(1, 2), View(2, 3)]),
    ],
)
def test_views_show_every_component(units, views):
    assert views_of(OutcomeFormat(tuple("abcd"[: len(units)]), tuple(units))) == views


def test_three_lengths_are_seen_from_above_and_from_the_side():
    above, side = views_of(OutcomeFormat.metres(3))
    assert {above.across, above.up, side.across, side.up} == {0, 1, 2}
    assert side.up == 2


@pytest.mark.slow
def test_from_above_left_is_left_and_beyond_is_up():
    (axes,) = draw_table([told([0.05, 0.0])]).axes
    x, y = axes.transData.transform([[-10.0, 92.0], [10.0, 102.0]]).T
    assert x[1] < x[0]  # y = +10 cm is to the left
    assert y[1] > y[0]
    assert axes.get_xlabel().startswith("← left")
    assert axes.get_ylabel().endswith("long →")


@pytest.mark.slow
@pytest.mark.parametrize("draw", [lambda record: draw_table([record]), draw_close_up])
@pytest.mark.parametrize("k", [2, 3])
def test_a_centimetre_is_as_long_up_as_across(draw, k):
    record = adaptation(seed=1, k=k, units=("m",) * k, action_dim=1, most=2)
    figure = draw(record)
    figure.draw_without_rendering()
    for axes in figure.axes:
        origin, across, up = axes.transData.transform([[0, 0], [1, 0], [0, 1]])
        assert abs(across - origin)[0] == pytest.approx(abs(up - origin)[1])


def test_trials_on_a_line_stand_below_each_other():
    record = adaptation(seed=1, k=1, units=("m",), action_dim=1, most=3)
    (axes,) = draw_close_up(record).axes
    badges = {text.get_text(): text.xy for text in axes.texts}
    assert [badges[str(trial.number)][1] for trial in record.trials] == [
        -row for row in range(1, len(record.trials) + 1)
    ]
    seen = [badges[str(trial.number)][0] for trial in record.trials]
    np.testing.assert_allclose(seen, [100 * landing[0] for landing in record.landings])

"""Pictures of places: everything is seen, named as on the page, and inside the figure."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.readings import Reading
from prior_reinforce.report.places import draw_close_up, draw_table
from tests.report.swing_world import adaptation, demonstrations, told

REGION = np.array([[0.80, -0.32], [1.08, 0.32]])
KINDS = [(1, ("m",)), (2, ("m", "m")), (2, ("m", "s")), (3, ("m",) * 3), (4, ("rad",) * 4)]


def texts(figure):
    figure.draw_without_rendering()
    return [text.get_text() for axes in figure.axes for text in axes.texts]


@pytest.fixture(scope="module", params=KINDS, ids=lambda kind: "-".join(kind[1]))
def record(request):
    k, units = request.param
    if k == 4:
        record = told([0.05, 0.0])
        outcomes = np.random.default_rng(0).uniform(size=(6, 4))
        demos = replace(
            demonstrations(),
            outcomes_seen=outcomes,
            outcome_format=OutcomeFormat(tuple("abcd"), units),
        )
        (trial,) = record.trials
        trial = replace(trial, condition=outcomes[0], reading=Reading.measured(np.full(4, 0.1)))
        return replace(record, demonstrations=demos, goal=outcomes[0], trials=(trial,))
    return adaptation(seed=1, k=k, units=units, action_dim=1, most=3)


@pytest.mark.parametrize(
    "draw",
    [
        lambda record: draw_table([record]),
        draw_close_up,
        lambda record: draw_close_up(record, aims=True),
    ],
    ids=["table", "landings", "aims"],
)
def test_nothing_is_cut_off_at_the_edge(draw, record):
    figure = draw(record)
    bounds = figure.get_tightbbox()
    width, height = figure.get_size_inches()
    assert min(bounds.x0, bounds.y0) >= 0
    assert bounds.x1 <= width
    assert bounds.y1 <= height


def test_every_trial_and_demonstration_is_within_the_table(record):
    figure = draw_table([record])
    for axes in figure.axes:
        frame = axes.get_window_extent()
        for line in axes.lines:
            points = axes.transData.transform(line.get_xydata())
            if np.ptp(points, axis=0).max() == 0:  # a mark
                assert frame.contains(*points[0])


def test_one_goal_has_its_trials_numbered_as_they_were_told():
    figure = draw_table([told([0.05, 0.0], None, [0.0, 0.0], first_number=7)], REGION)
    assert sorted(texts(figure)) == ["7", "9"]  # the voided one landed nowhere


def test_several_goals_are_named_as_on_the_page():
    records = [told([0.05, 0.0]), replace(told([0.0, 0.0], goal=(1.0, 0.2)), title="far hoop")]
    figure = draw_table(records, REGION)
    assert sorted(texts(figure)) == ["Goal 1", "far hoop"]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "goal ± 1.5 cm",
        "demonstrations",
        "misses, first to last",
        "hits",
        "region of goals",
    ]


def test_a_flat_table_has_a_flat_picture():
    figure = draw_table([told([0.05, 0.0])], REGION)
    assert figure.get_figheight() < 3.5
    tall = draw_table([told([0.05, 0.0])], np.array([[0.5, -0.1], [2.0, 0.1]]))
    assert tall.get_figheight() == pytest.approx(4.5)


def test_truth_is_shown_close_up_beside_what_was_seen():
    goal = np.array([0.92, -0.10])
    record = told([0.05, 0.0], outcomes=(np.add(goal, [0.04, 0.01]),))
    places = [
        line.get_xydata()[0].tolist()
        for line in draw_close_up(record).axes[0].lines
        if line.get_color() == "white"
    ]
    np.testing.assert_allclose(places, [[-9.0, 96.0]])  # across y, up x, in [cm]


def test_a_true_landing_beyond_what_was_seen_is_shown_and_a_lost_ball_moves_nothing():
    goal = np.array([0.92, -0.10])
    beyond, lost = np.add(goal, [-0.075, 0.01]), np.add(goal, [3.0, 0.0])
    (near,) = draw_close_up(told([-0.05, 0.0], outcomes=(beyond,))).axes
    low, high = near.get_ybound()
    assert low < 100 * beyond[0] < high
    (plain,) = draw_close_up(told([-0.05, 0.0])).axes
    (far,) = draw_close_up(told([-0.05, 0.0], outcomes=(lost,))).axes
    assert far.get_ybound() == plain.get_ybound()


def test_a_wild_landing_leaves_the_aims_as_large_as_they_were():
    (calm,) = draw_close_up(told([0.02, 0.0]), aims=True).axes
    (wild,) = draw_close_up(told([0.30, 0.0]), aims=True).axes
    assert wild.get_ybound() == calm.get_ybound()
    assert wild.get_ybound()[1] < 110
    (landings,) = draw_close_up(told([0.30, 0.0])).axes
    assert landings.get_ybound()[1] > 122


def test_aims_have_a_legend_and_voided_ones_are_hollow():
    figure = draw_close_up(told([0.05, 0.0], None, [0.0, 0.0]), aims=True)
    marks = [line for line in figure.axes[0].lines if line.get_marker() == "s"]
    assert [line.get_color() == "white" for line in marks] == [False, True, False]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "goal ± 1.5 cm",
        "demonstrations",
        "aims, first to last",
        "aim that hit",
        "voided",
    ]


@pytest.mark.parametrize("across", [0.004, 0.005, 0.006])  # a tick comes to the very edge
def test_no_tick_is_cut_off_after_both_directions_have_one_scale(across):
    figure = draw_close_up(told([0.0, 0.0], goal=(1.4, across), tolerance=0.02), aims=True)
    figure.draw_without_rendering()
    assert figure.get_tightbbox().x1 <= figure.get_figwidth()

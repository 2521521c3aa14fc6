"""Curves: errors as long as they are, plans as they were, noise no larger than it is."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from prior_reinforce.readings import Reading
from prior_reinforce.report.curves import draw_errors, draw_plans, draw_trials_by_goal
from prior_reinforce.report.style import HIT
from prior_reinforce.session.trials import Stage
from tests.report.swing_world import told

GOAL = np.array([0.92, -0.10])


def test_errors_are_drawn_in_centimetres_over_the_trials_own_numbers():
    record = told([0.03, 0.04], None, [0.0, 0.01], first_number=4)
    (axes,) = draw_errors(record).axes
    (way,) = [line for line in axes.lines if line.get_linestyle() == "-" and line.get_zorder() == 3]
    np.testing.assert_allclose(way.get_xydata(), [[1, 5.0], [3, 1.0]])
    assert [label.get_text() for label in axes.get_xticklabels()] == ["4", "5", "6"]
    said = [text.get_text() for text in axes.texts]
    assert said == ["5 cm", "voided", "1 cm"]
    assert axes.get_title(loc="right") == "shaded: reached, within 1.5 cm"
    assert axes.get_ylim()[1] > 5.0


@pytest.mark.parametrize(("hit", "said"), [(True, "hit"), (False, "miss")])
def test_a_distance_that_nobody_told_is_not_drawn(hit, said):
    record = told([0.03, 0.04])
    bare = replace(record.trials[0], reading=Reading.only(hit, 2), hit=hit)
    (axes,) = draw_errors(replace(record, trials=(bare,))).axes
    assert [text.get_text() for text in axes.texts] == [said]


def test_true_errors_are_hollow():
    record = told([0.03, 0.04], outcomes=(np.add(GOAL, [0.0, 0.06]),))
    (axes,) = draw_errors(record).axes
    (true,) = [line for line in axes.lines if line.get_label() == "true error"]
    np.testing.assert_allclose(true.get_xydata(), [[1, 6.0]])


def test_a_goal_not_tried_yet_has_axes_all_the_same():
    (axes,) = draw_errors(told()).axes
    assert axes.get_ylim()[1] > 1.5


def test_what_is_said_of_a_waiting_trial_covers_no_other_words():
    record = told([0.30, 0.0], [0.0, 0.02], [0.0, 0.02])
    waiting = replace(record.trials[2], stage=Stage.ASKED, reading=None)
    figure = draw_errors(replace(record, trials=(*record.trials[:2], waiting)))
    figure.draw_without_rendering()
    (axes,) = figure.axes
    # Three points apart.
    texts = (*axes.texts, axes._right_title)
    boxes = [text.get_window_extent().padded(1.5 * figure.dpi / 72) for text in texts]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))


def test_every_joint_shows_the_demonstrations_and_each_trial_and_their_differences():
    record = told([0.03, 0.04], None)
    first, second = record.trials
    record = replace(record, trials=(first, replace(second, plan=second.plan + 0.002)))
    figure = draw_plans(record)
    panels = [axes for axes in figure.axes if axes.axison]
    whole = [axes for axes in panels if axes.get_title(loc="left").startswith("joint")]
    differences = [axes for axes in panels if axes not in whole]
    assert [axes.get_title(loc="left") for axes in whole] == [
        f"joint{i} [rad]" for i in range(1, 8)
    ]
    for j, axes in enumerate(whole):
        drawn = [line.get_ydata() for line in axes.lines]
        plans = [*record.demonstrations.plans, *(trial.plan for trial in record.trials)]
        np.testing.assert_array_equal(drawn, [plan[:, j] for plan in plans])
    for axes in differences:
        assert axes.get_title(loc="left") == "minus trial 1 [mrad]"
        drawn = [line.get_ydata() for line in axes.lines]
        np.testing.assert_allclose(drawn, [np.zeros(60), np.full(60, 2.0)], atol=1e-9)
    assert len(differences) == 7
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "demonstrations",
        "trial 1",
        "trial 2",
    ]
    assert whole[0].lines[-1].get_linestyle() == "--"  # voided


def test_only_plans_of_one_horizon_are_compared():
    record = told([0.03, 0.04], None, [0.0, 0.0])
    first, second, third = record.trials
    shorter = replace(second, plan=second.plan[:-5])
    for trials, n in (((first,), 0), ((first, shorter), 0), ((first, shorter, third), 2)):
        panels = draw_plans(replace(record, trials=trials)).axes
        below = [axes for axes in panels if "minus" in axes.get_title(loc="left")]
        drawn = [sum(len(line.get_xdata()) > 0 for line in axes.lines) for axes in below]
        assert drawn == ([n] * 7 if n else [])


def test_a_plan_that_is_lost_is_left_out():
    record = told([0.03, 0.04])
    lost = replace(record, trials=(replace(record.trials[0], plan=np.empty((0, 7))),))
    lines = draw_plans(lost).axes[0].lines
    assert sum(len(line.get_xdata()) > 0 for line in lines) == 6


def test_a_joint_at_rest_is_not_blown_up_to_its_noise():
    record = told([0.03, 0.04])
    plans = record.demonstrations.plans.copy()
    plans[:, :, 3] = 0.5 + 1e-5 * np.random.default_rng(0).normal(size=plans.shape[:2])
    trial = replace(record.trials[0], plan=plans[0])
    held = replace(
        record, demonstrations=replace(record.demonstrations, plans=plans), trials=(trial,)
    )
    figure = draw_plans(held)
    assert np.ptp(figure.axes[3].get_ylim()) > 0.02
    assert sum(figure.axes[3].get_ylim()) / 2 == pytest.approx(0.5, abs=1e-4)


def test_trials_by_goal_are_those_up_to_the_hit_and_only_goals_that_were_reached_are_joined():
    records = [
        told([0.05, 0.0], None, [0.0, 0.01]),
        replace(told([0.05, 0.0], [0.03, 0.0]), number=4),
        told(None),
        replace(told([0.0, 0.0]), number=7),
    ]
    figure = draw_trials_by_goal(records)
    (axes,) = figure.axes
    (way,) = [line for line in axes.lines if line.get_linestyle() == "-"]
    np.testing.assert_array_equal(way.get_xydata(), [[1, 2], [4, 1]])
    assert [text.get_text() for text in axes.texts] == ["2", "2", "–", "1"]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["1", "4", "3", "7"]
    marks = [line for line in axes.lines if line.get_marker() == "o"]
    assert [line.get_markerfacecolor() for line in marks] == [HIT, "white", HIT]
    (legend,) = figure.legends
    assert "not reached yet" in [text.get_text() for text in legend.get_texts()]
    assert draw_trials_by_goal([records[0], records[3]]).legends == []

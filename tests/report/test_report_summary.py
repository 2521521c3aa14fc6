"""Headline, counts and words, against values worked by hand."""

from dataclasses import replace

import numpy as np
import pytest
from swing_world import Swing, adaptation, demonstrations

from prior_reinforce.errors import ConfigurationError, InvalidGoalError
from prior_reinforce.report import AdaptationRecord
from prior_reinforce.report.summary import headline, outcome_line, trial_rows
from prior_reinforce.report.wording import say_aim, say_error, say_length, say_place
from prior_reinforce.session import Trial, TrialState

DEMOS = demonstrations()
GOAL = np.array([0.92, -0.10])


def record(*errors, tolerance=0.015, outcomes=None, demos=DEMOS):
    """Trials with these errors seen; None voids a trial."""
    plan = Swing(7).generate(GOAL[None])[0]
    trials = []
    for number, error in enumerate(errors, start=1):
        if error is None:
            trials.append(Trial(number, GOAL, plan, TrialState.VOIDED, note="the arm stopped"))
            continue
        error = np.array(error)
        hit = bool(np.linalg.norm(error) <= tolerance)
        trials.append(Trial(number, GOAL + np.array([0.03, 0]), plan, TrialState.TOLD, error, hit))
    return AdaptationRecord(demos, GOAL, tolerance, tuple(trials), outcomes=outcomes)


REACHED_IN_2 = record([0.05, 0.0], None, [0.0, 0.01])
REACHED_IN_1 = record([0.0, 0.0])
MISSED = record([0.05, 0.0], [0.03, 0.04])


def test_voided_trials_are_not_counted():
    assert REACHED_IN_2.trials_to_hit == 2
    assert outcome_line(REACHED_IN_2) == "reached in 2 trials"
    assert outcome_line(MISSED) == "not reached in 2 trials"


def test_trials_after_the_hit_are_not_counted():
    assert record([0.0, 0.0], [0.05, 0.0], [0.0, 0.0]).trials_to_hit == 1


def test_the_headline_counts_as_the_paper_does():
    said = headline([REACHED_IN_1, REACHED_IN_2])
    assert (said.text, said.count) == ("2 of 2 goals reached", "N = 6 + 1.5 trials")
    assert "from 1 to 2" in said.explanation


def test_the_headline_admits_goals_that_were_not_reached():
    said = headline([REACHED_IN_2, MISSED])
    assert (said.text, said.count) == ("1 of 2 goals reached", "N = 6 + 2.0 trials")
    assert "leaves out the 1 goal that was not reached" in said.explanation


def test_one_goal_has_a_headline_of_its_own():
    assert headline([REACHED_IN_2]).text == "Goal reached"
    assert headline([REACHED_IN_2]).count == "N = 6 + 2 trials"
    assert headline([MISSED]).count == ""


def test_rows_say_each_trial_in_words():
    first, second, third = trial_rows(REACHED_IN_2)
    assert (first.aim, first.seen, first.off) == ("3 cm long", "5 cm long", "5 cm")
    assert (first.state, first.result) == ("miss", "miss")
    assert (second.seen, second.off) == ("voided: the arm stopped", "–")
    assert (third.seen, third.state) == ("1 cm left", "hit")


@pytest.mark.parametrize(
    ("seen", "true_error", "result"),
    [
        ([0.0, 0.0], [0.01, 0.0], "hit"),
        ([0.0, 0.0], [0.02, 0.0], "taken for a hit"),
        ([0.02, 0.0], [0.01, 0.0], "taken for a miss"),
        ([0.02, 0.0], [0.02, 0.0], "miss"),
    ],
)
def test_the_truth_is_told_where_it_disagrees(seen, true_error, result):
    (row,) = trial_rows(record(seen, outcomes=(GOAL + true_error,)))
    assert row.result == result
    assert row.truly_off == f"{np.linalg.norm(true_error) * 100:g} cm"


def test_places_and_lengths_are_said_in_centimetres():
    assert say_place(MISSED, np.array([0.9204, -0.1])) == "92 cm ahead, 10 cm to the right"
    assert say_place(MISSED, np.array([1.0, 0.0])) == "100 cm ahead, in the middle"
    assert say_length(MISSED, 0.015) == "1.5 cm"
    assert say_length(MISSED, 0.0) == "0 cm"
    assert say_aim(MISSED, GOAL) == "at the goal"


def test_other_units_are_said_as_they_are():
    mixed = adaptation(seed=1, units=("m", "s"), most=0)
    assert say_error(mixed, np.array([0.0123456, -0.5])) == "distance +0.0123 m, duration −0.5 s"
    assert say_length(mixed, 0.25) == "0.25"


def test_a_record_checks_what_it_is_given():
    with pytest.raises(InvalidGoalError, match="2 finite numbers"):
        replace(MISSED, goal=np.array([0.9]))
    with pytest.raises(ConfigurationError, match="2 trials need as many"):
        replace(MISSED, outcomes=(GOAL,))
    with pytest.raises(ConfigurationError, match="trial 2"):
        replace(MISSED, outcomes=(None, np.array([np.nan, 0.0])))


def test_a_hit_is_drawn_within_its_circle_however_coarsely_it_was_called():
    missed, called_far, called_near = record([0.05, 0.0], [0.02, 0.0], [0.01, 0.0]).landings
    np.testing.assert_allclose(missed - GOAL, [0.05, 0.0])
    np.testing.assert_allclose(called_far - GOAL, [0.02, 0.0])  # a miss
    np.testing.assert_allclose(called_near - GOAL, [0.01, 0.0])
    hit = replace(record([0.03, 0.04]).trials[0], hit=True)
    (drawn,) = AdaptationRecord(DEMOS, GOAL, 0.015, (hit,)).landings
    np.testing.assert_allclose(drawn - GOAL, [0.009, 0.012])

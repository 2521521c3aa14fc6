"""Headline, counts and words, against values worked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.adapters.base import Expectation
from prior_reinforce.report.summary import (
    headline,
    outcome_line,
    titles,
    trial_rows,
)
from prior_reinforce.session.trials import Stage
from prior_reinforce.wording import say_place, say_tolerance
from tests.report.swing_world import adaptation
from tests.report.swing_world import told as record

GOAL = np.array([0.92, -0.10])
REACHED_IN_2 = record([0.05, 0.0], None, [0.0, 0.01])
REACHED_IN_1 = record([0.0, 0.0])
MISSED = record([0.05, 0.0], [0.03, 0.04])


def test_voided_trials_are_not_counted():
    assert outcome_line(REACHED_IN_2) == "reached in 2 trials"
    assert outcome_line(MISSED) == "not reached in 2 trials"
    assert outcome_line(record(None)) == "no trial that counts"
    assert outcome_line(record()) == "not tried yet"


@pytest.mark.parametrize(("lines", "said"), [({}, "executed"), ({8: "is executing now"}, "told")])
def test_a_goal_whose_only_trial_is_open_waits_for_it(lines, said):
    trial = replace(MISSED.trials[0], number=8, stage=Stage.ASKED, reading=None)
    waiting = replace(MISSED, trials=(trial,), lines=lines)
    assert outcome_line(waiting) == f"trial 8 waits to be {said}"


def test_what_went_wrong_with_an_execution_is_said_beside_what_was_seen():
    why = {1: "but aborted: the command ended with status 1"}
    (row,) = trial_rows(replace(record([0.05, 0.0]), warnings=why))
    assert row.seen == "5 cm long; but aborted: the command ended with status 1"


def test_how_many_trials_are_to_go_is_left_out_where_nobody_knows():
    told = record([0.05, 0.0])
    trial = replace(told.trials[0], expected=Expectation(1e-3))
    (row,) = trial_rows(replace(told, trials=(trial,)))
    assert row.expected == "unlikely"


def test_the_headline_counts_as_the_paper_does():
    said = headline([REACHED_IN_1, REACHED_IN_2])
    assert (said.text, said.count) == (
        "2 of 2 goals reached",
        "N = 6 demonstrations + 1.5 trials = 7.5",
    )
    assert "from 1 to 2" in said.explanation


def test_the_headline_admits_goals_that_were_not_reached():
    said = headline([REACHED_IN_2, MISSED])
    assert (said.text, said.count) == (
        "1 of 2 goals reached",
        "N = 6 demonstrations + 2.0 trials = 8.0",
    )
    assert "leaves out the 1 goal that was not reached" in said.explanation


def test_goals_with_no_trial_that_counts_are_named_and_not_counted():
    said = headline([REACHED_IN_2, MISSED, record(None), replace(record(), number=9)])
    assert (said.text, said.complete) == ("1 of 2 goals reached", False)
    assert "then 2 trials to reach one goal" in said.explanation
    assert "with no trial that counts: Goal 3, Goal 9." in said.explanation
    assert headline([REACHED_IN_1, record(None)]).text == "1 of 1 goal reached"
    assert headline([REACHED_IN_1, REACHED_IN_2]).complete
    assert headline([record(None), record()]).text == "No goal tried yet"


def test_one_goal_has_a_headline_of_its_own():
    assert headline([REACHED_IN_2]).text == "Goal reached"
    assert headline([REACHED_IN_2]).count == "N = 6 demonstrations + 2 trials = 8"
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


def test_a_trial_that_hits_is_aimed_where_its_condition_lies():
    at_goal = replace(MISSED, trials=(replace(MISSED.trials[0], condition=GOAL),))
    assert trial_rows(at_goal)[0].aim == "at the goal"


@pytest.mark.parametrize(
    ("lines", "seen"),
    [({}, "not executed yet"), ({1: "executed, but aborted"}, "executed, but aborted")],
)
def test_open_trials_say_what_they_wait_for(lines, seen):
    trial = replace(MISSED.trials[0], stage=Stage.ASKED, reading=None)
    (row,) = trial_rows(replace(MISSED, trials=(trial,), lines=lines))
    assert (row.seen, row.state, row.result, row.off) == (seen, "open", "open", "–")


def test_goals_say_where_they_are_and_how_near_is_near_enough():
    assert say_place(MISSED.goal, MISSED.format) == "92 cm ahead, 10 cm right"
    assert say_tolerance(MISSED.format) == "1.5 cm"
    mixed = adaptation(seed=1, units=("m", "s"), most=1)
    assert say_place(mixed.goal, mixed.format) == "distance 0.9 m, duration 0.1 s"
    assert say_tolerance(mixed.format) == "1.5 cm and 15 ms"
    assert say_tolerance(replace(mixed, tolerance=[0.01, 0.2]).format) == "1 cm and 200 ms"
    coarse = replace(MISSED, tolerance=[0.0125, 0.02])
    assert say_tolerance(coarse.format) == "x 1.25 cm and y 2 cm"
    assert trial_rows(mixed)[0].aim == "distance 0.9 m, duration 0.1 s"
    named = [MISSED, replace(MISSED, title="the far hoop"), replace(MISSED, number=7)]
    assert titles(named) == ["Goal 1", "the far hoop", "Goal 7"]

"""What is known of a goal: what counts, where trials landed, in which unit that is drawn."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.patches import FancyArrowPatch

from prior_reinforce.errors import ConfigurationError, InvalidGoalError
from prior_reinforce.parsing import from_words
from prior_reinforce.report.places import draw_close_up
from tests.report.swing_world import adaptation, told

GOAL = np.array([0.92, -0.10])


def test_voided_trials_and_those_after_the_hit_are_not_counted():
    assert told([0.05, 0.0], None, [0.0, 0.01]).trials_to_hit == 2
    assert told([0.0, 0.0], [0.05, 0.0], [0.0, 0.0]).trials_to_hit == 1
    assert told([0.05, 0.0], None).trials_to_hit is None
    assert [trial.number for trial in told([0.05, 0.0], None, [0.0, 0.01]).told] == [1, 3]


def test_a_hit_is_drawn_within_its_circle_however_coarsely_it_was_called():
    record = told([0.05, 0.0], [0.02, 0.0], [0.01, 0.0], None)
    missed, called_far, called_near, voided = record.landings
    np.testing.assert_allclose(missed - GOAL, [0.05, 0.0])
    np.testing.assert_allclose(called_far - GOAL, [0.02, 0.0])  # a miss
    np.testing.assert_allclose(called_near - GOAL, [0.01, 0.0])
    assert voided is None
    hit = replace(told([0.03, 0.04]).trials[0], hit=True)
    (drawn,) = replace(record, trials=(hit,)).landings
    np.testing.assert_allclose(drawn - GOAL, [0.009, 0.012])


def test_a_direction_alone_is_no_measured_place():
    record = told([0.05, 0.0], [0.05, 0.0], [0.05, 0.0])
    first, second, third = record.trials
    second = replace(second, reading=from_words("long, somewhere"))
    third = replace(third, reading=from_words("long"), hit=True)
    record = replace(record, trials=(first, second, third))
    assert record.directions == {2}
    axes = draw_close_up(record).axes[0]
    arrows = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    assert [arrow.get_linestyle() == "-" for arrow in arrows] == [True, False, True]


def test_the_true_outcome_of_a_voided_trial_does_not_count():
    outcomes = (GOAL + 0.01, GOAL + 0.02)
    first, second = told([0.01, 0.01], None, outcomes=outcomes).true_outcomes
    np.testing.assert_array_equal(first, outcomes[0])
    assert second is None
    assert told([0.01, 0.01]).true_outcomes == (None,)


def test_metres_are_drawn_in_centimetres_and_other_units_as_they_are():
    metres = told([0.05, 0.0])
    assert (metres.scale, metres.unit(), metres.unit(0)) == (100.0, "cm", "cm")
    mixed = adaptation(seed=1, units=("m", "s"), most=0)
    assert (mixed.scale, mixed.unit(), mixed.unit(0, 1)) == (1.0, "", "")
    assert (mixed.unit(0), mixed.unit(1)) == ("m", "s")


def test_a_record_checks_what_it_is_given():
    record = told([0.05, 0.0], [0.03, 0.04])
    with pytest.raises(InvalidGoalError, match="2 components"):
        replace(record, goal=np.array([0.9]))
    with pytest.raises(ConfigurationError, match="2 trials need as many"):
        replace(record, outcomes=(GOAL,))


def test_distances_are_lengths_where_all_have_one_unit_and_one_tolerance_else_tolerances():
    mixed = adaptation(seed=1, units=("m", "s"), most=1)
    assert (mixed.edge, mixed.distance_unit) == (1.0, "tolerances")
    assert mixed.distance(np.array([0.009, 0.012])) == pytest.approx(1.0)
    short = told([0.03, 0.04])
    assert (short.edge, short.distance_unit) == (pytest.approx(1.5), "cm")
    assert short.distance(np.array([0.03, 0.04])) == pytest.approx(5.0)
    uneven = replace(short, tolerance=[0.01, 0.02])
    assert (uneven.distance(np.array([0.0, 0.02])), uneven.distance_unit) == (1.0, "tolerances")

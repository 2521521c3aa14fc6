"""The fold of a log into goals and trials, by hand."""

import numpy as np
import pytest
from msgspec.structs import replace

from prior_reinforce.errors import WorkspaceError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.readings import Reading
from prior_reinforce.session.events import Amended, Asked, GoalSet, Told, Voided
from prior_reinforce.session.trials import Log, Stage, told_trials, trials_to_hit


def reading(*error_seen):
    return Reading.measured(error_seen).record()


GOAL = GoalSet(goal=[0.9, 0.1], format=OutcomeFormat.metres(2).within(0.015), carry_over=False)
ASKED = Asked(trial=1, goal=1, condition=[0.88, 0.1], model="m")
TOLD = Told(trial=1, reading=reading(0.02, 0.0), hit=False)
VOIDED = Voided(trial=1, reason="slipped")


def amended(trial=1, error_seen=(0.02, 0.0), hit=False):
    return Amended(trial=trial, reading=reading(*error_seen), hit=hit)


def state(*events):
    log = Log()
    for event in events:
        log.append(event)
    return log.state()


def test_nothing_happened_yet():
    empty = state()
    assert (empty.goal, empty.open_trial, empty.trials) == (None, None, [])


def test_a_goal_and_its_trial():
    told = state(GOAL, ASKED)
    assert (told.goal.number, *told.goal.tolerance, told.goal.carry_over) == (
        1,
        0.015,
        0.015,
        False,
    )
    (trial,) = told.trials
    assert told.open_trial is trial
    assert (trial.number, trial.goal_number, trial.stage, trial.model) == (1, 1, Stage.ASKED, "m")
    np.testing.assert_array_equal(trial.condition, [0.88, 0.1])
    with pytest.raises(ValueError, match="read-only"):
        trial.condition[0] = 1.0


@pytest.mark.parametrize(
    ("then", "stage", "error_seen"),
    [
        ([], Stage.ASKED, None),
        ([TOLD], Stage.TOLD, [0.02, 0.0]),
        ([TOLD, amended(error_seen=(0.2, 0.0))], Stage.TOLD, [0.2, 0.0]),
        ([TOLD, VOIDED], Stage.VOIDED, None),
    ],
)
def test_events_of_a_trial_say_where_it_stands(then, stage, error_seen):
    (trial,) = state(GOAL, ASKED, *then).trials
    assert trial.stage is stage
    assert trial.open == (stage is Stage.ASKED)
    assert error_seen == (None if trial.error_seen is None else trial.error_seen.tolist())
    assert trial.note == ("slipped" if stage is Stage.VOIDED else "")


@pytest.mark.parametrize("said", [Reading.only(True, 2), Reading.only(False, 2)])
def test_a_bare_hit_or_miss_has_no_error(said):
    told = replace(TOLD, reading=said.record(), hit=bool(said.hit))
    (trial,) = state(GOAL, ASKED, told).trials
    assert trial.error_seen is None
    assert ("error" in repr(trial), "hit" in repr(trial)) == (False, bool(said.hit))


def test_a_log_keeps_what_was_said():
    said = Reading([0.05, 0.0], [0.01, -np.inf], [np.inf, np.inf], [0.0, 0.0], None, "long")
    (trial,) = state(GOAL, ASKED, replace(TOLD, reading=said.record())).trials
    assert (trial.reading.said, trial.reading.high.tolist()) == ("long", [np.inf, np.inf])
    damaged = replace(said.record(), sd=[-1.0, 0.0])
    with pytest.raises(WorkspaceError, match="does not fit"):
        state(GOAL, ASKED, replace(TOLD, reading=damaged))


def test_an_error_of_one_tolerance_in_all_is_a_hit():
    goal = state(replace(GOAL, format=OutcomeFormat(("x", "t"), ("m", "s"), (0.015, 0.02)))).goal
    assert goal.is_hit(np.array([0.009, 0.016]))
    assert not goal.is_hit(np.array([0.0092, 0.016]))
    np.testing.assert_allclose(goal.format.least_sd, [0.005, 0.02 / 3])


def test_numbers_run_over_all_goals():
    carried = replace(GOAL, carry_over=True, adapter="proportional")
    told = state(GOAL, ASKED, TOLD, carried, replace(ASKED, trial=2, goal=2))
    assert [trial.number for trial in told.trials_of(2)] == [2]
    assert (told.goal.carry_over, told.goal.adapter) == (True, "proportional")


@pytest.mark.parametrize(
    "events",
    [
        [TOLD],
        [replace(ASKED, trial=2)],
        [replace(ASKED, goal=2)],
        [replace(ASKED, condition=[0.88])],
        [replace(GOAL, format=OutcomeFormat.metres(1).within(0.015))],
        [replace(GOAL, format=OutcomeFormat.metres(2))],
        [ASKED, replace(ASKED, trial=2)],
        [ASKED, replace(TOLD, trial=0)],
        [ASKED, replace(TOLD, reading=reading(0.1))],
    ],
    ids=[
        "no trial",
        "a gap",
        "no goal",
        "half a condition",
        "half a tolerance",
        "no tolerance",
        "two open",
        "number 0",
        "one component",
    ],
)
def test_an_event_that_cannot_follow_is_named(events):
    with pytest.raises(WorkspaceError, match=rf"event {len(events) + 1} .*{events[-1].kind}.*copy"):
        state(GOAL, *events)


@pytest.mark.parametrize(
    ("carry_over", "then", "outdated"),
    [
        (False, amended(2, error_seen=(0.2, 0.0)), True),
        (False, amended(2), False),  # the same in other words
        (False, amended(2, hit=True), True),
        (False, Voided(trial=2, reason="typed nonsense"), True),
        (False, Voided(trial=1, reason="of another goal"), False),
        (True, Voided(trial=1, reason="of another goal"), True),
    ],
)
def test_a_plan_is_outdated_once_what_it_was_planned_from_is_corrected(carry_over, then, outdated):
    events = [
        *[GOAL, ASKED, TOLD],
        *[replace(GOAL, carry_over=carry_over), replace(ASKED, trial=2, goal=2)],
        *[replace(TOLD, trial=2), replace(ASKED, trial=3, goal=2)],
    ]
    assert not state(*events).open_trial.outdated
    assert state(*events, then).open_trial.outdated is outdated
    again = [Voided(trial=3, reason="outdated"), replace(ASKED, trial=4, goal=2)]
    assert not state(*events, then, *again).open_trial.outdated


def test_readings_of_another_model_count_for_nothing():
    told = state(GOAL, ASKED, TOLD)
    assert [trial.number for trial in told.readings_for(told.goal, "m")] == [1]
    assert told.readings_for(told.goal, "another") == []


def test_trials_until_the_first_hit_are_those_that_count():
    again = replace(ASKED, trial=2), Told(trial=2, reading=reading(0.0, 0.0), hit=True)
    third = replace(ASKED, trial=3)
    trials = state(GOAL, ASKED, VOIDED, *again, third).trials
    assert [trial.number for trial in told_trials(trials)] == [2]
    assert trials_to_hit(trials) == 1
    assert trials_to_hit(state(GOAL, ASKED, TOLD, *again).trials) == 2
    assert trials_to_hit(state(GOAL, ASKED, TOLD).trials) is None

"""The fold of a log into goals and trials, by hand."""

import numpy as np
import pytest

from prior_reinforce.errors import WorkspaceError
from prior_reinforce.readings import Reading
from prior_reinforce.session.trials import KINDS, History, MemoryLog, Stage

GOAL = {"goal": [0.9, 0.1], "tolerance": 0.015, "memory": "goal", "adapter": "gp"}
ASKED = {"trial": 1, "goal": 1, "condition": [0.88, 0.1], "model": "m", "plan": [[0.0], [1.0]]}
TOLD = {"trial": 1, "error_seen": [0.02, 0.0], "hit": False}


def history(*events):
    log = MemoryLog()
    for kind, data in events:
        log.append(kind, data)
    told = History()
    told.update(log.events())
    return told


def test_nothing_happened_yet():
    empty = history()
    assert (empty.goal, empty.open_trial, empty.trials) == (None, None, [])


def test_a_goal_and_its_trial():
    told = history(("goal_set", GOAL), ("asked", ASKED))
    assert (told.goal.number, told.goal.tolerance, told.goal.carry_over) == (1, 0.015, False)
    (trial,) = told.trials
    assert told.open_trial is trial
    assert (trial.number, trial.goal_number, trial.stage, trial.model) == (1, 1, Stage.ASKED, "m")
    np.testing.assert_array_equal(trial.condition, [0.88, 0.1])
    np.testing.assert_array_equal(trial.plan, [[0.0], [1.0]])
    with pytest.raises(ValueError, match="read-only"):
        trial.condition[0] = 1.0


@pytest.mark.parametrize(
    ("then", "stage", "error_seen"),
    [
        ([], Stage.ASKED, None),
        ([("executing", {"trial": 1})], Stage.EXECUTING, None),
        ([("executing", {"trial": 1}), ("not_executed", {"trial": 1})], Stage.ASKED, None),
        ([("executing", {"trial": 1}), ("executed", {"trial": 1})], Stage.EXECUTED, None),
        ([("told", TOLD)], Stage.TOLD, [0.02, 0.0]),
        ([("told", TOLD), ("amended", TOLD | {"error_seen": [0.2, 0.0]})], Stage.TOLD, [0.2, 0.0]),
        ([("told", TOLD), ("voided", {"trial": 1, "reason": "slipped"})], Stage.VOIDED, None),
    ],
)
def test_events_of_a_trial_say_where_it_stands(then, stage, error_seen):
    (trial,) = history(("goal_set", GOAL), ("asked", ASKED), *then).trials
    assert trial.stage is stage
    assert trial.open == (stage in {Stage.ASKED, Stage.EXECUTING, Stage.EXECUTED})
    assert error_seen == (None if trial.error_seen is None else trial.error_seen.tolist())
    assert trial.note == ("slipped" if stage is Stage.VOIDED else "")


@pytest.mark.parametrize(("hit", "seen_directly"), [(False, None), (True, True)])
def test_journals_without_readings_tell_numbers_of_unknown_origin(hit, seen_directly):
    told = TOLD | {"error_seen": [0.08, 0.0], "hit": hit}
    (trial,) = history(("goal_set", GOAL), ("asked", ASKED), ("told", told)).trials
    np.testing.assert_allclose(trial.reading.sd, [np.hypot(0.01, 0.02), 0.01])
    assert (trial.reading.hit, trial.hit) == (seen_directly, hit)


def test_a_journal_keeps_what_was_said():
    reading = Reading([0.05, 0.0], [0.01, -np.inf], [np.inf, np.inf], [0.0, 0.0], None, "long")
    told = TOLD | {"error_seen": [0.05, 0.0], "reading": reading.as_json()}
    (trial,) = history(("goal_set", GOAL), ("asked", ASKED), ("told", told)).trials
    assert (trial.reading.said, trial.reading.high.tolist()) == ("long", [np.inf, np.inf])
    damaged = {**told, "reading": {**told["reading"], "sd": [-1.0, 0.0]}}
    with pytest.raises(WorkspaceError, match="does not fit"):
        history(("goal_set", GOAL), ("asked", ASKED), ("told", damaged))


def test_the_first_journals_measured_by_the_plain_distance():
    goal = history(("goal_set", GOAL)).goal
    assert goal.distance(np.array([0.3, 0.4])) == pytest.approx(0.5)
    stretched = history(("goal_set", GOAL | {"metric": [1.0, 0.1]})).goal
    assert stretched.distance(np.array([0.3, 4.0])) == pytest.approx(0.5)
    np.testing.assert_allclose(stretched.radius, [0.015, 0.15])


def test_numbers_run_over_all_goals():
    second = ASKED | {"trial": 2, "goal": 2}
    carried = GOAL | {"memory": "workspace", "adapter": "proportional"}
    told = history(
        ("goal_set", GOAL), ("asked", ASKED), ("told", TOLD), ("goal_set", carried),
        ("asked", second),
    )  # fmt: skip
    assert [trial.number for trial in told.trials_of(2)] == [2]
    assert (told.goal.carry_over, told.goal.adapter) == (True, "proportional")


def test_the_first_journals_named_no_adapter_and_no_model():
    goal = {key: value for key, value in GOAL.items() if key != "adapter"}
    asked = {key: value for key, value in ASKED.items() if key not in ("model", "plan")}
    told = history(("goal_set", goal), ("asked", asked))
    assert (told.goal.adapter, told.trials[0].model, told.trials[0].plan) == ("gp", "", None)


@pytest.mark.parametrize(
    "events",
    [
        [("told", TOLD)],
        [("asked", ASKED | {"trial": 2})],
        [("asked", ASKED), ("asked", ASKED | {"trial": 2})],
        [("asked", ASKED), ("told", TOLD | {"trial": 0})],
        [("asked", ASKED), ("told", {"trial": 1, "hit": True})],
        [("goal_set", {"goal": [0.9]})],
    ],
    ids=["no trial", "a gap", "two open", "number 0", "no error", "no tolerance"],
)
def test_an_event_that_cannot_follow_is_named(events):
    with pytest.raises(WorkspaceError, match=rf"event {len(events) + 1} .*{events[-1][0]}.*copy"):
        history(("goal_set", GOAL), *events)


def test_only_what_is_new_is_taken_in():
    log, told = MemoryLog(), History()
    log.append("goal_set", GOAL)
    told.update(log.events())
    log.append("asked", ASKED)
    told.update(log.events())
    told.update(log.events())
    assert len(told.goals) == len(told.trials) == 1


def test_every_event_of_a_session_is_known():
    assert {"goal_set", "asked", "told", "amended", "voided", "executing", "executed"} <= KINDS


@pytest.mark.parametrize(
    ("memory", "then", "outdated"),
    [
        ("goal", ("amended", TOLD | {"trial": 2, "error_seen": [0.2, 0.0]}), True),
        ("goal", ("amended", TOLD | {"trial": 2}), False),  # the same in other words
        ("goal", ("amended", TOLD | {"trial": 2, "hit": True}), True),
        ("goal", ("voided", {"trial": 2, "reason": "typed nonsense"}), True),
        ("goal", ("voided", {"trial": 1, "reason": "of another goal"}), False),
        ("workspace", ("voided", {"trial": 1, "reason": "of another goal"}), True),
    ],
)
def test_a_plan_is_outdated_once_what_it_was_planned_from_is_corrected(memory, then, outdated):
    events = [
        *[("goal_set", GOAL), ("asked", ASKED), ("told", TOLD)],
        *[("goal_set", GOAL | {"memory": memory}), ("asked", ASKED | {"trial": 2, "goal": 2})],
        *[("told", TOLD | {"trial": 2}), ("asked", ASKED | {"trial": 3, "goal": 2})],
    ]
    assert not history(*events).open_trial.outdated
    assert history(*events, then).open_trial.outdated is outdated
    void = ("voided", {"trial": 3, "reason": "outdated"})
    again = ("asked", ASKED | {"trial": 4, "goal": 2})
    assert not history(*events, then, void, again).open_trial.outdated


def test_readings_of_another_model_count_for_nothing():
    told = history(("goal_set", GOAL), ("asked", ASKED), ("told", TOLD))
    assert [trial.number for trial in told.readings_for(told.goal, "m")] == [1]
    assert told.readings_for(told.goal, "another") == []

import sys
import threading
import time

import numpy as np
import pytest

from prior_reinforce.bench.console.verbs import (
    Ask,
    Execute,
    Seen,
    SetGoal,
    Tell,
    Verbs,
    Void,
)
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidFeedbackError,
    InvalidGoalError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.session.trials import Stage
from tests.bench.workspace.planar import events_in

SLOW = f"{sys.executable} -c \"import time; print('moving', flush=True); time.sleep(60)\" {{plan}}"
FAILS = f'{sys.executable} -c "raise SystemExit(75)" {{plan}}'


def aimed(verbs, goal=(0.9, 0.05)):
    state = verbs.set_goal(SetGoal(seen=verbs.state().id, goal=list(goal)))
    return verbs.ask(Ask(seen=state.id))


def executing(folder, command, heard=None):
    def execute(workspace, body):
        return workspace.execute(body.trial, command, time_limit=60)

    publish = (lambda message: None) if heard is None else heard.append
    return Verbs(folder, execute=execute, executor="arm", publish=publish)


def wait_for(what):
    for _ in range(1200):
        if found := what():
            return found
        time.sleep(0.05)
    raise AssertionError("it never came")


def kinds(folder):
    return [entry.kind for entry in events_in(folder)]


def test_from_a_goal_to_a_hit(verbs):
    state = aimed(verbs)
    assert (state.step, state.open) == ("execute", 1)
    state = verbs.tell(Tell(seen=state.id, trial=1, outcome=[0.95, 0.05]))
    assert state.step == "ask"
    assert state.trials[0].said == "5 cm long"
    state = verbs.ask(Ask(seen=state.id))
    state = verbs.tell(Tell(seen=state.id, trial=2, hit=True))
    assert state.step == "reached"


@pytest.mark.parametrize(
    ("body", "low", "high", "sd"),
    [
        ({"outcome": [0.95, 0.05]}, [0.05, 0.0], [0.05, 0.0], [0.0112, 0.005]),
        ({"outcome": [0.95, 0.05], "sd": 0.003}, [0.05, 0.0], [0.05, 0.0], [0.003, 0.003]),
        ({"words": "5cm long, 2cm left"}, [0.035, 0.01], [0.075, 0.035], [0.0, 0.0]),
    ],
)
def test_a_touch_is_an_estimate_a_picture_a_measurement_and_words_are_intervals(
    verbs, body, low, high, sd
):
    state = aimed(verbs)
    verbs.tell(Tell(seen=state.id, trial=1, **body))
    reading = verbs.workspace.state.trial(1).reading
    np.testing.assert_allclose(reading.low, low, atol=1e-12)
    np.testing.assert_allclose(reading.high, high, atol=1e-12)
    np.testing.assert_allclose(reading.sd, sd, rtol=0.01)


@pytest.mark.parametrize(
    ("body", "error"),
    [
        ({}, InvalidFeedbackError),
        ({"outcome": [0.9]}, InvalidFeedbackError),
        ({"outcome": [float("nan"), 0.0]}, InvalidFeedbackError),
        ({"outcome": [0.9, 0.0], "sd": -1.0}, InvalidFeedbackError),
        ({"outcome": [0.9, 0.0], "words": "hit"}, InvalidFeedbackError),
        ({"words": "very long"}, InvalidFeedbackError),
    ],
)
def test_what_is_no_reading_changes_nothing(verbs, body, error):
    state = aimed(verbs)
    with pytest.raises(error):
        verbs.tell(Tell(seen=state.id, trial=1, **body))
    assert verbs.state() == state


def test_a_verb_is_for_the_state_that_was_seen(verbs):
    state = aimed(verbs)
    verbs.tell(Tell(seen=state.id, trial=1, outcome=[0.95, 0.05]))
    for late in (
        lambda: verbs.tell(Tell(seen=state.id, trial=1, outcome=[0.95, 0.05])),
        lambda: verbs.void(Void(seen=state.id, trial=1)),
        lambda: verbs.amend(Tell(seen=state.id, trial=1, hit=True)),
        lambda: verbs.set_goal(SetGoal(seen=state.id, goal=[0.9, 0.1])),
        lambda: verbs.learn(Seen(seen=state.id)),
        lambda: verbs.ask(Ask(seen=state.id)),
    ):
        with pytest.raises(TrialStateError, match="meanwhile: told trial 1; look again"):
            late()
    assert kinds(verbs.folder).count("told") == 1


def test_a_state_of_a_journal_that_was_restored_from_a_copy_is_not_the_one_seen(verbs):
    state = aimed(verbs)
    with pytest.raises(TrialStateError, match="fewer events than the page"):
        verbs.tell(Tell(seen=state.id + 1, trial=1, hit=True))
    assert "told" not in kinds(verbs.folder)


def test_the_command_line_goes_on_beside_it(verbs):
    state = aimed(verbs)
    with Workspace(verbs.folder) as workspace:
        workspace.session().tell(1, "5cm long")
    with pytest.raises(TrialStateError, match="told trial 1"):
        verbs.tell(Tell(seen=state.id, trial=1, hit=True))
    assert verbs.state().trials[0].said == "5cm long"


def test_amend_and_void_take_back(verbs):
    state = aimed(verbs)
    state = verbs.tell(Tell(seen=state.id, trial=1, hit=True))
    state = verbs.amend(Tell(seen=state.id, trial=1, outcome=[0.95, 0.05]))
    assert (state.step, state.trials[0].hit) == ("ask", False)
    state = verbs.void(Void(seen=state.id, trial=1, reason="slipped"))
    assert state.trials[0].said == "void: slipped"


def test_a_goal_keeps_the_adapter_and_says_what_changed(verbs):
    verbs.workspace.set_goal([0.9, 0.0], adapter="gp", carry_over=True)
    state = verbs.set_goal(SetGoal(seen=verbs.state().id, goal=[0.9, 0.1], new_hardware="a ball"))
    goal = verbs.workspace.state.goals[-1]
    assert (goal.adapter, goal.carry_over, goal.new_hardware) == ("gp", True, "a ball")
    with pytest.raises(InvalidGoalError):
        verbs.set_goal(SetGoal(seen=state.id, goal=[0.9]))


def test_without_an_executor_the_plan_is_downloaded(verbs):
    state = aimed(verbs)
    with pytest.raises(TrialStateError, match="download"):
        verbs.execute(Execute(seen=state.id, trial=1, plan=state.trials[0].plan))
    assert (
        verbs.plan_file(1).read_bytes()
        == verbs.workspace.plan_path(verbs.workspace.state.trial(1)).read_bytes()
    )


def test_two_people_who_press_at_once_execute_it_once(folder, tmp_path):
    log = tmp_path / "log"
    command = f"{sys.executable} -c \"open('{log}', 'a').write('moved\\n')\" {{plan}}"
    verbs = executing(tmp_path / folder, command)
    state = aimed(verbs)
    body = Execute(seen=state.id, trial=1, plan=state.trials[0].plan)
    refused = []

    def press():
        try:
            verbs.execute(body)
        except TrialStateError as error:
            refused.append(str(error))

    presses = [threading.Thread(target=press) for _ in range(8)]
    for each in presses:
        each.start()
    for each in presses:
        each.join()
    wait_for(lambda: verbs.state().step == "tell")
    verbs.close()
    assert len(refused) == 7
    assert log.read_text() == "moved\n"
    assert kinds(verbs.folder)[-2:] == ["executing", "executed"]


@pytest.mark.parametrize(
    "wrong", [{"trial": 2}, {"plan": "0" * 64}, {"plan": ""}, {"seen": 0}, {"trial": -1}]
)
def test_only_the_plan_that_was_seen_is_executed(folder, tmp_path, wrong):
    verbs = executing(tmp_path / folder, SLOW)
    state = aimed(verbs)
    seen = {"seen": state.id, "trial": 1, "plan": state.trials[0].plan}
    with pytest.raises(TrialStateError):
        verbs.execute(Execute(**(seen | wrong)))
    verbs.close()
    assert "executing" not in kinds(verbs.folder)


def test_a_press_that_is_sent_again_after_nothing_moved_is_refused(folder, tmp_path):
    verbs = executing(tmp_path / folder, FAILS)
    state = aimed(verbs)
    body = Execute(seen=state.id, trial=1, plan=state.trials[0].plan)
    verbs.execute(body)
    wait_for(lambda: verbs.state().step == "execute")
    assert "says that the arm did not move" in verbs.state().trials[0].warning
    with pytest.raises(TrialStateError, match="meanwhile"):
        verbs.execute(body)
    verbs.close()
    assert kinds(verbs.folder).count("executing") == 1


def test_what_cannot_be_started_is_said_to_who_pressed(folder, tmp_path):
    verbs = executing(tmp_path / folder, "/no/such/program {plan}")
    state = aimed(verbs)
    # Refused before or just after the journal says `executing`: either way all tabs hear it.
    heard = []
    verbs.publish = heard.append
    try:
        verbs.execute(Execute(seen=state.id, trial=1, plan=state.trials[0].plan))
    except ConfigurationError as error:
        heard.append({"error": str(error)})
    wait_for(lambda: any("no/such/program" in m.get("error", "") for m in heard))
    verbs.close()
    assert Workspace(verbs.folder).state.trial(1).stage is Stage.ASKED


def test_stop_stops_and_a_person_says_what_moved(folder, tmp_path):
    heard = []
    verbs = executing(tmp_path / folder, SLOW, heard)
    state = aimed(verbs)
    state = verbs.execute(Execute(seen=state.id, trial=1, plan=state.trials[0].plan))
    assert state.step == "executing"
    wait_for(lambda: {"output": "moving\n"} in heard)
    assert "moving" in verbs.state().output
    start = time.monotonic()
    state = verbs.stop()
    assert time.monotonic() - start < 20
    assert state.step == "settle"
    assert "stopped by a signal" in state.trials[0].warning
    state = verbs.ask(Ask(seen=state.id, arm_did_not_move=True))
    assert state.step == "execute"
    verbs.close()


def test_stop_stops_what_another_program_executes(folder, tmp_path):
    verbs, other = executing(tmp_path / folder, SLOW), executing(tmp_path / folder, SLOW)
    state = aimed(verbs)
    other.execute(Execute(seen=state.id, trial=1, plan=state.trials[0].plan))
    wait_for(lambda: verbs.state().step == "executing")
    assert verbs.stop().step in ("executing", "settle")  # the other program writes how it ended
    wait_for(lambda: verbs.state().step == "settle")
    other.close()
    verbs.close()


def test_stop_with_nothing_to_stop_changes_nothing(verbs):
    state = aimed(verbs)
    assert verbs.stop() == state


def test_closing_stops_what_was_started_here(folder, tmp_path):
    verbs = executing(tmp_path / folder, SLOW)
    state = aimed(verbs)
    verbs.execute(Execute(seen=state.id, trial=1, plan=state.trials[0].plan))
    verbs.close()
    assert kinds(tmp_path / folder)[-1] == "executed"


def test_everybody_hears_what_the_command_line_does(folder, tmp_path):
    heard = []
    verbs = executing(tmp_path / folder, SLOW, heard)
    with Workspace(tmp_path / folder) as workspace:
        workspace.set_goal([0.9, 0.0])
    wait_for(lambda: {"id": 3} in heard)
    verbs.close()


def test_learning_goes_on_beside_and_says_how_far_it_is(folder, tmp_path):
    heard = []
    verbs = executing(tmp_path / folder, SLOW, heard)
    verbs.learn(Seen(seen=verbs.state().id))
    wait_for(lambda: {"learning": None} in heard)
    assert verbs.state().model == "auto"
    state = aimed(verbs)
    with pytest.raises(TrialStateError, match="waits to be told"):
        verbs.learn(Seen(seen=state.id))
    verbs.close()


def test_a_report_is_of_trials(verbs):
    assert verbs.state().report == ""
    with pytest.raises(WorkspaceError, match="no trial"):
        verbs.write_report()
    state = aimed(verbs)
    assert state.report.startswith("/report/")
    assert b"planar" in verbs.write_report().read_bytes()

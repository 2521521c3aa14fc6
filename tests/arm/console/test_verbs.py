import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from msgspec import structs

from prior_reinforce.adapters import DEFAULT_ADAPTER
from prior_reinforce.arm.console.verbs import (
    Ask,
    Execute,
    Measured,
    Seen,
    SetGoal,
    Tell,
    Verbs,
    Void,
)
from prior_reinforce.arm.executing.lock import MARK, executing_lock
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidFeedbackError,
    InvalidGoalError,
    OutOfReachError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.simulation.tasks import make_task
from tests.arm.executing import toy_arm
from tests.arm.workspace.planar import events_in, stage_in

SLOW = f"{sys.executable} -c \"import time; print('moving', flush=True); time.sleep(60)\" {{plan}}"
FAILS = f'{sys.executable} -c "raise SystemExit(75)" {{plan}}'


def aimed(verbs, goal=(0.9, 0.05)):
    state = verbs.goal(SetGoal(seen=verbs.state().id, goal=list(goal)))
    return verbs.ask(Ask(seen=state.id))


def execution(state, **more):
    """What the button that moves the arm sends, as it is seen."""
    trial = state.trials[0]
    return Execute(seen=state.id, trial=1, sha256=trial.sha256, stopped=state.stopped, **more)


def executing(folder, command, heard=None):
    publish = (lambda message: None) if heard is None else heard.append
    return Verbs(folder, moved_by=command, time_limit=60, publish=publish)


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
    assert (state.step, state.open_trial.number) == ("execute", 1)
    state = verbs.tell(Tell(seen=state.id, trial=1, error=[0.05, 0.0]))
    assert state.step == "ask"
    assert state.trials[0].line == "5 cm long"
    state = verbs.ask(Ask(seen=state.id))
    state = verbs.tell(Tell(seen=state.id, trial=2, hit=True))
    assert state.step == "reached"


@pytest.mark.parametrize(
    ("error", "low", "high", "sd"),
    [
        ([0.05, 0.0], [0.05, 0.0], [0.05, 0.0], [0.0112, 0.005]),
        (Measured([0.05, 0.0], 0.003), [0.05, 0.0], [0.05, 0.0], [0.003, 0.003]),
        ("5cm long, 2cm left", [0.035, 0.01], [0.075, 0.035], [0.0, 0.0]),
    ],
)
def test_a_touch_is_an_estimate_a_picture_a_measurement_and_words_are_intervals(
    verbs, error, low, high, sd
):
    state = aimed(verbs)
    verbs.tell(Tell(seen=state.id, trial=1, error=error))
    reading = verbs.workspace.state.trial(1).reading
    np.testing.assert_allclose(reading.low, low, atol=1e-12)
    np.testing.assert_allclose(reading.high, high, atol=1e-12)
    np.testing.assert_allclose(reading.sd, sd, rtol=0.01)


@pytest.mark.parametrize(
    "error",
    [
        *(None, [0.9], [], [float("nan"), 0.0], "very long"),
        *(Measured([0.9, 0.0], -1.0), Measured([0.9], 0.01), Measured([], 0.0)),
    ],
)
def test_what_is_no_reading_changes_nothing(verbs, error):
    state = aimed(verbs)
    with pytest.raises(InvalidFeedbackError):
        verbs.tell(Tell(seen=state.id, trial=1, error=error))
    assert verbs.state() == state


def test_a_verb_is_for_the_state_that_was_seen(verbs):
    state = aimed(verbs)
    verbs.tell(Tell(seen=state.id, trial=1, error=[0.05, 0.0]))
    for late in (
        lambda: verbs.tell(Tell(seen=state.id, trial=1, error=[0.05, 0.0])),
        lambda: verbs.void(Void(seen=state.id, trial=1)),
        lambda: verbs.amend(Tell(seen=state.id, trial=1, hit=True)),
        lambda: verbs.goal(SetGoal(seen=state.id, goal=[0.9, 0.1])),
        lambda: verbs.learn(Seen(seen=state.id)),
        lambda: verbs.ask(Ask(seen=state.id)),
    ):
        with pytest.raises(TrialStateError, match="not done: told trial 1"):
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
    assert verbs.state().trials[0].seen == "5cm long"


def test_amend_and_void_take_back(verbs):
    state = aimed(verbs)
    state = verbs.tell(Tell(seen=state.id, trial=1, hit=True))
    state = verbs.amend(Tell(seen=state.id, trial=1, error=[0.05, 0.0]))
    assert (state.step, state.trials[0].hit) == ("ask", False)
    state = verbs.void(Void(seen=state.id, trial=1, reason="slipped"))
    assert state.trials[0].line == "void: slipped"


def test_a_goal_keeps_the_adapter_and_says_what_changed(verbs):
    verbs.workspace.set_goal([0.9, 0.0], adapter="gp", carry_over=True)
    state = verbs.goal(SetGoal(seen=verbs.state().id, goal=[0.9, 0.1], new_hardware="a ball"))
    goal = verbs.workspace.state.goals[-1]
    assert (goal.adapter, goal.carry_over, goal.new_hardware) == ("gp", True, "a ball")
    with pytest.raises(InvalidGoalError):
        verbs.goal(SetGoal(seen=state.id, goal=[0.9]))


def test_after_a_goal_that_was_set_by_a_session_in_python_another_is_set(verbs):
    verbs.workspace.session().set_goal([0.9, 0.0])
    state = verbs.state()
    assert state.goals[0].adapter == DEFAULT_ADAPTER
    verbs.goal(SetGoal(seen=state.id, goal=[0.9, 0.1]))
    assert verbs.workspace.state.goals[-1].adapter == DEFAULT_ADAPTER


def test_before_a_goal_is_touched_those_within_reach_are_told(verbs, tmp_path):
    nothing_moves = verbs.reach()
    assert (nothing_moves.goals, nothing_moves.refused) == ([], [])
    hoop = tmp_path / "hoop"
    with Workspace.create(hoop, symmetry="carried", box=(-0.8, -0.9, 0.4, 0.6, 0.9, 1.4)) as made:
        shown = make_task("basketball-v1").demonstrations("A").only([0]).without_symmetry()
        made.import_demonstrations(shown, "a throw")
        unlearned = Verbs(hoop)
        assert unlearned.reach().goals == []
        unlearned.close()
        made.learn()
    console = Verbs(hoop)
    region = console.reach()
    with pytest.raises(OutOfReachError):
        console.goal(SetGoal(seen=console.state().id, goal=region.refused[0]))
    assert console.goal(SetGoal(seen=console.state().id, goal=region.goals[0])).step == "ask"
    console.close()


def test_without_an_executor_the_plan_is_downloaded(verbs):
    state = aimed(verbs)
    with pytest.raises(TrialStateError, match="download"):
        verbs.execute(execution(state))
    assert (
        verbs.plan_file(1).read_bytes()
        == verbs.workspace.plan_file(verbs.workspace.state.trial(1)).path.read_bytes()
    )


def test_two_people_who_press_at_once_execute_it_once(folder, tmp_path):
    log = tmp_path / "log"
    command = f"{sys.executable} -c \"open('{log}', 'a').write('moved\\n')\" {{plan}}"
    verbs = executing(tmp_path / folder, command)
    state = aimed(verbs)
    body = execution(state)
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
    assert kinds(verbs.folder)[-2:] == ["moving", "moved"]


@pytest.mark.parametrize(
    "wrong",
    [
        *({"trial": 2}, {"sha256": "0" * 64}, {"sha256": ""}, {"seen": 0}, {"trial": -1}),
        *({"stopped": ""}, {"stopped": "1"}),
    ],
)
def test_only_the_plan_that_was_seen_is_executed(folder, tmp_path, wrong):
    verbs = executing(tmp_path / folder, SLOW)
    state = aimed(verbs)
    seen = {"seen": state.id, "trial": 1, "sha256": state.trials[0].sha256, "stopped": "0"}
    with pytest.raises(TrialStateError):
        verbs.execute(Execute(**(seen | wrong)))
    verbs.close()
    assert "moving" not in kinds(verbs.folder)


def test_a_press_that_is_sent_again_after_nothing_moved_is_refused(folder, tmp_path):
    verbs = executing(tmp_path / folder, FAILS)
    state = aimed(verbs)
    body = execution(state)
    verbs.execute(body)
    wait_for(lambda: verbs.state().step == "execute")
    assert "says that the arm did not move" in verbs.state().trials[0].warning
    with pytest.raises(TrialStateError, match="not done"):
        verbs.execute(body)
    verbs.close()
    assert kinds(verbs.folder).count("moving") == 1


def test_what_cannot_be_started_is_said_to_who_pressed(folder, tmp_path):
    verbs = executing(tmp_path / folder, "/no/such/program {plan}")
    state = aimed(verbs)
    # Refused before or just after the journal says `executing`: either way all tabs hear it.
    heard = []
    verbs.publish = heard.append
    try:
        verbs.execute(execution(state))
    except ConfigurationError as error:
        heard.append({"error": str(error)})
    wait_for(lambda: any("no/such/program" in m.get("error", "") for m in heard))
    verbs.close()
    assert stage_in(verbs.folder) == "asked"


def test_stop_stops_and_a_person_says_what_moved(folder, tmp_path):
    heard = []
    verbs = executing(tmp_path / folder, SLOW, heard)
    state = aimed(verbs)
    state = verbs.execute(execution(state))
    assert state.step == "executing"
    wait_for(lambda: any(message.get("output") == "moving\n" for message in heard))
    assert "moving" in verbs.state().output
    start = time.monotonic()
    state = verbs.stop()
    assert time.monotonic() - start < 20
    assert state.step == "settle"
    assert "stopped by Ctrl-C, Stop" in state.trials[0].warning
    state = verbs.ask(Ask(seen=state.id, arm_did_not_move=True))
    assert state.step == "execute"
    verbs.close()


def test_stop_stops_what_another_program_executes(folder, tmp_path):
    verbs, other = executing(tmp_path / folder, SLOW), executing(tmp_path / folder, SLOW)
    state = aimed(verbs)
    other.execute(execution(state))
    wait_for(lambda: "moving" in verbs.state().output)
    assert verbs.stop().step in ("executing", "settle")  # the other program writes how it ended
    wait_for(lambda: verbs.state().step == "settle")
    other.close()
    verbs.close()


def test_stop_with_nothing_to_stop_changes_nothing(verbs):
    state = aimed(verbs)
    assert structs.replace(verbs.stop(), stopped=state.stopped) == state


def test_after_a_stop_nothing_begins_that_was_asked_for_before(folder, tmp_path):
    heard = []
    verbs = executing(tmp_path / folder, SLOW, heard)
    state = aimed(verbs)
    other = Verbs(tmp_path / folder)
    stopped = other.stop().stopped
    other.close()
    with pytest.raises(TrialStateError, match="somebody pressed Stop since"):
        verbs.execute(execution(state))
    wait_for(lambda: {"id": state.id, "stopped": stopped, "output": ""} in heard)
    verbs.execute(execution(verbs.state()))
    verbs.close()
    assert kinds(verbs.folder).count("moving") == 1


def test_stop_stops_what_another_program_is_about_to_start(verbs):
    ended, held = [], threading.Event()

    def start():
        with executing_lock(verbs.folder) as lock:
            held.set()
            time.sleep(0.5)
            marked = os.environ | {MARK: " ".join(lock.names)}
            ended.append(subprocess.run(["sleep", "60"], env=marked).returncode)

    starting = threading.Thread(target=start)
    starting.start()
    held.wait()
    verbs.stop()
    starting.join()
    assert ended[0] < 0  # by a signal


@pytest.fixture
def on_arm(folder, tmp_path, toy_plugin):
    """A console of a workspace whose manifest names a toy arm; call it with what is wrong."""
    opened = []

    def open_(**options):
        toy_arm.name_arm(tmp_path / folder, tmp_path / "arm", **options)
        arm = Workspace(tmp_path / folder).manifest.driven_by
        opened.append(Verbs(tmp_path / folder, moved_by=arm))
        return opened[-1], tmp_path / "arm"

    yield open_
    for verbs in opened:
        verbs.close()


def test_an_arm_says_where_it_stands_and_a_person_is_asked_what_the_command_line_asks(on_arm):
    verbs, arm = on_arm()
    state = aimed(verbs)
    assert state.moved_by == "arm"
    asked = verbs.question(execution(state))
    assert asked.question == (
        "Trial 1 will run at FULL SPEED (0.5 s). NOT checked: self-collision, the table. "
        "Is the area clear?"
    )
    assert asked.arm == "toy, firmware 1.0: the arm is 0 rad (joint1) from the start pose"
    assert (asked.motion, asked.refused, toy_arm.motions(arm)) == ("trial", "", 0)
    slow = verbs.question(execution(state, motion="rehearsal", speed=0.2))
    assert slow.question.startswith("Trial 1 will be rehearsed at 20 % of its speed (2.3 s). NOT")
    verbs.execute(execution(state, stood=slow.stood))
    wait_for(lambda: verbs.state().step == "tell")
    assert toy_arm.motions(arm) == 1


def test_an_arm_that_stands_elsewhere_is_asked_to_go_to_the_start_first(on_arm):
    verbs, arm = on_arm()
    (arm / "pose").write_text("0.0 0.3")
    state = aimed(verbs)
    asked = verbs.question(execution(state))
    assert asked.motion == "approach"
    assert asked.question.startswith(
        "The arm will move slowly to where trial 1 begins (1.9 s). NOT"
    )
    with pytest.raises(TrialStateError, match="prepare it again"):
        verbs.execute(execution(state, motion="approach"))
    (arm / "pose").write_text("0.0 0.9")  # by somebody, while it is asked about
    verbs.execute(execution(state, motion="approach", stood=asked.stood))
    wait_for(lambda: kinds(verbs.folder)[-1] == "moved")
    state = verbs.state()
    assert "from where it stood when a person was asked" in state.trials[0].warning
    asked = verbs.question(execution(state))
    verbs.execute(execution(state, motion="approach", stood=asked.stood))
    wait_for(
        lambda: kinds(verbs.folder)[-2:] == ["moving", "moved"] and verbs.state().id > state.id + 1
    )
    state = verbs.state()
    assert (state.step, state.trials[0].warning) == ("execute", None)
    assert verbs.question(execution(state)).motion == "trial"


def test_a_plan_that_the_arm_refuses_and_a_fault_are_said(on_arm):
    verbs, _ = on_arm(fastest=0.1)
    state = aimed(verbs)
    assert "more than 0.1000" in verbs.question(execution(state)).refused
    verbs.close()
    verbs, _ = on_arm(kind="faults")
    state = verbs.state()
    asked = verbs.question(execution(state))
    verbs.execute(execution(state, stood=asked.stood))
    wait_for(lambda: verbs.state().step == "settle")
    assert verbs.state().trials[0].warning == f"but aborted: {toy_arm.FAULT}"


def test_a_command_is_asked_nothing_so_less_is_checked(folder, tmp_path):
    verbs = executing(tmp_path / folder, SLOW)
    asked = verbs.question(execution(aimed(verbs)))
    verbs.close()
    assert asked.question == (
        "Trial 1 will run at FULL SPEED (0.5 s). NOT checked: where the arm stands, the arm's "
        "limits, self-collision, the table. Is the area clear?"
    )


def test_closing_stops_what_was_started_here(folder, tmp_path):
    verbs = executing(tmp_path / folder, SLOW)
    state = aimed(verbs)
    verbs.execute(execution(state))
    verbs.close()
    assert kinds(tmp_path / folder)[-1] == "moved"  # stopped before it began


def test_everybody_hears_what_the_command_line_does(folder, tmp_path):
    heard = []
    verbs = executing(tmp_path / folder, SLOW, heard)
    with Workspace(tmp_path / folder) as workspace:
        workspace.set_goal([0.9, 0.0])
    wait_for(lambda: {"id": 3, "stopped": "0", "output": ""} in heard)
    verbs.close()


def test_learning_goes_on_beside_and_says_how_far_it_is(folder, tmp_path):
    heard = []
    verbs = executing(tmp_path / folder, SLOW, heard)
    verbs.learn(Seen(seen=verbs.state().id))
    wait_for(lambda: {"learning": None} in heard)
    assert verbs.state().generator == "auto"
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

"""Executing a trial: it runs once, and nothing that may have moved is forgotten."""

import errno
import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from prior_reinforce.arm.executing import supervision
from prior_reinforce.arm.executing.lock import executing_lock, is_executing, stop_executing
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.report import LimitReport
from prior_reinforce.arm.workspace import execute as execute_module
from prior_reinforce.arm.workspace.events import Moving
from prior_reinforce.arm.workspace.execute import (
    ask_to_move,
    execute,
    look_at_arm,
    note_not_moved,
    recover,
)
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    TrialStateError,
)
from prior_reinforce.session.trials import Stage
from tests.arm.executing import toy_arm
from tests.arm.workspace.planar import (
    ask,
    describe,
    reopened,
    stage,
    tell,
    trials,
)


def test_a_command_runs_once_and_its_end_is_kept(workspace):
    number = ask(workspace).number
    done = execute(workspace, number, "cat {plan}", time_limit=20)
    assert done.succeeded
    assert stage(workspace) == "executed"
    with pytest.raises(TrialStateError, match="a plan runs once"):
        execute(workspace, number, "cat {plan}", time_limit=20)
    assert len(list((workspace.folder / "executions").iterdir())) == 1
    tell(workspace, number, [0.02, 0.0])
    assert workspace.events[-2].event.exit_status == 0


def test_a_program_that_is_not_there_leaves_the_trial_to_be_executed(workspace):
    number = ask(workspace).number
    with pytest.raises(ConfigurationError):
        execute(workspace, number, "no-such-controller {plan}", time_limit=5)
    assert stage(workspace) == "asked"


def test_an_execution_that_was_cut_off_is_never_repeated_by_itself(workspace):
    number = ask(workspace).number
    with workspace.log.exclusive():  # what execute writes before the program dies
        workspace.log.append(Moving(number, "trial", "arm", ""))
    again = reopened(workspace)
    with pytest.raises(TrialStateError, match="did the arm move"):
        ask(again)
    assert "did the arm move" in describe(again)
    ask(again, arm_did_not_move=True)
    assert stage(again) == "asked"
    execute(again, number, "cat {plan}", time_limit=20)
    again.close()


def wait_for(what):
    deadline = time.monotonic() + 60
    while not what():
        assert time.monotonic() < deadline, "waited a minute in vain"
        time.sleep(0.02)


CONTROLLER = """
import pathlib, sys, time
here = pathlib.Path(sys.argv[1])
with open(here / "runs", "a") as file:
    file.write("moved\\n")
until = time.monotonic() + 60
while not (here / "stop").exists() and time.monotonic() < until:
    time.sleep(0.02)
"""
TELLING = """
import sys
from prior_reinforce.arm.workspace.workspace import Workspace
Workspace(sys.argv[1]).session().tell(1, [0.05, 0.0])
"""
PROGRAM = """
import sys
from prior_reinforce.arm.workspace.execute import execute
from prior_reinforce.arm.workspace.workspace import Workspace
execute(Workspace(sys.argv[1]), 1, sys.argv[2], time_limit=120)
"""


@pytest.mark.slow
def test_a_controller_that_outlives_our_program_keeps_the_arm_to_itself(workspace, tmp_path):
    workspace.session().ask()
    (tmp_path / "arm.py").write_text(CONTROLLER)
    command = f"{sys.executable} {tmp_path}/arm.py {tmp_path} {{plan}}"
    program = subprocess.Popen([sys.executable, "-c", PROGRAM, workspace.folder, command])
    wait_for((tmp_path / "runs").exists)
    os.kill(program.pid, signal.SIGKILL)
    program.wait()

    for asked in (workspace.session().ask, lambda: note_not_moved(workspace)):
        with pytest.raises(TrialStateError, match="executing now"):
            asked()
    # Even told trials make no room for the next while the arm moves.
    workspace.session().tell(1, [0.05, 0.0])
    assert workspace.session().ask().number == 2
    with pytest.raises(TrialStateError, match="executed right now"):
        execute(workspace, 2, command, time_limit=1)

    (tmp_path / "stop").touch()
    wait_for(lambda: not is_executing(workspace.folder))
    assert (tmp_path / "runs").read_text() == "moved\n"
    assert execute(workspace, 2, command, time_limit=60).succeeded
    assert stage(workspace, 2) == "executed"


def test_an_execution_whose_program_was_killed_is_recorded_by_what_watched_over_it(
    workspace, tmp_path
):
    workspace.session().ask()
    (tmp_path / "arm.py").write_text(CONTROLLER)
    command = f"{sys.executable} {tmp_path}/arm.py {tmp_path} {{plan}}"
    program = subprocess.Popen([sys.executable, "-c", PROGRAM, workspace.folder, command])
    wait_for((tmp_path / "runs").exists)
    program.kill()
    program.wait()
    assert recover(workspace) is None  # it goes on
    assert stage(workspace, 1) == "executing"
    (tmp_path / "stop").touch()
    wait_for(lambda: not is_executing(workspace.folder))
    trial = recover(workspace)
    assert stage(workspace, trial.number) == "executed"
    assert workspace.state.executions[1].outcome == "done"
    assert recover(workspace) is None


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["tell", "void"])
def test_what_a_killed_program_would_have_noted_is_noted_after_the_trial_was_settled(
    workspace, tmp_path, verb
):
    workspace.session().ask()
    (tmp_path / "arm.py").write_text(f"{CONTROLLER}\nsys.exit(3)")
    command = f"{sys.executable} {tmp_path}/arm.py {tmp_path} {{plan}}"
    program = subprocess.Popen([sys.executable, "-c", PROGRAM, workspace.folder, command])
    wait_for((tmp_path / "runs").exists)
    session = workspace.session()
    session.tell(1, [0.05, 0.0]) if verb == "tell" else session.void(1)
    program.kill()
    program.wait()
    (tmp_path / "stop").touch()
    wait_for(lambda: not is_executing(workspace.folder))
    asked = session.ask()
    assert recover(workspace) is None  # nothing of the trial that waits
    workspace = reopened(workspace)
    ended = workspace.state.executions[1]
    assert (ended.outcome, ended.exit_status) == ("aborted", 3)
    assert workspace.state.trial(1).stage.value == ("told" if verb == "tell" else "voided")
    assert stage(workspace, asked.number) == "asked"
    known = len(workspace.events)
    recover(workspace)
    assert len(workspace.events) == known


def test_an_execution_that_was_interrupted_is_recorded_as_aborted(workspace, tmp_path):
    workspace.session().ask()
    (tmp_path / "arm.py").write_text(CONTROLLER)
    command = f"{sys.executable} {tmp_path}/arm.py {tmp_path} {{plan}}"
    program = subprocess.Popen(
        [
            *(sys.executable, "-m", "prior_reinforce.cli"),
            *("ask", workspace.folder, "--yes", "--run", command),
        ],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    wait_for((tmp_path / "runs").exists)
    program.send_signal(signal.SIGINT)
    _, err = program.communicate(timeout=60)
    assert program.returncode == 130
    assert "interrupted; trial 1: aborted" in err
    assert stage(workspace, 1) == "executed"
    assert "void" in describe(workspace).splitlines()[-1]
    assert not is_executing(workspace.folder)


@pytest.mark.parametrize("error", [ConfigurationError, KeyboardInterrupt])
def test_what_is_raised_while_the_arm_moves_is_no_sign_that_it_did_not(workspace, error):
    number = ask(workspace).number

    def show(text):
        raise error("shown")

    with pytest.raises(error, match="shown"):
        execute(
            workspace, number, "sh -c 'echo moves; exec sleep 60' {plan}", time_limit=120, show=show
        )
    assert stage(workspace) == "executed"
    assert workspace.state.executions[number].outcome == "aborted"
    assert not is_executing(workspace.folder)


def test_a_stop_as_the_motion_begins_lets_nothing_begin(workspace, monkeypatch):
    """Nothing bears a mark yet that whoever stops could find."""
    begin = execute_module._begin

    def stopped(workspace, event):
        begin(workspace, event)
        stop_executing(workspace.folder)

    monkeypatch.setattr(execute_module, "_begin", stopped)
    result = execute(workspace, ask(workspace).number, "sh -c 'sleep 5' {plan}", time_limit=60)
    assert (result.outcome, result.reason) == ("not_moved", "it was stopped before it began")
    assert stage(workspace) == "asked"


def test_the_time_limit_of_an_arm_is_beyond_the_plans_own_duration(arm, monkeypatch):
    workspace, limits = arm(), []

    def executed(*args, time_limit, **more):
        limits.append(time_limit)
        raise ConfigurationError("nothing is started here")

    monkeypatch.setattr(execute_module, "execute_command", executed)
    settings, seconds = workspace.manifest.driven_by, workspace.plan(trials(workspace)[0]).times[-1]
    for motion, speed in (("trial", 1.0), ("rehearsal", 0.05)):
        with pytest.raises(ConfigurationError, match="nothing is started"):
            execute(workspace, 1, settings, time_limit=2.0, motion=motion, speed=speed)
    assert limits == pytest.approx([2.0 + seconds, 2.0 + 20 * seconds])


def test_nothing_moves_where_an_interruption_came_first(workspace, tmp_path, monkeypatch):
    number = ask(workspace).number
    begin = execute_module._begin

    def interrupted(*args):
        begin(*args)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(execute_module, "_begin", interrupted)
    with pytest.raises(KeyboardInterrupt):
        execute(workspace, number, f"touch {tmp_path}/ran {{plan}}", time_limit=20)
    assert not (tmp_path / "ran").exists()
    assert stage(workspace) == "asked"


def test_a_disk_that_fails_after_the_motion_is_no_sign_that_it_was_none(workspace, monkeypatch):
    """Network file systems say only when a file is closed that it did not fit."""
    number = ask(workspace).number
    usual = Path.open

    class Full(io.FileIO):
        def close(self):
            was_open = not self.closed
            super().close()
            if was_open:
                raise OSError(errno.EDQUOT, "quota exceeded")

    def opened(path, mode="r", **options):
        kept = path.name == supervision.OUTPUT_FILE and mode == "wb"
        return Full(path, "w+") if kept else usual(path, mode, **options)

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(OSError, match="quota"):
        execute(workspace, number, "cat {plan}", time_limit=60)
    assert stage(workspace) == "executing"
    recovered = recover(workspace)
    assert recovered is not None
    assert stage(workspace) == "executed"


def test_the_arm_is_the_one_that_the_manifest_names_by_now(workspace, monkeypatch):
    number = ask(workspace).number
    path, ran = workspace.folder / "workspace.toml", workspace.folder / "ran"
    unnamed = path.read_text()
    assert unnamed.count("# arm = ") == 1
    named = unnamed.replace("# arm = ", "arm = ", 1)
    path.write_text(named)
    arm = Workspace(workspace.folder).manifest.arm
    with executing_lock(arm=arm), pytest.raises(TrialStateError, match="right now"):
        execute(workspace, number, f"touch {ran} {{plan}}", time_limit=20)
    check = execute_module.to_execute

    def renamed(*args):
        path.write_text(unnamed)  # while the lock of the other is held
        return check(*args)

    monkeypatch.setattr(execute_module, "to_execute", renamed)
    with pytest.raises(ConfigurationError, match="names another arm"):
        execute(workspace, number, f"touch {ran} {{plan}}", time_limit=20)
    assert not ran.exists()
    assert stage(workspace) == "asked"


@pytest.mark.parametrize("deed", ["true", "rm -r $1", "rm -f $1/*", "chmod u+w $0; echo >> $0"])
def test_a_restored_journal_finds_what_ran_whatever_a_driver_did_to_its_files(workspace, deed):
    number, journal = ask(workspace).number, workspace.folder / "journal.sqlite"
    workspace.close()
    before, ran = journal.read_bytes(), workspace.folder / "ran"
    with Workspace(workspace.folder) as first:
        execute(first, number, f"sh -c '{deed}' {{plan}} {{result}}", time_limit=60)
    for path in workspace.folder.glob("journal.sqlite-*"):
        path.unlink()
    journal.write_bytes(before)
    with Workspace(workspace.folder) as restored:
        with pytest.raises(TrialStateError):
            execute(restored, number, f"touch {ran} {{plan}}", time_limit=60)
        assert stage(restored) == "executing"
    assert not ran.exists()


def test_a_session_that_was_open_sees_what_another_window_executes(workspace):
    session = workspace.session()
    session.ask()
    with workspace.log.exclusive():
        workspace.log.append(Moving(1, "trial", "arm", ""))
    with pytest.raises(TrialStateError, match="did the arm move"):
        session.ask()
    note_not_moved(workspace)
    assert session.ask().number == 1
    assert stage(workspace) == "asked"


def test_a_plan_runs_once_and_told_while_it_runs_the_trial_stays_told(workspace, tmp_path):
    number = ask(workspace).number
    (tmp_path / "tell.py").write_text(TELLING)
    command = f"{sys.executable} {tmp_path}/tell.py {workspace.folder} {{plan}}"
    assert execute(workspace, number, command, time_limit=60).succeeded
    assert workspace.state.trial(number).stage is Stage.TOLD
    assert workspace.state.executions[number].outcome == "done"  # noted, as of any motion
    with pytest.raises(TrialStateError, match="told already; a plan runs once"):
        execute(workspace, number, command, time_limit=60)


@pytest.mark.parametrize("verb", ["tell", "void"])
def test_a_motion_that_fails_after_its_trial_was_settled_is_noted_as_aborted(
    workspace, tmp_path, verb
):
    number = ask(workspace).number
    settle = {"tell": "tell(1, [0.05, 0.0])", "void": "void(1)"}[verb]
    text = TELLING.replace("tell(1, [0.05, 0.0])", settle)
    assert settle in text
    (tmp_path / "settle.py").write_text(f"{text}\nsys.exit(3)")
    command = f"{sys.executable} {tmp_path}/settle.py {workspace.folder} {{plan}}"
    assert execute(workspace, number, command, time_limit=60).outcome == "aborted"
    workspace = reopened(workspace)
    ended = workspace.state.executions[number]
    assert (ended.outcome, ended.exit_status) == ("aborted", 3)
    assert "but aborted" in workspace.status().trials[-1].warning
    assert workspace.state.trial(number).stage.value == ("told" if verb == "tell" else "voided")


def test_nobody_can_say_that_the_arm_did_not_move_for_no_trial(workspace):
    tell(workspace, ask(workspace).number, [0.02, 0.0])
    with pytest.raises(TrialStateError, match="no trial waits"):
        note_not_moved(workspace)


@pytest.fixture
def arm(workspace, tmp_path, toy_plugin):
    """A toy arm that the manifest names; its settings, with `.named(...)` for others."""
    ask(workspace)

    def named(**options):
        toy_arm.name_arm(workspace.folder, tmp_path / "arm", **options)
        return reopened(workspace)

    return named


def kinds(workspace):
    return [entry.kind for entry in workspace.events][-4:]


def test_an_arm_executes_a_trial_and_its_measured_path_is_kept(arm, tmp_path):
    workspace = arm()
    settings = workspace.manifest.driven_by
    look = look_at_arm(workspace, 1, settings)
    assert (look.arm.model, look.there, look.refused) == ("toy", True, "")
    assert toy_arm.motions(tmp_path / "arm") == 0
    result = execute(workspace, 1, settings, time_limit=60)
    assert result.outcome == "done"
    assert result.tracking_max["rad"] < 1e-4  # it stands 3e-5 rad from the start
    ended = workspace.state.executions[1]
    assert ended.end_error["rad"] < 1e-6
    assert kinds(workspace)[-2:] == ["moving", "moved"]
    began = workspace.events[-2].event
    assert began.by == toy_arm.TOY
    path = workspace.store.execution_folder(began.folder) / "executed.npz"
    assert len(np.load(path)["t"]) == 47
    with pytest.raises(TrialStateError, match="a plan runs once"):
        execute(workspace, 1, settings, time_limit=60)
    assert toy_arm.motions(tmp_path / "arm") == 1


def test_a_rehearsal_is_no_trial(arm, tmp_path):
    workspace = arm()
    settings = workspace.manifest.driven_by
    result = execute(workspace, 1, settings, time_limit=60, motion="rehearsal", speed=0.5)
    assert result.outcome == "done"
    assert result.tracking_max["rad"] < 1e-4  # it stands 3e-5 rad from the start
    assert kinds(workspace)[-2:] == ["moving", "moved"]
    assert stage(workspace) == "asked"
    assert workspace.session().state.readings_for(workspace.state.goals[-1], "") == []
    # The arm stands at the plan's end now.
    assert execute(workspace, 1, settings, time_limit=60).outcome == "not_moved"
    assert execute(workspace, 1, settings, time_limit=60, motion="approach").outcome == "done"
    assert execute(workspace, 1, settings, time_limit=60).outcome == "done"
    assert toy_arm.motions(tmp_path / "arm") == 3
    began = [entry.event for entry in workspace.events if entry.kind == "moving"]
    assert [(event.motion, event.speed) for event in began] == [
        ("rehearsal", 0.5),
        ("trial", 1),  # which did not begin
        ("approach", 1),
        ("trial", 1),
    ]


def test_an_arm_that_was_changed_since_a_person_saw_it_is_not_moved(arm, workspace, tmp_path):
    workspace = arm()
    seen = workspace.manifest.driven_by
    toy_arm.name_arm(workspace.folder, tmp_path / "arm", kind="faults")
    with pytest.raises(ConfigurationError, match="names another arm since"):
        execute(workspace, 1, seen, time_limit=60)
    workspace = reopened(workspace)
    for call in (execute, look_at_arm):
        with pytest.raises(ConfigurationError, match="names another arm since"):
            call(workspace, 1, seen, **({"time_limit": 60} if call is execute else {}))
    assert toy_arm.motions(tmp_path / "arm") == 0
    assert kinds(workspace)[-1] == "asked"


def test_an_arm_that_somebody_moves_is_not_connected_to_for_a_look(arm):
    workspace = arm()
    with executing_lock(), pytest.raises(TrialStateError, match="a motion is being executed"):
        look_at_arm(workspace, 1, workspace.manifest.driven_by)


@pytest.mark.parametrize(("motion", "speed"), [("trial", 0.5), ("rehearsal", 1), ("rehearsal", 0)])
def test_only_a_rehearsal_is_slower(arm, motion, speed):
    workspace = arm()
    with pytest.raises(ConfigurationError, match="a rehearsal has a share"):
        execute(
            workspace, 1, workspace.manifest.driven_by, time_limit=60, motion=motion, speed=speed
        )
    with pytest.raises(ConfigurationError, match=r"makes no approach; name the arm in \[arm\]"):
        execute(workspace, 1, "true {plan}", time_limit=60, motion="approach")


def test_a_rehearsal_whose_program_was_killed_stays_in_the_journal(arm, tmp_path):
    workspace = arm(seconds=3.0)
    program = subprocess.Popen([
        sys.executable, "-c", "import sys\nfrom prior_reinforce.arm.workspace.execute import "
        "execute\nfrom prior_reinforce.arm.workspace.workspace import Workspace\nwith "
        "Workspace(sys.argv[1]) as w: execute(w, 1, w.manifest.driven_by, "
        "time_limit=60, motion='rehearsal', speed=0.5)", workspace.folder,
    ])  # fmt: skip
    wait_for((tmp_path / "arm" / "pose").exists)
    program.kill()
    program.wait()
    wait_for(lambda: not is_executing(workspace.folder))
    assert kinds(workspace)[-1] == "moving"
    assert recover(workspace) is None
    assert stage(workspace) == "asked"


@pytest.mark.parametrize("gated", [True, False])
def test_the_box_for_the_tool_tip_holds_for_a_plan_and_its_approach_where_the_gate_saw_them(gated):
    gate = GateSettings(box_low=(0.2, -0.6, 0.05), box_high=(0.9, 0.6, 1.2))
    verdict = LimitReport("fr3", "any", "", ()) if gated else None
    workspace = SimpleNamespace(
        manifest=SimpleNamespace(gate=gate),
        plan=lambda trial: SimpleNamespace(actions=np.zeros((2, 7)), times=np.array([0.0, 1.0])),
        gate=lambda frames, condition: verdict,
    )
    trial = SimpleNamespace(number=1, condition=np.zeros(2))
    said = "the table, but for the tool tip. Is" if gated else "the table. Is"
    assert said in ask_to_move(workspace, trial)
    assert said in ask_to_move(workspace, trial, motion="approach")

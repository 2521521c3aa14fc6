"""A workspace: what happened is kept, whatever happens in between."""

import copy
import errno
import io
import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.adapters.proportional import ProportionalAdapter
from prior_reinforce.bench.robots.executors import supervision
from prior_reinforce.bench.robots.executors.lock import executing_lock, stop_executing
from prior_reinforce.bench.workspace import workspace as workspace_module
from prior_reinforce.bench.workspace.log import Executing
from prior_reinforce.bench.workspace.status import describe
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    InvalidFeedbackError,
    InvalidGoalError,
    RobotLimitError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.generators import make_generator, training
from prior_reinforce.generators.base import Generator
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.plans.motions import Demonstrations, PlanFormat
from prior_reinforce.readings import Reading
from prior_reinforce.session.session import Session
from prior_reinforce.session.trials import Stage
from tests.bench.robots.executors import toy_arm
from tests.bench.workspace.planar import (
    amend,
    ask,
    demonstrations,
    manifest,
    recordings,
    reopened,
    tell,
    trials,
    void,
)

GOAL = [0.9, 0.05]
SLOW = (
    'model = "given"\njoint_names = ["joint1", "joint2"]\nlower = [-3, -3]\nupper = [3, 3]\n'
    "velocity = [0.1, 0.1]\nacceleration = [100, 100]\njerk = [10000, 10000]\n"
)


class OwnInterpolation(SmoothInterpolation):
    """Not one of ours, as far as the package knows."""

    name = "own-interpolation"


OWN = f"{__name__}:OwnInterpolation"


def test_a_told_trial_is_there_when_the_program_starts_again(workspace):
    trial = ask(workspace)
    tell(workspace, trial.number, [0.05, -0.02])
    again = reopened(workspace)
    (kept,) = trials(again)
    assert kept.stage is Stage.TOLD
    np.testing.assert_array_equal(kept.error_seen, [0.05, -0.02])
    np.testing.assert_array_equal(kept.condition, trial.condition)
    again.close()


def test_ask_gives_the_same_plan_also_from_another_program(workspace):
    first = ask(workspace)
    again = reopened(workspace)
    second = ask(again)
    assert (second.number, second.kept.sha256) == (first.number, first.kept.sha256)
    assert len(list((workspace.folder / "plans").glob("*.npz"))) == 1
    again.close()


def test_the_next_condition_is_the_sessions(workspace):
    """The workspace adds nothing to Algorithm 1: a session in memory goes the same way."""
    generator = workspace.session().generator
    session = Session(generator, BayesianAdapter(), demonstrations(), GOAL, 0.015)
    for error in ([0.05, 0.0], [0.01, -0.02]):
        trial = session.ask()
        session.tell(trial.number, error)
        number = ask(workspace).number
        tell(workspace, number, error)
    np.testing.assert_array_equal(ask(workspace).condition, session.ask().condition)


def test_numbers_run_over_all_goals_and_an_earlier_goals_trial_can_be_amended(workspace):
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    workspace.set_goal([0.95, 0.0])
    assert ask(workspace).number == 2
    amend(workspace, 1, [0.03, 0.0])
    assert not trials(workspace)[0].hit
    np.testing.assert_array_equal(trials(workspace)[0].error_seen, [0.03, 0.0])


@pytest.mark.parametrize(
    ("adapter", "carry_over", "carried"),
    [
        ("bayes", None, True),
        ("bayes", False, False),
        ("gp", None, False),
        ("gp", True, True),
    ],
)
def test_earlier_goals_serve_a_later_one_where_they_serve_its_adapter(
    workspace, adapter, carry_over, carried
):
    tell(workspace, ask(workspace).number, [0.06, 0.03])
    goal = workspace.set_goal([0.91, 0.05], carry_over=carry_over, adapter=adapter)
    assert goal.carry_over is carried
    moved = np.linalg.norm(ask(workspace).condition - [0.91, 0.05])
    assert moved > 0.01 if carried else moved < 0.0005


def test_new_hardware_is_noted_and_what_is_known_is_believed_less(workspace):
    for goal in ([0.9, 0.05], [0.95, -0.05], [0.85, 0.0]):
        workspace.set_goal(goal)
        for _ in range(2):
            number = ask(workspace).number
            session = workspace.session()
            error = session.trials[-1].condition - np.subtract(goal, [0.08, 0.0])
            session.tell(number, Reading.measured(error, 0.001), hit=False)
    shifted = workspace.set_goal([0.9, 0.0])
    known = ask(workspace)
    void(workspace, known.number, "")
    goal = workspace.set_goal([0.9, 0.0], new_hardware="another ball")
    assert goal.new_hardware == "another ball"
    anew = ask(workspace)
    assert (known.condition - shifted.goal)[0] < -0.06
    np.testing.assert_allclose(anew.condition, known.condition, atol=0.005)
    assert anew.p_hit < 0.5 * known.p_hit
    assert "another ball" in describe(workspace)


def test_the_adapter_is_the_goals(workspace):
    workspace.set_goal(GOAL, adapter="proportional,gain=0.5")
    tell(workspace, ask(workspace).number, [0.06, 0.03])
    again = reopened(workspace)
    np.testing.assert_allclose(ask(again).condition, np.subtract(GOAL, [0.03, 0.015]))
    assert "adapter proportional,gain=0.5" in describe(again)
    before = again.events
    for wrong in ("spline", "gp,size=2"):
        with pytest.raises(ConfigurationError):
            again.set_goal(GOAL, adapter=wrong)
    assert again.events == before
    again.close()


def test_a_trial_of_another_model_is_left_out(workspace):
    first = ask(workspace)
    tell(workspace, first.number, [0.06, 0.03])
    workspace.learn("nearest")
    np.testing.assert_array_equal(ask(workspace).condition, first.condition)


@pytest.mark.parametrize("choice", ["interpolation", "interpolation,timing=align"])
def test_a_workspace_plans_as_its_generator_does_by_itself(tmp_path, choice):
    """Recordings that start at different times, aligned or not."""
    demos = demonstrations()
    late = [
        np.concatenate([p[:1].repeat(n, 0), p[: len(p) - n]]) for n, p in enumerate(demos.plans)
    ]
    rest = np.repeat(np.array(late)[:, -1:], 4, axis=1)
    demos = Demonstrations(np.concatenate([late, rest], axis=1), demos.outcomes_seen, demos.format)
    with Workspace.create(tmp_path / "planar", manifest()) as workspace:
        workspace.import_demonstrations(demos, "made up")
        model = workspace.learn(choice).model
        workspace.set_goal(GOAL)
        trial = ask(workspace)
        alone = make_generator(choice).fit(demos, seed=0)
        expected = alone.generate(trial.condition[None])[0]
        np.testing.assert_array_equal(workspace.plan(trial).actions, expected)
        assert f"{model}, {choice}" in describe(workspace)


def test_what_a_fit_chose_is_kept_and_shown(workspace):
    training = workspace.learn()
    assert [remark.split(":")[0] for remark in training.remarks] == ["generator", "timing"]
    assert all(remark in describe(workspace) for remark in training.remarks)


def test_ones_own_generator_is_named_by_a_person_not_by_the_journal(workspace):
    workspace.learn(OWN)
    assert f"prior-reinforce ask {workspace.folder} --generator {OWN}" in describe(workspace)
    before = workspace.events
    with pytest.raises(ConfigurationError, match=f"--generator {OWN}"):
        ask(workspace)
    with pytest.raises(ConfigurationError, match="learned by"):
        ask(workspace, own="examples:Another")
    assert workspace.events == before
    assert ask(workspace, own=OWN).number == 1
    void(workspace, 1, "")
    workspace.learn("interpolation")
    with pytest.raises(ConfigurationError, match="drop --generator"):
        ask(workspace, own=OWN)


class OwnAdapter(ProportionalAdapter):
    """Not one of ours, as far as the package knows."""


def test_ones_own_adapter_is_named_by_a_person_not_by_the_journal(workspace):
    own = f"{__name__}:OwnAdapter"
    workspace.set_goal(GOAL, adapter=f"{own},gain=0.5")
    assert f"prior-reinforce ask {workspace.folder} --adapter {own}" in describe(workspace)
    before = workspace.events
    with pytest.raises(ConfigurationError, match=f"--adapter {own}"):
        ask(workspace)
    assert workspace.events == before
    number = workspace.session(own_adapter=own).ask().number
    tell(workspace, number, [0.06, 0.03])
    again = workspace.session(own_adapter=own).ask()
    np.testing.assert_allclose(again.condition, np.subtract(GOAL, [0.03, 0.015]))


def test_bad_feedback_changes_nothing(workspace):
    number = ask(workspace).number
    before = workspace.events
    for error in ([0.1], [np.nan, 0.0], "far"):
        with pytest.raises(InvalidFeedbackError):
            tell(workspace, number, error)
    for call in (
        lambda: tell(workspace, 7, [0.0, 0.0]),
        lambda: amend(workspace, number, [0.0, 0.0]),
        lambda: workspace.set_goal([0.9, 0.0]),
        lambda: workspace.learn("interpolation"),
    ):
        with pytest.raises(TrialStateError):
            call()
    assert workspace.events == before


def test_a_bad_goal_changes_nothing(workspace):
    before = workspace.events
    for goal in ([0.9], [np.inf, 0.0], ["a", "b"]):
        with pytest.raises(InvalidGoalError):
            workspace.set_goal(goal)
    assert workspace.events == before


def test_the_order_of_things_is_told(tmp_path):
    workspace = Workspace.create(tmp_path / "new", manifest())
    with pytest.raises(WorkspaceError, match="prior-reinforce import"):
        workspace.set_goal(GOAL)
    workspace.import_demonstrations(demonstrations(), "made up")
    with pytest.raises(WorkspaceError, match="prior-reinforce learn"):
        ask(workspace)
    workspace.learn("interpolation")
    with pytest.raises(WorkspaceError, match="prior-reinforce goal"):
        ask(workspace)
    workspace.close()


def test_demonstrations_must_fit_the_manifest(workspace):
    other = demonstrations()
    slow = Demonstrations(
        other.plans, other.outcomes_seen, PlanFormat(other.format.names, other.format.units, 0.04)
    )
    with pytest.raises(InvalidDemonstrationsError, match=r"dt 0\.04.*0\.02"):
        workspace.import_demonstrations(slow, "slow.npz")


def test_a_plan_that_breaks_a_limit_is_refused_and_nothing_is_written(workspace):
    path = workspace.folder / "workspace.toml"
    path.write_text(path.read_text().replace('model = "none"', SLOW, 1))
    slow = reopened(workspace)
    before = slow.events
    with pytest.raises(RobotLimitError, match="velocity"):
        ask(slow)
    assert slow.events == before
    assert not list((slow.folder / "plans").glob("*"))
    slow.close()


def test_a_command_runs_once_and_its_end_is_kept(workspace):
    number = ask(workspace).number
    done = workspace.execute(number, "cat {plan}", time_limit=20)
    assert done.succeeded
    assert trials(workspace)[0].stage is Stage.EXECUTED
    with pytest.raises(TrialStateError, match="a plan runs once"):
        workspace.execute(number, "cat {plan}", time_limit=20)
    assert len(list((workspace.folder / "executions").iterdir())) == 1
    tell(workspace, number, [0.02, 0.0])
    assert workspace.events[-2].event.exit_status == 0


def test_a_plan_that_the_limits_refuse_by_now_is_neither_given_out_nor_executed(workspace):
    """The verdict counts at the moment of leaving, whatever it was when the plan was made."""
    number = ask(workspace).number
    path = workspace.folder / "workspace.toml"
    path.write_text(path.read_text().replace('model = "none"', SLOW, 1))
    narrow = reopened(workspace)
    before = narrow.events
    ran = workspace.folder / "ran"
    with pytest.raises(RobotLimitError, match="void it and ask again"):
        ask(narrow)
    with pytest.raises(RobotLimitError, match="velocity"):
        narrow.execute(number, f"touch {ran} {{plan}}", time_limit=20)
    assert narrow.events == before
    assert not ran.exists()
    narrow.close()


def test_a_program_that_is_not_there_leaves_the_trial_to_be_executed(workspace):
    number = ask(workspace).number
    with pytest.raises(ConfigurationError):
        workspace.execute(number, "no-such-controller {plan}", time_limit=5)
    assert trials(workspace)[0].stage is Stage.ASKED


def test_an_execution_that_was_cut_off_is_never_repeated_by_itself(workspace):
    number = ask(workspace).number
    with workspace.log.exclusive():  # what execute writes before the program dies
        workspace.log.append(Executing(trial=number, command="arm {plan}", folder=""))
    again = reopened(workspace)
    with pytest.raises(TrialStateError, match="did the arm move"):
        ask(again)
    assert "did the arm move" in describe(again)
    assert ask(again, arm_did_not_move=True).stage is Stage.ASKED
    again.execute(number, "cat {plan}", time_limit=20)
    again.close()


def test_a_workspace_that_was_copied_goes_on(workspace, tmp_path):
    tell(workspace, ask(workspace).number, [0.05, -0.02])
    shutil.copytree(workspace.folder, tmp_path / "elsewhere")
    copy = Workspace(tmp_path / "elsewhere")
    np.testing.assert_array_equal(ask(copy).condition, ask(workspace).condition)
    copy.close()


def test_folders_that_are_no_workspace_are_named(tmp_path):
    with pytest.raises(WorkspaceError, match="prior-reinforce new"):
        Workspace(tmp_path)
    (tmp_path / "file").write_text("x")
    with pytest.raises(WorkspaceError, match="not empty"):
        Workspace.create(tmp_path, manifest())


def test_a_trial_is_told_once_and_voided_once(workspace):
    number = ask(workspace).number
    tell(workspace, number, [0.05, 0.0])
    with pytest.raises(TrialStateError, match="amend it"):
        tell(workspace, number, [0.01, 0.0])
    void(workspace, number, "slipped")
    before = workspace.events
    for call in (
        lambda: void(workspace, number, "again"),
        lambda: tell(workspace, number, [0.0, 0.0]),
        lambda: amend(workspace, number, [0.0, 0.0]),
    ):
        with pytest.raises(TrialStateError, match="ask for another"):
            call()
    assert workspace.events == before


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
from prior_reinforce.bench.workspace.workspace import Workspace
Workspace(sys.argv[1]).session().tell(1, [0.05, 0.0])
"""
PROGRAM = """
import sys
from prior_reinforce.bench.workspace.workspace import Workspace
Workspace(sys.argv[1]).execute(1, sys.argv[2], time_limit=120)
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

    for moved_or_not in ({}, {"arm_did_not_move": True}):
        with pytest.raises(TrialStateError, match="executing now"):
            workspace.session().ask(**moved_or_not)
    # Even told trials make no room for the next while the arm moves.
    workspace.session().tell(1, [0.05, 0.0])
    assert workspace.session().ask().number == 2
    with pytest.raises(TrialStateError, match="executed right now"):
        workspace.execute(2, command, time_limit=1)

    (tmp_path / "stop").touch()
    wait_for(lambda: not workspace.log.is_executing())
    assert (tmp_path / "runs").read_text() == "moved\n"
    assert workspace.execute(2, command, time_limit=60).succeeded
    assert workspace.session().trial(2).stage is Stage.EXECUTED


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
    assert workspace.recover() is None  # it goes on
    assert workspace.session().trial(1).stage is Stage.EXECUTING
    (tmp_path / "stop").touch()
    wait_for(lambda: not workspace.log.is_executing())
    trial = workspace.recover()
    assert trial.stage is Stage.EXECUTED
    assert workspace.state.executions[1].outcome == "done"
    assert workspace.recover() is None


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
    assert workspace.session().trial(1).stage is Stage.EXECUTED
    assert "void" in describe(workspace).splitlines()[-1]
    assert not workspace.log.is_executing()


@pytest.mark.parametrize("error", [ConfigurationError, KeyboardInterrupt])
def test_what_is_raised_while_the_arm_moves_is_no_sign_that_it_did_not(workspace, error):
    number = ask(workspace).number

    def show(text):
        raise error("shown")

    with pytest.raises(error, match="shown"):
        workspace.execute(
            number, "sh -c 'echo moves; exec sleep 60' {plan}", time_limit=120, show=show
        )
    assert trials(workspace)[0].stage is Stage.EXECUTED
    assert workspace.state.executions[number].outcome == "aborted"
    assert not workspace.log.is_executing()


def test_a_stop_as_the_motion_begins_ends_it(workspace, monkeypatch):
    """Nothing bears a mark yet that whoever stops could find."""
    begin = Workspace._begin

    def stopped(self, event):
        begin(self, event)
        stop_executing(self.folder)

    monkeypatch.setattr(Workspace, "_begin", stopped)
    result = workspace.execute(ask(workspace).number, "sh -c 'sleep 5' {plan}", time_limit=60)
    assert (result.outcome, result.interrupted) == ("aborted", True)


def test_the_time_limit_of_an_arm_is_beyond_the_plans_own_duration(arm, monkeypatch):
    workspace, limits = arm(), []

    def executed(*args, time_limit, **more):
        limits.append(time_limit)
        raise ConfigurationError("nothing is started here")

    monkeypatch.setattr(workspace_module, "execute_command", executed)
    settings, seconds = workspace.manifest.driven_by, workspace.plan(trials(workspace)[0]).times[-1]
    for motion, speed in (("trial", 1.0), ("rehearsal", 0.05)):
        with pytest.raises(ConfigurationError, match="nothing is started"):
            workspace.execute(1, settings, time_limit=2.0, motion=motion, speed=speed)
    assert limits == pytest.approx([2.0 + seconds, 2.0 + 20 * seconds])


def test_nothing_moves_where_an_interruption_came_first(workspace, tmp_path, monkeypatch):
    number = ask(workspace).number
    begin = Workspace._begin

    def interrupted(*args):
        begin(*args)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(Workspace, "_begin", interrupted)
    with pytest.raises(KeyboardInterrupt):
        workspace.execute(number, f"touch {tmp_path}/ran {{plan}}", time_limit=20)
    assert not (tmp_path / "ran").exists()
    assert trials(workspace)[0].stage is Stage.ASKED


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
        kept = path.name == supervision.OUTPUT_FILE and mode == "wb+"
        return Full(path, "w+") if kept else usual(path, mode, **options)

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(OSError, match="quota"):
        workspace.execute(number, "cat {plan}", time_limit=60)
    assert trials(workspace)[0].stage is Stage.EXECUTING
    recovered = workspace.recover()
    assert recovered is not None
    assert recovered.stage is Stage.EXECUTED


def test_the_arm_is_the_one_that_the_manifest_names_by_now(workspace, monkeypatch):
    number = ask(workspace).number
    path, ran = workspace.folder / "workspace.toml", workspace.folder / "ran"
    unnamed = path.read_text()
    assert unnamed.count("# arm = ") == 1
    named = unnamed.replace("# arm = ", "arm = ", 1)
    path.write_text(named)
    arm = Workspace(workspace.folder).manifest.arm
    with executing_lock(arm=arm), pytest.raises(TrialStateError, match="right now"):
        workspace.execute(number, f"touch {ran} {{plan}}", time_limit=20)
    check = Workspace.to_execute

    def renamed(*args):
        path.write_text(unnamed)  # while the lock of the other is held
        return check(*args)

    monkeypatch.setattr(Workspace, "to_execute", renamed)
    with pytest.raises(ConfigurationError, match="names another arm"):
        workspace.execute(number, f"touch {ran} {{plan}}", time_limit=20)
    assert not ran.exists()
    assert trials(workspace)[0].stage is Stage.ASKED


@pytest.mark.parametrize("deed", ["true", "rm -r $1", "rm -f $1/*", "chmod u+w $0; echo >> $0"])
def test_a_restored_journal_finds_what_ran_whatever_a_driver_did_to_its_files(workspace, deed):
    number, journal = ask(workspace).number, workspace.folder / "journal.sqlite"
    workspace.close()
    before, ran = journal.read_bytes(), workspace.folder / "ran"
    with Workspace(workspace.folder) as first:
        first.execute(number, f"sh -c '{deed}' {{plan}} {{result}}", time_limit=60)
    for path in workspace.folder.glob("journal.sqlite-*"):
        path.unlink()
    journal.write_bytes(before)
    with Workspace(workspace.folder) as restored:
        with pytest.raises(TrialStateError):
            restored.execute(number, f"touch {ran} {{plan}}", time_limit=60)
        assert trials(restored)[0].stage is Stage.EXECUTING
    assert not ran.exists()


def test_limits_that_were_narrowed_while_the_program_waited_are_the_ones_that_count(workspace):
    number = ask(workspace).number
    path = workspace.folder / "workspace.toml"
    path.write_text(path.read_text().replace('model = "none"', SLOW, 1))
    ran = workspace.folder / "ran"
    for call in (
        lambda: ask(workspace),
        lambda: workspace.execute(number, f"touch {ran} {{plan}}", time_limit=20),
    ):
        with pytest.raises(RobotLimitError, match="velocity"):
            call()
    assert not ran.exists()
    assert not (workspace.folder / "executions").exists()


@pytest.mark.parametrize(
    "name", ["journal.sqlite", "models", "plans", "demonstrations.png", "report", "workspace.toml"]
)
def test_links_out_of_the_folder_are_refused_before_anything_is_read_or_written(
    workspace, tmp_path, name
):
    workspace.close()
    target = tmp_path / "elsewhere"
    if (workspace.folder / name).exists():
        (workspace.folder / name).rename(target)
    (workspace.folder / name).symlink_to(target)
    with pytest.raises(FileFormatError, match=f"{name} is a link out of"):
        Workspace(workspace.folder)


@pytest.mark.parametrize("part", ["plans", "models", "demonstrations"])
def test_links_further_down_are_refused_too(workspace, tmp_path, part):
    ask(workspace)
    (path,) = (workspace.folder / part).iterdir()
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    again = reopened(workspace)
    if part != "plans":  # an open trial has its plan already
        void(again, 1, "")
    with pytest.raises(FileFormatError, match="is a link out of"):
        ask(again)
    again.close()


def test_no_training_goes_on_in_another_folder(workspace, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (workspace.folder / ".training").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FileFormatError, match=r"\.training is a link out of"):
        workspace.learn("nearest")


class Unsavable(Generator):
    """Knows how to learn, and not how to be kept."""

    def _fit(self, demonstrations, seed, progress):
        raise AssertionError("must be refused before it is fitted")

    def _generate(self, conditions): ...


def test_a_generator_that_cannot_be_kept_is_refused_before_it_is_fitted(workspace):
    with pytest.raises(ConfigurationError, match=r"give the class state\(\) and from_state"):
        workspace.learn(f"{__name__}:Unsavable")


def test_one_long_session_follows_what_is_learned_and_chosen_meanwhile(tmp_path):
    with Workspace.create(tmp_path / "planar", manifest()) as workspace:
        workspace.import_demonstrations(demonstrations(), "made up")
        session = workspace.session()
        first = workspace.learn("interpolation").model
        session.set_goal(GOAL)
        alone = session.ask()
        assert alone.model == first
        session.tell(1, [0.06, 0.03])
        assert not np.allclose(session.ask().condition, alone.condition)
        session.void(2, "")
        with Workspace(workspace.folder) as elsewhere:
            second = elsewhere.learn("nearest").model
        trial = session.ask()
        assert trial.model == second
        np.testing.assert_array_equal(trial.condition, alone.condition)
        session.tell(3, [0.06, 0.03])
        session.set_goal(GOAL, adapter="proportional,gain=0.5", carry_over=True)
        expected = trial.condition - [0.03, 0.015]
        np.testing.assert_allclose(session.ask().condition, expected)


def test_a_session_that_was_open_sees_what_another_window_executes(workspace):
    session = workspace.session()
    session.ask()
    with workspace.log.exclusive():
        workspace.log.append(Executing(trial=1, command="arm {plan}", folder=""))
    with pytest.raises(TrialStateError, match="did the arm move"):
        session.ask()
    assert session.ask(arm_did_not_move=True).stage is Stage.ASKED


def test_a_plan_runs_once_and_told_while_it_runs_the_trial_stays_told(workspace, tmp_path):
    number = ask(workspace).number
    (tmp_path / "tell.py").write_text(TELLING)
    command = f"{sys.executable} {tmp_path}/tell.py {workspace.folder} {{plan}}"
    assert workspace.execute(number, command, time_limit=60).succeeded
    assert workspace.state.trial(number).stage is Stage.TOLD
    with pytest.raises(TrialStateError, match="told already; a plan runs once"):
        workspace.execute(number, command, time_limit=60)


def test_a_training_that_was_interrupted_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_SAVED_EVERY", 0.0)
    monkeypatch.setattr(training, "_SAVING", np.inf)
    choice = "regression,training_steps=4,network.widths=8,network.groups=2,timing=none"
    steps = []

    def interrupt(progress):
        steps.append(progress.step)
        if len(steps) == 2:
            raise KeyboardInterrupt

    models = []
    for folder, progresses in ((tmp_path / "a", (None,)), (tmp_path / "b", (interrupt,) * 2)):
        with Workspace.create(folder, manifest()) as workspace:
            workspace.import_demonstrations(demonstrations(), "made up")
            for progress in progresses:
                with suppress(KeyboardInterrupt):
                    models.append(workspace.learn(choice, progress=progress).model)
    assert steps == [1, 2, 2, 3, 4]
    assert models[0] == models[1]


@pytest.fixture
def arm(workspace, tmp_path, monkeypatch):
    """A toy arm that the manifest names; its settings, with `.named(...)` for others."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
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
    look = workspace.look_at_arm(1, settings)
    assert (look.arm.model, look.there, look.refused) == ("toy", True, "")
    assert toy_arm.motions(tmp_path / "arm") == 0
    result = workspace.execute(1, settings, time_limit=60)
    assert result.outcome == "done"
    assert result.tracking_max["rad"] < 1e-6
    ended = workspace.state.executions[1]
    assert ended.end_error["rad"] < 1e-6
    assert kinds(workspace)[-2:] == ["executing", "executed"]
    began = workspace.events[-2].event
    assert began.command == toy_arm.TOY
    path = workspace.store.execution_folder(began.folder) / "executed.npz"
    assert len(np.load(path)["t"]) == 47
    with pytest.raises(TrialStateError, match="a plan runs once"):
        workspace.execute(1, settings, time_limit=60)
    assert toy_arm.motions(tmp_path / "arm") == 1


def test_a_rehearsal_is_no_trial(arm, tmp_path):
    workspace = arm()
    settings = workspace.manifest.driven_by
    result = workspace.execute(1, settings, time_limit=60, motion="rehearsal", speed=0.5)
    assert result.outcome == "done"
    assert result.tracking_max["rad"] < 1e-6
    assert kinds(workspace)[-2:] == ["moving", "moved"]
    assert workspace.state.trial(1).stage is Stage.ASKED
    assert workspace.session().state.readings_for(workspace.state.goals[-1], "") == []
    # The arm stands at the plan's end now.
    assert workspace.execute(1, settings, time_limit=60).outcome == "not_moved"
    assert workspace.execute(1, settings, time_limit=60, motion="approach").outcome == "done"
    assert workspace.execute(1, settings, time_limit=60).outcome == "done"
    assert toy_arm.motions(tmp_path / "arm") == 3
    began = [entry.event for entry in workspace.events if entry.kind == "moving"]
    assert [(event.motion, event.speed) for event in began] == [("rehearsal", 0.5), ("approach", 1)]


def test_an_arm_that_was_changed_since_a_person_saw_it_is_not_moved(arm, workspace, tmp_path):
    workspace = arm()
    seen = workspace.manifest.driven_by
    toy_arm.name_arm(workspace.folder, tmp_path / "arm", kind="faults")
    with pytest.raises(ConfigurationError, match="names another arm since"):
        workspace.execute(1, seen, time_limit=60)
    workspace = reopened(workspace)
    for call in (workspace.execute, workspace.look_at_arm):
        with pytest.raises(ConfigurationError, match="names another arm since"):
            call(1, seen, **({"time_limit": 60} if call == workspace.execute else {}))
    assert toy_arm.motions(tmp_path / "arm") == 0
    assert kinds(workspace)[-1] == "asked"


def test_an_arm_that_somebody_moves_is_not_connected_to_for_a_look(arm):
    workspace = arm()
    with executing_lock(), pytest.raises(TrialStateError, match="a motion is being executed"):
        workspace.look_at_arm(1, workspace.manifest.driven_by)


@pytest.mark.parametrize(("motion", "speed"), [("trial", 0.5), ("rehearsal", 1), ("rehearsal", 0)])
def test_only_a_rehearsal_is_slower(arm, motion, speed):
    workspace = arm()
    with pytest.raises(ConfigurationError, match="a rehearsal has a share"):
        workspace.execute(
            1, workspace.manifest.driven_by, time_limit=60, motion=motion, speed=speed
        )
    with pytest.raises(ConfigurationError, match=r"makes no approach; name the arm in \[arm\]"):
        workspace.execute(1, "true {plan}", time_limit=60, motion="approach")


def test_a_rehearsal_whose_program_was_killed_stays_in_the_journal(arm, tmp_path):
    workspace = arm(seconds=3.0)
    program = subprocess.Popen([
        sys.executable, "-c", "import sys\nfrom prior_reinforce.bench.workspace.workspace import "
        "Workspace\nwith Workspace(sys.argv[1]) as w: w.execute(1, w.manifest.driven_by, "
        "time_limit=60, motion='rehearsal', speed=0.5)", workspace.folder,
    ])  # fmt: skip
    wait_for((tmp_path / "arm" / "pose").exists)
    program.kill()
    program.wait()
    wait_for(lambda: not workspace.log.is_executing())
    assert kinds(workspace)[-1] == "moving"
    assert workspace.recover() is None
    assert workspace.state.trial(1).stage is Stage.ASKED


def test_closed_it_says_so_and_is_never_copied(workspace):
    session = workspace.session()
    for copied in (copy.deepcopy, pickle.dumps):
        for each in (workspace, session):
            with pytest.raises(WorkspaceError, match=r"not copied; open it again: Workspace\('"):
                copied(each)
    assert repr(workspace).endswith("planar': goal 1, trial 0)")
    workspace.close()
    for ask_it in (lambda: workspace.state, lambda: session.solved, session.ask):
        with pytest.raises(WorkspaceError, match="planar is closed; open it again"):
            ask_it()
    assert "is closed" in repr(workspace)


def test_it_is_made_as_new_makes_it(tmp_path, run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = {"robot": "ur5e", "gripper": "percent", "dt": 0.01, "tolerance": [0.02, 0.03]}
    Workspace.create("hoop", name="one", **given).close()
    said = (
        "--robot",
        "ur5e",
        "--gripper",
        "percent",
        "--dt",
        "0.01",
        "--tolerance",
        "0.02",
        "0.03",
    )
    assert run("new", "other", "--name", "one", *said)[0] == 0
    assert Path("hoop/workspace.toml").read_text() == Path("other/workspace.toml").read_text()
    with pytest.raises(ConfigurationError, match="--gripper adds a column"):
        Workspace.create("third", robot="none", gripper="percent")


@pytest.mark.parametrize("names", [None, ["joint1", "joint2"], ["joint2", "joint1"]])
def test_an_arm_may_be_known_by_its_first_recordings(tmp_path, names):
    recordings(tmp_path / "throws")
    with Workspace.create(tmp_path / "hoop", robot="none", dt=0.02) as workspace:
        options = {} if names is None else {"joints": names}
        result = workspace.import_recordings(tmp_path / "throws", **options)
        expected = tuple(names or ("joint1", "joint2"))
        assert workspace.manifest.format.names == expected == result.demonstrations.format.names
        assert workspace.manifest.format.units == ("rad",) * len(expected)
        workspace.learn("nearest")
        workspace.set_goal([0.9, 0.0])
        trial = workspace.session().ask()
        assert workspace.plan(trial).format.names == expected
    with Workspace(tmp_path / "hoop") as workspace:
        assert workspace.session().ask().plan.shape[1] == len(expected)


def test_recordings_are_taken_in_as_the_command_does(tmp_path, run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings(tmp_path / "throws")
    how = {"robot": "none", "action_names": ["joint1", "joint2"], "dt": 0.02}
    for name in ("one", "other"):
        Workspace.create(name, **how).close()
    with Workspace("one") as workspace:
        result = workspace.import_recordings("throws")
        assert result._repr_html_().startswith("<pre>episodes    4 from throws (npz)")
        assert repr(result) == "ImportResult(4 of throws (npz))"
        with pytest.raises(InvalidDemonstrationsError, match=r"twice|identical|same"):
            workspace.import_recordings("throws", append=True)
        python = [e.event for e in workspace.events]
    assert run("import", "other", "throws")[0] == 0
    with Workspace("other") as workspace:
        assert [e.event for e in workspace.events] == python


def test_where_it_stands_reports_and_exports(workspace, tmp_path):
    trial = ask(workspace)
    status = workspace.status()
    assert repr(status) == status.text
    assert status._repr_html_().startswith("<pre>task")
    assert (status.solved, status.open_trial.number, status.goals[0].told) == (False, 1, 0)
    assert workspace.export(1, tmp_path / "plan.csv").path.is_file()
    with pytest.raises(TrialStateError):
        workspace.export(2, tmp_path / "none.csv")
    tell(workspace, trial.number, "hit")
    assert workspace.report() == workspace.folder / "report" / "report.html"

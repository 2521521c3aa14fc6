"""Executing by a command: real processes, no shell, a time limit that holds."""

import json
import os
import shlex
import sys
import time

import numpy as np
import pytest
from msgspec import to_builtins

from prior_reinforce.arm.executing.command import execute_command, run_command
from prior_reinforce.arm.executing.lock import executing_lock
from prior_reinforce.arm.executing.supervision import Interruptions
from prior_reinforce.arm.robots.plan_files import write_plan
from prior_reinforce.errors import ConfigurationError, FileFormatError, TrialStateError
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat

PYTHON = sys.executable


@pytest.fixture
def plan_file(tmp_path):
    folder = tmp_path / "it's; touch $(oops)"
    folder.mkdir()
    plan = Plan(np.zeros((5, 2)), PlanFormat(("a", "b"), ("rad", "rad"), 0.01))
    return write_plan(plan, folder / "plan 1.npz")


def test_a_controller_reads_the_plan(plan_file):
    code = "import sys, numpy; print(numpy.load(sys.argv[1])['q'].shape)"
    result = run_command(f'{PYTHON} -c "{code}" {{plan}}', plan_file, time_limit=30)
    assert result.succeeded
    assert result.exit_status == 0
    assert result.output_tail.strip() == "(5, 2)"
    assert "command" not in json.loads(json.dumps(to_builtins(result)))  # it may hold passwords


def test_no_shell_is_asked(plan_file, tmp_path):
    code = "import sys; print(sys.argv[1:])"
    result = run_command(
        f'{PYTHON} -c "{code}" {{plan}} "; touch {tmp_path}/made" "$HOME"', plan_file, time_limit=30
    )
    assert "$HOME" in result.output_tail
    assert not (tmp_path / "made").exists()


def test_exit_status_and_output_of_a_failure(plan_file):
    code = "import sys; print('joint 4', flush=True); sys.exit('reflex: velocity')"
    result = run_command(f'{PYTHON} -c "{code}" {{plan}}', plan_file, time_limit=30)
    assert result.exit_status == 1
    assert not result.succeeded
    assert result.output_tail == "joint 4\nreflex: velocity\n"


def test_a_signal_is_recorded(plan_file):
    code = "import os; os.kill(os.getpid(), 9)"
    assert run_command(f'{PYTHON} -c "{code}" {{plan}}', plan_file, time_limit=30).exit_status == -9


def test_only_the_end_of_long_output_is_kept(plan_file):
    code = "print('x' * 100000 + 'last')"
    result = run_command(f'{PYTHON} -c "{code}" {{plan}}', plan_file, time_limit=30)
    assert len(result.output_tail) == 4000
    assert result.output_tail.endswith("last\n")


def running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    # A killed orphan may wait for its new parent to collect it.
    with open(f"/proc/{pid}/stat") as file:
        return file.read().rsplit(")", 1)[1].split()[0] != "Z"


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="looks at processes through /proc")
def test_the_time_limit_stops_the_command_and_what_it_started(plan_file):
    # The child ignores the polite signal, as a hung driver would. A shell is there long before the
    # time limit, however busy the machine.
    code = "(trap '' TERM; exec sleep 60) & echo $!; exec sleep 60"
    start = time.monotonic()
    result = run_command(f'sh -c "{code}" {{plan}}', plan_file, time_limit=1.0)
    assert result.timed_out
    assert not result.succeeded
    assert result.exit_status == -15
    assert time.monotonic() - start < 30
    deadline = time.monotonic() + 10
    while running(int(result.output_tail)) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not running(int(result.output_tail))


def test_what_a_shell_leaves_behind_has_time_to_come_to_rest(plan_file, tmp_path):
    # The shell goes at the polite signal; its driver needs half a second to bring the arm to rest.
    rested = tmp_path / "rested"
    driver = f"trap 'sleep 0.5; touch {rested}; exit' TERM; while :; do sleep 0.05; done"
    script = tmp_path / "drive.sh"
    script.write_text(f'sh -c "{driver}" &\nwait\n')
    assert run_command(f"sh {script} {{plan}}", plan_file, time_limit=1.0).timed_out
    assert rested.exists()


def test_a_changed_plan_does_not_run(plan_file, tmp_path):
    plan_file.path.chmod(0o644)
    plan_file.path.write_bytes(b"other")
    with pytest.raises(FileFormatError, match="SHA-256"):
        run_command(f"touch {tmp_path}/ran {{plan}}", plan_file, time_limit=30)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("controller", "hold {plan}"),
        ("", "hold {plan}"),
        ("{plan}", "name a program"),
        ('controller "{plan}', "close its quotes"),
        ("no-such-program-anywhere {plan}", "cannot start"),
    ],
)
def test_commands_that_cannot_run(plan_file, command, says):
    with pytest.raises(ConfigurationError, match=says):
        run_command(command, plan_file, time_limit=1)


def test_a_program_that_the_system_cannot_start_is_named(plan_file, tmp_path):
    program = tmp_path / "driver"
    program.write_text("#!/no/such/interpreter")
    program.chmod(0o755)
    with pytest.raises(ConfigurationError, match=r"cannot start .*No such file .*that can run"):
        run_command(f"{program} {{plan}}", plan_file, time_limit=30)


def test_who_is_interrupted_before_it_runs_runs_nothing(plan_file, tmp_path):
    result, ran = tmp_path / "result", tmp_path / "ran"
    result.mkdir()
    noted = Interruptions()
    noted.came = True
    with pytest.raises(KeyboardInterrupt), executing_lock() as lock, noted:
        execute_command(
            f"touch {ran} {{plan}}",
            plan_file,
            result,
            time_limit=30,
            lock=lock,
            interruptions=noted,
        )
    assert not ran.exists()


def test_who_is_interrupted_while_it_runs_hears_of_it_once_all_has_ended(plan_file, tmp_path):
    command = f"sh -c 'kill -INT {os.getpid()}; sleep 60; touch {tmp_path}/ran' sh {{plan}}"
    with pytest.raises(KeyboardInterrupt):
        run_command(command, plan_file, time_limit=120)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf")])
def test_the_time_limit_is_checked(plan_file, limit):
    with pytest.raises(ConfigurationError, match="time limit"):
        run_command("true {plan}", plan_file, time_limit=limit)


@pytest.mark.parametrize("deed", ["chmod u+w $0; echo x > $0", "rm -f $0; echo x > $0"])
def test_a_plan_that_is_changed_on_its_way_is_not_done(plan_file, deed):
    result = run_command(f"sh -c '{deed}' {{plan}}", plan_file, time_limit=30)
    assert result.outcome == "aborted"
    assert "changed while it was executed" in result.reason
    plan_file.verify()  # the plan itself is out of its reach


def test_a_driver_reads_what_was_checked(plan_file):
    """Though the plan's file is replaced before the driver looks."""
    other = "import os, sys, numpy; os.unlink(sys.argv[2]); open(sys.argv[2], 'w').close()"
    code = f"{other}; print(numpy.load(sys.argv[1])['q'].shape)"
    path = shlex.quote(str(plan_file.path))
    result = run_command(f'{PYTHON} -c "{code}" {{plan}} {path}', plan_file, time_limit=30)
    assert (result.outcome, result.output_tail) == ("done", "(5, 2)\n")


def test_one_motion_at_a_time(plan_file):
    code = "import os, sys; print(os.environ.get('PRIOR_REINFORCE_EXECUTION'))"
    assert (
        "arm-"
        in run_command(f'{PYTHON} -c "{code}" {{plan}}', plan_file, time_limit=30).output_tail
    )
    with executing_lock():
        with pytest.raises(TrialStateError, match="right now"):
            run_command("true {plan}", plan_file, time_limit=30)
        assert run_command("true {plan}", plan_file, time_limit=30, arm="left").succeeded


def test_a_drivers_reason_moves_no_cursor(plan_file):
    said = {"outcome": "aborted", "reason": "\x1b[2J\nnext: x"}
    code = f"import json, sys; json.dump({said!r}, open(sys.argv[2] + '/result.json', 'w'))"
    command = f"{PYTHON} -c {shlex.quote(code)} {{plan}} {{result}}"
    result = run_command(command, plan_file, time_limit=30)
    assert result.reason == "\\x1b[2J\\nnext: x"

"""The report of a workspace."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from prior_reinforce.arm.robots.report import LimitLine, LimitReport
from prior_reinforce.arm.workspace.report import _checks
from prior_reinforce.session.trials import Stage, Trial


def test_the_report_shows_every_goal_and_the_voided_trials(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    run("tell", folder, 1, "--error", "3cm long")
    run("ask", folder)
    run("void", folder, 2, "--reason", "ball slipped")
    run("goal", folder, "0.95", "-0.05", "--memory", "workspace")
    run("ask", folder)
    status, out, _ = run("report", folder)
    assert status == 0
    page = (tmp_path / "planar" / "report" / "report.html").read_text()
    assert out == "report: planar/report/report.html\n"
    for text in ("Goal 1", "Goal 2", "ball slipped", "3cm long", "Arrows lead from goals"):
        assert text in page
    path = next((tmp_path / "planar" / "plans").glob("trial-001*"))
    path.chmod(0o644)
    path.write_bytes(path.read_bytes()[:-20])
    assert run("ask", folder)[0] == 0  # goes on, for that trial was told
    assert run("report", folder)[0] == 0
    page = (tmp_path / "planar" / "report" / "report.html").read_text()
    assert "the plan of trial 1 is not drawn" in page
    assert path.name in page
    path.unlink()
    run("void", folder, 1)
    assert run("report", folder)[0] == 0


def test_goals_are_called_what_status_calls_them_and_none_is_left_out_without_a_word(
    run, folder, tmp_path
):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    run("tell", folder, 1, "--error", "3cm long")
    run("goal", folder, "0.85", "0.05")
    run("goal", folder, "0.95", "-0.05")
    run("ask", folder)
    assert run("report", folder)[0] == 0
    page = (tmp_path / "planar" / "report" / "report.html").read_text()
    for text in (
        "0 of 1 goal reached",
        "Left out, with no trial that counts: Goal 3.",
        "No plan was given for goal 2.",
        "trial 2 waits to be executed",
        "<dd>by goal 3</dd>",  # goal 1 had no earlier trials
    ):
        assert text in page
    names = {path.name for path in (tmp_path / "planar" / "report").glob("*-table.svg")}
    assert names == {"goal-1-table.svg", "goal-3-table.svg"}


def test_an_aborted_execution_is_said_as_status_says_it(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    said = run("ask", folder, "--yes", "--run", "false {plan}")
    assert said[0] == 1
    assert "executed, but aborted: the command ended" in run("status", folder)[1]
    run("report", folder)
    page = (tmp_path / "planar" / "report" / "report.html").read_text()
    assert "executed, but aborted: the command ended" in page
    assert "trial 1 waits to be told" in page


_DRIVER = """
import pathlib, sys, numpy
plan = numpy.load(sys.argv[1])
numpy.savez(pathlib.Path(sys.argv[2]) / "executed.npz", t=plan["t"], q=plan["q"] + 0.002)
"""


def test_amendments_hardware_seed_paths_and_photographs_are_reported(run, folder, tmp_path):
    (tmp_path / "driver.py").write_text(_DRIVER)
    run("goal", folder, "0.9", "0.05", "--new-hardware", "smaller ball")
    driver = f"{sys.executable} driver.py {{plan}} {{result}}"
    assert run("ask", folder, "--yes", "--run", driver)[0] == 0
    run("tell", folder, 1, "30cm long")
    run("amend", folder, 1, "3cm long")
    pictures = tmp_path / "planar" / "pictures"
    pictures.mkdir()
    Image.new("RGB", (8, 8)).save(pictures / "trial-001-seen.png")
    (pictures / "trial-002-seen.png").symlink_to("/etc/passwd")
    run("ask", folder)
    assert run("report", folder)[0] == 0
    page = (tmp_path / "planar" / "report" / "report.html").read_text()
    for text in (
        "new on the hardware: smaller ball",
        "Trial 1 was corrected on 20",
        "before: 30cm long.",
        "Trial 1 went 0.002 rad rms off its plan, as measured.",
        "Dotted: the path that was measured on the arm",
        "Trial 1, as it was looked at.",
        "seed 0",
        "Trials made",
        "A hit, to go",
    ):
        assert text in page
    assert "Trial 2, as it was looked at." not in page
    next((tmp_path / "planar" / "executions").glob("*/executed.npz")).write_bytes(b"no npz")
    assert run("report", folder)[0] == 0
    page = (tmp_path / "planar" / "report" / "report.html").read_text()
    assert "the path of trial 1 is not drawn" in page


def test_a_surprise_is_said_by_every_command_until_it_is_amended(run, folder, tmp_path):
    odd = "from the prediction (a typo? amend 3; other hardware? goal --new-hardware)"
    run("goal", folder, "0.9", "0.05")
    for number in ("1", "2"):
        run("ask", folder)
        assert "standard deviations" not in run("tell", folder, number, "--hit")[1]
    run("ask", folder)
    assert odd in run("tell", folder, "3", "20cm long, 20cm left")[1]
    assert odd in run("status", folder)[1]
    assert odd in run("ask", folder)[1]
    run("report", folder)
    page = tmp_path / "planar" / "report" / "report.html"
    assert odd in page.read_text()
    said = run("amend", folder, "3", "2cm long")
    assert said[0] == 0
    assert odd not in said[1]
    assert odd not in run("status", folder)[1]
    run("report", folder)
    assert odd not in page.read_text()


def trial(number, **lines):
    """A trial whose gate said this of each check: its status and margin."""
    said = [
        LimitLine(check=check, status=status, margin=margin, text=f"{check} of {number}")
        for check, (status, margin) in lines.items()
    ]
    gate = LimitReport("arm", "any", "a manual", tuple(said)).as_json()
    return Trial(number, 1, np.zeros(2), stage=Stage.ASKED, gate=gate)


def test_the_plan_that_came_nearest_to_a_limit_is_shown():
    trials = [
        trial(1, velocity=("pass", 0.5), jerk=("warn", 0.1), box=("unchecked", None)),
        trial(2, velocity=("pass", 0.2), jerk=("pass", 0.05), box=("pass", 0.3)),
        Trial(3, 1, np.zeros(2), stage=Stage.ASKED),
    ]
    rows = [(row.check, row.status, row.trial) for row in _checks(trials)]
    assert rows == [("velocity", "pass", 2), ("jerk", "warn", 1), ("box", "pass", 2)]


@pytest.mark.slow
def test_two_reports_at_once_are_both_whole(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    program = [sys.executable, "-m", "prior_reinforce.cli", "report", folder]
    both = [subprocess.Popen(program, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    said = [program.communicate()[1] for program in both]
    assert [program.returncode for program in both] == [0, 0], said
    report = tmp_path / "planar" / "report"
    assert "</html>" in (report / "report.html").read_text()
    assert not list(report.glob(".unfinished*"))

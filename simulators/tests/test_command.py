"""`python -m simulators`: an arm that is not there."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.simulation.tasks import make_task
from simulators.__main__ import main


@pytest.fixture
def simulate(capsys):
    """Call the command; its exit status, and what it printed and complained of."""

    def call(*args):
        status = main([*args])
        said = capsys.readouterr()
        return status, said.out, said.err

    return call


def test_its_recordings_are_six_throws_that_can_be_imported(run, simulate, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert simulate("fr3", "--recordings", "throws")[0] == 0
    rows = list(csv.reader((tmp_path / "throws" / "outcomes.csv").read_text().splitlines()))
    assert rows[0] == ["episode", "x", "y"]
    task = make_task("basketball-fr3")
    demos = task.demonstrations("A")
    told = np.array([row[1:] for row in rows[1:]], float)
    undisturbed = [each.outcome for each in task.rollout(demos.plans, None)]
    assert told == pytest.approx(np.array(undisturbed), abs=3e-3)  # contact
    for i, plan in enumerate(demos.plans, start=1):
        with np.load(tmp_path / "throws" / f"throw-{i}.npz") as recorded:
            t, q = recorded["t"], recorded["q"]
        at = np.stack([np.interp(t, np.arange(len(plan)) * task.format.dt, c) for c in plan.T], 1)
        assert np.abs(q - at).max() < 0.005
    assert run("new", "hoop", "--robot", "fr3")[0] == 0
    assert run("import", "hoop", "throws")[0] == 0
    with Workspace("hoop") as workspace:
        assert workspace.demonstrations.n == 6


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (("--goal", "1.0"), "--goal needs 2 numbers"),
        (("--recordings", "."), "choose an empty or a new folder"),
        (("--task", "so101"), "is no task of this arm; choose basketball-fr3"),
    ],
)
def test_what_it_cannot_do_is_said_in_a_line(simulate, tmp_path, monkeypatch, flags, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").touch()
    status, _, err = simulate("fr3", *flags)
    assert status == 2
    assert says in err


def test_an_so101_is_recorded_with_record(simulate, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, _, err = simulate("so101", "--recordings", "throws")
    assert status == 2
    assert "record an so101 with: record" in err


def lines_of(served, wanted):
    """Lines until one that matches, which comes last."""
    lines = []
    while not (lines and re.search(wanted, lines[-1])):
        lines.append(served.stdout.readline())
        assert lines[-1], "the simulated arm ended"
    return lines


@pytest.mark.slow
def test_an_so101_goes_from_six_recorded_throws_to_a_hit(run, lerobot, tmp_path, monkeypatch):
    """The sequence of docs/lerobot.md, through LeRobot's own class."""
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, "-m", "simulators", "so101"]
    flags = ["--hand", "--lock-step", "--goal", "0.46", "0.08"]
    served = subprocess.Popen([*command, *flags], stdout=subprocess.PIPE, text=True)
    try:
        *section, _ = lines_of(served, "is served")
        assert run("new", "hoop", "--robot", "so101", "--dt", "0.02", "--tolerance", "0.02")[0] == 0
        with Path("hoop/workspace.toml").open("a") as manifest:
            manifest.write("".join(["\n", *section, f'python = "{lerobot}"\n']))
        record = ("record", "hoop", "--takes", "6", "--seconds", "1.7", "--pause", "3.8", "--yes")
        _, _, err = run(*record)
        assert "no outcomes for episodes take-1, take-2, take-3, take-4, take-5, take-6," in err
        rows = ["episode,x,y"]
        for i in range(1, 7):
            place = re.findall(r"[xy] (-?[\d.]+) m", lines_of(served, "came down")[-1])
            rows.append(f"take-{i},{','.join(place)}")
        Path("hoop/recordings/1/outcomes.csv").write_text("\n".join(rows))
        assert run("import", "hoop", "hoop/recordings/1")[0] == 0
        assert run("learn", "hoop")[0] == 0
        assert run("goal", "hoop", "46cm", "8cm")[0] == 0
        for trial in range(1, 5):
            status, said, err = run("ask", "hoop", "--execute", "--approach", "--yes")
            assert status == 0, err
            assert float(re.search(r"at most ([\d.]+) rad off the plan", said)[1]) < 0.02
            seen = lines_of(served, "came down")[-1]
            hit = seen.rstrip().endswith("a hit")
            words = re.search(r"by eye, of --goal: (.*?)(, a hit)?$", seen)[1]
            answer = ["--hit"] if hit else ["--error", words]
            assert run("tell", "hoop", str(trial), *answer)[0] == 0
            if hit:
                break
        assert hit
    finally:
        served.terminate()
        served.wait(20)
        served.stdout.close()

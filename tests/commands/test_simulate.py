"""`simulate`: an arm that is not there."""

import csv

import numpy as np
import pytest

from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.lab.tasks import make_task


def test_its_recordings_are_six_throws_that_can_be_imported(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("simulate", "fr3", "--recordings", "throws")[0] == 0
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
        (("--task", "zoo-swing"), "is no task of this arm"),
        (("--goal", "1.0"), "--goal needs 2 numbers"),
        (("--recordings", "."), "choose an empty or a new folder"),
    ],
)
def test_what_it_cannot_do_is_said_in_a_line(run, tmp_path, monkeypatch, flags, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").touch()
    status, _, err = run("simulate", "fr3", *flags)
    assert status == 2
    assert says in err

"""A tracker's table tells the trials that wait for it, and nothing twice."""

import numpy as np
import pandas as pd
import pytest

from prior_reinforce.bench.workspace.workspace import Workspace


def asked(run, folder):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)


def state(folder):
    with Workspace(folder) as workspace:
        return workspace.events


def errors(folder):
    with Workspace(folder) as workspace:
        return [t.error_seen for t in workspace.session().trials if t.error_seen is not None]


def test_a_trackers_table_tells_trial_by_trial(run, folder, tmp_path):
    asked(run, folder)
    tracker = tmp_path / "tracker.csv"
    tracker.write_text("trial;x [cm];y [mm];frame\n1;95,0;30;1032\n")
    status, out, _ = run("tell", folder, "--from", tracker)
    assert status == 0
    assert "trial 1: 5 cm long, 2 cm right" in out
    run("ask", folder)
    tracker.write_text(tracker.read_text() + "2;88,0;55;2011\n3;;;\n")
    assert "trial 2: 2 cm short" in run("tell", folder, "--from", tracker)[1]
    np.testing.assert_allclose(errors(folder), [[0.05, -0.02], [-0.02, 0.005]], atol=1e-9)
    before = state(folder)
    assert "says nothing that was not told already" in run("tell", folder, "--from", tracker)[1]
    assert state(folder) == before


def test_words_and_hits_stand_in_a_table_too(run, folder, tmp_path):
    asked(run, folder)
    frame = pd.DataFrame({"Trial": [1], "said": ["5cm long, 2cm left"], "hit": ["no"]})
    frame.to_excel(tmp_path / "notes.xlsx", index=False)
    assert "5cm long, 2cm left" in run("tell", folder, "--from", tmp_path / "notes.xlsx")[1]
    run("ask", folder)
    (tmp_path / "hits.csv").write_text("trial,said,hit\n2,,yes\n")
    assert "reached" in run("tell", folder, "--from", tmp_path / "hits.csv")[1]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a,b\n1,2\n", "expected column names such as trial,x,y"),
        ("trial,x\n1,0.9\n", "it has x, and no column for each of x, y"),
        ("trial,q\n1,0.9\n", "no column for each of x, y, nor one called said"),
        ("trial,x,y\n1,95,3\n", "x reaches 95, too far for an arm: it looks like cm"),
        ("trial,x,y\n1,far,0\n", "line 2: x is 'far', expected a finite number"),
        ("trial,x,y,hit\n1,0.9,0,perhaps\n", "hit is 'perhaps', expected yes or no"),
        ("trial,x,y\nnan,0.9,0\n", "trial is nan, expected its number"),
        ("trial,x,y\n7,0.9,0\n", "7"),
        ("trial,said\n1,green\n", "cannot read 'green'"),
    ],
)
def test_what_a_table_cannot_say_changes_nothing(run, folder, tmp_path, text, says):
    asked(run, folder)
    before = state(folder)
    (tmp_path / "t.csv").write_text(text)
    status, _, err = run("tell", folder, "--from", tmp_path / "t.csv")
    assert status == 2
    assert says in err
    assert state(folder) == before


def test_what_was_told_otherwise_is_not_overwritten(run, folder, tmp_path):
    asked(run, folder)
    run("tell", folder, 1, "5cm long")
    (tmp_path / "t.csv").write_text("trial,x,y\n1,0.90,0.05\n")
    status, _, err = run("tell", folder, "--from", tmp_path / "t.csv")
    assert status == 2
    assert "trial 1 was told otherwise; correct it with: prior-reinforce amend" in err
    run("void", folder, 1)
    assert run("tell", folder, "--from", tmp_path / "t.csv")[0] == 0


def test_a_table_goes_alone(run, folder, tmp_path):
    asked(run, folder)
    (tmp_path / "t.csv").write_text("trial,x,y\n1,0.90,0.05\n")
    assert "drop what else was given" in run("tell", folder, 1, "--from", tmp_path / "t.csv")[2]
    assert "no table at" in run("tell", folder, "--from", "gone.csv")[2]

"""`ask` and `export`: where plans go, and what runs them."""

import pytest

from prior_reinforce.trials import Stage
from prior_reinforce.workspace.workspace import Workspace
from tests.workspace.planar import events_in, trials_in


@pytest.mark.parametrize(
    ("flags", "remedy"),
    [
        (("--out", "plan.txt"), "end the name in"),
        (("--out", "nowhere/plan.csv"), "make the folder first"),
        (("--out", "plan.csv", "--rate", "1e12"), "up to 100000"),
        (("--out", "plan.csv", "--rate", "nan"), "up to 100000"),
        (("--run", "true {plan}", "--rate", "1000"), "--run is given the plan's own frames"),
        (("--run", "true"), "hold {plan}"),
        (("--run", "no-such-controller {plan}"), "give the path of a program"),
        (("--run", "true {plan}", "--time-limit", "0"), "must be a positive number"),
    ],
)
def test_what_ask_cannot_do_is_said_before_a_trial_is_made(run, folder, flags, remedy):
    run("goal", folder, "0.9", "0.05")
    before = events_in(folder)
    status, out, err = run("ask", folder, *flags)
    assert (status, out) == (2, "")
    assert remedy in err
    assert len(err.splitlines()) == 1
    assert events_in(folder) == before


def test_a_plan_can_be_put_elsewhere_trial_by_trial(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    for number in (1, 2):
        assert run("ask", folder, "--out", "plan-{trial}.csv")[0] == 0
        assert run("ask", folder, "--out", ".")[0] == 0
        run("tell", folder, number, "--error", "3cm long")
    assert sorted(path.name for path in tmp_path.glob("*-*")) == [
        *("plan-1.csv", "plan-2.csv", "trial-1.npz", "trial-2.npz")
    ]
    before = events_in(folder)
    status, out, err = run("ask", folder, "--out", "plan-1.csv")
    assert (status, out) == (2, "")
    assert "plan-1.csv is there already" in err
    assert "{trial}" in err
    (tmp_path / "plan-3.csv").touch()
    _, _, err = run("ask", folder, "--out", "plan-{trial}.csv")
    assert err.endswith("choose another name\n")
    assert events_in(folder) == before


def test_a_command_that_fails_is_told_by_the_status(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    script = tmp_path / "arm.py"
    script.write_text("import sys; print('moved', sys.argv[1][-4:]); sys.exit(int(sys.argv[2]))")
    status, out, err = run("ask", folder, "--run", f"python3 {script} {{plan}} 3")
    assert status == 1
    assert "moved .npz" in out
    assert "ended with status 3" in err
    assert "prior-reinforce void planar 1" in err
    status, out, err = run("ask", folder, "--run", f"python3 {script} {{plan}} 0")
    assert status == 2
    assert "a plan runs once" in err
    assert "it was executed already" in run("ask", folder)[1]
    run("void", folder, 1)
    status, out, _ = run("ask", folder, "--run", f"python3 {script} {{plan}} 0")
    assert status == 0
    assert "next: prior-reinforce tell planar 2" in out


def cut_off(folder):
    with Workspace(folder) as workspace, workspace.log.journal.exclusive():
        # What is written before the program dies.
        workspace.log.journal.append("executing", {"trial": 1, "command": "arm {plan}"})


@pytest.mark.parametrize(("answer", "stage"), [("no", "asked"), ("yes", "executing")])
def test_a_cut_off_execution_asks_whether_the_arm_moved(run, folder, monkeypatch, answer, stage):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    cut_off(folder)
    status, _, err = run("ask", folder)
    assert status == 2
    assert "did the arm move?" in err
    answers = iter(["perhaps", answer])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("builtins.input", lambda question: next(answers))
    status, out, _ = run("ask", folder)
    assert status == (0 if answer == "no" else 1)
    assert trials_in(folder)[0].stage is Stage(stage)
    assert ("plan: " in out) == (answer == "no")


def test_export_writes_what_was_handed_out(run, folder):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    status, out, _ = run("export", folder, 1, "plan.npz")
    assert status == 0
    assert trials_in(folder)[0].kept["plan_sha256"] in out

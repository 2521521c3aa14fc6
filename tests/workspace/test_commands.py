"""The commands of a workspace through the installed entry point: what is printed, how it ends."""

import json
import os
import shutil

import numpy as np
import pytest
from planar import demonstrations

from prior_reinforce.cli import main
from prior_reinforce.trials import Stage
from prior_reinforce.workspace.workspace import Workspace

NEW = (
    "--action-names", "joint1", "joint2", "--dt", "0.02", "--robot", "none",
)  # fmt: skip


@pytest.fixture
def folder(learned_folder, tmp_path, monkeypatch):
    shutil.copytree(learned_folder, tmp_path / "planar")
    monkeypatch.chdir(tmp_path)
    return "planar"


@pytest.fixture
def run(capsys):
    def call(*args):
        status = main([str(arg) for arg in args])
        said = capsys.readouterr()
        return status, said.out, said.err

    return call


def recordings(folder, outcomes=range(4)):
    folder.mkdir()
    demos = demonstrations()
    for i, plan in enumerate(demos.plans):
        t = np.arange(len(plan)) * 0.02
        np.savez(folder / f"throw_{i}.npz", t=t, q=plan, joint_names=["joint1", "joint2"])
    rows = [f"{i},{x},{y}" for i, (x, y) in enumerate(demos.outcomes_seen) if i in outcomes]
    if rows:
        (folder / "outcomes.csv").write_text("\n".join(["episode,x,y", *rows]))


def trials(folder):
    workspace = Workspace(folder)
    session = workspace.session()
    found = [trial for goal in session.goals for trial in session.trials_of(goal.number)]
    workspace.close()
    return found


def journal(folder):
    workspace = Workspace(folder)
    events = workspace.events
    workspace.close()
    return events


def test_new_import_learn_and_what_comes_next(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings(tmp_path / "recordings")
    status, out, _ = run("new", "hoop", *NEW)
    assert status == 0
    assert "next: prior-reinforce import hoop RECORDINGS" in out
    status, out, _ = run("import", "hoop", "recordings")
    assert status == 0
    assert "episodes    4 from recordings" in out
    assert "next: prior-reinforce learn hoop" in out
    assert (tmp_path / "hoop" / "demonstrations.png").stat().st_size > 10_000
    small = "diffusion,training_steps=2,sampling_steps=2"
    status, out, _ = run("learn", "hoop", "--generator", small)
    assert status == 0
    assert "next: prior-reinforce goal hoop X Y" in out


def test_an_afternoon(run, folder):
    assert run("goal", folder, "0.9", "-0.05")[1].startswith("goal 1: 90 cm ahead, 5 cm right")
    status, out, _ = run("ask", folder, "--out", "plan.csv")
    assert status == 0
    assert "no limits checked" in out
    assert 'next: prior-reinforce tell planar 1 --error "5cm long, 2cm left"' in out
    assert run("tell", folder, 1, "--error", "5cm", "long,", "2cm", "left")[0] == 0
    _, out, _ = run("amend", folder, 1, "--error", "-0.05", "0.02")
    assert "trial 1, corrected: 5 cm short, 2 cm left" in out
    run("ask", folder)
    status, out, _ = run("void", folder, 2, "--reason", "ball slipped")
    assert "trial 2: void: ball slipped" in out
    run("ask", folder)
    _, out, _ = run("tell", folder, 3, "--outcome", "0.93", "-0.05")
    assert "trial 3: 3 cm long" in out
    run("ask", folder)
    _, out, _ = run("tell", folder, 4, "--hit")
    assert "trial 4: reached" in out
    _, out, _ = run("status", folder)
    assert "reached, N = 4 demonstrations + 3 trials = 7" in out
    assert len(out.splitlines()) <= 10
    assert "this trial repeats it" in run("ask", folder)[1]
    run("void", folder, 5)
    _, out, _ = run("log", folder)
    kinds = [json.loads(line)["kind"] for line in out.splitlines()]
    assert kinds[2:6] == ["goal_set", "asked", "told", "amended"]


@pytest.mark.parametrize(
    "args", [("log", "planar"), ("status", "planar"), ("goal", "planar", "0.9", "0")]
)
@pytest.mark.parametrize("buffering", [1, -1])
def test_a_reader_may_leave_before_the_end(folder, monkeypatch, capsys, args, buffering):
    """Line by line, printing itself fails; buffered, nothing does before the end."""
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w", buffering) as nobody_reads, monkeypatch.context() as patched:
        patched.setattr("sys.stdout", nobody_reads)
        assert main(args) == 141
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("said", "seen"),
    [
        (("--error", "0.05", "-0.02"), [0.05, -0.02]),
        (("--error", "-0.05", "-0.02"), [-0.05, -0.02]),
        (("--error=-0.05 0.02",), [-0.05, 0.02]),
        (("--error", "-.05,0.02"), [-0.05, 0.02]),
        (("--error", "-1e-2", "0"), [-0.01, 0.0]),
        (("--error", "5cm short and 2 cm right"), [-0.05, -0.02]),
        (("--error", "120cm long"), [1.2, 0.0]),
        (("--error", "hit"), [0.0, 0.0]),
        (("--error", "0"), [0.0, 0.0]),
        (("--outcome", "0.9", "-0.1"), [0.0, -0.15]),
        (("--hit",), [0.0, 0.0]),
        (("--error", "2cm long", "--hit"), [0.02, 0.0]),
    ],
)
def test_an_error_can_be_told_in_many_ways(run, folder, said, seen):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    assert run("tell", folder, 1, *said)[0] == 0
    (trial,) = trials(folder)
    np.testing.assert_allclose(trial.error_seen, seen, atol=1e-12)
    assert trial.hit == (np.linalg.norm(seen) <= 0.015 or "--hit" in said)


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ((), "--error or --outcome"),
        (("--error", "5", "-2"), "looks like centimetres"),
        (("--outcome", "92", "10"), "looks like centimetres"),
        (("--error", "0.05"), "needs 2 numbers"),
        (("--error", "nan", "0"), "void the trial"),
        (("--error", "0.05 long"), "say m, cm or mm"),
        (("--error", "5cm far"), "write a length and one of long, short"),
        (("--error", "50m long"), "say it again, in cm"),
        (("--error", "0.05", "0", "--outcome", "0.9", "0"), "--error or --outcome"),
        (("--outcome", "0.9"), "needs 2 numbers"),
        (("--hit", "--miss"), "--hit alone"),
    ],
)
def test_what_cannot_be_told_is_one_line_and_changes_nothing(run, folder, said, remedy):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    before = journal(folder)
    status, out, err = run("tell", folder, 1, *said)
    assert (status, out) == (2, "")
    assert remedy in err
    assert len(err.splitlines()) == 1
    assert journal(folder) == before


@pytest.mark.parametrize(
    "args",
    [
        ("tell", "planar", "1", "--hit"),
        ("amend", "planar", "0", "--hit"),
        ("void", "planar", "-1"),
        ("export", "planar", "3", "plan.csv"),
        ("ask", "planar"),
        ("report", "planar"),
        ("learn", "planar", "--task", "curling"),
        ("goal", "planar", "0.9", "0", "--adapter", "spline"),
        ("goal", "planar", "0.9"),
        ("goal", "planar", "nan", "0"),
        ("goal", "planar", "x", "y"),
        ("status", "nowhere"),
        ("import", "planar", "nowhere"),
        ("new", "planar"),
        ("new", "other", "--tolerance", "-1"),
        ("new", "other", "--dt", "inf"),
        ("new", "other", "--action-names", "a", "a"),
        ("new", "other", "--outcome-names", "x", "y", "z", "--outcome-units", "m", "m"),
    ],
)
def test_bad_input_ends_with_status_2_and_leaves_nothing_behind(folder, capsys, tmp_path, args):
    before = journal(folder)
    try:
        status = main(args)
    except SystemExit as end:  # tyro's own, for what is no number
        status = end.code
    assert status == 2
    assert capsys.readouterr().err
    assert journal(folder) == before
    assert not (tmp_path / "other").exists()


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
    before = journal(folder)
    status, out, err = run("ask", folder, *flags)
    assert (status, out) == (2, "")
    assert remedy in err
    assert len(err.splitlines()) == 1
    assert journal(folder) == before


def test_a_plan_can_be_put_elsewhere_trial_by_trial(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    for number in (1, 2):
        assert run("ask", folder, "--out", "plan-{trial}.csv")[0] == 0
        assert run("ask", folder, "--out", ".")[0] == 0
        run("tell", folder, number, "--error", "3cm long")
    assert sorted(path.name for path in tmp_path.glob("*-*")) == [
        *("plan-1.csv", "plan-2.csv", "trial-1.npz", "trial-2.npz")
    ]
    before = journal(folder)
    status, out, err = run("ask", folder, "--out", "plan-1.csv")
    assert (status, out) == (2, "")
    assert "plan-1.csv is there already" in err
    assert "{trial}" in err
    assert journal(folder) == before


def test_another_generator_can_be_learned(run, folder):
    _, out, _ = run("learn", folder, "--generator", "interpolation,timing=align")
    assert "next: prior-reinforce goal" in out
    assert "interpolation" in run("status", folder)[1]
    before = journal(folder)
    for args, remedy in (
        (("--generator", "spline"), "known are diffusion"),
        (("--generator", "nearest,training_steps=5"), "has no setting 'training_steps'"),
        (("--generator", "nearest,neighbours=0"), ">= 1 - at `$.neighbours`"),
    ):
        status, _, err = run("learn", folder, *args)
        assert status == 2
        assert remedy in err
    assert journal(folder) == before


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
    workspace = Workspace(folder)
    with workspace.log.journal.exclusive():  # what is written before the program dies
        workspace.log.journal.append("executing", {"trial": 1, "command": "arm {plan}"})
    workspace.close()


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
    assert trials(folder)[0].stage is Stage(stage)
    assert ("plan: " in out) == (answer == "no")


def test_missing_outcomes_are_named_or_asked_for(run, folder, tmp_path, monkeypatch):
    recordings(tmp_path / "some", outcomes=[0, 3])
    status, _, err = run("import", folder, "some")
    assert status == 2
    assert "throw_1, throw_2" in err
    answers = iter(["far away", "80cm ahead, 20cm to the left", "1.0 -0.2"])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("builtins.input", lambda question: next(answers))
    status, out, _ = run("import", folder, "some")
    assert status == 0
    assert "2 episodes have no outcome" in out
    workspace = Workspace(folder)
    np.testing.assert_allclose(
        workspace.demonstrations.outcomes_seen, demonstrations().outcomes_seen
    )
    workspace.close()
    monkeypatch.setattr("sys.stdin.isatty", lambda: False)
    assert run("import", folder, "some", "--outcomes", "planar/outcomes.csv")[0] == 0


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
    for text in ("Goal 1", "Goal 2", "ball slipped", "3 cm long"):
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


def test_export_writes_what_was_handed_out(run, folder):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    status, out, _ = run("export", folder, 1, "plan.npz")
    assert status == 0
    assert trials(folder)[0].kept["plan_sha256"] in out

"""The program: exit statuses, one line for what was wrong, and a reader that leaves."""

import os

import pytest

from prior_reinforce.cli import main
from prior_reinforce.errors import WorkspaceError
from tests.workspace.planar import events_in


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
    before = events_in(folder)
    try:
        status = main(args)
    except SystemExit as end:  # tyro's own, for what is no number
        status = end.code
    assert status == 2
    assert capsys.readouterr().err
    assert events_in(folder) == before
    assert not (tmp_path / "other").exists()


def test_the_status_says_whether_something_changed(run, folder, tmp_path, monkeypatch):
    """The plan cannot be written, but the trial was made: that is not `nothing changed`."""
    run("goal", folder, "0.9", "0.05")

    def full(*args, **how):
        raise WorkspaceError("the disk is full; free some space")

    monkeypatch.setattr("prior_reinforce.commands.trials.write_plan", full)
    status, _, err = run("ask", folder, "--out", "plan.csv")
    assert status == 1
    assert "the disk is full" in err
    assert "what was recorded before stays" in err
    assert events_in(folder)[-1].kind == "asked"
    status, _, err = run("ask", folder, "--out", "plan.csv")  # the open trial: nothing new
    assert status == 2


def test_an_interruption_after_the_commit_says_so(run, folder, monkeypatch):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)

    def interrupted(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr("prior_reinforce.commands.trials.say_trial", interrupted)
    status, _, err = run("tell", folder, 1, "--hit")
    assert status == 130
    assert err == "prior-reinforce: interrupted; what was recorded before stays\n"
    assert events_in(folder)[-1].kind == "told"
    status, _, err = run("tell", folder, 9, "--hit")
    assert (status, events_in(folder)[-1].kind) == (2, "told")

"""Which workspace and which trial the words of a command are about."""

import os
import sys

import pytest

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands.base import print_checked
from tests.arm.workspace.planar import trials_in


@pytest.fixture
def within(folder, tmp_path, monkeypatch):
    """Be in the workspace, with an open trial of each kind of goal."""
    with Workspace(folder) as workspace:
        workspace.set_goal([0.9, 0.05])
        workspace.session().ask()
    monkeypatch.chdir(tmp_path / folder)
    return tmp_path / folder


def test_within_its_folder_a_workspace_need_not_be_named(run, within, monkeypatch):
    for place in (within, within / "models"):
        monkeypatch.chdir(place)
        status, out, err = run("status")
        assert (status, err) == (0, "")
        assert 'next            prior-reinforce tell 1 --error "_cm long, _cm left"' in out


@pytest.mark.parametrize(
    "words",
    [("5cm long",), ("1", "5cm long"), ("5", "cm", "long"), ("0.05", "0"), (".", "5cm long")],
)
def test_the_trial_that_waits_need_not_be_numbered(run, within, words):
    status, _, err = run("tell", *words)
    if words == ("5", "cm", "long"):  # a whole number comes first: a trial
        assert (status, "there is no trial 5" in err) == (2, True)
        return
    (trial,) = trials_in(within)
    assert (status, trial.error_seen.tolist()) == (0, [0.05, 0.0])


@pytest.mark.slow
def test_all_commands_take_their_words_so(run, within, tmp_path):
    assert run("ask")[0] == 0
    assert run("export", tmp_path / "1.csv")[0] == run("export", "1", tmp_path / "2.csv")[0] == 0
    assert run("void", "--reason", "slipped")[1].startswith("trial 1: void: slipped")
    assert run("goal", "0.8", "-0.05")[1].startswith("goal 2: 80 cm ahead, 5 cm right")
    assert run("learn", "--generator", "interpolation")[0] == 0
    assert run("import", "nowhere")[2] == (
        "prior-reinforce: no recording at nowhere; give the path of a file or a folder\n"
    )


@pytest.mark.slow
def test_no_word_is_dropped(run, within):
    for args, said in [
        (("status", "hoop"), "'hoop' is no workspace"),
        (("void", "1", "slipped"), "unexpected 'slipped'; say why with --reason"),
        (("export", "1"), "say the file"),
        (("export", "1", "a.csv", "b.csv"), "say the file"),
        (("import",), "say which recordings"),
        (("import", "a", "b"), "say which recordings"),
        (("tell", "planar", "1", "hit"), "write a length and one of"),
        (("goal",), "trial 1 waits to be told"),
    ]:
        status, out, err = run(*args)
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert said in err
    assert run("tell", "hit")[0] == 0
    assert "no trial waits" in run("tell", "hit")[2]
    assert run("goal")[2].startswith("prior-reinforce: goal: ")


def test_a_folder_in_a_workspace_that_is_called_like_a_trial_is_none(run, within):
    """What is told never goes to another workspace because of a name."""
    with Workspace.create(within / "1", robot="none"):
        pass
    assert run("tell", "1", "hit")[1].startswith("trial 1: reached")
    assert "task            1," in run("status", "./1")[1]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives folders away")
def test_a_folder_of_somebody_else_is_not_searched(run, within, tmp_path, monkeypatch):
    """Else a manifest in /tmp would be everybody's."""
    (within / "mine").mkdir()
    monkeypatch.chdir(within / "mine")
    assert run("status")[0] == 0
    os.chown(within / "mine", 12345, -1)
    assert "name the workspace" in run("status")[2]


def test_elsewhere_the_workspace_is_named_first(run, folder):
    assert "name the workspace, or change into its folder" in run("status")[2]
    assert "5cm long is not a workspace" in run("tell", "5cm long")[2]
    assert f"did you mean {folder}?" in run("status", "planer")[2]
    assert run("status", "..")[2].endswith("make one with: prior-reinforce new WORKSPACE\n")
    assert run("status", folder)[0] == 0


def test_a_folder_of_recordings_is_taken_for_no_misspelt_workspace(run, folder, tmp_path):
    (tmp_path / "planarr").mkdir()
    said = run("import", "planarr")[2]
    assert "name the workspace first" in said
    assert "did you mean" not in said


def test_without_a_number_a_told_trial_is_amended_and_none_that_waits_is_said(run, within):
    assert "ask" in run("amend", "5cm long")[2]
    assert "amend" not in run("tell", "2", "5cm long")[2]
    assert run("tell", "5cm long")[0] == 0
    status, _, said = run("tell", "2cm long")
    assert status == 2
    assert all(way in said for way in ("no trial waits", "prior-reinforce ask", "amend N"))
    assert run("ask")[0] == 0
    assert run("amend", "2cm long")[0] == 0
    told, waiting = trials_in(within)
    assert (told.error_seen.tolist(), waiting.open) == ([0.02, 0.0], True)


def test_what_the_gate_refuses_is_red_on_a_terminal(monkeypatch, capsys):
    text = "plan refused\n  REFUSE jerk   too much\n  ok     rest   ok is ok\n  WARN   speed  fast"
    print_checked(text)
    assert capsys.readouterr().out == text + "\n"
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    print_checked(text)
    assert capsys.readouterr().out == (
        "plan refused\n  \x1b[1;31mREFUSE\x1b[0m jerk   too much\n"
        "  \x1b[32mok\x1b[0m     rest   ok is ok\n  \x1b[33mWARN\x1b[0m   speed  fast\n"
    )

"""The program: exit statuses, one line for what was wrong, and a reader that leaves."""

import json
import os
import re
import subprocess
import sys
from contextlib import suppress
from importlib.metadata import version

import pytest
from tyro._docstrings import parse_docstring_from_object

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.cli import main
from prior_reinforce.commands import COMMANDS
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.registry import PLUGINS
from tests.arm.workspace.planar import events_in


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


@pytest.mark.skipif(os.name != "posix", reason="pipes as POSIX has them")
def test_output_that_is_not_buffered_leaves_as_quietly(folder):
    program = [sys.executable, "-m", "prior_reinforce.cli", "log", folder]
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "wb") as nobody_reads:
        run = subprocess.run(
            program,
            stdout=nobody_reads,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
    assert (run.returncode, run.stderr) == (141, b"")


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
        ("tell", "planar"),
        ("tell", "planar", "one", "--hit"),
        ("ask", "planar", "--nope"),
        ("ask", "planar", "--rate", "fast"),
        ("goal", "planar", "0.9", "0", "--memory", "all"),
        ("learn", "planar", "--seed", str(2**64)),
        ("learn", "planar", "--seed", "-1"),
        ("learn", "planar", "--seed", "9" * 5000),
        ("demo", "--goals", "9" * 300),
        ("nope",),
        ("status", "x" * 300),
        ("status", "a/" * 2000),
        ("status", "planar\x1b[2J\nprior-reinforce: forged"),
        ("import", "planar", "no\nwhere"),
        ("new", "other\x1b[2J", "--name", "other"),
        ("ask", "planar", "--out", "plan\x1b[2J.npz"),
        ("new", "planar"),
        ("new", "other", "--name", "a\x1b]0;b"),
        ("new", "other", "--outcome-names", "x", "x"),
        ("new", "other", "--tolerance", "-1"),
        ("new", "other", "--dt", "inf"),
        ("new", "other", "--action-names", "a", "a"),
        ("new", "other", "--outcome-names", "x", "y", "z", "--outcome-units", "m", "m"),
    ],
)
def test_bad_input_ends_with_status_2_and_leaves_nothing_behind(folder, capsys, tmp_path, args):
    before = events_in(folder)
    assert main(args) == 2
    err = capsys.readouterr().err
    assert err.startswith("prior-reinforce: ")
    assert len(err.splitlines()) == 1
    assert events_in(folder) == before
    assert not (tmp_path / "other").exists()


def test_the_status_says_whether_something_changed(run, folder, tmp_path, monkeypatch):
    """The plan cannot be written, but the trial was made: that is not `nothing changed`."""
    run("goal", folder, "0.9", "0.05")

    def full(*args, **how):
        raise WorkspaceError("the disk is full; free some space")

    monkeypatch.setattr("prior_reinforce.arm.workspace.workspace.write_plan", full)
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

    monkeypatch.setattr("prior_reinforce.commands.telling.say_told", interrupted)
    status, _, err = run("tell", folder, 1, "--hit")
    assert status == 130
    assert err == "prior-reinforce: interrupted; what was recorded before stays\n"
    assert events_in(folder)[-1].kind == "told"
    status, _, err = run("tell", folder, 9, "--hit")
    assert (status, events_in(folder)[-1].kind) == (2, "told")


@pytest.mark.parametrize("name", COMMANDS)
def test_every_help_has_an_example_and_says_no_none(capsys, name):
    with pytest.raises(SystemExit) as end:
        main((name, "ur", "--help"))
    shown = capsys.readouterr().out
    assert end.value.code in (0, None)
    assert shown.startswith(f"usage: prior-reinforce {name}")
    assert f"    prior-reinforce {name} " in shown
    for empty in ("{None}", "(default: None)", "(default: False)", "(default: )", "\0"):
        assert empty not in shown
    for flag in {*re.findall(r"^ +(--no-[\w-]+)", shown, re.MULTILINE)} - {"--no-box"}:
        assert f"`{flag}`" in shown  # what is said is of the flag, not of the field behind it
    if "[WORKSPACE]" in shown:
        assert "WORKSPACE" in shown.partition("\n\n")[0]


@pytest.mark.parametrize(
    "before", [("new", "--help"), ("new", "x", "--nope"), ("--tyro-print-completion", "bash")]
)
def test_what_an_option_does_is_one_paragraph_however_its_source_is_wrapped(
    capsys, monkeypatch, before
):
    monkeypatch.setenv("COLUMNS", "80")
    parse_docstring_from_object.cache_clear()  # as in a new process
    with suppress(SystemExit):
        main(before)
    capsys.readouterr()
    with pytest.raises(SystemExit):
        main(("new", "--help"))
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    first = next(i for i, line in enumerate(lines) if line.startswith("Names of the action dim"))
    assert lines[first + 1] == "given, with no robot those that the first import has."


@pytest.mark.parametrize("args", [(), ("-h",), ("--help",)])
def test_alone_it_lists_the_commands_by_what_they_are_for(run, args):
    status, out, err = run(*args)
    assert (status, err) == (0, "")
    at = [out.index(f"{group}:") for group in ("your arm", "simulated tasks")]
    assert at[0] < out.index("  tell ") < at[1] < out.index("  demo ")
    assert all(re.search(rf"^  {name} ", out, re.MULTILINE) for name in COMMANDS)


def test_a_word_where_a_number_belongs_is_named(run, folder):
    status, out, err = run("ask", folder, "--rate", "abc")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "--rate" in err
    assert "'abc'" in err


@pytest.mark.parametrize("option", ["--version", "-V"])
def test_the_version_is_the_installed_one(run, option):
    assert run(option) == (0, f"prior-reinforce {version('prior-reinforce')}\n", "")


@pytest.mark.parametrize(
    ("args", "meant"),
    [
        (("staus", "planar"), "did you mean status?"),
        (("--verion",), "there is no option --verion; did you mean --version?"),
        (("ask", "planar", "--ot", "plan.npz"), "ask has no --ot; did you mean --out?"),
        (("goal", "planar", "1", "0", "--memroy", "goal"), "did you mean --memory?"),
        (("ask", "planar", "--nothing-like-it"), "ask has no --nothing-like-it; see"),
    ],
)
def test_what_is_misspelt_is_named_with_what_was_meant(run, args, meant):
    status, out, err = run(*args)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert meant in err


def test_quiet_leaves_errors_and_json(run, folder):
    assert run("status", folder, "-q") == (0, "", "")
    assert run("-q", "goal", folder, "0.9", "0.05") == (0, "", "")
    status, out, err = run("ask", folder, "--quiet", "--json")
    assert (status, err, json.loads(out)["trial"]["number"]) == (0, "", 1)
    status, out, err = run("tell", folder, "9", "hit", "-q")
    assert (status, out) == (2, "")
    assert "there is no trial 9" in err


def test_colour_is_for_terminals_that_want_it(folder, monkeypatch):
    def said(**environment):
        leader, follower = os.openpty()
        given = {k: v for k, v in os.environ.items() if k != "NO_COLOR"} | environment
        program = [sys.executable, "-m", "prior_reinforce.cli", "status", "nowhere"]
        subprocess.run(program, stderr=follower, stdout=subprocess.DEVNULL, env=given)
        os.close(follower)
        return os.read(leader, 1000).decode()

    assert said(TERM="xterm").startswith("\x1b[1;31mprior-reinforce:\x1b[0m ")
    assert said(TERM="xterm", NO_COLOR="1").startswith("prior-reinforce: ")
    assert said(TERM="dumb").startswith("prior-reinforce: ")


def run_program(*args, **how):
    program = [sys.executable, "-m", "prior_reinforce.cli", *args]
    return subprocess.run(program, capture_output=True, **how)


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a disk that is always full")
@pytest.mark.parametrize(
    ("redirections", "status"),
    [("> /dev/full", 2), (">&-", 0), ("2>&-", 0), ("<&-", 0), ("<&- >&- 2>&-", 0)],
)
def test_streams_may_be_closed_or_full(folder, redirections, status):
    command = f"{sys.executable} -m prior_reinforce.cli status {folder} {redirections}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == (status != 0)


@pytest.mark.slow
def test_names_that_are_no_text_can_be_printed(folder, tmp_path):
    strange = os.fsencode(str(tmp_path)) + b"/\xff\xfe"
    os.rename(folder, strange)
    done = run_program("status", strange)
    assert done.returncode == 0, done.stderr
    done = run_program("status", strange + b"2")
    assert (done.returncode, done.stderr.count(b"\n")) == (2, 1)


def test_what_a_person_writes_forges_no_line(run, folder):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    forged = "slipped\nnext: rm -rf \x1b[2J\u202e"
    status, out, _ = run("void", folder, 1, "--reason", forged)
    assert status == 0
    for said in (out, run("status", folder)[1]):
        assert "slipped\\nnext: rm -rf \\x1b[2J\\u202e" in said
        assert "\x1b" not in said


def test_a_message_of_any_length_can_be_read(folder, run):
    status, _, err = run("goal", folder, "x" * 100_000)
    assert status == 2
    assert len(err) < 1100
    assert " ... " in err
    assert err.endswith(run("goal", folder, "x")[2][-30:])


def test_the_package_runs_as_a_program():
    program = [sys.executable, "-m", "prior_reinforce", "--version"]
    told = subprocess.run(program, capture_output=True, text=True, check=True).stdout
    assert told.startswith("prior-reinforce ")


def test_a_traceback_is_shown_where_it_is_asked_for(run, tmp_path):
    for flags, shown in (((), False), (("--traceback",), True)):
        status, _, err = run("status", tmp_path, *flags)
        assert status == 2
        assert ("Traceback (most recent call last)" in err) == shown
        assert err.splitlines()[-1].startswith("prior-reinforce: ")


def test_plugins_are_imported_before_a_command_is_read(run, tmp_path, monkeypatch):
    monkeypatch.setenv(PLUGINS, "")
    monkeypatch.setattr(ADAPTERS, "members", dict(ADAPTERS.members))
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "offset_plugin.py").write_text(
        "import prior_reinforce as pr\n"
        "class Still(pr.FrozenAdapter): pass\n"
        "pr.ADAPTERS.add('still', Still)\n"
    )
    refused = run("adapt", "--adapter", "still", "--perception", "no-such")
    assert "no adapter 'still'" in refused[2]
    assert (
        "no perception"
        in run(
            "adapt", "--adapter", "still", "--perception", "no-such", "--plugins", "offset_plugin"
        )[2]
    )
    assert os.environ[PLUGINS] == "offset_plugin"  # for programs that are started from here
    assert "needs a module" in run("status", "--plugins")[2]


def test_an_option_of_several_values_that_is_given_twice_is_refused(folder, tmp_path, capsys):
    new = ["new", str(tmp_path / "w"), "--robot", "none", "--hold", "a=1", "--hold=b=2"]
    assert main(new) == 2
    assert "--hold is given twice; put all its values behind one" in capsys.readouterr().err
    assert main(["import", folder, "none", "--leave_out", "a", "--leave-out", "b"]) == 2
    assert "--leave-out is given twice" in capsys.readouterr().err
    assert main(["import", folder, "none", "--key", "q", "--key", "gripper"]) == 2
    assert "twice" not in capsys.readouterr().err

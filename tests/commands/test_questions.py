"""Questions at the terminal: nothing moves by what was typed before its question was shown."""

import builtins
import os
import re
import select
import subprocess
import sys
import time

import numpy as np
import pytest

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands.questions import agrees, answer_after
from prior_reinforce.errors import ConfigurationError
from tests.arm.executing import toy_arm
from tests.commands.at_terminal import PROGRAM, Typed

SCRIPTS = int(os.environ.get("PRIOR_REINFORCE_RUNS", "6"))
QUESTION = re.compile(r"(?:The arm will move slowly|Trial \d+ will (?:run|be rehearsed)) .*\r\n")


@pytest.fixture
def toy(run, folder, tmp_path, toy_plugin):
    """A toy arm that stands a short way from where the plan begins, and takes a while to move."""
    run("goal", folder, "0.9", "0.05")
    toy_arm.name_arm(tmp_path / folder, tmp_path / "arm", seconds=0.2)
    (tmp_path / "arm" / "pose").write_text("0.0 0.1")
    return tmp_path / "arm"


def on_arm(folder, *flags):
    return Typed("ask", folder, "--execute", *flags)


@pytest.mark.parametrize(
    ("answer", "typed", "agreed", "times"),
    [
        ("yes", ["yes"], True, 1),
        ("yes", ["  YES "], True, 1),
        ("yes", ["y", "yes"], True, 2),
        ("yes", ["y", "y"], False, 2),
        ("yes", ["no"], False, 1),
        ("yes", ["N"], False, 1),
        ("yes", [""], False, 1),
        ("yes", ["\x04"], False, 1),
        ("throw 9", ["yes", "throw 9"], True, 2),
        ("throw 9", ["throw 8", "yes"], False, 2),
        ("throw 9", ["throw 9\nthrow 9"], True, 1),
    ],
)
def test_a_question_is_agreed_to_in_full(person, answer, typed, agreed, times):
    asked = person(*typed).asked
    assert agrees("may it?", answer) == agreed
    assert asked[0] == "may it?"
    assert len(asked) == times


def test_what_was_typed_before_a_question_answers_nothing(person):
    """Also what was read ahead of it with an earlier line: the buffer of a pipe or of raw input."""
    seated = person("no", "no")
    os.write(seated._screen, b"yes\nyes\n")
    assert select.select([seated.stdin], [], [], 10.0)[0]
    assert not agrees("may it?")
    os.write(seated._screen, b"yes\n")
    assert not agrees("may it now?")
    assert seated.asked == ["may it?", "may it now?"]


def test_a_pipe_answers_nothing(folder):
    program = [sys.executable, "-m", "prior_reinforce.cli", "ask", folder, "--run", "true {plan}"]
    done = subprocess.run(program, input="yes\nthrow 1\n", capture_output=True, text=True)
    assert done.returncode == 2
    assert "no pipe: run it in a terminal, or add --yes" in done.stderr


def test_where_what_was_typed_cannot_be_thrown_away_nothing_is_asked(person, monkeypatch):
    real, asked = builtins.__import__, person("yes").asked

    def without_termios(name, *rest):
        if name == "termios":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without_termios)
    with pytest.raises(ConfigurationError, match=r"no termios here.*--yes"):
        answer_after("may it?", 'type "yes": ')
    assert asked == []


def test_a_terminal_that_cannot_show_the_question_is_refused(person, monkeypatch):
    seated = person("yes")
    with open(os.ttyname(seated.stdin.fileno())) as read_only:
        monkeypatch.setattr(sys, "stdin", read_only)
        with pytest.raises(ConfigurationError, match="cannot be shown on the terminal"):
            agrees("may it?")


def test_answers_typed_ahead_start_nothing_and_those_in_time_start_each_motion(folder, toy):
    typed = on_arm(folder, "--approach")
    typed.type("yes\nthrow 1\nyes\n")  # before anything is shown
    typed.wait_for("The arm will move slowly to where trial 1 begins")
    typed.type("yes\n")  # before it may be answered
    typed.wait_for('type "yes" if so, or press Enter if not: ')
    assert toy_arm.motions(toy) == 0
    typed.type("yes\n")
    typed.wait_for("toy moves for")
    typed.type("throw 1\nyes\nthrow 1\n")  # during the approach
    typed.wait_for('type "throw 1" if so, or press Enter if not: ')
    typed.type("yes\n")
    typed.wait_for("in full")
    typed.type("throw 1\n")  # between two questions
    typed.wait_for('type "throw 1" if so, or press Enter if not: ')
    assert toy_arm.motions(toy) == 1
    typed.type("\n")
    typed.wait_for("nothing moved")
    assert typed.process.wait(60) == 1
    typed.close()
    assert toy_arm.motions(toy) == 1


def test_a_question_is_on_the_screen_whatever_is_redirected(folder, toy):
    flags = "--execute --approach"
    script = f"{PROGRAM} ask {folder} {flags} >log 2>&1"
    typed = Typed("-c", script, program="sh")
    typed.wait_for("The arm will move slowly to where trial 1 begins")
    typed.wait_for("press Enter if not: ")
    typed.type("no\n")
    assert typed.process.wait(60) == 1
    typed.close()


@pytest.mark.slow
def test_scripts_that_type_ahead_move_nothing_unasked(folder, toy):
    """Whatever is typed when: each motion follows an answer to its question.

    A line is an answer if its question stood on the screen before it was typed. Scripts in which
    this computer was too busy to tell are not judged. `PRIOR_REINFORCE_RUNS` makes more of them.
    """
    rng, moved, judged, blind = np.random.default_rng(43), 0, 0, 0
    for number in range(1, SCRIPTS + 1):
        (toy / "pose").write_text("0.0 0.1")
        (toy / "motions").unlink(missing_ok=True)
        slow = rng.random() < 0.5
        right = ["yes\n", "yes\n" if slow else f"throw {number}\n"]
        typed = on_arm(folder, "--approach", *(("--rehearse", "0.2") if slow else ()))
        answered, busy = set(), False
        for _ in range(200):
            looked = time.monotonic()
            while select.select([typed.ours], [], [], 0)[0] and typed.look(0):
                pass
            shown = len(QUESTION.findall(typed.shown))
            line = rng.choice(
                ["yes\n", f"throw {number}\n", "y\n", "no\n"], p=(0.5, 0.4, 0.05, 0.05)
            )
            if shown and line == right[shown - 1]:
                answered.add(shown)
            typed.type(line)
            busy |= time.monotonic() > looked + 0.25
            blind += not shown
            if typed.process.poll() is not None:
                break
            time.sleep(rng.exponential(0.2))
        assert typed.process.wait(60) in (0, 1)
        if not busy:
            assert toy_arm.motions(toy) <= len(answered), typed.shown
            judged, moved = judged + 1, moved + toy_arm.motions(toy)
        typed.close()
        with Workspace(folder) as workspace:
            assert workspace.session().void(number).number == number
    assert judged > SCRIPTS // 2 < blind
    assert moved > SCRIPTS // 4

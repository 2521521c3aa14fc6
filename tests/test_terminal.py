"""Text is safe to print, and coloured only where a terminal shows it."""

import io
import subprocess
import sys

import pytest

from prior_reinforce.terminal import RED, coloured, plain


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("ball slipped, 5 cm", "ball slipped, 5 cm"),
        ("Würfel → 球", "Würfel → 球"),
        ("a\nb\tc", "a\\nb\\tc"),
        ("\x1b[31mred", "\\x1b[31mred"),
        ("\x9b31m \u202e \u2028 \udcff", "\\x9b31m \\u202e \\u2028 \\udcff"),
    ],
)
def test_control_characters_are_shown_and_not_done(text, shown):
    assert plain(text) == shown
    assert plain(f"{text}\n", keep="\n").endswith("\n")


def test_colour_is_for_terminals_that_want_it(monkeypatch):
    stream = io.StringIO()
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert coloured("no", RED, stream) == "no"
    stream.isatty = lambda: True
    assert coloured("no", RED, stream) == "\x1b[1;31mno\x1b[0m"
    monkeypatch.setenv("NO_COLOR", "1")
    assert coloured("no", RED, stream) == "no"


@pytest.mark.slow
@pytest.mark.parametrize("asked", ["--version", "--help"])
def test_what_only_says_a_line_loads_no_library(asked):
    code = (
        "import sys; from prior_reinforce.cli import main; main([sys.argv[1]]);"
        "print(*sorted({'numpy', 'scipy', 'tyro', 'jaxtyping'} & set(sys.modules)))"
    )
    program = [sys.executable, "-c", code, asked]
    run = subprocess.run(program, check=True, capture_output=True, text=True)
    assert run.stdout.splitlines()[-1] == ""
